"""Floating bodies packed for the kernels that run inside a simulation: see `_afloat_kernels`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped, unused-ignore]

from mjskip._typing import Array, Integers
from mjskip.hydro import _afloat_kernels as kernels
from mjskip.hydro.panels import WettedHull, refined, wetted_hull
from mjskip.hydro.radiation import (
    HEADINGS,
    RadiationTable,
    body_modes,
    known_waves,
    radiation_table,
)
from mjskip.hydro.seas import Sea
from mjskip.hydro.surface_modes import SurfaceModes

SEA_ERROR = 0.01
"""Error allowed to the sea's pressure around a body, of its root mean square."""
FACES = 240
"""Triangles of a hull, dry ones included, on which still water and the sea press."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RestPose:
    """How a body floats: what its hull is prepared for.

    Attributes:
        rotation: body axes to its level frame (3, 3), heading left out.
        height: of the centre of mass above still water [m].
    """

    rotation: Array
    height: float

    @classmethod
    def of(cls, rotation: Array, height: float) -> RestPose:
        """Of any orientation, body to world (3, 3): its heading is taken out."""
        yaw = math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
        c, s = math.cos(yaw), math.sin(yaw)
        back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return cls(rotation=back @ rotation, height=height)

    def moved(self, height: float, roll: float, pitch: float) -> RestPose:
        """Another pose: higher [m], rolled and pitched [rad] in the level frame."""
        from scipy.spatial.transform import Rotation  # takes as long to import as MuJoCo

        turn = Rotation.from_rotvec([roll, pitch, 0.0]).as_matrix()
        return RestPose.of(turn @ self.rotation, self.height + height)


def hull_at_rest(triangles: Array, rest: RestPose) -> WettedHull:
    """The wetted hull of a surface (n, 3, 3) in body axes about its centre of mass."""
    placed = triangles @ rest.rotation.T + [0.0, 0.0, rest.height]
    return wetted_hull(placed, height=rest.height)


@dataclass(frozen=True, kw_only=True, eq=False)
class Afloat:
    """A block of doubles and the whole numbers beside it."""

    block: Array
    words: Integers


def pack_surface(modes: SurfaceModes, sea: Sea, *, bodies: int, timestep: float) -> Afloat:
    """The surface with the waves of a sea."""
    k = modes.wavenumbers[modes.ring]
    omega = modes.frequencies[modes.ring]
    turn = np.exp(-1j * omega * timestep)
    waves = [
        k.real, k.imag, np.cos(modes.direction), np.sin(modes.direction),
        turn.real, turn.imag, omega.real, omega.imag,
    ]  # fmt: skip
    known = [
        sea.wavenumber, sea.omega, np.cos(sea.direction), np.sin(sea.direction),
        sea.amplitude, sea.phase,
    ]  # fmt: skip
    header = np.zeros(kernels.SURFACE)
    header[kernels.WAVES], header[kernels.RINGS] = modes.size, len(modes.angles)
    header[kernels.GRAVITY] = modes.gravity
    header[kernels.DEPTH] = modes.depth if math.isfinite(modes.depth) else 0.0
    header[kernels.KNOWN] = len(sea.omega)
    header[kernels.CURRENT_X], header[kernels.CURRENT_Y] = sea.current
    header[kernels.TIMESTEP], header[kernels.BODIES] = timestep, bodies
    header[kernels.REACH] = modes.reach
    header[kernels.AT_WAVES] = kernels.SURFACE
    header[kernels.AT_KNOWN] = kernels.SURFACE + kernels.WAVE_ROWS * modes.size
    return Afloat(
        block=np.concatenate([header, *waves, *known]),
        words=np.ascontiguousarray(modes.first, dtype=np.int64),
    )


def pack_body(table: RadiationTable, triangles: Array, rest: RestPose, sea: Sea) -> Afloat:
    """A hull with its tables against the surface and the sea's waves."""
    shortest = _typical_wavenumber(sea)
    vertices, faces = _mesh(triangles, shortest)
    lids, patterns = table.lid_force.shape[1], table.patterns.shape[1]
    turn_at, turns = table.turns
    seen = np.zeros(0)
    if len(sea.omega):
        known = known_waves(table, sea.wavenumber, sea.omega, sea.direction)
        both = np.concatenate([known.diffraction, known.flow], axis=2)
        seen = np.stack([both.real, both.imag], axis=2).ravel()
    parts = [
        turns, table.rows.ravel(), table.columns.ravel(), table.lid_force.ravel(), seen,
        vertices.ravel(), faces.ravel().astype(np.float64),
    ]  # fmt: skip
    starts = kernels.BODY + np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    header = np.zeros(kernels.BODY)
    header[kernels.ROWS], header[kernels.PATTERNS] = len(table.rows), patterns
    header[kernels.LIDS], header[kernels.HARMONICS] = lids, table.rows.shape[1]
    header[kernels.RINGS_OF], header[kernels.HEADINGS] = len(table.orders), HEADINGS
    places = (
        kernels.AT_TURNS, kernels.AT_ROWS, kernels.AT_COLUMNS, kernels.AT_LID, kernels.AT_SEEN,
        kernels.AT_VERTICES, kernels.AT_FACES,
    )  # fmt: skip
    for place, start in zip(places, starts[:-1], strict=True):
        header[place] = start
    header[kernels.ADDED : kernels.ADDED + 36] = table.added_mass.ravel()
    header[kernels.REST : kernels.REST + 9] = rest.rotation.ravel()
    header[kernels.DENSITY] = table.density
    placed = triangles @ rest.rotation.T
    header[kernels.REST_HEIGHT] = rest.height
    header[kernels.DRAFT] = max(-float(placed[..., 2].min()) - rest.height, 1e-9)
    header[kernels.LENGTH] = 2.0 * table.hull.radius
    header[kernels.VERTICES], header[kernels.FACES] = len(vertices), len(faces)
    half = 0.5 * np.ptp((triangles @ rest.rotation.T).reshape(-1, 3), axis=0)
    header[kernels.NODES_X], header[kernels.NODES_Y] = (_nodes(sea, float(x)) for x in half[:2])
    return Afloat(
        block=np.concatenate([header, *parts]),
        words=np.ascontiguousarray(
            np.concatenate([table.orders, table.starts[:-1], turn_at]), dtype=np.int64
        ),
    )


def _typical_wavenumber(sea: Sea) -> float:
    """Twice the root mean square of the wavenumbers, by energy [1/m]; 0 without waves."""
    energy = sea.amplitude**2
    if not energy.any():
        return 0.0
    return 2.0 * math.sqrt(float(np.average(sea.wavenumber**2, weights=energy)))


def _nodes(sea: Sea, half: float) -> int:
    """Nodes of polynomials that follow the sea over 2 x `half` [m] within SEA_ERROR, by Bessel's bound."""
    from scipy.special import jv

    for count in range(4, kernels.MAX_NODES):
        missed = sea.amplitude * 2.0 * np.abs(jv(count, sea.wavenumber * half))
        if np.sum(missed**2) <= SEA_ERROR**2 * np.sum(sea.amplitude**2):
            return count
    return kernels.MAX_NODES


def _mesh(triangles: Array, shortest: float) -> tuple[Array, Integers]:
    """Vertices and faces of a surface, fine enough for a pressure that is linear on each triangle."""
    edges = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = 0.5 * float(np.linalg.norm(edges, axis=1).sum())
    size = math.inf
    if shortest > 0.0:  # still water's pressure is linear itself
        size = max(2.4 * math.sqrt(area / FACES), 0.25 / shortest)
    fine = refined(triangles, size)
    extent = float(np.ptp(fine.reshape(-1, 3), axis=0).max())
    _, first, index = np.unique(
        np.round(fine.reshape(-1, 3) / (1e-9 * extent)),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    return fine.reshape(-1, 3)[first], index.reshape(-1, 3)


def prepare(
    surfaces: Sequence[Array],
    rests: Sequence[RestPose],
    places: Array,
    sea: Sea,
    *,
    density: float,
    timestep: float,
    most_waves: int,
    most_readings: int,
    modes: SurfaceModes | None = None,
) -> tuple[SurfaceModes, Afloat, list[Afloat], list[RadiationTable]]:
    """Everything for bodies that share a surface.

    Args:
        surfaces: triangles of each (n, 3, 3), body axes about its centre of mass [m].
        rests: how each floats.
        places: x and y of their centres of mass (bodies, 2) [m].
        sea: waves, current, depth and gravity.
        density: of the water [kg/m^3].
        timestep: of the simulation [s].
        most_waves: plane waves, at most; the shortest are left out, and follow the hulls at once.
        most_readings: patterns of flow and of the lid of one body, at most; the weakest are left out.
        modes: those of the bodies in another pose, to go on with; made if None.
    """
    with threadpool_limits(
        limits=1, user_api="blas"
    ):  # small matrices: threads that wait cost more
        hulls = [hull_at_rest(t, rest) for t, rest in zip(surfaces, rests, strict=True)]
        away = np.linalg.norm(places - places.mean(axis=0), axis=1)
        reach = max(hull.radius + a for hull, a in zip(hulls, away, strict=True))
        if len(hulls) > 1:
            reach *= DRIFT_ALLOWANCE
        modes = modes or body_modes(
            tuple(hulls), reach=reach, depth=sea.depth, gravity=sea.gravity, most=most_waves
        )
        tables = [
            radiation_table(hull, modes, density=density, most=most_readings // 2) for hull in hulls
        ]
        bodies = [
            pack_body(table, t, rest, sea)
            for table, t, rest in zip(tables, surfaces, rests, strict=True)
        ]
        surface = pack_surface(modes, sea, bodies=len(bodies), timestep=timestep)
    return modes, surface, bodies, tables


DRIFT_ALLOWANCE = 1.25
"""Several bodies may drift this much farther from their middle than they are at first."""
