"""A rigid body as the kernels integrate it: its row of properties, and its motion as x, q, P, L."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mjskip._typing import Array
from mjskip.rigid import _rigid_kernels as kernels
from mjskip.rigid.attitude import matrices


def body_row(
    mass: float,
    inertia: Array,
    *,
    gravity: Sequence[float] | Array = (0.0, 0.0, 0.0),
    forces: int = 0,
    block: int = 0,
    frozen_attitude: bool = False,
) -> Array:
    """The row (BODY,) of a body's properties.

    Args:
        mass: [kg].
        inertia: about the centre of mass, body axes (3, 3) [kg m^2].
        gravity: (3,) [m/s^2].
        forces: address of its force kernel, void(block*, state*, wrench*).
        block: address of what that kernel knows it by; must stay alive.
        frozen_attitude: it cannot turn.
    """
    row = np.zeros(kernels.BODY)
    row[[kernels.FORCES, kernels.BLOCK]] = np.array([forces, block], np.int64).view(np.float64)
    row[kernels.MASS] = mass
    row[kernels.GRAVITY : kernels.INVERSE_INERTIA] = gravity
    if not frozen_attitude:
        row[kernels.INVERSE_INERTIA : kernels.BODY] = np.linalg.inv(inertia).ravel()
    return row


def momenta(
    mass: float, inertia: Array, *, position: Array, q: Array, velocity: Array, omega: Array
) -> Array:
    """x, q, P, L (13,) of a body in a state."""
    rotation = matrices(q)
    spin = rotation @ (inertia @ (rotation.T @ omega))
    return np.concatenate([position, q, mass * velocity, spin])
