"""A camera as geometry: where points of the world are in its picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mjskip._typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PinholeCamera:
    """A pinhole camera.

    Attributes:
        position: (3,) [m].
        forward: unit (3,).
        up: unit (3,), across forward.
        half_height: tangent of half the vertical angle of view.
        aspect: width over height of the picture.
    """

    position: Array
    forward: Array
    up: Array
    half_height: float
    aspect: float

    @classmethod
    def of(cls, scene: Any, aspect: float) -> PinholeCamera:
        """The camera of an `mujoco.MjvScene`, for pictures of this width over height."""
        left, right = scene.camera  # a stereo pair: the same but for their separation
        return cls(
            position=0.5 * (np.array(left.pos, np.float64) + right.pos),
            forward=np.array(left.forward, np.float64),
            up=np.array(left.up, np.float64),
            half_height=float(left.frustum_top / left.frustum_near),
            aspect=aspect,
        )

    @property
    def right(self) -> Array:
        """Unit (3,)."""
        return np.cross(self.forward, self.up)

    def project(self, points: Array) -> tuple[Array, Array]:
        """Where points (n, 3) are seen: (n, 2) in -1 to 1 from bottom left, and how far ahead [m]."""
        to = np.asarray(points) - self.position
        ahead = to @ self.forward
        with np.errstate(divide="ignore", invalid="ignore"):
            place = np.column_stack([to @ self.right / self.aspect, to @ self.up])
            place /= self.half_height * ahead[:, None]
        return place, ahead
