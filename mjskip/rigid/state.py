"""A rigid body's state as a row of 18 numbers, world frame: the names of its columns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mjskip._typing import Array

POSITION = 0
"""Where the centre of mass begins (3) [m]."""
ROTATION = 3
"""Where the rotation matrix begins, body to world, row by row (9)."""
VELOCITY = 12
"""Where the velocity of the centre of mass begins (3) [m/s]."""
OMEGA = 15
"""Where the angular velocity begins (3) [rad/s]."""
STATE = 18
"""Length of a state."""


class StateColumns(NamedTuple):
    """Views of one state (18,) or of many (n, 18)."""

    position: Array
    rotation: Array
    velocity: Array
    omega: Array


def state_columns(states: Array) -> StateColumns:
    """Views: position (..., 3), rotation (..., 3, 3), velocity (..., 3), omega (..., 3)."""
    return StateColumns(
        position=states[..., POSITION:ROTATION],
        rotation=states[..., ROTATION:VELOCITY].reshape(*states.shape[:-1], 3, 3),
        velocity=states[..., VELOCITY:OMEGA],
        omega=states[..., OMEGA:STATE],
    )


def pack_states(position: Array, rotation: Array, velocity: Array, omega: Array) -> Array:
    """States (n, 18) from (n, 3), (n, 3, 3), (n, 3) and (n, 3)."""
    return np.hstack([position, rotation.reshape(-1, 9), velocity, omega])
