"""MuJoCo's free joint as a rigid body's state: the pose and velocity of a body's own origin, seen at its centre."""

from typing import Any

from mjskip._compile.jit import kernel
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
