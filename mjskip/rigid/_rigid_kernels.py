"""Rigid-body motion of Witkin & Baraff (2001): x, q, P, L and their time derivatives."""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, as_doubles, bits, call_address

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
def free_body(pose: Any, velocity: Any, centre: Any, state: Any) -> None:
    """State (18,) of a free joint from the pose (7,) and velocity (6,) of the body's own origin.

    Linear velocity is in the world, angular velocity in body axes, as MuJoCo has them; `centre` is the
    centre of mass in body axes (3,).
    """
    _turn(pose[3], pose[4], pose[5], pose[6], state)
    for i in range(3):
        arm = omega = 0.0
        for j in range(3):
            arm += state[3 + 3 * i + j] * centre[j]
            omega += state[3 + 3 * i + j] * velocity[3 + j]
        state[i] = pose[i] + arm
        state[15 + i] = omega
    for i in range(3):  # v = v_origin + omega x arm
        j, k = (i + 1) % 3, (i + 2) % 3
        state[12 + i] = (
            velocity[i]
            + state[15 + j] * (state[k] - pose[k])
            - state[15 + k] * (state[j] - pose[j])
        )


@kernel
def free_motion(qpos: Any, qvel: Any, centre: Any, states: Any) -> None:
    """The same for rows (n, 7) and (n, 6) into states (n, 18)."""
    for n in range(qpos.shape[0]):
        free_body(qpos[n], qvel[n], centre, states[n])


HOP_STEP, HOP_MODEL, HOP_DATA, HOP_POSE, HOP_VELOCITY, HOP_CENTRE = 0, 1, 2, 3, 4, 5
HOP_SIZE = 8


def hop(context: Any, state: Any, _unused: Any) -> None:
    """Step an engine and read the state (18,) of its one free body: void(double*, double*, double*).

    Args:
        context: the bits of five addresses: void step(model, data), the model and the data, the body's pose
            and its velocity as in `free_body`; then the centre of mass (3).
        state: after the step.
    """
    call_address(bits(context[HOP_STEP]), bits(context[HOP_MODEL]), bits(context[HOP_DATA]), 0)
    pose, velocity = as_doubles(bits(context[HOP_POSE])), as_doubles(bits(context[HOP_VELOCITY]))
    centre = (context[HOP_CENTRE], context[HOP_CENTRE + 1], context[HOP_CENTRE + 2])
    free_body(pose, velocity, centre, state)


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
