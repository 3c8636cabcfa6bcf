"""A stone in its water as the block of doubles that the kernels know (`mjskip.hydro._block`)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.hydro import _block as layout
from mjskip.hydro.hull import Hull
from mjskip.hydro.laws import LAWS
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water


def pack(stone: Hull, water: Water, *, gravity: float = 9.81) -> Array:
    """The block of doubles that the kernels know a stone in its water by; gravity [m/s^2] for buoyancy."""
    law = LAWS[water.law]
    header = np.zeros(layout.HEADER)
    header[layout.RADIUS] = stone.radius
    header[layout.LOCAL_GATE] = water.gate == "local"
    header[layout.NORMAL_SQUARED] = water.density * law.normal_squared
    header[layout.SPEED_NORMAL] = water.density * law.speed_normal
    header[layout.SPEED_SQUARED] = water.density * law.speed_squared
    header[layout.FRICTION] = water.density * law.friction
    header[layout.CAVITY] = water.density * law.cavity
    header[layout.FORWARD] = law.forward
    header[layout.QUADRATURE] = water.quadrature
    header[layout.WEIGHT_DENSITY] = water.density * gravity if water.buoyancy else 0.0
    header[layout.SKIN_DENSITY] = water.density if water.skin_friction else 0.0
    header[layout.VISCOSITY] = water.viscosity
    header[layout.LENGTH] = 2.0 * np.sqrt(stone.disc_area / np.pi)
    header[layout.AIR_DENSITY] = water.air_density
    header[layout.DISC_AREA] = stone.disc_area
    header[layout.DISC_NORMAL : layout.DISC_NORMAL + 3] = stone.disc_normal
    header[layout.DISC_CENTRE : layout.DISC_CENTRE + 3] = stone.disc_centre
    if water.added_mass:
        if not isinstance(stone, Stone):
            raise ValueError(
                f"added_mass is {water.added_mass:g}, which needs a body that is free and its mass: throw a Stone by the reference "
                "engine or in a sweep, and leave it off in MuJoCo"
            )
        header[layout.ADDED_MASS] = water.added_mass * water.density
        header[layout.GRAVITY] = gravity
        header[layout.INVERSE_MASS] = 1.0 / stone.mass
        header[layout.INERTIA : layout.INERTIA + 9] = stone.inertia.ravel()
        header[layout.INVERSE_INERTIA : layout.INVERSE_INERTIA + 9] = np.linalg.inv(
            stone.inertia
        ).ravel()
    return block_of(header, stone.triangles)


def block_of(header: Array, triangles: Array) -> Array:
    """A block with this header (of any block) and these triangles (n, 3, 3), counter-clockwise from outside."""
    triangles = triangles[_by_place(triangles.mean(axis=1))]
    a, b, c = np.moveaxis(triangles, 1, 0)
    vectors = 0.5 * np.cross(b - a, c - a)
    areas = np.linalg.norm(vectors, axis=1)
    normals, centroids = vectors / areas[:, None], triangles.mean(axis=1)
    n = len(triangles)
    stride = n + (layout.WIDTH - n) % (2 * layout.WIDTH)  # odd: columns share no place in the cache
    header = header[: layout.HEADER].copy()
    header[layout.N_FACES], header[layout.STRIDE] = n, stride

    header[layout.MIDDLE : layout.MIDDLE + 6] = _box(triangles.reshape(-1, 3))

    volumes = np.linalg.det(triangles) / 6.0
    header[layout.VOLUME] = volumes.sum()
    centre = volumes @ triangles.sum(axis=1) / (4.0 * volumes.sum())
    header[layout.VOLUME_CENTRE : layout.VOLUME_CENTRE + 3] = centre

    columns = np.zeros((stride, layout.COLUMNS))
    columns[:n, : layout.AREA] = triangles.reshape(-1, 9)
    columns[n:, : layout.AREA] = np.tile(triangles[-1, 0], 3)
    columns[:n, layout.AREA] = areas
    faces = columns[:n, layout.FACES :]
    faces[:, layout.NORMAL : layout.CENTROID] = normals
    faces[:, layout.CENTROID : layout.ARM] = centroids
    faces[:, layout.ARM : layout.ARM + 3] = np.cross(centroids, normals)
    groups = np.zeros((-(-stride // layout.GROUP), layout.ABOUT_GROUP))
    for group, first in zip(
        groups, range(0, n, layout.GROUP), strict=False
    ):  # padding is in no group
        part = slice(first, first + layout.GROUP)
        group[layout.BOX : layout.LIFT] = _box(triangles[part].reshape(-1, 3))
        group[layout.LIFT :] = _lift(triangles[part], vectors[part])

    planes: list[Array] = []
    if header[layout.FORWARD]:
        planes, plane_of = _planes(triangles, vectors)
        sizes = [len(plane) for plane in planes]
        first = layout.HEADER + columns.size + groups.size
        places = first + np.cumsum([0, *sizes])
        header[layout.N_PLANES], header[layout.PLANES] = len(planes), first
        header[layout.MAX_EDGES] = (max(sizes) - layout.OUTLINE) // layout.EDGE
        columns[:n, layout.PLANE] = places[plane_of]
    return _aligned(np.concatenate([header, columns.T.ravel(), groups.ravel(), *planes]))


def _aligned(block: Array) -> Array:
    """A copy whose columns begin where lines of the cache do: vectors across two of them take twice as long."""
    room = np.empty(block.size + layout.WIDTH)
    first = -room.ctypes.data // room.itemsize % layout.WIDTH
    found = room[first : first + block.size]
    found[:] = block
    return found


def triangles_of(block: Array) -> Array:
    """The triangles (n, 3, 3) of a block, in its order."""
    columns = block[layout.HEADER :][: layout.AREA * int(block[layout.STRIDE])]
    return columns.reshape(layout.AREA, -1).T[: int(block[layout.N_FACES])].reshape(-1, 3, 3)


def planes_of(block: Array) -> list[Array]:
    """The plane faces of a block of a law that acts `forward`: normal (3), distance from the centre, number of edges
    and the ends (6) of every edge of the outline, of each."""
    found, at = [], int(block[layout.PLANES])
    for _ in range(int(block[layout.N_PLANES])):
        size = layout.OUTLINE + layout.EDGE * int(block[at + layout.EDGES])
        found.append(block[at : at + size])
        at += size
    return found


def _by_place(centroids: Array) -> npt.NDArray[np.intp]:
    """An order (n,) in which the faces of a group lie near each other: halved across the longest side."""
    done: list[npt.NDArray[np.intp]] = []
    waiting = [np.arange(len(centroids))]
    while waiting:
        faces = waiting.pop()
        groups = -(-len(faces) // layout.GROUP)
        if groups == 1:
            done.append(faces)
            continue
        axis = np.argmax(np.ptp(centroids[faces], axis=0))
        faces = faces[np.argsort(centroids[faces, axis], kind="stable")]
        half = groups // 2 * layout.GROUP
        waiting += [faces[half:], faces[:half]]
    return np.concatenate(done)


def _box(points: Array) -> Array:
    """Middle and half the sides (6,) of a box about points (n, 3), with a margin for rounding."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.concatenate([0.5 * (low + high), 0.5 * (1.0 + 1e-9) * (high - low)])


def _lift(triangles: Array, vectors: Array) -> Array:
    """Force and torque (24,) per rho g on triangles quite under water, by height z and upward vertical u.

        F = sum S (z + u.c) n,  tau = sum S (z c + Q u) x n

    c centroid, Q mean of r r^T over the triangle; each component's four numbers go with z, u_x, u_y, u_z.
    """
    total = triangles.sum(axis=1)
    second = np.einsum("ni,nj->nij", total, total) + np.einsum("nki,nkj->nij", triangles, triangles)
    lifts = np.empty((6, 4))
    lifts[:3, 0] = vectors.sum(axis=0)
    lifts[:3, 1:] = vectors.T @ total / 3.0
    lifts[3:, 0] = np.cross(total / 3.0, vectors).sum(axis=0)
    lifts[3:, 1:] = np.cross(second / 12.0, vectors[:, :, None], axis=1).sum(axis=0)
    return lifts.ravel()


SAME_PLANE = 1e-3
"""Angle between two triangles of one plane face at most [rad]: meshes of single precision have bent planes."""


def _planes(triangles: Array, vectors: Array) -> tuple[list[Array], npt.NDArray[np.intp]]:
    """Plane faces as the kernels know them, and the face of every triangle (n,).

    Triangles that share an edge and a plane are one face. Its outline are the edges whose reverse it lacks.
    """
    n = len(triangles)
    points = triangles.reshape(-1, 3)
    size = np.ptp(points, axis=0).max()
    _, corner = np.unique(np.round(points / (1e-9 * size)), axis=0, return_inverse=True)
    start = corner.reshape(n, 3)
    end = np.roll(start, -1, axis=1)
    triangle = np.repeat(np.arange(n), 3)
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    # neighbours: an edge and its reverse
    most = np.int64(corner.max() + 1)
    edge, reverse = (start * most + end).ravel(), (end * most + start).ravel()
    order = np.argsort(edge, kind="stable")
    found = order[np.minimum(np.searchsorted(edge[order], reverse), 3 * n - 1)]
    shared = edge[found] == reverse
    one, other = triangle[shared], triangle[found[shared]]
    flat = np.linalg.norm(normals[one] - normals[other], axis=1) < SAME_PLANE
    from scipy.sparse import coo_array  # scipy takes longer to import than MuJoCo
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(flat.sum()), (one[flat], other[flat])), shape=(n, n))
    count, plane_of = connected_components(graph, directed=False)

    # edges whose reverse is not of the same face
    of_edge = plane_of[triangle].astype(np.int64)
    outer = ~np.isin(of_edge * most**2 + edge, of_edge * most**2 + reverse)
    place = np.flatnonzero(outer)
    place = place[np.argsort(of_edge[place], kind="stable")]
    ends = np.hstack([points[place], triangles[:, [1, 2, 0]].reshape(-1, 3)[place]])
    parts = np.split(ends, np.searchsorted(of_edge[place], np.arange(1, count)))
    whole = np.stack([np.bincount(plane_of, vectors[:, k], count) for k in range(3)], axis=1)
    whole = whole / np.linalg.norm(whole, axis=1, keepdims=True)
    heights = np.einsum("ni,ni->n", whole[plane_of], triangles.mean(axis=1))
    weights = np.linalg.norm(vectors, axis=1)
    heights = np.bincount(plane_of, weights * heights, count) / np.bincount(plane_of, weights)
    planes = [
        np.array([*normal, height, len(part), *part.ravel()])
        for normal, height, part in zip(whole, heights, parts, strict=True)
    ]
    return planes, plane_of.astype(np.intp)
