"""The stone: a closed triangle mesh for the water, and the thin disc it is for the air."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip.checks import check_positive
from mjskip.errors import MeshError

Array = npt.NDArray[np.float64]

GRANITE = 2600.0
"""Density of the stones made here unless another is given [kg/m^3]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stone:
    """A rigid body in its own frame: axes of the body, origin at its centre of mass.

    Attributes:
        vertices: (n, 3) [m].
        faces: (m, 3) indices, counter-clockwise seen from outside.
        mass: [kg].
        inertia: about the centre of mass (3, 3) [kg m^2].
        disc_normal: axis of largest inertia, unit (3,), pointing to the body's own +z side.
        disc_area: area of the silhouette along it [m^2].
        disc_centre: centroid of that silhouette relative to the centre of mass (3,) [m].
    """

    vertices: Array
    faces: npt.NDArray[np.int32]
    mass: float
    inertia: Array
    disc_normal: Array
    disc_area: float
    disc_centre: Array

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
    def radius(self) -> float:
        """Distance of the farthest vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @cached_property
    def thickness(self) -> float:
        """Extent along the disc normal [m]."""
        return float(np.ptp(self.vertices @ self.disc_normal))

    @classmethod
    def pebble(
        cls,
        *,
        radius: float = 0.045,
        thickness: float = 0.015,
        density: float | None = None,
        mass: float | None = None,
    ) -> Stone:
        """The paper's stone of 44 triangles: apex, ring of 11, ring of 11, apex.

        The rings stand at plus and minus a fifth of the thickness, so that the rim is blunt.
        """
        profile = [(0.0, 0.5), (1.0, 0.2), (1.0, -0.2), (0.0, -0.5)]
        return cls._turned(profile, radius, thickness, 11, density, mass)

    @classmethod
    def disc(
        cls,
        radius: float,
        thickness: float,
        *,
        segments: int = 64,
        density: float | None = None,
        mass: float | None = None,
    ) -> Stone:
        """A flat disc: a regular prism of 4 x `segments` triangles inscribed in the circle [m]."""
        profile = [(0.0, 0.5), (1.0, 0.5), (1.0, -0.5), (0.0, -0.5)]
        return cls._turned(profile, radius, thickness, segments, density, mass)

    @classmethod
    def lens(
        cls,
        radius: float,
        thickness: float,
        *,
        segments: int = 32,
        rings: int = 6,
        density: float | None = None,
        mass: float | None = None,
    ) -> Stone:
        """Two spherical caps rim to rim: `rings` steps from apex to rim, `segments` around [m]."""
        if rings < 1:
            raise ValueError(f"rings is {rings!r}: a lens needs at least 1 step from apex to rim")
        check_positive(radius=radius, thickness=thickness)
        half = 0.5 * thickness
        sphere = (radius**2 + half**2) / (2.0 * half)
        opening = math.atan2(radius, sphere - half)
        upper = [
            (
                sphere * math.sin(opening * k / rings) / radius,
                (sphere * math.cos(opening * k / rings) - (sphere - half)) / thickness,
            )
            for k in range(rings)
        ]
        profile = [*upper, (1.0, 0.0), *((r, -z) for r, z in reversed(upper))]
        return cls._turned(profile, radius, thickness, segments, density, mass)

    @classmethod
    def _turned(
        cls,
        profile: list[tuple[float, float]],
        radius: float,
        thickness: float,
        segments: int,
        density: float | None,
        mass: float | None,
    ) -> Stone:
        """Body of revolution from (radius, height) fractions, top apex to bottom apex."""
        check_positive(radius=radius, thickness=thickness)
        if segments < 3:
            raise ValueError(f"segments is {segments!r}: a rim needs at least 3")
        turn = 2.0 * np.pi * np.arange(segments) / segments
        rim = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(segments)])
        rings = [rim * (r * radius) + [0.0, 0.0, z * thickness] for r, z in profile[1:-1]]
        apexes = np.array([[0.0, 0.0, profile[k][1] * thickness] for k in (0, -1)])
        vertices = np.vstack([*rings, apexes])
        top, bottom = len(vertices) - 2, len(vertices) - 1
        here = np.arange(segments)
        after = np.roll(here, -1)
        faces = [np.column_stack([np.full(segments, top), here, after])]
        for k in range(len(rings) - 1):
            upper, lower = k * segments, (k + 1) * segments
            faces.append(np.column_stack([upper + here, lower + here, lower + after]))
            faces.append(np.column_stack([upper + here, lower + after, upper + after]))
        last = (len(rings) - 1) * segments
        faces.append(np.column_stack([np.full(segments, bottom), last + after, last + here]))
        import trimesh  # half a second that a command's help does not need

        mesh = trimesh.Trimesh(vertices, np.vstack(faces), process=False)
        return cls.from_mesh(mesh, density=density, mass=mass)

    @classmethod
    def from_mesh(
        cls,
        mesh: Any,
        *,
        density: float | None = None,
        mass: float | None = None,
        fix_normals: bool = False,
        scale: float = 1.0,
    ) -> Stone:
        """A stone of uniform density from a closed mesh.

        Args:
            mesh: a `trimesh.Trimesh`, or the path of a file that trimesh reads (STL, OBJ, PLY, ...).
            density: [kg/m^3]; granite if neither density nor mass is given.
            mass: [kg], instead of the density.
            fix_normals: turn triangles so that all normals point outwards.
            scale: factor from the mesh's length unit to metres.

        Raises:
            MeshError: the mesh is open, has inverted normals or degenerate triangles, or no volume.
            ValueError: density, mass or scale is not a positive number, or both are given.
        """
        check_positive(scale=scale)
        mesh = closed_mesh(_read(mesh), scale=scale, fix_normals=fix_normals)
        if density is not None and mass is not None:
            raise ValueError(
                f"both density {density!r} and mass {mass!r} are given: give one of them"
            )
        if mass is not None:
            check_positive(mass=mass)
            density = mass / float(mesh.volume)
        elif density is None:
            density = GRANITE
        check_positive(density=density)
        mesh.density = density
        return cls.of_parts(
            vertices=np.asarray(mesh.vertices, dtype=np.float64),
            faces=np.asarray(mesh.faces, dtype=np.int32),
            mass=float(mesh.mass),
            centre=np.asarray(mesh.center_mass, dtype=np.float64),
            inertia=np.asarray(mesh.moment_inertia, dtype=np.float64),
        )

    @classmethod
    def of_parts(
        cls,
        *,
        vertices: Array,
        faces: npt.NDArray[np.int32],
        mass: float,
        centre: Array,
        inertia: Array,
    ) -> Stone:
        """A stone whose mass properties are known; vertices and centre of mass in one frame [m]."""
        vertices = vertices - centre
        normal = _axis_of_largest_inertia(inertia)
        area, disc_centre = _silhouette(vertices[faces], normal)
        return cls(
            vertices=vertices,
            faces=faces,
            mass=mass,
            inertia=inertia,
            disc_normal=normal,
            disc_area=area,
            disc_centre=disc_centre,
        )


def _read(mesh: Any) -> Any:
    import trimesh

    if isinstance(mesh, trimesh.Trimesh):
        return mesh
    path = Path(mesh)
    if not path.is_file():
        raise MeshError(f"no mesh file {path}: give the path of an STL, OBJ or PLY file")
    try:
        return trimesh.load_mesh(path)
    except Exception as error:  # trimesh raises whatever its readers raise
        raise MeshError(f"{path} cannot be read as a mesh: {error}") from error


def closed_mesh(mesh: Any, *, scale: float = 1.0, fix_normals: bool = False) -> Any:
    """A welded copy in metres, known to be closed, outward and solid.

    Raises:
        MeshError: with what is wrong and what to do.
    """
    import trimesh

    if len(mesh.faces) == 0:
        raise MeshError("the mesh has no triangles: a stone needs a closed surface")
    if not np.isfinite(mesh.vertices).all():  # welding would drop them without a word
        raise MeshError("the mesh has vertices that are not finite: repair it first")
    mesh = trimesh.Trimesh(np.asarray(mesh.vertices) * scale, mesh.faces, process=True)
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    flat = int(np.sum(mesh.area_faces <= 1e-12 * extent**2))
    if flat:
        raise MeshError(
            f"{flat} of {len(mesh.faces)} triangles are degenerate (no area): remove them, for "
            "example with mesh.update_faces(mesh.nondegenerate_faces())"
        )
    if not mesh.is_watertight:
        edges = trimesh.grouping.group_rows(mesh.edges_sorted, require_count=1)
        raise MeshError(
            f"the mesh is open ({len(edges)} edges with one triangle only): close it, for example "
            "with mesh.fill_holes()"
        )
    if fix_normals:
        mesh.fix_normals(multibody=True)
    if not mesh.is_winding_consistent:
        raise MeshError(
            "some triangles of the mesh face inwards: pass fix_normals=True to turn them"
        )
    with np.errstate(all="ignore"):  # trimesh divides by it
        volume = float(mesh.volume)
    if abs(volume) <= 1e-9 * extent**3:
        raise MeshError(f"the mesh has no volume ({volume:.3g} m^3): a stone must be solid")
    if volume < 0.0:
        raise MeshError("the normals of the mesh point inwards: pass fix_normals=True to turn them")
    return mesh


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
