"""Round solids by few faces: vertices stand a little outside, so that the volume is exact.

Every one has the mirror planes of its solid, so that what lies straight in the water is not turned by its mesh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Integers

RESOLUTION = 12
"""Segments around a circle unless told otherwise; multiples of 4 keep every mirror plane."""

MAX_SEGMENTS = 1000
"""Around a circle: a sphere of so many has half a million faces."""


def box(size: npt.ArrayLike) -> Any:
    """A box of half lengths (3,) [m], 24 faces: every side is four triangles about its middle."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    middles = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
    around = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [
        [8 + side, ring[k], ring[(k + 1) % 4]] for side, ring in enumerate(around) for k in range(4)
    ]
    vertices = np.vstack([corners, middles]) * np.asarray(size, np.float64)
    return _mesh(vertices, faces)


def ellipsoid(size: npt.ArrayLike, resolution: int = RESOLUTION) -> Any:
    """An ellipsoid of half axes (3,) [m]: an octahedron whose faces are divided, 8 (resolution / 4)^2 faces."""
    n = max(2, round(resolution / 4.0))
    vertices, faces = _octasphere(n)
    mesh = _mesh(vertices, faces)
    grow = (4.0 / 3.0 * math.pi / mesh.volume) ** (1.0 / 3.0)
    return _mesh(vertices * grow * np.asarray(size), faces)


def _octasphere(n: int) -> tuple[Array, Integers]:
    """Unit sphere: every face of an octahedron divided into n^2, even in angle along the edges."""
    points: list[Array] = []
    faces: list[list[int]] = []
    for sx, sy, sz in ((x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)):
        first = len(points)
        number: dict[tuple[int, int], int] = {}
        for i in range(n + 1):
            for j in range(n + 1 - i):
                k = n - i - j
                a = np.sin(0.5 * np.pi * np.array([i, j, k]) / n)
                number[i, j] = first + len(number)
                points.append(a / np.linalg.norm(a) * [sx, sy, sz])
        for i in range(n):
            for j in range(n - i):
                triangles = [(number[i, j], number[i + 1, j], number[i, j + 1])]
                if i + j < n - 1:
                    triangles.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
                faces += [list(t if sx * sy * sz > 0 else t[::-1]) for t in triangles]
    mesh = _mesh(np.array(points), faces)
    mesh.merge_vertices()
    return np.array(mesh.vertices), np.array(mesh.faces)


def cylinder(radius: float, half_length: float, resolution: int = RESOLUTION) -> Any:
    """A cylinder along z [m]: 4 faces a segment."""
    n = max(3, resolution)
    grow = math.sqrt(math.pi / (0.5 * n * math.sin(2.0 * math.pi / n)))
    return _revolved([(0.0, half_length), (grow * radius, half_length)], n)


def capsule(radius: float, half_length: float, resolution: int = RESOLUTION) -> Any:
    """A capsule along z, `half_length` to the centres of its caps [m]: 8 faces a segment, finer 4 more for every ring."""
    n = max(4, resolution)
    rings = max(2, round(n / 6.0))
    turns = 0.5 * np.pi * np.arange(rings) / rings

    def grown(grow: float) -> Any:
        r = grow * radius
        upper = [(r * math.sin(t), half_length + r * math.cos(t)) for t in turns]
        return _revolved([*upper, (r, half_length)], n)

    volume = math.pi * radius**2 * (2.0 * half_length + 4.0 / 3.0 * radius)
    grow = 1.0
    for _ in range(60):  # the volume is a grow^2 + b grow^3: Newton with the round one's slope
        slope = math.pi * radius**2 * (4.0 * half_length * grow + 4.0 * radius * grow**2)
        step = (volume - float(grown(grow).volume)) / slope
        grow += step
        if abs(step) < 1e-15:
            break
    return grown(grow)


def _revolved(profile: Sequence[tuple[float, float]], segments: int) -> Any:
    """Body of revolution, the same above and below: (radius, height) from the apex to the widest ring.

    Neighbouring quadrangles are divided along opposite diagonals, so that planes through the axis and a vertex
    mirror the mesh.
    """
    turn = 2.0 * np.pi * np.arange(segments) / segments
    rim = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(segments)])
    both = [*profile[1:], *((r, -z) for r, z in reversed(profile[1:]) if z > 0.0)]
    rings = [rim * r + [0.0, 0.0, z] for r, z in both]
    apexes = np.array([[0.0, 0.0, profile[0][1]], [0.0, 0.0, -profile[0][1]]])
    here = np.arange(segments)
    after = np.roll(here, -1)
    top, last = np.full(segments, len(both) * segments), (len(both) - 1) * segments
    faces = [
        np.column_stack([top, here, after]),
        np.column_stack([top + 1, last + after, last + here]),
    ]
    even = (here % 2 == 0)[:, None]
    for k in range(len(both) - 1):
        a, b = k * segments + here, k * segments + after
        c, d = a + segments, b + segments
        odd = even if 2 * k >= len(both) - 1 else ~even  # mirrored below
        faces += [
            np.where(odd, np.column_stack([a, c, d]), np.column_stack([a, c, b])),
            np.where(odd, np.column_stack([a, d, b]), np.column_stack([b, c, d])),
        ]
    return _mesh(np.vstack([*rings, apexes]), np.vstack(faces))


def _mesh(vertices: Any, faces: Any) -> Any:
    import trimesh  # half a second that a command's help does not need

    return trimesh.Trimesh(vertices, faces, process=False)
