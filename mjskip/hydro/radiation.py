"""Waves that a floating body makes and meets, in time: tables of its hull against the surface's modes.

    zeta_t = G phi + L V - R phi,   phi_t = -g zeta - nu X phi
    F = -A dV/dt - rho g L' zeta + lid,   L = C M^-1 n,  R = C M^-1 D   (`response` has C, D, M, X)

L is what the hull's motion gives to the surface, R phi what the hull at rest throws back. R is of low rank: the
flow of waves of interest on a hull has some tens of independent patterns. The term with nu damps the water
inside the hull, which is not there: without it that water sloshes and resonates (irregular frequencies).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Complex, Integers
from mjskip.hydro._coupling_tables import PlaneWaves, plane_waves
from mjskip.hydro.panels import Influence, WettedHull, hull_influence, hull_width, lid_rate
from mjskip.hydro.surface_modes import SurfaceModes, ring_directions, surface_modes

PATTERNS, LID_PATTERNS = 2e-2, 5e-2
"""Patterns of flow, and of motion under the lid, weaker than this share of the strongest are left out."""
SPARE_ORDERS = 2
SHORTEST = 2.0
"""Waves up to this many times shorter than the modes' shortest follow a hull at once."""
SHORT_RINGS = 12


def body_modes(
    hulls: tuple[WettedHull, ...],
    *,
    reach: float | None = None,
    depth: float = math.inf,
    gravity: float = 9.81,
    most: float = math.inf,
) -> SurfaceModes:
    """Modes for hulls that stay within `reach` of the origin [m]; by default the largest hull's radius.

    There are at most `most` plane waves: of more, the shortest are left out.
    """
    cutoff = max(shortest_wave(hull) for hull in hulls)
    while True:
        modes = surface_modes(
            shortest=2.0 * math.pi / cutoff,
            reach=reach or max(hull.radius for hull in hulls),
            depth=depth,
            gravity=gravity,
        )
        if modes.size <= most:
            return modes
        cutoff *= 0.9


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
        added_mass: of the water beside the modes (6, 6).
        density: of the water [kg/m^3].
    """

    hull: WettedHull
    modes: SurfaceModes
    orders: Integers
    rows: Array
    columns: Array
    lid_force: Array
    patterns: Array
    added_mass: Array
    density: float
    influence: Influence

    @cached_property
    def starts(self) -> Integers:
        """Where every ring's harmonics start, and their number at the end (rings + 1,)."""
        return np.concatenate([[0], np.cumsum(2 * (2 * self.orders + 1))])

    @cached_property
    def turns(self) -> tuple[Integers, Array]:
        """Starts (rings,) and cosines and sines of all directions, see `gather`."""
        blocks = []
        for count, order in zip(self.modes.angles, self.orders, strict=True):
            angle = np.arange(order + 1)[:, None] * ring_directions(int(count))
            blocks.append(np.concatenate([np.cos(angle), np.sin(angle[1:])]).ravel())
        sizes = [len(block) for block in blocks]
        return np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64), np.concatenate(blocks)


def radiation_table(
    hull: WettedHull, modes: SurfaceModes, *, density: float = 1000.0, most: int | None = None
) -> RadiationTable:
    """Prepare a hull for the modes of a surface, with at most `most` patterns; some tenths of a second."""
    influence = _with_short_waves(hull_influence(hull, depth=modes.depth), modes)
    gravity = modes.gravity
    inverse = np.linalg.inv(influence.velocity)
    reflected = influence.loads @ influence.potential @ inverse
    lid_points, lid_areas = hull.lid()
    rate = lid_rate(hull, gravity=gravity)
    orders = np.minimum(
        np.ceil(np.abs(modes.wavenumbers) * hull.radius).astype(np.int64) + SPARE_ORDERS,
        modes.angles // 2 - 1,
    )
    waves, insides = _waves_at(hull, lid_points, modes, orders)
    omega, weight = modes.frequencies, modes.weights
    to_phi = weight * gravity / omega
    patterns = _patterns(
        [inverse @ wave.slope for wave in waves],
        [
            math.sqrt(abs(w) * n / m)
            for w, n, m in zip(weight, modes.angles, (len(x.T) for x in insides), strict=True)
        ],
        hull.areas,
        PATTERNS,
    )[:, :most]
    lids = _patterns(insides, [1.0] * len(insides), np.abs(lid_areas), LID_PATTERNS)[:, :most]
    project = np.linalg.pinv(patterns)
    rows, columns = [], []
    moved = inverse @ influence.motions
    for j, (wave, inside) in enumerate(zip(waves, insides, strict=True)):
        received = density * (influence.loads @ wave.value - reflected @ wave.slope)
        flow = project @ (inverse @ wave.slope)
        lid = np.linalg.pinv(lids) @ inside if len(lid_points) else np.zeros((0, inside.shape[1]))
        rows.append(
            np.vstack(
                [
                    _real_rows(-gravity * weight[j] * received, int(orders[j]), imaginary=False),
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
        received = density * (influence.loads @ wave.value - reflected @ wave.slope)
        pressed = -rate * (lid_areas[:, None] / inside).T @ lids
        share = weight[j] * modes.angles[j] / inside.shape[1]
        force += (share * received @ pressed).real
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


def _waves_at(
    hull: WettedHull, lid_points: Array, modes: SurfaceModes, orders: Integers
) -> tuple[list[PlaneWaves], list[Complex]]:
    """Of every ring of modes, the plane waves at the panels, and exp(i k.x) at the lid's points."""
    waves: list[PlaneWaves] = []
    insides: list[Complex] = []
    for k, order in zip(modes.wavenumbers, orders, strict=True):
        angles = ring_directions(2 * int(order) + 4)
        waves.append(
            plane_waves(
                hull.points, hull.normals, hull.areas,
                k=complex(k), directions=angles, depth=modes.depth,
            )
        )  # fmt: skip
        insides.append(np.exp(1j * k * (lid_points @ np.stack([np.cos(angles), np.sin(angles)]))))
    return waves, insides


def _with_short_waves(influence: Influence, modes: SurfaceModes) -> Influence:
    """The hull's potentials with the waves that are too short for the modes, which follow it at once.

    For them omega^2 is small beside g k: f = 1 / (g k tanh kH) in the formula of `response`.
    """
    cutoff = modes.cutoff
    nodes, parts = np.polynomial.legendre.leggauss(SHORT_RINGS)
    stretch = 0.5 * math.log(SHORTEST)
    potential, velocity = influence.potential.copy(), influence.velocity.copy()
    for k, part in zip(cutoff * np.exp(stretch * (nodes + 1.0)), parts, strict=True):
        angles = ring_directions(2 * math.ceil(k * influence.hulls[0].radius) + 8)
        wave = influence.plane_waves(k, angles)
        steep = math.tanh(k * influence.depth) if math.isfinite(influence.depth) else 1.0
        share = part * stretch * k / steep / (2.0 * math.pi * len(angles))  # k dk / (k tanh kH)
        velocity -= share * (wave.slope @ wave.source).real
        potential -= share * (wave.value @ wave.source).real
    return replace(influence, potential=potential, velocity=velocity)


def _patterns(parts: list[Complex], scales: list[float], areas: Array, weakest: float) -> Array:
    """Orthogonal real patterns (n, r) that span columns of `parts`, in the mean square over areas."""
    if len(areas) == 0:
        return np.zeros((0, 0))
    root = np.sqrt(areas)
    scaled = [scale * part for scale, part in zip(scales, parts, strict=True)]
    whole = root[:, None] * np.hstack([*(s.real for s in scaled), *(s.imag for s in scaled)])
    left, strength, _ = np.linalg.svd(whole, full_matrices=False)
    return np.asarray(left[:, strength > weakest * strength[0]] / root[:, None])


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
    return np.stack(pair, axis=2).reshape(len(table), 2 * (2 * order + 1))


def _real_columns(table: Complex, order: int) -> Array:
    """Harmonics, as real numbers, of a table (rows, n) over equal directions."""
    parts = np.concatenate(_harmonics(table, order), axis=1)
    return np.stack([parts.real, parts.imag], axis=2).reshape(len(table), 2 * (2 * order + 1))


def table_coefficients(table: RadiationTable, omega: npt.ArrayLike) -> tuple[Array, Array]:
    """Added mass and damping (w, 6, 6) that a body has in time with this table [kg, kg/s and so on].

    Of unit u(t) = Re(exp(-i omega t)) a wave c_t = -i omega_j c + S u gives a reading Re(F c) of amplitude

        1/2 [ F S / (i (omega_j - omega)) - conj(F S) / (i (conj(omega_j) + omega)) ]
    """
    frequencies = np.atleast_1d(np.asarray(omega, dtype=np.float64))
    pairs = len(table.rows)
    products = np.empty((len(table.orders), pairs, pairs), complex)
    for j, order in enumerate(table.orders):
        part = slice(table.starts[j], table.starts[j + 1])
        read = table.rows[:, part][:, ::2] - 1j * table.rows[:, part][:, 1::2]
        give = table.columns[:, part][:, ::2] + 1j * table.columns[:, part][:, 1::2]
        share = np.full(2 * order + 1, 0.5 * table.modes.angles[j])
        share[0] *= 2.0
        products[j] = (read * share) @ give.T
    own = table.modes.frequencies
    added, damping = [], []
    lid = table.lid_force.shape[1]
    for w in frequencies:
        transfer = 0.5 * (
            np.tensordot(1.0 / (1j * (own - w)), products, 1)
            - np.tensordot(1.0 / (1j * (own.conj() + w)), products.conj(), 1)
        )
        # readings r = T_rV V + T_rr r
        inner = np.linalg.solve(np.eye(pairs - 6) - transfer[6:, 6:], transfer[6:, :6])
        force = transfer[:6, :6] + transfer[:6, 6:] @ inner
        force += table.lid_force @ inner[pairs - 6 - lid :]
        added.append(table.added_mass + (force / (1j * w)).real)
        damping.append(-force.real)
    return np.array(added), np.array(damping)


HEADINGS = 96
"""Headings of a body at which the table of known waves is made; it is linear in between."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownWaves:
    """What the waves of a sea do to a hull, for all its headings.

    Attributes:
        krylov: Froude-Krylov force on the hull at rest by unit waves (headings, n, 6), complex [N/m, N].
        diffraction: the instantaneous part of what it scatters (headings, n, 6).
        flow: on the hull's patterns (headings, n, r).
    """

    krylov: Complex
    diffraction: Complex
    flow: Complex

    def at(self, yaw: float) -> tuple[Complex, Complex, Complex]:
        """The three at one heading [rad]: (n, 6), (n, 6), (n, r)."""
        place = yaw / (2.0 * math.pi) % 1.0 * HEADINGS
        a = int(place) % HEADINGS
        b, share = (a + 1) % HEADINGS, place - int(place)
        krylov, diffraction, flow = (
            (1.0 - share) * part[a] + share * part[b]
            for part in (self.krylov, self.diffraction, self.flow)
        )
        return krylov, diffraction, flow


def known_waves(
    table: RadiationTable, wavenumbers: Array, omega: Array, directions: Array
) -> KnownWaves:
    """Tables for waves of a sea (n,), directions from the x axis of the world [rad]."""
    hull, gravity, influence = table.hull, table.modes.gravity, table.influence
    inverse = np.linalg.inv(influence.velocity)
    reflected = influence.loads @ influence.potential @ inverse
    project = np.linalg.pinv(table.patterns) @ inverse
    weight = table.density * gravity
    headings = 2.0 * math.pi * np.arange(HEADINGS) / HEADINGS
    krylov, diffraction, flow = [], [], []
    for k, w, direction in zip(wavenumbers, omega, directions, strict=True):
        wave = plane_waves(
            hull.points,
            hull.normals,
            hull.areas,
            k=complex(k),
            directions=direction - headings,
            depth=table.modes.depth,
        )
        krylov.append(-weight * (influence.loads @ wave.value).T)
        diffraction.append(weight * (reflected @ wave.slope).T)
        flow.append(-1j * gravity / w * (project @ wave.slope).T)
    return KnownWaves(
        krylov=np.stack(krylov, axis=1),
        diffraction=np.stack(diffraction, axis=1),
        flow=np.stack(flow, axis=1),
    )
