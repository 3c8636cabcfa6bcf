"""What the environments do at every step, for the rows of one simulation or of many.

Arrays have a row for each simulation; `rows` are those that were stepped. Free joints: position (3) and quaternion
w-x-y-z (4) in qpos, velocity in the world (3) and angular velocity in the body (3) in qvel.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel


@kernel
def cut_actions(actions: Any, out: Any) -> bool:
    """Actions (n, k) cut to -1 to 1 into out; whether all are finite."""
    total = 0.0
    for row in range(actions.shape[0]):
        for k in range(actions.shape[1]):
            value = actions[row, k]
            total += value - value  # 0, or not a number
            out[row, k] = min(max(value, -1.0), 1.0)
    return total == 0.0


@kernel
def cut_observations(observations: Any, low: Any, high: Any, out: Any) -> None:
    """Observations (n, k) cut to their bounds (k,) into out."""
    for row in range(observations.shape[0]):
        for k in range(observations.shape[1]):
            out[row, k] = min(max(observations[row, k], low[k]), high[k])


@kernel
def count_skips(
    rows: Any, seen: Any, timestep: float, min_airtime: float,
    skips: Any, contact: Any, dry: Any, grounded: Any,
) -> None:  # fmt: skip
    """A stone in a touch (contact > 0) that has been dry for min_airtime has skipped.

    Args:
        seen: whether it was wet, and whether it touched the ground, at each step (len(rows), steps, 2).
        skips, contact, dry: number of skips, time of the present touch [s], time dry in it [s]; changed.
        grounded: whether it touched the ground, after which nothing counts; changed.
    """
    for i in range(len(rows)):
        row = rows[i]
        for k in range(seen.shape[1]):
            grounded[row] |= seen[i, k, 1]
            if grounded[row]:
                break
            if seen[i, k, 0]:
                contact[row] += timestep
                dry[row] = 0.0
            elif contact[row] > 0.0:
                contact[row] += timestep
                dry[row] += timestep
                if dry[row] >= min_airtime * (1.0 - 1e-9):
                    skips[row] += 1
                    contact[row] = 0.0


@kernel
def upward(q: Any, at: int, axis: int, out: Any, to: int) -> None:
    """Column `axis` of the rotation matrix of the quaternion at q[at:at + 4], into out[to:to + 3]."""
    w, x, y, z = q[at], q[at + 1], q[at + 2], q[at + 3]
    if axis == 0:
        out[to] = 1.0 - 2.0 * (y * y + z * z)
        out[to + 1] = 2.0 * (x * y + w * z)
        out[to + 2] = 2.0 * (x * z - w * y)
    elif axis == 1:
        out[to] = 2.0 * (x * y - w * z)
        out[to + 1] = 1.0 - 2.0 * (x * x + z * z)
        out[to + 2] = 2.0 * (y * z + w * x)
    else:
        out[to] = 2.0 * (x * z + w * y)
        out[to + 1] = 2.0 * (y * z - w * x)
        out[to + 2] = 1.0 - 2.0 * (x * x + y * y)


@kernel
def into_body(q: Any, at: int, x: float, y: float, z: float, out: Any, to: int) -> None:
    """A vector of the world in the axes of a body: the transposed rotation of its quaternion."""
    for axis in range(3):
        upward(q, at, axis, out, to + axis)
        along = out[to + axis] * x + out[to + axis + 1] * y + out[to + axis + 2] * z
        out[to + axis] = along


@kernel
def judge_stone(
    rows: Any, qpos: Any, at: int, radius: Any, skips: Any, contact: Any, grounded: Any, free: Any,
    sink_depth: float, max_contact: float, skip_reward: float, metre_reward: float,
    start: Any, counted: Any, distance: Any, reward: Any, over: Any,
) -> None:  # fmt: skip
    """Reward and end of stones in flight.

        reward = skip_reward (skips - counted) + metre_reward (distance - distance before)

    Args:
        at: where the stone's free joint begins in qpos.
        radius: of each stone [m].
        free: whether it was let go.
        start: x and y where it was let go.
        counted: skips that were rewarded; changed.
        distance: horizontal, from the start [m]; changed.
    """
    for i in range(len(rows)):
        row = rows[i]
        if not free[row]:
            continue
        x, y = qpos[row, at] - start[row, 0], qpos[row, at + 1] - start[row, 1]
        far = math.sqrt(x * x + y * y)
        reward[row] += skip_reward * (skips[row] - counted[row])
        reward[row] += metre_reward * (far - distance[row])
        counted[row] = skips[row]
        distance[row] = far
        sunk = qpos[row, at + 2] < -sink_depth * radius[row]
        over[row] = sunk or contact[row] > max_contact or grounded[row]


@kernel
def observe_thrower(qpos: Any, qvel: Any, held: Any, time: Any, duration: float, out: Any) -> None:
    """Joints, grip and stone of the arm, see `ThrowerTask`."""
    for row in range(qpos.shape[0]):
        o = out[row]
        o[0], o[1] = qpos[row, 0], qpos[row, 1]
        o[2], o[3] = math.sin(qpos[row, 2]), math.cos(qpos[row, 2])
        for k in range(3):
            o[4 + k] = qvel[row, k]
            o[9 + k] = qpos[row, 3 + k]
            o[12 + k] = qvel[row, 3 + k]
        o[7] = held[row]
        o[8] = time[row] / duration
        upward(qpos[row], 6, 2, o, 15)
        o[18] = qvel[row, 8]


@kernel
def judge_float(
    rows: Any, qpos: Any, goal: Any, action: Any, far: float, offset: Any, reward: Any, over: Any
) -> None:
    """Reward of keeping station: minus distance [m], heading error [rad] and effort.

        reward = -(distance + 0.3 |heading error| + 0.05 mean(action^2))

    Args:
        goal: x, y, heading.
        far: distance at which a raft is lost [m].
        offset: distance and heading error; set.
    """
    ahead = np.empty(3)
    for i in range(len(rows)):
        row = rows[i]
        x, y = goal[row, 0] - qpos[row, 0], goal[row, 1] - qpos[row, 1]
        upward(qpos[row], 3, 0, ahead, 0)
        turn = goal[row, 2] - math.atan2(ahead[1], ahead[0])
        turn = abs(math.atan2(math.sin(turn), math.cos(turn)))
        distance = math.sqrt(x * x + y * y)
        effort = 0.0
        for k in range(action.shape[1]):
            effort += action[row, k] ** 2
        offset[row, 0], offset[row, 1] = distance, turn
        reward[row] -= distance + 0.3 * turn + 0.05 * effort / action.shape[1]
        upward(qpos[row], 3, 2, ahead, 0)
        over[row] = distance > far or ahead[2] < 0.3


@kernel
def observe_float(qpos: Any, qvel: Any, goal: Any, out: Any) -> None:
    """Where the goal is and how the raft moves, in its own axes, see `FloatTask`."""
    for row in range(qpos.shape[0]):
        o = out[row]
        upward(qpos[row], 3, 0, o, 5)  # ahead; overwritten below
        heading = math.atan2(o[6], o[5])
        x, y = goal[row, 0] - qpos[row, 0], goal[row, 1] - qpos[row, 1]
        o[0] = math.cos(heading) * x + math.sin(heading) * y
        o[1] = math.cos(heading) * y - math.sin(heading) * x
        turn = goal[row, 2] - heading
        o[2], o[3] = math.sin(turn), math.cos(turn)
        o[4] = qpos[row, 2]
        into_body(qpos[row], 3, 0.0, 0.0, 1.0, o, 5)
        into_body(qpos[row], 3, qvel[row, 0], qvel[row, 1], qvel[row, 2], o, 8)
        for k in range(3):
            o[11 + k] = qvel[row, 3 + k]


@kernel
def judge_wade(
    rows: Any, qpos: Any, action: Any, before: Any, far_bank: float, lowest: float,
    progress: Any, crossed: Any, reward: Any, over: Any,
) -> None:  # fmt: skip
    """Reward of crossing: metres forward, less the effort, and 10 for standing on the far bank.

        reward = 10 dx - 0.02 mean(action^2) + 10 [crossed]

    Args:
        before: x of the trunk one action ago [m]; changed.
        far_bank: x at which the ford is crossed [m].
        lowest: height of the trunk below which it has sunk or fallen [m].
        progress: metres since the start; changed.
        crossed: whether it arrived; changed.
    """
    axis = np.empty(3)
    for i in range(len(rows)):
        row = rows[i]
        x = qpos[row, 0]
        effort = 0.0
        for k in range(action.shape[1]):
            effort += action[row, k] ** 2
        reward[row] += 10.0 * (x - before[row]) - 0.02 * effort / action.shape[1]
        progress[row] += x - before[row]
        before[row] = x
        upward(qpos[row], 3, 2, axis, 0)
        fallen = axis[2] < 0.2 or qpos[row, 2] < lowest
        crossed[row] = x > far_bank and not fallen
        if crossed[row]:
            reward[row] += 10.0
        over[row] = fallen or crossed[row]


@kernel
def observe_wade(qpos: Any, qvel: Any, joints: int, out: Any) -> None:
    """Trunk and joints of the quadruped, see `WadeTask`."""
    for row in range(qpos.shape[0]):
        o = out[row]
        o[0], o[1], o[2] = qpos[row, 0], qpos[row, 1], qpos[row, 2]
        into_body(qpos[row], 3, 0.0, 0.0, 1.0, o, 3)
        upward(qpos[row], 3, 0, o, 6)
        heading = math.atan2(o[7], o[6])
        o[6], o[7] = math.sin(heading), math.cos(heading)
        into_body(qpos[row], 3, qvel[row, 0], qvel[row, 1], qvel[row, 2], o, 8)
        for k in range(3):
            o[11 + k] = qvel[row, 3 + k]
        for k in range(joints):
            o[14 + k] = qpos[row, 7 + k]
            o[14 + joints + k] = qvel[row, 6 + k]
