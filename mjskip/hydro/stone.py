"""The stone: a hull with a mass and an inertia, which is thrown."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.checks import (
    check_array,
    check_count,
    check_number,
    check_path,
    check_positive,
    check_switch,
    check_triangles,
    check_vector,
    fault,
)
from mjskip.errors import MeshError
from mjskip.hydro.hull import Hull, disc_of

GRANITE = 2600.0
"""Density of the stones made here unless another is given [kg/m^3]."""

SMALLEST, LARGEST = 1e-6, 1e6
"""Of the lengths of a stone [m]: its mass and its moments stay far from what a double cannot hold."""

MAX_SEGMENTS = 10_000
"""Around a rim, or from apex to rim."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Stone(Hull):
    """A rigid body that is thrown.

    Attributes:
        mass: [kg].
        inertia: about the centre of mass (3, 3) [kg m^2].
    """

    mass: float
    inertia: Array

    def __repr__(self) -> str:
        return f"Stone({len(self.faces)} triangles, {self.mass:.3g} kg, radius {self.radius:.3g} m)"

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

        Args:
            radius: of the rings [m].
            thickness: from apex to apex [m].
            density: [kg/m^3]; granite if neither density nor mass is given.
            mass: [kg], instead of the density.

        Raises:
            ValueError: a size, density or mass is not a positive number, or both of the last are given.
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
        """A flat disc: a regular prism of about 4 `segments` triangles inscribed in the circle.

        Args:
            radius: [m].
            thickness: [m].
            segments: corners of the rim, at least 3.
            density: [kg/m^3]; granite if neither density nor mass is given.
            mass: [kg], instead of the density.

        Raises:
            ValueError: an argument is out of range, or both density and mass are given.
        """
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
        """Two spherical caps rim to rim.

        Args:
            radius: of the rim [m].
            thickness: from apex to apex [m].
            segments: corners of the rim, at least 3.
            rings: steps from apex to rim.
            density: [kg/m^3]; granite if neither density nor mass is given.
            mass: [kg], instead of the density.

        Raises:
            ValueError: an argument is out of range, or both density and mass are given.
        """
        rings = check_count("rings", rings, high=MAX_SEGMENTS)
        radius, thickness = _checked_sizes(radius, thickness)
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
        radius, thickness = _checked_sizes(radius, thickness)
        segments = check_count("segments", segments, low=3, high=MAX_SEGMENTS)
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
        strict: bool = False,
    ) -> Stone:
        """A stone of uniform density from a closed mesh.

        A cavity within it takes away from mass and inertia; water does not reach it.

        Args:
            mesh: a `trimesh.Trimesh`, or the path of a file that trimesh reads (STL, OBJ, PLY, ...).
            density: [kg/m^3]; granite if neither density nor mass is given.
            mass: [kg], instead of the density.
            fix_normals: turn triangles so that normals point out of the stone.
            scale: factor from the mesh's length unit to metres.
            strict: refuse an open mesh; otherwise its convex hull is taken, with a warning.

        Raises:
            MeshError: the mesh has inverted normals or no volume, or it is open (strict).
            ValueError: density, mass or scale is not a positive number, or both are given.
        """
        from mjskip.hydro.solids import closed_mesh, with_area, without_voids

        check_positive(scale=scale)
        check_switch("fix_normals", fix_normals)
        check_switch("strict", strict)
        mesh = closed_mesh(_read(mesh), scale=scale, fix_normals=fix_normals, strict=strict)
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
        outside = without_voids(mesh)
        return cls.of_parts(
            vertices=np.asarray(outside.vertices, dtype=np.float64),
            faces=with_area(outside.vertices, np.asarray(outside.faces, dtype=np.int32)),
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
        """A stone whose mass properties are known.

        Args:
            vertices: (n, 3) [m].
            faces: (m, 3) indices, counter-clockwise seen from outside.
            mass: [kg].
            centre: centre of mass (3,), in the frame of the vertices [m].
            inertia: about the centre of mass (3, 3) [kg m^2].

        Raises:
            ValueError: an argument has another shape, or is not finite.
        """
        vertices, faces = check_triangles(vertices, faces)
        vertices = vertices - check_vector("centre", centre, 3)
        inertia = check_array("inertia", inertia, 3, 3)
        check_positive(mass=mass)
        disc = disc_of(vertices[faces], inertia)
        return cls(vertices=vertices, faces=faces, mass=mass, inertia=inertia, **disc)


def _checked_sizes(radius: object, thickness: object) -> tuple[float, float]:
    check_positive(radius=radius, thickness=thickness)
    return (
        check_number("radius", radius, low=SMALLEST, high=LARGEST, unit="m"),
        check_number("thickness", thickness, low=SMALLEST, high=LARGEST, unit="m"),
    )


def _read(mesh: Any) -> Any:
    import trimesh

    if isinstance(mesh, trimesh.Trimesh):
        return mesh
    if not isinstance(mesh, str | os.PathLike):
        raise fault("mesh", mesh, "give a trimesh.Trimesh or the path of a mesh file")
    path = check_path("mesh", mesh)
    if not path.is_file():
        raise MeshError(f"no mesh file {path}: give the path of an STL, OBJ or PLY file")
    try:
        return trimesh.load_mesh(path)
    except Exception as error:  # trimesh raises whatever its readers raise
        raise MeshError(f"{path} cannot be read as a mesh: {error}") from error
