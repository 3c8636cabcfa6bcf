"""The hull of a wet body: a closed triangle mesh for the water, and the thin disc it is for the air."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.checks import check_array, check_triangles


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Hull:
    """The outside of a rigid body in its own frame: axes of the body, origin at its centre of mass.

    Attributes:
        vertices: (n, 3) [m].
        faces: (m, 3) indices, counter-clockwise seen from outside.
        disc_normal: axis of largest inertia, unit (3,), pointing to the body's own +z side.
        disc_area: area of the silhouette along it [m^2].
        disc_centre: centroid of that silhouette relative to the centre of mass (3,) [m].
    """

    vertices: Array
    faces: npt.NDArray[np.int32]
    disc_normal: Array
    disc_area: float
    disc_centre: Array

    def __repr__(self) -> str:
        return f"Hull({len(self.faces)} triangles, radius {self.radius:.3g} m)"

    @classmethod
    def of_surface(cls, *, vertices: Array, faces: npt.NDArray[np.int32], inertia: Array) -> Hull:
        """A hull in axes about the centre of mass of a body.

        Args:
            vertices: (n, 3) [m].
            faces: (m, 3) indices, counter-clockwise seen from outside.
            inertia: of the body about its centre of mass (3, 3) [kg m^2].

        Raises:
            ValueError: an argument has another shape, or is not finite.
        """
        vertices, faces = check_triangles(vertices, faces)
        inertia = check_array("inertia", inertia, 3, 3)
        return cls(vertices=vertices, faces=faces, **disc_of(vertices[faces], inertia))

    @cached_property
    def triangles(self) -> Array:
        """Corners of every triangle (m, 3, 3) [m]."""
        return self.vertices[self.faces]

    @cached_property
    def area_vectors(self) -> Array:
        """Outward normal times area of every triangle (m, 3) [m^2]."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return np.asarray(0.5 * np.cross(b - a, c - a), dtype=np.float64)

    @cached_property
    def area(self) -> float:
        """Area of the surface [m^2]."""
        return float(np.linalg.norm(self.area_vectors, axis=1).sum())

    @cached_property
    def volume(self) -> float:
        """Volume within the surface: what the body displaces when it is sunk [m^3]."""
        return float(np.einsum("ni,ni->", self.triangles.mean(axis=1), self.area_vectors) / 3.0)

    @cached_property
    def centroid(self) -> Array:
        """Centroid of that volume (3,) [m]: the centre of buoyancy of the sunk body."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        parts = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
        return np.asarray(parts @ (a + b + c) / (4.0 * parts.sum()), dtype=np.float64)

    @cached_property
    def radius(self) -> float:
        """Distance of the farthest vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @cached_property
    def thickness(self) -> float:
        """Extent along the disc normal [m]."""
        return float(np.ptp(self.vertices @ self.disc_normal))


def disc_of(triangles: Array, inertia: Array) -> dict[str, Any]:
    """The disc that a body is for the air: fields of `Hull`."""
    normal = _axis_of_largest_inertia(inertia)
    area, centre = _silhouette(triangles, normal)
    return {"disc_normal": normal, "disc_area": area, "disc_centre": centre}


def _axis_of_largest_inertia(inertia: Array) -> Array:
    """Unit vector (3,) towards +z; among equal axes the one nearest to z."""
    values, axes = np.linalg.eigh(inertia)
    equal = axes[:, values >= values[-1] * (1.0 - 1e-6)]
    nearest = equal @ equal[2]
    axis = nearest if np.linalg.norm(nearest) > 1e-9 else equal[:, -1]
    axis = axis / np.linalg.norm(axis)
    axis = np.where(np.abs(axis) < 1e-12, 0.0, axis)
    leading = axis[2] if axis[2] != 0.0 else axis[np.argmax(np.abs(axis))]
    return np.asarray(axis * np.sign(leading), dtype=np.float64)


def _silhouette(triangles: Array, normal: Array) -> tuple[float, Array]:
    """Area [m^2] of the shadow along `normal` and its centroid (3,) in the plane of the origin [m]."""
    import shapely

    across = np.linalg.svd(normal[None, :])[2][1:]
    facing = np.einsum("ni,i->n", np.cross(*np.diff(triangles, axis=1).transpose(1, 0, 2)), normal)
    shadows = shapely.polygons((triangles @ across.T)[facing > 0.0])
    shadow = shapely.union_all(shadows)
    centre = np.array(shapely.centroid(shadow).coords[0]) @ across
    # a symmetric stone has its disc at the centre of mass: rounding must not give it a lever
    if np.linalg.norm(centre) < 1e-6 * math.sqrt(shadow.area):
        centre = np.zeros(3)
    return float(shadow.area), centre
