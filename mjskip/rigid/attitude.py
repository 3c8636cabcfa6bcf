"""Orientation: quaternions (w-x-y-z, body to world) and the angles a thrower speaks of.

Angles are taken against the stone's own heading at that moment: e the horizontal unit vector of travel,
l = z x e to the left of it, n the upper disc normal: attack = arcsin(-n.e), bank = arcsin(n.l), spin = omega.n.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array


class Angles(NamedTuple):
    """Attack [rad], bank [rad] and spin [rad/s], arrays of one shape."""

    attack: Array
    bank: Array
    spin: Array


def matrices(q: npt.ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3), body to world, of quaternions (..., 4)."""
    from scipy.spatial.transform import Rotation  # a third of a second that many never need

    q = np.asarray(q, dtype=np.float64)
    flat = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_matrix()
    return np.asarray(flat, dtype=np.float64).reshape(*q.shape[:-1], 3, 3)


def quaternions(matrix: npt.ArrayLike) -> Array:
    """Unit quaternions (n, 4) of rotation matrices (n, 3, 3), without jumps of sign between rows."""
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(np.asarray(matrix, dtype=np.float64))
    q = np.asarray(found.as_quat(scalar_first=True), dtype=np.float64)
    q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
    return q


def difference(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Angle of the rotation between orientations a and b, quaternions (..., 4) [rad]."""
    relative = np.einsum("...ji,...jk->...ik", matrices(a), matrices(b))
    # the sine from the antisymmetric part stays exact for small angles, where arccos does not
    sine = 0.5 * np.linalg.norm(
        np.stack(
            [
                relative[..., 2, 1] - relative[..., 1, 2],
                relative[..., 0, 2] - relative[..., 2, 0],
                relative[..., 1, 0] - relative[..., 0, 1],
            ],
            axis=-1,
        ),
        axis=-1,
    )
    cosine = 0.5 * (np.trace(relative, axis1=-2, axis2=-1) - 1.0)
    return np.asarray(np.arctan2(sine, cosine), dtype=np.float64)


def release_attitude(normal_body: npt.ArrayLike, attack: float, bank: float) -> Array:
    """Rotation matrix (3, 3) that gives a stone travelling along +x this attack and bank [rad].

    Raises:
        ValueError: no normal has these two angles (sin^2 attack + sin^2 bank > 1).
    """
    ahead, left = -np.sin(attack), np.sin(bank)
    up = 1.0 - ahead**2 - left**2
    if up < 0.0:
        raise ValueError(
            f"attack {np.degrees(attack):g} and bank {np.degrees(bank):g} degrees cannot both hold: "
            "their squared sines must not add up to more than 1"
        )
    z = np.array([ahead, left, np.sqrt(up)])
    x = np.array([1.0, 0.0, 0.0]) - ahead * z
    if np.linalg.norm(x) < 1e-9:  # flat on to the motion: any heading of the disc will do
        x = np.array([0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(z, x), z])
    return np.asarray(
        frame @ _to_z(*np.asarray(normal_body, dtype=float).tolist()), dtype=np.float64
    )


@cache
def _to_z(x: float, y: float, z: float) -> Array:
    """The least rotation (3, 3) that turns a unit vector to +z."""
    from scipy.spatial.transform import Rotation

    turn, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [[x, y, z]])
    return np.asarray(turn.as_matrix(), dtype=np.float64)


def angles(normal: npt.ArrayLike, velocity: npt.ArrayLike, omega: npt.ArrayLike) -> Angles:
    """Attack, bank and spin of stones with these world-frame normals, velocities and omegas (..., 3).

    A stone without horizontal motion is taken to head along +x.
    """
    n = np.asarray(normal, dtype=np.float64)
    n = np.where(n[..., 2:] < 0.0, -n, n)
    heading = np.array(velocity, dtype=np.float64)
    heading[..., 2] = 0.0
    speed = np.linalg.norm(heading, axis=-1, keepdims=True)
    e = np.where(speed > 1e-9, heading / np.maximum(speed, 1e-9), np.array([1.0, 0.0, 0.0]))
    left = np.stack([-e[..., 1], e[..., 0], np.zeros_like(e[..., 0])], axis=-1)

    def arcsine(sine: Array) -> Array:
        return np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)), dtype=np.float64)

    return Angles(
        attack=arcsine(-np.sum(n * e, axis=-1)),
        bank=arcsine(np.sum(n * left, axis=-1)),
        spin=np.asarray(np.sum(np.asarray(omega) * n, axis=-1), dtype=np.float64),
    )
