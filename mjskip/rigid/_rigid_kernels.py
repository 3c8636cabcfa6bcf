"""Rigid-body motion of Witkin & Baraff (2001): position x, orientation q, momentum P, angular momentum L.

    dx = P / m,  dq = 1/2 (0, omega) q,  dP = F + m g,  dL = tau,  omega = R I^-1 R^T L

F and tau come from a force kernel at an address: void(block*, state*, wrench*), with water and air apart. A
single run, the reference engine and batches all move by `step`.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, bits, call_address
from mjskip.rigid.state import OMEGA, POSITION, ROTATION, STATE, VELOCITY

EULER, MIDPOINT, RK4 = 0, 1, 2

# y, what is integrated: x (3), q (4) w-x-y-z, P (3), L (3)
X, Q, P, L = 0, 3, 7, 10
SIZE = 13

# a body: all that its motion depends on
FORCES = 0  # address of the force kernel, as the bits of a double
BLOCK = 1  # address of what that kernel knows the body by, likewise
MASS = 2
GRAVITY = 3  # (3)
INVERSE_INERTIA = 6  # in body axes, row by row (9); zero for a body that cannot turn
BODY = 15


@kernel
def rotation(w: float, x: float, y: float, z: float, state: Any) -> None:
    """Rotation matrix of a quaternion of any length into a state."""
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    state[ROTATION] = 1.0 - scale * (y * y + z * z)
    state[ROTATION + 1] = scale * (x * y - w * z)
    state[ROTATION + 2] = scale * (x * z + w * y)
    state[ROTATION + 3] = scale * (x * y + w * z)
    state[ROTATION + 4] = 1.0 - scale * (x * x + z * z)
    state[ROTATION + 5] = scale * (y * z - w * x)
    state[ROTATION + 6] = scale * (x * z - w * y)
    state[ROTATION + 7] = scale * (y * z + w * x)
    state[ROTATION + 8] = 1.0 - scale * (x * x + y * y)


@kernel
def motion(body: Any, y: Any, state: Any) -> None:
    """State of the force kernel from y: v = P / m, omega = R I^-1 R^T L."""
    rotation(y[Q], y[Q + 1], y[Q + 2], y[Q + 3], state)
    for i in range(3):
        state[POSITION + i] = y[X + i]
        state[VELOCITY + i] = y[P + i] / body[MASS]
        state[OMEGA + i] = 0.0
    for i in range(3):  # L in body axes, omega in body axes, omega in the world
        turned = 0.0
        for j in range(3):
            along = 0.0
            for k in range(3):
                along += state[ROTATION + 3 * k + j] * y[L + k]
            turned += body[INVERSE_INERTIA + 3 * i + j] * along
        for k in range(3):
            state[OMEGA + k] += state[ROTATION + 3 * k + i] * turned


@kernel
def derivative(body: Any, y: Any, state: Any, load: Any, out: Any) -> None:
    """dy/dt (SIZE,) into out; the state of y and the load (12,) on it are left in `state` and `load`."""
    motion(body, y, state)
    call_address(bits(body[FORCES]), bits(body[BLOCK]), address_of(state), address_of(load))
    wx, wy, wz = state[OMEGA], state[OMEGA + 1], state[OMEGA + 2]
    qw, qx, qy, qz = y[Q], y[Q + 1], y[Q + 2], y[Q + 3]
    for i in range(3):  # water and air
        out[X + i] = state[VELOCITY + i]
        out[P + i] = load[i] + load[6 + i] + body[MASS] * body[GRAVITY + i]
        out[L + i] = load[3 + i] + load[9 + i]
    out[Q] = 0.5 * (-wx * qx - wy * qy - wz * qz)
    out[Q + 1] = 0.5 * (wx * qw + wy * qz - wz * qy)
    out[Q + 2] = 0.5 * (wy * qw + wz * qx - wx * qz)
    out[Q + 3] = 0.5 * (wz * qw + wx * qy - wy * qx)


@kernel
def step(body: Any, method: int, timestep: float, y: Any, slopes: Any, work: Any, out: Any) -> None:
    """One explicit step of a method from y into out, which may be y.

    Args:
        body: what moves (BODY,), or a longer row that begins so.
        method: EULER, MIDPOINT or RK4.
        timestep: [s].
        y: at its beginning (SIZE,).
        slopes: dy/dt at y in row 0; the stages' go into the rows after it (4, SIZE).
        work: scratch (3, STATE).
        out: (SIZE,).
    """
    state, load, trial = work[0], work[1], work[2]
    if method == EULER:
        for i in range(SIZE):
            out[i] = y[i] + timestep * slopes[0, i]
    else:
        for i in range(SIZE):
            trial[i] = y[i] + 0.5 * timestep * slopes[0, i]
        derivative(body, trial, state, load, slopes[1])
        if method == MIDPOINT:
            for i in range(SIZE):
                out[i] = y[i] + timestep * slopes[1, i]
        else:
            for i in range(SIZE):
                trial[i] = y[i] + 0.5 * timestep * slopes[1, i]
            derivative(body, trial, state, load, slopes[2])
            for i in range(SIZE):
                trial[i] = y[i] + timestep * slopes[2, i]
            derivative(body, trial, state, load, slopes[3])
            for i in range(SIZE):
                rise = slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i]
                out[i] = y[i] + timestep / 6.0 * rise
    normalise(out)


@kernel
def normalise(y: Any) -> None:
    """Bring the quaternion of y to unit length."""
    norm = math.sqrt(y[Q] ** 2 + y[Q + 1] ** 2 + y[Q + 2] ** 2 + y[Q + 3] ** 2)
    for i in range(Q, P):
        y[i] /= norm


@kernel
def advance(body: Any, method: int, timestep: float, y: Any, states: Any) -> None:
    """Advance y (SIZE,) in place by one step per row of states (n, STATE), which get the state after it."""
    slopes, work = np.empty((4, SIZE)), np.empty((3, STATE))
    for row in range(states.shape[0]):
        derivative(body, y, work[0], work[1], slopes[0])
        step(body, method, timestep, y, slopes, work, y)
        motion(body, y, states[row])
