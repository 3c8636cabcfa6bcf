"""Many throws from release to rest: the pure integrator and the counting of touches in one call.

The motion is that of `_rigid_kernels` (Witkin & Baraff 2001: x, q, P, L), step by step the same numbers,
and touches are found as in `recording`; tests hold both to the last bit. It is written out here again
because kernels that call each other share a file (numba's cache goes stale otherwise).

Stretches in the air may be taken in long steps instead: Dormand & Prince's 5(4) pair for x and P, and for a
stone of revolution the exact free rotation (Landau & Lifshitz, Mechanics, section 33)

    q(t) = exp(t L / 2 I1) q(0) exp(t (L.n) (1/I3 - 1/I1) n_body / 2),

so that the spin does not limit the step. Such a step ends before the stone can meet the water; the touch
itself is then found inside an ordinary step.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, call_address

EULER, MIDPOINT, RK4 = 0, 1, 2
SIZE = 13  # of y: x (3), q (4) w-x-y-z, P (3), L (3)
STATE = 18  # of a state for the force kernel: x (3), rotation (9), velocity (3), omega (3)

# a body: a stone in its water
MASS, RADIUS = 0, 1
REACH, HALF = 2, 3  # farthest from the axis, and along it [m]
ROUND = 4  # 1: a stone of revolution for its motion in the air
PRECESSION = 5  # 1 / I1
SPINNING = 6  # 1 / I3 - 1 / I1
AXIS = 7  # disc normal in body axes
INVERSE = 10  # of the inertia (9)
BLOCK = 19  # where its block begins
FIRST, LAST = 20, 21  # its vertices
BODY = 22

# the rules of a run
TIMESTEP, DURATION, MIN_AIRTIME, MAX_CONTACT, SINK_DEPTH, REST_SPEED, REST_TIME = range(7)
GRAVITY = 7
METHOD, AIR_TOLERANCE = 10, 11  # tolerance 0: the air too is taken at the fixed step
RULES = 12

# what comes out of a throw
SKIPS, TOUCHES, END, TIME, X, Y, DEPTH, ENTRY, EXIT, EXIT_VELOCITY = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
STEPS = 12
OUT = 13
SUNK, AT_REST, PLANING, OUT_OF_TIME, DIVERGED = 0, 1, 2, 3, 4

TOUCHING = 1e-9
"""The touch is located to this clearance [m]."""


@kernel
def motion(y: Any, body: Any, state: Any) -> None:
    """State of the force kernel from y: v = P / m, omega = R I^-1 R^T L."""
    w, x, y_, z = y[3], y[4], y[5], y[6]
    scale = 2.0 / (w * w + x * x + y_ * y_ + z * z)
    state[0], state[1], state[2] = y[0], y[1], y[2]
    state[3] = 1.0 - scale * (y_ * y_ + z * z)
    state[4] = scale * (x * y_ - w * z)
    state[5] = scale * (x * z + w * y_)
    state[6] = scale * (x * y_ + w * z)
    state[7] = 1.0 - scale * (x * x + z * z)
    state[8] = scale * (y_ * z - w * x)
    state[9] = scale * (x * z - w * y_)
    state[10] = scale * (y_ * z + w * x)
    state[11] = 1.0 - scale * (x * x + y_ * y_)
    for i in range(3):
        state[12 + i] = y[7 + i] / body[MASS]
        state[15 + i] = 0.0
    for i in range(3):  # L in body axes, omega in body axes, omega in the world
        turned = 0.0
        for j in range(3):
            along = 0.0
            for k in range(3):
                along += state[3 + 3 * k + j] * y[10 + k]
            turned += body[INVERSE + 3 * i + j] * along
        for k in range(3):
            state[15 + k] += state[3 + 3 * k + i] * turned


@kernel
def derivative(
    wrench: int, block: int, body: Any, rules: Any, y: Any, state: Any, load: Any, out: Any
) -> None:
    """dx = v, dq = 1/2 (0, omega) q, dP = F + m g, dL = tau, by the force kernel at an address."""
    motion(y, body, state)
    call_address(wrench, block, address_of(state), address_of(load))
    wx, wy, wz = state[15], state[16], state[17]
    for i in range(3):
        out[i] = state[12 + i]
        out[7 + i] = load[i] + load[6 + i] + body[MASS] * rules[GRAVITY + i]
        out[10 + i] = load[3 + i] + load[9 + i]
    out[3] = 0.5 * (-wx * y[4] - wy * y[5] - wz * y[6])
    out[4] = 0.5 * (wx * y[3] + wy * y[6] - wz * y[5])
    out[5] = 0.5 * (wy * y[3] + wz * y[4] - wx * y[6])
    out[6] = 0.5 * (wz * y[3] + wx * y[5] - wy * y[4])


@kernel
def step(
    wrench: int, block: int, body: Any, rules: Any, y: Any, k: Any, timestep: float, scratch: Any,
    out: Any,
) -> None:  # fmt: skip
    """One step of the chosen method from y into out; k[0] is the derivative at y."""
    state, load, trial = scratch[0], scratch[1], scratch[2]
    method = rules[METHOD]
    if method == EULER:
        for i in range(SIZE):
            out[i] = y[i] + timestep * k[0, i]
    else:
        for i in range(SIZE):
            trial[i] = y[i] + 0.5 * timestep * k[0, i]
        derivative(wrench, block, body, rules, trial, state, load, k[1])
        if method == MIDPOINT:
            for i in range(SIZE):
                out[i] = y[i] + timestep * k[1, i]
        else:
            for i in range(SIZE):
                trial[i] = y[i] + 0.5 * timestep * k[1, i]
            derivative(wrench, block, body, rules, trial, state, load, k[2])
            for i in range(SIZE):
                trial[i] = y[i] + timestep * k[2, i]
            derivative(wrench, block, body, rules, trial, state, load, k[3])
            for i in range(SIZE):
                out[i] = y[i] + timestep / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    norm = math.sqrt(out[3] ** 2 + out[4] ** 2 + out[5] ** 2 + out[6] ** 2)
    for i in range(3, 7):
        out[i] /= norm


@kernel
def clearance(state: Any, vertices: Any, body: Any) -> float:
    """Height of the lowest vertex above still water [m]."""
    ux, uy, uz, z = state[9], state[10], state[11], state[2]
    lowest = np.inf
    for i in range(int(body[FIRST]), int(body[LAST])):
        height = z + ux * vertices[i, 0] + uy * vertices[i, 1] + uz * vertices[i, 2]
        if height < lowest:
            lowest = height
    return lowest


@kernel
def drop(y: Any, state: Any, body: Any) -> float:
    """How far below its centre a freely turning stone can reach for as long as it is free [m]."""
    if body[ROUND] == 0.0:
        return float(body[RADIUS])
    nx, ny, nz = 0.0, 0.0, 0.0
    for j in range(3):
        nx += state[3 + j] * body[AXIS + j]
        ny += state[6 + j] * body[AXIS + j]
        nz += state[9 + j] * body[AXIS + j]
    lx, ly, lz = y[10], y[11], y[12]
    size = math.sqrt(lx * lx + ly * ly + lz * lz)
    if size == 0.0 or body[PRECESSION] == 0.0:
        tilt = math.acos(min(abs(nz), 1.0))
    else:  # the axis stays on a cone about L
        cone = math.acos(min(abs(lx * nx + ly * ny + lz * nz) / size, 1.0))
        tilt = math.acos(min(abs(lz) / size, 1.0)) + cone
    steepest = math.atan2(body[REACH], body[HALF])
    tilt = min(tilt, steepest)
    # a hair more, for rounding
    return float(body[REACH] * math.sin(tilt) + body[HALF] * math.cos(tilt)) + 1e-9


@kernel
def turn(y: Any, body: Any, state: Any, time: float, out: Any) -> None:
    """Orientation of a freely turning stone of revolution after `time`, into out[3:7].

    `state` is that of y.
    """
    lx, ly, lz = y[10], y[11], y[12]
    size = math.sqrt(lx * lx + ly * ly + lz * lz)
    half = 0.5 * time * size * body[PRECESSION]
    s = math.sin(half) / size if size > 0.0 else 0.0
    aw, ax, ay, az = math.cos(half), s * lx, s * ly, s * lz
    along = 0.0
    for j in range(3):
        part = state[3 + j] * lx + state[6 + j] * ly + state[9 + j] * lz
        along += part * body[AXIS + j]
    half = 0.5 * time * along * body[SPINNING]
    s = math.sin(half)
    bw, bx, by, bz = math.cos(half), s * body[AXIS], s * body[AXIS + 1], s * body[AXIS + 2]
    qw, qx, qy, qz = y[3], y[4], y[5], y[6]
    cw = aw * qw - ax * qx - ay * qy - az * qz
    cx = aw * qx + ax * qw + ay * qz - az * qy
    cy = aw * qy - ax * qz + ay * qw + az * qx
    cz = aw * qz + ax * qy - ay * qx + az * qw
    out[3] = cw * bw - cx * bx - cy * by - cz * bz
    out[4] = cw * bx + cx * bw + cy * bz - cz * by
    out[5] = cw * by - cx * bz + cy * bw + cz * bx
    out[6] = cw * bz + cx * by - cy * bx + cz * bw


@kernel
def glide(
    wrench: int, block: int, body: Any, rules: Any, y: Any, begin: Any, k: Any, longest: float,
    floor: float, table: Any, scratch: Any, out: Any,
) -> float:  # fmt: skip
    """One long step through the air from y into out, no longer than `longest`; how long it was.

    Of Dormand & Prince (1980), its length such that the estimated error is the tolerance, and such that the
    centre stays above `floor` at every stage. `begin` is the state of y, k[0] the derivative there. 0 if
    no step longer than the ordinary one does.
    """
    state, load, trial = scratch[0], scratch[1], scratch[2]
    rounded = body[ROUND] == 1.0
    tolerance = rules[AIR_TOLERANCE]
    impulse = momentum = 0.0
    for i in range(3):
        momentum += y[7 + i] ** 2
        impulse += y[10 + i] ** 2
    momentum, impulse = math.sqrt(momentum) + 0.1 * body[MASS], math.sqrt(impulse) + 1e-12
    h = longest
    while h > rules[TIMESTEP]:
        low = np.inf
        for stage in range(1, 7):
            for i in range(SIZE):
                total = 0.0
                for j in range(stage):
                    total += table[stage, j] * k[j, i]
                trial[i] = y[i] + h * total
            if rounded:
                turn(y, body, begin, h * table[stage, 7], trial)
                for i in range(10, 13):
                    trial[i] = y[i]
            low = min(low, trial[2])
            derivative(wrench, block, body, rules, trial, state, load, k[stage])
        # the last stage is the step itself
        worst = 0.0
        for i in range(SIZE):
            if rounded and (3 <= i < 7 or i >= 10):
                continue
            error = 0.0
            for j in range(7):
                error += table[7, j] * k[j, i]
            scale = 1.0 if i < 7 else (momentum if i < 10 else impulse)
            worst = max(worst, abs(h * error) / (tolerance * scale))
        if worst <= 1.0 and low > floor:
            norm = math.sqrt(trial[3] ** 2 + trial[4] ** 2 + trial[5] ** 2 + trial[6] ** 2)
            for i in range(SIZE):
                out[i] = trial[i]
            for i in range(3, 7):
                out[i] /= norm
            return h
        h *= 0.5 if worst <= 1.0 else max(0.1, 0.9 * worst**-0.2)
    return 0.0


@kernel
def until_floor(height: float, climb: float, acceleration: float) -> float:
    """Time until a height is used up at constant acceleration [s]; infinite if never."""
    if acceleration < 0.0:
        root = math.sqrt(climb * climb - 2.0 * acceleration * height)
        if climb < 0.0:
            return 2.0 * height / (root - climb)
        return (climb + root) / -acceleration
    return height / -climb if climb < 0.0 else np.inf


@kernel
def fly(
    wrench: int, block: int, body: Any, rules: Any, vertices: Any, y: Any, k: Any, table: Any,
    scratch: Any, out: Any,
) -> None:  # fmt: skip
    """One throw from y, which is advanced, to its end; what it did into out (OUT,)."""
    state, fresh, before, begin, load = scratch[3], scratch[4], scratch[5], scratch[6], scratch[1]
    timestep, gentle = rules[TIMESTEP], rules[AIR_TOLERANCE]
    x0, y0 = y[0], y[1]
    out[:] = np.nan
    out[SKIPS] = out[TOUCHES] = out[DEPTH] = 0.0
    steps = try_again = 0
    time = last_time = last_clear = since_dry = since_fast = entered = left = 0.0
    became_dry = np.nan
    floor = (
        np.nan
    )  # height below which the centre of a flying stone may bring its rim into the water
    guess = np.inf  # length of a long step that may do
    touching = False  # wet now
    pending = False  # a touch is over, unless the next begins too soon
    landed = False
    while True:
        derivative(wrench, block, body, rules, y, state, load, k[0])
        for i in range(STATE):
            begin[i] = state[i]
        finite = True
        for i in range(STATE):
            finite = finite and math.isfinite(state[i])
        for i in range(12):
            finite = finite and math.isfinite(load[i])
        if not finite:
            end = DIVERGED
            break
        clear = np.inf if state[2] > body[RADIUS] else clearance(state, vertices, body)

        # touches, as `recording.find_contacts` has them
        if clear < 0.0:
            floor = np.nan
            if not touching:
                touching = True
                landed = False
                entered = time
                if steps > 0:
                    if last_clear == np.inf:
                        last_clear = clearance(before, vertices, body)
                    entered = last_time + last_clear / (last_clear - clear) * (time - last_time)
                if pending and entered - left >= rules[MIN_AIRTIME]:
                    out[TOUCHES] += 1.0
                    out[SKIPS] += 1.0
                pending = False
                if math.isnan(out[ENTRY]):
                    out[ENTRY] = entered
            out[DEPTH] = max(out[DEPTH], -clear)
        elif touching:
            touching, pending = False, True
            if clear == np.inf:
                clear = clearance(state, vertices, body)
            left = last_time + last_clear / (last_clear - clear) * (time - last_time)
            if out[TOUCHES] == 0.0:
                part = (left - last_time) / (time - last_time)
                out[EXIT] = left
                for i in range(3):
                    out[EXIT_VELOCITY + i] = (1.0 - part) * before[12 + i] + part * state[12 + i]

        # is it over? as `recording.Log` has it
        if clear >= 0.0:
            if math.isnan(became_dry):
                became_dry = time
            if time - became_dry >= rules[MIN_AIRTIME]:
                since_dry = time
        else:
            became_dry = np.nan
        turning = body[RADIUS] * math.sqrt(state[15] ** 2 + state[16] ** 2 + state[17] ** 2)
        speed = math.sqrt(state[12] ** 2 + state[13] ** 2 + state[14] ** 2)
        if max(speed, turning) > rules[REST_SPEED]:
            since_fast = time
        if state[2] < -rules[SINK_DEPTH] * body[RADIUS]:
            end = SUNK
            break
        if time - since_fast >= rules[REST_TIME]:
            end = AT_REST
            break
        if time - since_dry > rules[MAX_CONTACT] and clear < 0.0:
            end = PLANING
            break
        if time >= rules[DURATION] * (1.0 - 1e-12):
            end = OUT_OF_TIME
            break

        # on to the next moment
        for i in range(STATE):
            before[i] = state[i]
        last_time, last_clear = time, clear
        steps += 1
        length = 0.0
        if gentle > 0.0 and clear >= 0.0:
            if math.isnan(floor):  # the same for as long as it flies: L is constant
                floor = drop(y, state, body)
            if state[2] > floor and steps >= try_again:
                longest = until_floor(state[2] - floor, state[14], k[0, 9] / body[MASS])
                longest = min(0.999 * longest, rules[DURATION] - time, guess)
                length = glide(
                    wrench, block, body, rules, y, begin, k, longest, floor, table, scratch, fresh
                )
                guess = 3.0 * length if length > 0.0 else np.inf
                if length == 0.0 and longest > 8.0 * timestep:
                    try_again = steps + 16  # the spin asks for short steps: do not ask every time
        if length == 0.0:
            length = timestep if gentle == 0.0 else min(timestep, rules[DURATION] - time)
            step(wrench, block, body, rules, y, k, length, scratch, fresh)
            if gentle > 0.0 and clear >= 0.0 and not landed and fresh[2] <= floor:
                motion(fresh, body, state)
                after = clearance(state, vertices, body)
                if after < 0.0:
                    length = land(
                        wrench, block, body, rules, vertices, y, k, length, clear, after, scratch,
                        fresh,
                    )  # fmt: skip
                    landed = True
        time = timestep * steps if gentle == 0.0 else time + length
        for i in range(SIZE):
            y[i] = fresh[i]

    if end != DIVERGED:
        if touching:
            out[TOUCHES] += 1.0
            if out[TOUCHES] == 1.0:  # a touch that went on after its first moment out
                out[EXIT] = out[EXIT_VELOCITY] = np.nan
                out[EXIT_VELOCITY + 1] = out[EXIT_VELOCITY + 2] = np.nan
        elif pending:
            out[TOUCHES] += 1.0
            if time - left >= rules[MIN_AIRTIME]:
                out[SKIPS] += 1.0
    out[TIME] = time
    out[X], out[Y] = y[0] - x0, y[1] - y0
    out[END] = end
    out[STEPS] = steps


@kernel
def land(
    wrench: int, block: int, body: Any, rules: Any, vertices: Any, y: Any, k: Any, length: float,
    clear: float, after: float, scratch: Any, out: Any,
) -> float:  # fmt: skip
    """Step from y only as far as the water, into out; how long that took.

    The clearance is `clear` at y and `after` < 0 a step of `length` later: regula falsi (Illinois).
    """
    state = scratch[3]
    early, late = 0.0, length
    high, low = clear, after
    if high < TOUCHING:
        high = TOUCHING
    side = 0
    for _ in range(30):
        length = late - low * (late - early) / (low - high)
        step(wrench, block, body, rules, y, k, length, scratch, out)
        motion(out, body, state)
        height = clearance(state, vertices, body)
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
def fly_all(
    wrench: int, blocks: Any, bodies: Any, which: Any, rules: Any, vertices: Any, starts: Any,
    table: Any, out: Any,
) -> None:  # fmt: skip
    """Every row of starts (n, 13), thrown with body which[i] (n,), into out (n, OUT)."""
    scratch = np.empty((7, STATE))
    k = np.empty((7, SIZE))
    y = np.empty(SIZE)
    for i in range(starts.shape[0]):
        body = bodies[which[i]]
        for j in range(SIZE):
            y[j] = starts[i, j]
        block = address_of(blocks) + 8 * int(body[BLOCK])
        fly(wrench, block, body, rules, vertices, y, k, table, scratch, out[i])
