"""Rigid-body motion of Witkin & Baraff (2001): x, q, P, L and their time derivatives."""

import math
from typing import Any

import numpy as np

from mjskip._jit import kernel
from mjskip._native import address_of, call_address

EULER, MIDPOINT, RK4 = 0, 1, 2

SIZE = 13  # of y: x (3), q (4) w-x-y-z, P (3), L (3)
STATE = 18  # of a state for the force kernel: x (3), rotation (9), velocity (3), omega (3)


@kernel
def _turn(w: float, x: float, y: float, z: float, state: Any) -> None:
    """Rotation matrix of a quaternion of any length into a state."""
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    state[3] = 1.0 - scale * (y * y + z * z)
    state[4] = scale * (x * y - w * z)
    state[5] = scale * (x * z + w * y)
    state[6] = scale * (x * y + w * z)
    state[7] = 1.0 - scale * (x * x + z * z)
    state[8] = scale * (y * z - w * x)
    state[9] = scale * (x * z - w * y)
    state[10] = scale * (y * z + w * x)
    state[11] = 1.0 - scale * (x * x + y * y)


@kernel
def free_motion(qpos: Any, qvel: Any, centre: Any, states: Any) -> None:
    """States (n, 18) of free joints: pose (n, 7) and velocity (n, 6) of the body's own origin.

    Linear velocity is in the world, angular velocity in body axes, as MuJoCo has them; `centre` is the
    centre of mass in body axes (3,).
    """
    for n in range(qpos.shape[0]):
        state = states[n]
        _turn(qpos[n, 3], qpos[n, 4], qpos[n, 5], qpos[n, 6], state)
        for i in range(3):
            arm = omega = 0.0
            for j in range(3):
                arm += state[3 + 3 * i + j] * centre[j]
                omega += state[3 + 3 * i + j] * qvel[n, 3 + j]
            state[i] = qpos[n, i] + arm
            state[15 + i] = omega
        for i in range(3):  # v = v_origin + omega x arm
            j, k = (i + 1) % 3, (i + 2) % 3
            state[12 + i] = (
                qvel[n, i]
                + state[15 + j] * (state[k] - qpos[n, k])
                - state[15 + k] * (state[j] - qpos[n, j])
            )


@kernel
def motion(y: Any, mass: float, inverse_inertia: Any, state: Any) -> None:
    """State of the force kernel from y: v = P / m, omega = R I^-1 R^T L."""
    state[0], state[1], state[2] = y[0], y[1], y[2]
    _turn(y[3], y[4], y[5], y[6], state)
    for i in range(3):
        state[12 + i] = y[7 + i] / mass
        state[15 + i] = 0.0
    for i in range(3):  # L in body axes, omega in body axes, omega in the world
        turned = 0.0
        for j in range(3):
            body = 0.0
            for k in range(3):
                body += state[3 + 3 * k + j] * y[10 + k]
            turned += inverse_inertia[i, j] * body
        for k in range(3):
            state[15 + k] += state[3 + 3 * k + i] * turned


@kernel
def derivative(
    wrench: int, block: Any, y: Any, mass: float, inverse_inertia: Any, gravity: Any,
    state: Any, load: Any, out: Any,
) -> None:  # fmt: skip
    """dx = v, dq = 1/2 (0, omega) q, dP = F + m g, dL = tau, by the force kernel at an address."""
    motion(y, mass, inverse_inertia, state)
    call_address(wrench, address_of(block), address_of(state), address_of(load))
    wx, wy, wz = state[15], state[16], state[17]
    for i in range(3):
        out[i] = state[12 + i]
        out[7 + i] = load[i] + load[6 + i] + mass * gravity[i]
        out[10 + i] = load[3 + i] + load[9 + i]
    out[3] = 0.5 * (-wx * y[4] - wy * y[5] - wz * y[6])
    out[4] = 0.5 * (wx * y[3] + wy * y[6] - wz * y[5])
    out[5] = 0.5 * (wy * y[3] + wz * y[4] - wx * y[6])
    out[6] = 0.5 * (wz * y[3] + wx * y[5] - wy * y[4])


@kernel
def march(
    wrench: int, block: Any, y: Any, mass: float, inverse_inertia: Any, gravity: Any,
    method: int, timestep: float, states: Any,
) -> None:  # fmt: skip
    """Advance y (13,) in place by one step per row of states (n, 18), which get the state after it."""
    state = np.empty(STATE)
    load = np.empty(12)
    trial = np.empty(SIZE)
    k1, k2, k3, k4 = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE), np.empty(SIZE)
    for row in range(states.shape[0]):
        derivative(wrench, block, y, mass, inverse_inertia, gravity, state, load, k1)
        if method == EULER:
            for i in range(SIZE):
                y[i] += timestep * k1[i]
        else:
            for i in range(SIZE):
                trial[i] = y[i] + 0.5 * timestep * k1[i]
            derivative(wrench, block, trial, mass, inverse_inertia, gravity, state, load, k2)
            if method == MIDPOINT:
                for i in range(SIZE):
                    y[i] += timestep * k2[i]
            else:
                for i in range(SIZE):
                    trial[i] = y[i] + 0.5 * timestep * k2[i]
                derivative(wrench, block, trial, mass, inverse_inertia, gravity, state, load, k3)
                for i in range(SIZE):
                    trial[i] = y[i] + timestep * k3[i]
                derivative(wrench, block, trial, mass, inverse_inertia, gravity, state, load, k4)
                for i in range(SIZE):
                    y[i] += timestep / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        norm = math.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2 + y[6] ** 2)
        for i in range(3, 7):
            y[i] /= norm
        motion(y, mass, inverse_inertia, states[row])
