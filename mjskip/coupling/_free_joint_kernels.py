"""MuJoCo's free joint as a rigid body's state: the pose and velocity of a body's own origin, seen at its centre."""

from typing import Any

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, bits, call_address
from mjskip.rigid._rigid_kernels import rotation
from mjskip.rigid.state import OMEGA, POSITION, ROTATION, VELOCITY


@kernel
def free_body(pose: Any, velocity: Any, centre: Any, state: Any) -> None:
    """State (18,) of a free joint from the pose (7,) and velocity (6,) of the body's own origin.

    Linear velocity is in the world, angular velocity in body axes, as MuJoCo has them; `centre` is the
    centre of mass in body axes (3,).
    """
    rotation(pose[3], pose[4], pose[5], pose[6], state)
    for i in range(3):
        arm = omega = 0.0
        for j in range(3):
            arm += state[ROTATION + 3 * i + j] * centre[j]
            omega += state[ROTATION + 3 * i + j] * velocity[3 + j]
        state[POSITION + i] = pose[i] + arm
        state[OMEGA + i] = omega
    for i in range(3):  # v = v_origin + omega x arm
        j, k = (i + 1) % 3, (i + 2) % 3
        state[VELOCITY + i] = (
            velocity[i]
            + state[OMEGA + j] * (state[POSITION + k] - pose[k])
            - state[OMEGA + k] * (state[POSITION + j] - pose[j])
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
