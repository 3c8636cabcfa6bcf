"""The wetted hull of a body at rest as flat panels, and its hydrostatics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mjskip._typing import Array
from mjskip.errors import MeshError
from mjskip.hydro._coupling_tables import PlaneWaves, plane_waves
from mjskip.hydro._panel_kernels import influence

PANELS = 160
"""Panels that a hull is refined to, at least."""
MAX_PANELS = 1200
"""A finer hull is first made coarser."""
IMAGES = 4
"""Images in the bottom on each side; their sum alternates and falls with the third power."""

SHARP, FINEST, GRADING = math.radians(30.0), 0.2, 1.0
"""Angle from which an edge is sharp [rad], length of panels there as a share of others, and its growth with distance."""

LID_EDGE = 0.7
"""Damping of the water inside a hull is full from this share of the largest distance to the waterline on."""

LID_RATE = 0.5
"""Damping of the water inside a hull, as a share of sqrt(g / width) [rad]."""

CORNER_POINTS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
"""Three points of a triangle that integrate quadratics exactly (equal weights)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WettedHull:
    """Panels of one body below still water, in its hydrodynamic frame.

    The frame is level and turns with the body's heading only; its origin lies at z = 0 above or below the
    centre of mass.

    Attributes:
        triangles: corners (n, 3, 3) [m], counter-clockwise seen from the water.
        height: of the centre of mass above still water [m].
        centre: x and y of the centre of mass (2,) [m]; the origin unless several bodies share a frame.
    """

    triangles: Array
    height: float
    centre: Array = field(default_factory=lambda: np.zeros(2))

    @cached_property
    def centres(self) -> Array:
        """Centroids (n, 3) [m]."""
        return np.asarray(self.triangles.mean(axis=1))

    @cached_property
    def area_vectors(self) -> Array:
        """Outward normal times area (n, 3) [m^2]."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return np.asarray(0.5 * np.cross(b - a, c - a))

    @cached_property
    def areas(self) -> Array:
        """(n,) [m^2]."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def normals(self) -> Array:
        """Unit normals into the water (n, 3)."""
        return np.asarray(self.area_vectors / self.areas[:, None])

    @cached_property
    def points(self) -> Array:
        """Three points of every panel that integrate quadratics exactly (3, n, 3) [m]."""
        return np.asarray(np.einsum("pc,ncx->pnx", CORNER_POINTS, self.triangles))

    @cached_property
    def motions(self) -> Array:
        """Normal speed of every panel by unit surge, sway, heave, roll, pitch, yaw (n, 6).

        Rotations are about the centre of mass.
        """
        arm = self.centres - [*self.centre, self.height]
        return np.hstack([self.normals, np.cross(arm, self.normals)])

    @cached_property
    def volume(self) -> float:
        """Displaced volume [m^3]."""
        return float(np.sum(self.area_vectors[:, 2] * self.centres[:, 2]))

    @cached_property
    def radius(self) -> float:
        """Largest horizontal distance of a wetted point from the centre of mass [m]."""
        return float(np.linalg.norm(self.triangles[..., :2] - self.centre, axis=-1).max())

    @cached_property
    def panel_size(self) -> float:
        """Mean side of a panel: of the square of twice its area [m]."""
        return math.sqrt(2.0 * float(self.areas.mean()))

    def moved(self, by: Array) -> WettedHull:
        """The same elsewhere, by (2,) [m]."""
        return WettedHull(
            triangles=self.triangles + np.array([*by, 0.0]),
            height=self.height,
            centre=self.centre + by,
        )

    def moments(self) -> tuple[float, Array, Array]:
        """Waterplane area [m^2], its first (2,) [m^3] and second (2, 2) [m^4] moments about the centre."""
        down = -self.area_vectors[:, 2] / 3.0
        xy = self.points[..., :2] - self.centre
        return (
            float(3.0 * down.sum()),
            np.asarray(np.einsum("n,pnx->x", down, xy)),
            np.asarray(np.einsum("n,pnx,pny->xy", down, xy, xy)),
        )

    def buoyancy_centre(self) -> Array:
        """Centroid of the displaced water (3,) [m]."""
        weighted = np.einsum("nx,pnx,pnx->x", self.area_vectors / 3.0, self.points, self.points)
        return np.asarray(0.5 * weighted / self.volume)

    def lid(self) -> tuple[Array, Array]:
        """Points (m, 2) [m] of the plane z = 0 inside the hull, and their areas (m,) [m^2].

        The panels seen from above; areas are reduced towards the waterline, to 0 there.
        """
        ends = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=2)
        afloat = np.abs(ends[..., 2]).max(axis=2) < 1e-6 * self.radius
        if not afloat.any():
            return np.zeros((0, 2)), np.zeros(0)
        start, end = np.moveaxis(ends[afloat][..., :2], 1, 0)
        xy, area = self.centres[:, :2], -self.area_vectors[:, 2]
        along = end - start
        to = xy[:, None] - start
        share = np.einsum("pex,ex->pe", to, along) / np.einsum("ex,ex->e", along, along)
        away = np.linalg.norm(to - np.clip(share, 0.0, 1.0)[..., None] * along, axis=2).min(axis=1)
        above = (start[:, 1] > xy[:, None, 1]) != (end[:, 1] > xy[:, None, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = start[:, 0] + along[:, 0] * (xy[:, None, 1] - start[:, 1]) / along[:, 1]
        inside = (above & (xy[:, None, 0] < cross)).sum(axis=1) % 2 == 1
        if not inside.any():
            return np.zeros((0, 2)), np.zeros(0)
        area = area * np.minimum(away / (LID_EDGE * away[inside].max()), 1.0) ** 2
        kept = inside & (np.abs(area) > 1e-2 * np.abs(area).max())
        return xy[kept], area[kept]

    def stiffness(self, *, density: float, gravity: float, mass: float) -> Array:
        """Restoring matrix (6, 6) of hydrostatics and weight about the centre of mass [N/m, N, N m].

            C_33 = rho g S, C_34 = rho g S_y, C_35 = -rho g S_x,
            C_44 = rho g S_yy + rho g V z_B - m g z_G, C_45 = -rho g S_xy, C_55 = rho g S_xx + ...

        with moments about the centre of mass (Newman, Marine Hydrodynamics, 1977, section 6.16).
        """
        area, first, second = self.moments()
        weight = density * gravity
        restoring = np.zeros((6, 6))
        restoring[2, 2] = weight * area
        restoring[2, 3] = restoring[3, 2] = weight * first[1]
        restoring[2, 4] = restoring[4, 2] = -weight * first[0]
        upright = weight * self.volume * self.buoyancy_centre()[2] - mass * gravity * self.height
        restoring[3, 3] = weight * second[1, 1] + upright
        restoring[4, 4] = weight * second[0, 0] + upright
        restoring[3, 4] = restoring[4, 3] = -weight * second[0, 1]
        return restoring


def wetted_hull(
    triangles: Array,
    *,
    height: float,
    panels: int = PANELS,
    most: int = MAX_PANELS,
    graded: bool = False,
) -> WettedHull:
    """Cut a closed surface at z = 0 and refine what is below to panels of similar size.

    Args:
        triangles: corners (n, 3, 3) of the body at rest, hydrodynamic frame [m].
        height: of its centre of mass above still water [m].
        panels: refine until there are about as many.
        most: a finer surface is made coarser, by merging corners that lie close together.
        graded: finer towards sharp edges, where sources grow without bound.

    Raises:
        MeshError: nothing of the surface is below the water.
    """
    below = below_water(np.asarray(triangles, dtype=np.float64))
    if len(below) == 0:
        raise MeshError("no part of the hull is below still water: a floating body needs a draft")
    hull = WettedHull(triangles=below, height=height)
    size = 2.4 * float(np.sqrt(hull.areas.sum() / panels))
    if len(below) > most:
        below = _coarser(below, 0.2 * size, most)
    edges = sharp_edges(below) if graded else np.zeros((0, 2, 3))
    while len(fine := refined(below, size, edges)) > most and size < np.inf:
        size = 1.2 * size if len(below) < 0.8 * most else np.inf
    return WettedHull(triangles=fine, height=height)


def below_water(triangles: Array) -> Array:
    """What is below z = 0, as triangles (n, 3, 3); slivers without area are left out."""
    found = []
    extent = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    whole = (triangles[..., 2] <= 0.0).all(axis=1) & (triangles[..., 2] < 0.0).any(axis=1)
    cut = (triangles[..., 2] < 0.0).any(axis=1) & ~whole
    for corners in triangles[cut]:
        polygon = []
        for k in range(3):
            a, b = corners[k], corners[(k + 1) % 3]
            if a[2] <= 0.0:
                polygon.append(a)
            if a[2] * b[2] < 0.0:
                cut = a + a[2] / (a[2] - b[2]) * (b - a)
                polygon.append(np.array([cut[0], cut[1], 0.0]))
        found += [[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, len(polygon) - 1)]
    wet = np.concatenate([triangles[whole], np.array(found).reshape(-1, 3, 3)])
    area = np.linalg.norm(np.cross(wet[:, 1] - wet[:, 0], wet[:, 2] - wet[:, 0]), axis=1)
    return np.asarray(wet[area > 1e-9 * extent**2])


def sharp_edges(triangles: Array) -> Array:
    """Edges (e, 2, 3) where two triangles meet at more than SHARP."""
    points = triangles.reshape(-1, 3)
    extent = float(np.ptp(points, axis=0).max())
    _, corner = np.unique(np.round(points / (1e-7 * extent)), axis=0, return_inverse=True)
    index = corner.reshape(-1, 3)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    met: dict[tuple[int, int], tuple[int, int]] = {}
    found = []
    for n, face in enumerate(index.tolist()):
        for k in range(3):
            a, b = face[k], face[(k + 1) % 3]
            other = met.setdefault((min(a, b), max(a, b)), (n, k))
            if other[0] != n and normals[n] @ normals[other[0]] < math.cos(SHARP):
                found.append(triangles[n][[k, (k + 1) % 3]])
    return np.array(found).reshape(-1, 2, 3)


def refined(triangles: Array, size: float, edges: Array | None = None) -> Array:
    """Halve the longest edge of every triangle until none is longer than `size`.

    Near `edges` (e, 2, 3) the limit falls, to FINEST of it there.
    """
    done = []
    while len(triangles):
        lengths = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        limit = np.full(len(triangles), size)
        if edges is not None and len(edges) and size < np.inf:
            away = _distance(triangles.mean(axis=1), edges)
            limit = np.minimum(limit, FINEST * size + GRADING * away)
        short = lengths.max(axis=1) <= limit
        done.append(triangles[short])
        triangles, lengths = triangles[~short], lengths[~short]
        turn = (np.argmax(lengths, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[..., None], axis=1), 1, 0)
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(done)


def _distance(points: Array, edges: Array) -> Array:
    """Of points (n, 3) from the nearest of some edges (e, 2, 3) (n,)."""
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    to = points[:, None] - start
    share = np.einsum("nex,ex->ne", to, along) / np.einsum("ex,ex->e", along, along)
    return np.asarray(
        np.linalg.norm(to - np.clip(share, 0.0, 1.0)[..., None] * along, axis=2).min(axis=1)
    )


def _coarser(triangles: Array, cell: float, most: int) -> Array:
    """Merge corners that share a cell of a grid, growing until at most `most` triangles are left.

    Corners at the waterline stay there. The displaced volume is kept by moving the merged corners apart.
    """
    least = 1e-9 * cell
    while True:
        points = triangles.reshape(-1, 3)
        keys = np.round(points / cell).astype(np.int64)
        keys[points[:, 2] > -least, 2] = 1 << 30
        _, group = np.unique(keys, axis=0, return_inverse=True)
        group = group.ravel()
        # one vote for each distinct corner, or a fan's hub would draw its cell to itself
        _, first = np.unique(np.round(points / least), axis=0, return_index=True)
        votes = np.bincount(group[first], minlength=group.max() + 1)
        sums = [np.bincount(group[first], points[first, k], group.max() + 1) for k in range(3)]
        merged = (np.stack(sums, axis=1) / votes[:, None])[group].reshape(-1, 3, 3)
        index = group.reshape(-1, 3)
        distinct = (index != np.roll(index, -1, axis=1)).all(axis=1)
        merged = merged[distinct]
        if len(merged) <= most:
            old, new = (
                WettedHull(triangles=part, height=0.0).volume for part in (triangles, merged)
            )
            if new > 0.0:
                merged = merged * (old / new) ** (1.0 / 3.0)
            return np.asarray(merged)
        cell *= 1.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Influence:
    """Panels of one or more hulls and the potentials of their sources (see `_panel_kernels`).

    Attributes:
        hulls: the bodies.
        potential: P (n, n), potential at panel i by unit strength on panel j.
        velocity: M (n, n), its normal derivative there.
        depth: of the water [m]; infinite by default.
    """

    hulls: tuple[WettedHull, ...]
    potential: Array
    velocity: Array
    depth: float

    def plane_waves(self, k: float, directions: Array) -> PlaneWaves:
        """Plane waves of wavenumber k [1/m] in these directions (m,) [rad] at the panels."""
        return plane_waves(
            self.points, self.normals, self.areas, k=k, directions=directions, depth=self.depth
        )

    @cached_property
    def motions(self) -> Array:
        """Normal speeds of all panels by unit motions of all bodies (n, 6 x bodies)."""
        whole = np.zeros((len(self.potential), 6 * len(self.hulls)))
        row = 0
        for k, hull in enumerate(self.hulls):
            whole[row : row + len(hull.areas), 6 * k : 6 * k + 6] = hull.motions
            row += len(hull.areas)
        return whole

    @cached_property
    def areas(self) -> Array:
        """(n,) [m^2]."""
        return np.concatenate([hull.areas for hull in self.hulls])

    @cached_property
    def normals(self) -> Array:
        """(n, 3)."""
        return np.concatenate([hull.normals for hull in self.hulls])

    @cached_property
    def points(self) -> Array:
        """Three points of every panel (3, n, 3) [m]."""
        return np.concatenate([hull.points for hull in self.hulls], axis=1)

    @cached_property
    def loads(self) -> Array:
        """Generalised force of a unit pressure that pushes along the outward normal (6 x bodies, n)."""
        return np.asarray((self.motions * self.areas[:, None]).T)

    def added_mass(self, density: float) -> Array:
        """Added mass at infinite frequency, -rho (n A)' P M^-1 n, symmetric (6 x bodies, 6 x bodies)."""
        strengths = np.linalg.solve(self.velocity, self.motions)
        found = -density * self.loads @ self.potential @ strengths
        return np.asarray(0.5 * (found + found.T))


def hull_influence(*hulls: WettedHull, depth: float = np.inf) -> Influence:
    """Potentials of the sources on hulls that are all given in one frame."""
    triangles = np.concatenate([hull.triangles for hull in hulls])
    body = np.repeat(np.arange(len(hulls)), [len(hull.areas) for hull in hulls])
    edges = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    count = len(triangles)
    potential, velocity = np.empty((count, count)), np.empty((count, count))
    influence(
        triangles,
        np.concatenate([hull.normals for hull in hulls]),
        np.concatenate([hull.centres for hull in hulls]),
        np.concatenate([hull.areas for hull in hulls]),
        edges.max(axis=1),
        body,
        depth if np.isfinite(depth) else 0.0,
        IMAGES,
        potential,
        velocity,
    )
    return Influence(hulls=hulls, potential=potential, velocity=velocity, depth=depth)


def lid_rate(hull: WettedHull, *, gravity: float) -> float:
    """Rate at which the water inside a hull is damped [1/s]."""
    area, _, _ = hull.moments()
    return LID_RATE * math.sqrt(gravity / math.sqrt(max(area, 1e-12) / math.pi))


def hull_width(hull: WettedHull) -> float:
    """Radius of the disc with the hull's waterplane, or with its panels seen from above [m]."""
    seen = 0.5 * float(np.abs(hull.area_vectors[:, 2]).sum())
    return math.sqrt(max(hull.moments()[0], seen) / math.pi)
