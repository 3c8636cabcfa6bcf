"""Waves that a floating body makes and meets, in time: tables of its hull against the surface's modes.

    zeta_t = G phi + L V - R phi,   phi_t = -g zeta - nu X phi
    F = -A dV/dt - rho g L' zeta + lid,   L = C M^-1 n,  R = C M^-1 D   (`response` has C, D, M, X)

L is what the hull's motion gives to the surface, R phi what the hull at rest throws back. R is of low rank: the
flow of waves of interest on a hull has some tens of independent patterns. The term with nu damps the water
inside the hull, which is not there: without it that water sloshes and resonates (irregular frequencies).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from mjskip.hydro import _radiation_kernels as kernels
from mjskip.hydro._coupling_tables import PlaneWaves, plane_waves
from mjskip.hydro.panels import Influence, WettedHull, hull_influence
from mjskip.hydro.response import hull_width, lid_rate
from mjskip.hydro.surface_modes import SurfaceModes, ring_directions, surface_modes

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

PATTERNS = 3e-3
"""Patterns of flow weaker than this share of the strongest are left out."""
SPARE_ORDERS = 2


def body_modes(
    hulls: tuple[WettedHull, ...],
    *,
    reach: float | None = None,
    depth: float = math.inf,
    gravity: float = 9.81,
) -> SurfaceModes:
    """Modes for hulls that stay within `reach` of the origin [m]; by default the largest hull's radius."""
    cutoff = max(shortest_wave(hull) for hull in hulls)
    return surface_modes(
        shortest=2.0 * math.pi / cutoff,
        reach=reach or max(hull.radius for hull in hulls),
        depth=depth,
        gravity=gravity,
    )


def shortest_wave(hull: WettedHull) -> float:
    """Largest wavenumber that matters to a hull [1/m]: 6 over its width, more if it is shallow."""
    width = hull_width(hull)
    draft = hull.volume / (math.pi * width**2)
    return max(6.0, min(1.6 * width / draft, 12.0)) / width


@dataclass(frozen=True, kw_only=True, eq=False)
class RadiationTable:
    """A hull against modes, in its hydrodynamic frame (see `WettedHull`).

    Attributes:
        hull: the wetted hull.
        modes: of the surface.
        orders: highest harmonic M of every ring (rings,).
        rows: what the body reads from its harmonics: wave force (6), flow patterns (r), lid (l); each a
            row of real numbers (6 + r + l, harmonics).
        columns: what unit motion (6), patterns (r) and lid (l) give to the harmonics (6 + r + l, harmonics).
        lid_force: force by unit lid readings (6, l).
        patterns: source strengths of the patterns on the panels (n, r).
        added_mass: at infinite frequency (6, 6).
        density: of the water [kg/m^3].
    """

    hull: WettedHull
    modes: SurfaceModes
    orders: npt.NDArray[np.int64]
    rows: Array
    columns: Array
    lid_force: Array
    patterns: Array
    added_mass: Array
    density: float
    influence: Influence

    @cached_property
    def starts(self) -> npt.NDArray[np.int64]:
        """Where every ring's harmonics start, and their number at the end (rings + 1,)."""
        return np.concatenate([[0], np.cumsum(2 * (2 * self.orders + 1))])

    @cached_property
    def turns(self) -> tuple[npt.NDArray[np.int64], Array]:
        """Starts (rings,) and cosines and sines of all directions, see `gather`."""
        blocks = []
        for count, order in zip(self.modes.angles, self.orders, strict=True):
            angle = np.arange(order + 1)[:, None] * ring_directions(int(count))
            blocks.append(np.concatenate([np.cos(angle), np.sin(angle[1:])]).ravel())
        sizes = [len(block) for block in blocks]
        return np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64), np.concatenate(blocks)


def radiation_table(
    hull: WettedHull, modes: SurfaceModes, *, density: float = 1000.0
) -> RadiationTable:
    """Prepare a hull for the modes of a surface; some tenths of a second."""
    influence = hull_influence(hull, depth=modes.depth)
    gravity = modes.gravity
    inverse = np.linalg.inv(influence.velocity)
    reflected = influence.loads @ influence.potential @ inverse
    lid_points, lid_areas = hull.lid()
    rate = lid_rate(hull, gravity=gravity)
    orders = np.minimum(
        np.ceil(np.abs(modes.wavenumbers) * hull.radius).astype(np.int64) + SPARE_ORDERS,
        modes.angles // 2 - 1,
    )
    waves: list[PlaneWaves] = []
    insides: list[Complex] = []
    for k, order in zip(modes.wavenumbers, orders, strict=True):
        angles = ring_directions(2 * int(order) + 4)
        waves.append(
            plane_waves(
                hull.points,
                hull.normals,
                hull.areas,
                k=complex(k),
                directions=angles,
                depth=modes.depth,
            )
        )
        insides.append(np.exp(1j * k * (lid_points @ np.stack([np.cos(angles), np.sin(angles)]))))
    omega, weight = modes.frequencies, modes.weights
    to_phi = weight * gravity / omega
    patterns = _patterns(
        [inverse @ wave.slope for wave in waves],
        [
            math.sqrt(abs(w) * n / m)
            for w, n, m in zip(weight, modes.angles, (len(x.T) for x in insides), strict=True)
        ],
        hull.areas,
    )
    lids = _patterns([x for x in insides], [1.0] * len(insides), np.abs(lid_areas))
    project = np.linalg.pinv(patterns)
    rows, columns = [], []
    moved = inverse @ influence.motions
    for j, (wave, inside) in enumerate(zip(waves, insides, strict=True)):
        felt = density * (influence.loads @ wave.value - reflected @ wave.slope)
        flow = project @ (inverse @ wave.slope)
        lid = np.linalg.pinv(lids) @ inside if len(lid_points) else np.zeros((0, inside.shape[1]))
        rows.append(
            np.vstack(
                [
                    _real_rows(-gravity * weight[j] * felt, int(orders[j]), imaginary=False),
                    _real_rows(to_phi[j] * flow, int(orders[j]), imaginary=True),
                    _real_rows(to_phi[j] * lid, int(orders[j]), imaginary=True),
                ]
            )
        )
        pressed = -rate * (lid_areas[:, None] / inside).T @ lids
        columns.append(
            np.vstack(
                [
                    _real_columns((wave.source @ moved).T, int(orders[j])),
                    _real_columns(-(wave.source @ patterns).T, int(orders[j])),
                    _real_columns(1j * omega[j] / gravity * pressed.T, int(orders[j])),
                ]
            )
        )
    force = np.zeros((6, lids.shape[1]))
    for j, (wave, inside) in enumerate(zip(waves, insides, strict=True)):
        felt = density * (influence.loads @ wave.value - reflected @ wave.slope)
        pressed = -rate * (lid_areas[:, None] / inside).T @ lids
        share = weight[j] * modes.angles[j] / inside.shape[1]
        force += (share * felt @ pressed).real
    return RadiationTable(
        hull=hull,
        modes=modes,
        orders=orders,
        rows=np.ascontiguousarray(np.hstack(rows)),
        columns=np.ascontiguousarray(np.hstack(columns)),
        lid_force=force,
        patterns=patterns,
        added_mass=influence.added_mass(density),
        density=density,
        influence=influence,
    )


def _patterns(parts: list[Complex], scales: list[float], areas: Array) -> Array:
    """Orthogonal real patterns (n, r) that span columns of `parts`, in the mean square over areas."""
    if len(areas) == 0:
        return np.zeros((0, 0))
    root = np.sqrt(areas)
    scaled = [scale * part for scale, part in zip(scales, parts, strict=True)]
    whole = root[:, None] * np.hstack([*(s.real for s in scaled), *(s.imag for s in scaled)])
    left, strength, _ = np.linalg.svd(whole, full_matrices=False)
    return np.asarray(left[:, strength > PATTERNS * strength[0]] / root[:, None])


def _harmonics(table: Complex, order: int) -> tuple[Complex, Complex]:
    """Cosine (rows, M + 1) and sine (rows, M) coefficients over equal directions (rows, n)."""
    count = table.shape[1]
    waves = np.fft.fft(table, axis=1) / count
    plus, minus = waves[:, 1 : order + 1], waves[:, -1 : -order - 1 : -1]
    return np.concatenate([waves[:, :1], plus + minus], axis=1), 1j * (plus - minus)


def _real_rows(table: Complex, order: int, *, imaginary: bool) -> Array:
    """Rows that give the real (or imaginary) part of sum_n c_n table(theta_n) from harmonics."""
    parts = np.concatenate(_harmonics(table, order), axis=1)
    pair = (parts.imag, parts.real) if imaginary else (parts.real, -parts.imag)
    return np.stack(pair, axis=2).reshape(len(table), -1)


def _real_columns(table: Complex, order: int) -> Array:
    """Harmonics, as real numbers, of a table (rows, n) over equal directions."""
    parts = np.concatenate(_harmonics(table, order), axis=1)
    return np.stack([parts.real, parts.imag], axis=2).reshape(len(table), -1)


class Surface:
    """The free surface with its floating bodies, stepped in time.

    Attributes:
        tables: one for every body.
        modes: of the surface.
        real: amplitudes of the plane waves (size,), and `imag`.
    """

    def __init__(self, tables: list[RadiationTable]) -> None:
        self.tables = tables
        self.modes = modes = tables[0].modes
        k = modes.wavenumbers[modes.ring]
        self._k = np.ascontiguousarray(k.real), np.ascontiguousarray(k.imag)
        self._toward = np.cos(modes.direction), np.sin(modes.direction)
        self.real, self.imag = np.zeros(modes.size), np.zeros(modes.size)
        self._placed = np.zeros((2, modes.size))
        self._added = np.zeros((2, modes.size))
        self._harmonics = [np.zeros(table.starts[-1]) for table in tables]
        self._readings = [np.zeros(len(table.rows)) for table in tables]

    @property
    def amplitudes(self) -> Complex:
        """Of the plane waves (size,)."""
        return np.asarray(self.real + 1j * self.imag)

    def force(self, body: int, x: float, y: float, yaw: float) -> Array:
        """Force and torque of the waves on a body, in its hydrodynamic frame (6,) [N, N m].

        Without the added mass; about the centre of mass.
        """
        table, readings = self.tables[body], self._readings[body]
        kernels.place_waves(
            self.real, self.imag, *self._k, *self._toward, x, y, 1.0, *self._placed
        )
        kernels.gather(
            *self._placed,
            self.modes.first,
            table.orders,
            table.starts,
            *table.turns,
            yaw,
            self._harmonics[body],
        )
        kernels.read_rows(table.rows, self._harmonics[body], readings)
        lid = table.lid_force.shape[1]
        return np.asarray(readings[:6] + table.lid_force @ readings[len(readings) - lid :])

    def push(
        self, body: int, x: float, y: float, yaw: float, velocity: Array, flow: Array | None = None
    ) -> None:
        """Let a body act on the surface over the coming step: its velocity (6,), and the flow of known waves.

        After `force`, whose readings say what the hull throws back.
        """
        table, amounts = self.tables[body], self._readings[body].copy()
        amounts[:6] = velocity
        if flow is not None:
            amounts[6 : 6 + len(flow)] += flow
        kernels.add_columns(table.columns, amounts, self._harmonics[body])
        kernels.scatter(
            self._harmonics[body],
            self.modes.first,
            table.orders,
            table.starts,
            *table.turns,
            yaw,
            *self._placed,
        )
        kernels.place_waves(
            *self._placed, *self._k, *self._toward, x, y, -1.0, *self._placed
        )
        self._added += self._placed

    def advance(self, step: float) -> None:
        """One time step [s] with what the bodies pushed."""
        turn = np.exp(-1j * self.modes.frequencies * step)[self.modes.ring]
        kernels.advance_waves(
            self.real, self.imag, *self._added, turn.real.copy(), turn.imag.copy(), step
        )
        self._added[:] = 0.0
