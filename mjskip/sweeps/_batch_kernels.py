"""Many throws from release to rest: motion by `rigid.step`, touches by `throws.follow`, all in one call.

With air at the fixed step a throw is what `mjskip.integrate` makes of it, to the last bit; tests hold it to
that. Stretches in the air may be taken in long steps instead: Dormand & Prince's 5(4) pair for x and P, and
for a stone of revolution its exact free rotation, so that the spin does not limit the step. Such a step ends
before the stone can meet the water; the touch itself is then found inside an ordinary step.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip.rigid._rigid_kernels import (
    BODY as RIGID_BODY,
)
from mjskip.rigid._rigid_kernels import (
    MASS,
    SIZE,
    L,
    P,
    Q,
    X,
    derivative,
    motion,
    normalise,
    step,
)
from mjskip.rigid.state import POSITION, ROTATION, STATE, VELOCITY
from mjskip.throws import _touch_kernels as touch
from mjskip.throws._touch_kernels import DIVERGED, GOING_ON

# a body: what `rigid` knows it by, and then
RADIUS = RIGID_BODY  # of the sphere about the centre of mass that holds it [m]
REACH, HALF = RADIUS + 1, RADIUS + 2  # farthest from the axis, and along it [m]
ROUND = RADIUS + 3  # 1: a stone of revolution for its motion in the air
PRECESSION = RADIUS + 4  # 1 / I1
SPINNING = RADIUS + 5  # 1 / I3 - 1 / I1
AXIS = RADIUS + 6  # disc normal in body axes (3)
FIRST, LAST = RADIUS + 9, RADIUS + 10  # its vertices
BODY = RADIUS + 11

# the rules of a run: what `follow` knows, and then
TIMESTEP, METHOD = touch.RULES, touch.RULES + 1
AIR_TOLERANCE = touch.RULES + 2  # of a long step; 0: the air too is taken at the fixed step
RULES = touch.RULES + 3

# what comes out of a throw
SKIPS, TOUCHES, END, TIME, DISTANCE, DRIFT, DEPTH, FIRST_ENTRY, FIRST_EXIT = range(9)
EXIT_VELOCITY = 9  # (3)
STEPS = 12
OUT = 13

# rows of scratch; `step` takes the first three
HERE, BEFORE, NEXT = 3, 4, 5  # state now and one step ago; y after this step
WORK = 6
STAGES = 7

TOUCHING = 1e-9
"""The touch is located to this clearance [m]."""


def _dormand_prince() -> Any:
    table = np.zeros((8, 8))
    table[1, :1] = [1 / 5]
    table[2, :2] = [3 / 40, 9 / 40]
    table[3, :3] = [44 / 45, -56 / 15, 32 / 9]
    table[4, :4] = [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]
    table[5, :5] = [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]
    table[6, :6] = [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
    table[1:7, 7] = [1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1]
    table[7, :7] = [
        71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40,
    ]  # fmt: skip
    return table


DORMAND_PRINCE = _dormand_prince()
"""Stages (rows 1-6, the last is the step; column 7 the time) and the error estimate (row 7): J. R. Dormand &
P. J. Prince, J. Comput. Appl. Math. 6:19, 1980."""


@kernel
def lowest_point(state: Any, vertices: Any) -> float:
    """Height of the lowest vertex above still water [m]."""
    ux, uy, uz = state[ROTATION + 6], state[ROTATION + 7], state[ROTATION + 8]
    z = state[POSITION + 2]
    lowest = np.inf
    for i in range(vertices.shape[0]):
        height = z + ux * vertices[i, 0] + uy * vertices[i, 1] + uz * vertices[i, 2]
        if height < lowest:
            lowest = height
    return lowest


@kernel
def reach_below(body: Any, y: Any, state: Any) -> float:
    """How far below its centre a freely turning stone can reach for as long as it is free [m]."""
    if body[ROUND] == 0.0:
        return float(body[RADIUS])
    nx, ny, nz = 0.0, 0.0, 0.0
    for j in range(3):
        nx += state[ROTATION + j] * body[AXIS + j]
        ny += state[ROTATION + 3 + j] * body[AXIS + j]
        nz += state[ROTATION + 6 + j] * body[AXIS + j]
    lx, ly, lz = y[L], y[L + 1], y[L + 2]
    size = math.sqrt(lx * lx + ly * ly + lz * lz)
    if size == 0.0 or body[PRECESSION] == 0.0:
        tilt = math.acos(min(abs(nz), 1.0))
    else:  # the axis stays on a cone about L
        cone = math.acos(min(abs(lx * nx + ly * ny + lz * nz) / size, 1.0))
        tilt = math.acos(min(abs(lz) / size, 1.0)) + cone
    steepest = math.atan2(body[REACH], body[HALF])
    tilt = min(tilt, steepest)
    # a nanometre more, for rounding
    return float(body[REACH] * math.sin(tilt) + body[HALF] * math.cos(tilt)) + 1e-9


@kernel
def free_rotation(body: Any, y: Any, state: Any, time: float, out: Any) -> None:
    """Orientation of a freely turning stone of revolution after `time`, into the q of out (SIZE,).

        q(t) = exp(t L / 2 I1) q(0) exp(t (L.n) (1/I3 - 1/I1) n_body / 2)

    of Landau & Lifshitz, Mechanics, section 33. `state` is that of y.
    """
    lx, ly, lz = y[L], y[L + 1], y[L + 2]
    size = math.sqrt(lx * lx + ly * ly + lz * lz)
    half = 0.5 * time * size * body[PRECESSION]
    s = math.sin(half) / size if size > 0.0 else 0.0
    aw, ax, ay, az = math.cos(half), s * lx, s * ly, s * lz
    along = 0.0
    for j in range(3):
        part = (
            state[ROTATION + j] * lx + state[ROTATION + 3 + j] * ly + state[ROTATION + 6 + j] * lz
        )
        along += part * body[AXIS + j]
    half = 0.5 * time * along * body[SPINNING]
    s = math.sin(half)
    bw, bx, by, bz = math.cos(half), s * body[AXIS], s * body[AXIS + 1], s * body[AXIS + 2]
    qw, qx, qy, qz = y[Q], y[Q + 1], y[Q + 2], y[Q + 3]
    cw = aw * qw - ax * qx - ay * qy - az * qz
    cx = aw * qx + ax * qw + ay * qz - az * qy
    cy = aw * qy - ax * qz + ay * qw + az * qx
    cz = aw * qz + ax * qy - ay * qx + az * qw
    out[Q] = cw * bw - cx * bx - cy * by - cz * bz
    out[Q + 1] = cw * bx + cx * bw + cy * bz - cz * by
    out[Q + 2] = cw * by - cx * bz + cy * bw + cz * bx
    out[Q + 3] = cw * bz + cx * by - cy * bx + cz * bw


@kernel
def air_step(
    body: Any, rules: Any, y: Any, slopes: Any, longest: float, floor: float, work: Any, out: Any
) -> float:
    """One long step through the air from y into out, no longer than `longest`; how long it was.

    Of Dormand & Prince, its length such that the estimated error is the tolerance, and such that the centre
    stays above `floor` at every stage. work[HERE] is the state of y, slopes[0] the derivative there. 0 if no
    step longer than the ordinary one does.
    """
    state, load, trial = work[0], work[1], work[2]
    rounded = body[ROUND] == 1.0
    tolerance = rules[AIR_TOLERANCE]
    impulse = momentum = 0.0
    for i in range(3):
        momentum += y[P + i] ** 2
        impulse += y[L + i] ** 2
    momentum, impulse = math.sqrt(momentum) + 0.1 * body[MASS], math.sqrt(impulse) + 1e-12
    h = longest
    while h > rules[TIMESTEP]:
        low = np.inf
        for stage in range(1, STAGES):  # the last one is the step itself
            for i in range(SIZE):
                total = 0.0
                for j in range(stage):
                    total += DORMAND_PRINCE[stage, j] * slopes[j, i]
                trial[i] = y[i] + h * total
            if rounded:
                free_rotation(body, y, work[HERE], h * DORMAND_PRINCE[stage, 7], trial)
                for i in range(L, SIZE):
                    trial[i] = y[i]
            low = min(low, trial[X + 2])
            derivative(body, trial, state, load, slopes[stage])
        # the largest error, as a part of what is tolerated
        worst = 0.0
        for i in range(SIZE):
            if rounded and (Q <= i < P or i >= L):
                continue
            error = 0.0
            for j in range(STAGES):
                error += DORMAND_PRINCE[7, j] * slopes[j, i]
            scale = 1.0 if i < P else (momentum if i < L else impulse)
            worst = max(worst, abs(h * error) / (tolerance * scale))
        if worst <= 1.0 and low > floor:
            for i in range(SIZE):
                out[i] = trial[i]
            normalise(out)
            return h
        h *= 0.5 if worst <= 1.0 else max(0.1, 0.9 * worst**-0.2)
    return 0.0


@kernel
def time_to_fall(height: float, climb: float, acceleration: float) -> float:
    """Time until a height is used up at constant acceleration [s]; infinite if never."""
    if acceleration < 0.0:
        root = math.sqrt(climb * climb - 2.0 * acceleration * height)
        if climb < 0.0:
            return 2.0 * height / (root - climb)
        return (climb + root) / -acceleration
    return height / -climb if climb < 0.0 else np.inf


@kernel
def locate_touchdown(
    body: Any, rules: Any, vertices: Any, y: Any, slopes: Any, length: float, clear: float, work: Any,
    out: Any,
) -> float:  # fmt: skip
    """Step from y only as far as the water, into out; how long that took.

    The clearance is `clear` at y; out is a step of `length` later, and stays if that is dry: regula falsi
    (Illinois).
    """
    state = work[0]
    motion(body, out, state)
    low = lowest_point(state, vertices)
    if low >= 0.0:
        return length
    early, late = 0.0, length
    high = max(clear, TOUCHING)
    side = 0
    for _ in range(30):
        length = late - low * (late - early) / (low - high)
        step(body, int(rules[METHOD]), length, y, slopes, work, out)
        motion(body, out, state)
        height = lowest_point(state, vertices)
        if abs(height) <= TOUCHING:
            break
        if height > 0.0:
            early, high = length, height
            if side == 1:
                low *= 0.5
            side = 1
        else:
            late, low = length, height
            if side == -1:
                high *= 0.5
            side = -1
    return length


@kernel
def is_finite(state: Any, load: Any) -> bool:
    """Whether motion and wrench are."""
    finite = True
    for i in range(STATE):
        finite = finite and math.isfinite(state[i])
    for i in range(12):
        finite = finite and math.isfinite(load[i])
    return finite


@kernel
def throw_one(
    body: Any, rules: Any, vertices: Any, y: Any, slopes: Any, work: Any, memory: Any, out: Any
) -> None:
    """One throw from y, which is advanced, to its end; what it did into out (OUT,)."""
    state, load, before, after = work[HERE], work[1], work[BEFORE], work[NEXT]
    timestep, long_steps = rules[TIMESTEP], rules[AIR_TOLERANCE] > 0.0
    x0, y0 = y[X], y[X + 1]
    out[:] = np.nan
    out[DEPTH] = 0.0
    touch.begin(memory)
    steps = try_again = 0
    time = 0.0
    floor = np.nan  # where the centre of a flying stone may bring its rim into the water, if known
    guess = np.inf  # length of a long step that may do
    located = False  # the touch to come was
    while True:
        derivative(body, y, state, load, slopes[0])
        if not is_finite(state, load):
            end = DIVERGED
            break

        # touches, and whether it is over; high in the air the lowest point is only looked for if needed
        was_wet = memory[touch.WET] == 1.0
        far = state[POSITION + 2] > body[RADIUS] and not was_wet
        clear = np.inf if far else lowest_point(state, vertices)
        if clear < 0.0:
            floor, located = np.nan, False
            if steps > 0 and memory[touch.CLEARANCE] == np.inf:
                memory[touch.CLEARANCE] = lowest_point(before, vertices)
        last_time = memory[touch.TIME]
        end = touch.follow(rules, body[RADIUS], memory, time, state, clear)
        out[DEPTH] = max(out[DEPTH], memory[touch.DEPTH])
        if memory[touch.TOUCHES] == 1.0:
            out[FIRST_ENTRY], out[FIRST_EXIT] = memory[touch.ENTRY], memory[touch.EXIT]
            if was_wet and memory[touch.WET] == 0.0:
                part = (out[FIRST_EXIT] - last_time) / (time - last_time)
                for i in range(3):
                    out[EXIT_VELOCITY + i] = (1.0 - part) * before[VELOCITY + i] + part * state[
                        VELOCITY + i
                    ]
        if end != GOING_ON:
            break

        # on to the next moment
        for i in range(STATE):
            before[i] = state[i]
        steps += 1
        length = 0.0
        if long_steps and clear >= 0.0:
            if math.isnan(floor):  # the same for as long as it flies: L is constant
                floor = reach_below(body, y, state)
            if state[POSITION + 2] > floor and steps >= try_again:
                fall = slopes[0, P + 2] / body[MASS]
                longest = time_to_fall(state[POSITION + 2] - floor, state[VELOCITY + 2], fall)
                longest = min(0.999 * longest, rules[touch.DURATION] - time, guess)
                length = air_step(body, rules, y, slopes, longest, floor, work, after)
                guess = 3.0 * length if length > 0.0 else np.inf
                if length == 0.0 and longest > 8.0 * timestep:
                    try_again = steps + 16  # the spin asks for short steps: do not ask every time
        if length == 0.0:
            length = min(timestep, rules[touch.DURATION] - time) if long_steps else timestep
            step(body, int(rules[METHOD]), length, y, slopes, work, after)
            if long_steps and clear >= 0.0 and not located and after[X + 2] <= floor:
                whole = length
                length = locate_touchdown(
                    body, rules, vertices, y, slopes, length, clear, work, after
                )
                located = length < whole
        time = time + length if long_steps else timestep * steps
        for i in range(SIZE):
            y[i] = after[i]

    out[SKIPS], out[TOUCHES] = touch.skips(rules, memory), memory[touch.TOUCHES]
    if math.isnan(out[FIRST_EXIT]):  # a touch that went on after its first moment out
        out[EXIT_VELOCITY : EXIT_VELOCITY + 3] = np.nan
    out[TIME] = time
    out[DISTANCE], out[DRIFT] = y[X] - x0, y[X + 1] - y0
    out[END], out[STEPS] = end, steps


@kernel
def throw_many(bodies: Any, which: Any, rules: Any, vertices: Any, starts: Any, out: Any) -> None:
    """Every row of starts (n, SIZE), thrown with body which[i] (n,), into out (n, OUT)."""
    slopes, work = np.empty((STAGES, SIZE)), np.empty((WORK, STATE))
    y, memory = np.empty(SIZE), np.empty(touch.MEMORY)
    for i in range(starts.shape[0]):
        body = bodies[which[i]]
        for j in range(SIZE):
            y[j] = starts[i, j]
        own = vertices[int(body[FIRST]) : int(body[LAST])]
        throw_one(body, rules, own, y, slopes, work, memory, out[i])
