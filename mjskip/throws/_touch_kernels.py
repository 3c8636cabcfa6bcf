"""Touches of the water, and when a run is over: found row by row, for a single run and for batches alike.

A touch begins when the lowest point meets the water and ends when nothing is wet. Dry spells shorter than
`MIN_AIRTIME` belong to the touch around them. Its moments lie between rows, where the clearance crosses zero:

    t = t_before + c_before / (c_before - c) (t - t_before)
"""

import math
from typing import Any

from mjskip._compile.jit import kernel
from mjskip.rigid.state import OMEGA, POSITION, VELOCITY

# the rules of a run
DURATION, MIN_AIRTIME, MAX_CONTACT, SINK_DEPTH, REST_SPEED, REST_TIME = range(6)
WEST, EAST, SOUTH, NORTH = range(6, 10)  # walls of the lake [m]
RULES = 10

# how a run ends
GOING_ON, SUNK, AT_REST, PLANING, OUT_OF_TIME, LEFT_THE_LAKE, DIVERGED = range(-1, 6)

# what is remembered from row to row
ROWS, TIME, CLEARANCE = 0, 1, 2  # rows until now; time and clearance of the last one
WET = 3  # 1: the last row was
DRY_SINCE = 4  # time of the first dry row of this spell, or NaN
LAST_AIRBORNE = 5  # time of the last row that was dry for MIN_AIRTIME
LAST_MOVING = 6
TOUCHES = 7  # that have begun
LATEST = 8  # the latest touch:
ENTRY, EXIT = 8, 9  # moments [s]; EXIT is NaN until it leaves
FIRST, LAST = 10, 11  # its wet rows, LAST excluded
DEPTH = 12  # deepest immersion of the lowest point [m]
MEMORY = 13
TOUCH = MEMORY - LATEST


@kernel
def begin(memory: Any) -> None:
    """Forget everything: a run begins."""
    memory[:] = 0.0
    memory[DRY_SINCE] = memory[EXIT] = math.nan


@kernel
def crossing(memory: Any, time: float, clearance: float) -> float:
    """When the clearance was zero between the last row and this one; now if there was none before."""
    if memory[ROWS] == 0.0:
        return time
    part = memory[CLEARANCE] / (memory[CLEARANCE] - clearance)
    return float(memory[TIME] + part * (time - memory[TIME]))


@kernel
def follow(
    rules: Any, radius: float, memory: Any, time: float, state: Any, clearance: float
) -> int:
    """Take one row of a run into memory (MEMORY,); how the run ends with it, or GOING_ON.

    Args:
        rules: (RULES,).
        radius: of the sphere about the centre of mass that holds the stone [m].
        memory: is altered.
        time: [s].
        state: (STATE,).
        clearance: height of the lowest point above the surface [m].
    """
    # touches
    row = memory[ROWS]
    if clearance < 0.0:
        if memory[WET] == 0.0:
            entry = crossing(memory, time, clearance)
            if memory[TOUCHES] == 0.0 or entry - memory[EXIT] >= rules[MIN_AIRTIME]:
                memory[TOUCHES] += 1.0
                memory[ENTRY], memory[FIRST], memory[DEPTH] = entry, row, 0.0
            memory[WET], memory[EXIT] = 1.0, math.nan
        memory[LAST] = row + 1.0
        memory[DEPTH] = max(memory[DEPTH], -clearance)
    elif memory[WET] == 1.0:
        memory[WET], memory[EXIT] = 0.0, crossing(memory, time, clearance)
    memory[ROWS], memory[TIME], memory[CLEARANCE] = row + 1.0, time, clearance

    # the last moments of flight and of motion
    if clearance >= 0.0:
        if math.isnan(memory[DRY_SINCE]):
            memory[DRY_SINCE] = time
        if time - memory[DRY_SINCE] >= rules[MIN_AIRTIME]:
            memory[LAST_AIRBORNE] = time
    else:
        memory[DRY_SINCE] = math.nan
    vx, vy, vz = state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2]
    wx, wy, wz = state[OMEGA], state[OMEGA + 1], state[OMEGA + 2]
    turning = radius * math.sqrt(wx**2 + wy**2 + wz**2)
    if max(math.sqrt(vx**2 + vy**2 + vz**2), turning) > rules[REST_SPEED]:
        memory[LAST_MOVING] = time

    # is it over?
    x, y = state[POSITION], state[POSITION + 1]
    if state[POSITION + 2] < -rules[SINK_DEPTH] * radius:
        return SUNK
    if not (rules[WEST] <= x <= rules[EAST] and rules[SOUTH] <= y <= rules[NORTH]):
        return LEFT_THE_LAKE
    if time - memory[LAST_MOVING] >= rules[REST_TIME]:
        return AT_REST
    if time - memory[LAST_AIRBORNE] > rules[MAX_CONTACT] and clearance < 0.0:
        return PLANING
    if time >= rules[DURATION] * (1.0 - 1e-12):
        return OUT_OF_TIME
    return GOING_ON


@kernel
def skips(rules: Any, memory: Any) -> int:
    """Touches until now that were followed by at least MIN_AIRTIME in the air."""
    if memory[TOUCHES] == 0.0:
        return 0
    airborne = memory[WET] == 0.0 and memory[TIME] - memory[EXIT] >= rules[MIN_AIRTIME]
    return int(memory[TOUCHES]) - 1 + int(airborne)


@kernel
def follow_rows(
    rules: Any, radius: float, memory: Any, times: Any, states: Any, clearance: Any, touches: Any
) -> tuple[int, int]:
    """`follow` rows (n,), (n, STATE) and (n,): how many belong to the run, and how it ends with the last.

    The touches until now are in the first rows of touches (m, TOUCH), of which half of n more are needed.
    """
    for k in range(len(times)):
        end = follow(rules, radius, memory, times[k], states[k], clearance[k])
        latest = int(memory[TOUCHES]) - 1
        if latest >= 0:
            for i in range(TOUCH):
                touches[latest, i] = memory[LATEST + i]
        if end != GOING_ON:
            return k + 1, end
    return len(times), GOING_ON
