"""Added mass, damping and wave forces of floating hulls over frequency, and what they make of a body.

Of a motion exp(-i omega t) the surface is left out exactly: with f = 1 / (g k tanh kH - omega^2)

    phi^ = f (-g C s + i omega X^ q),    M s + D phi = v.n - d_n phi_I,    q = nu phi on the lid

C s is the transform of the upward speed that the sources s make at the surface, D phi the normal speed that
the waves make at the panels, X^ the transform of the lid's points. Then psi = P s + E phi + phi_I and
F = -i omega rho sum_j psi_j n_j A_j. What the surface does is of low rank, U core(omega) V* of some tens of
patterns, so that a frequency costs little (Woodbury): of a condition b

    y = (1 + core V* N U)^-1 core V* N b,  (s, q) = N (b - U y),  N = M^-1 on the hull, 1 on the lid

Signs and names are Capytaine's: a wave of unit amplitude runs as
exp(i (k.x - omega t)).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray

from mjskip._typing import Array, Complex, Progress
from mjskip.checks import check_memory
from mjskip.hydro._coupling_tables import plane_waves
from mjskip.hydro.panels import Influence, WettedHull, hull_influence, hull_width, lid_rate
from mjskip.hydro.surface_modes import (
    SurfaceModes,
    ring_directions,
    surface_modes,
    wavenumber,
)

DOFS = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
RANK_TOLERANCE = 1e-4
"""Share of what the surface does that its patterns may leave out."""
MAX_WAVES = 2500
"""Plane waves, at most: bodies of unlike size far apart share them, and the shortest are left out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloatingBody:
    """A hull at rest in still water, with its mass.

    Attributes:
        name: of the body.
        hull: wetted panels, all bodies in one frame.
        mass: [kg].
        inertia: about its centre of mass (3, 3) [kg m^2].
    """

    name: str
    hull: WettedHull
    mass: float
    inertia: Array

    @property
    def mass_matrix(self) -> Array:
        """(6, 6), translations first."""
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = self.mass * np.eye(3)
        matrix[3:, 3:] = self.inertia
        return matrix


def response_modes(influence: Influence, *, highest: float, gravity: float) -> SurfaceModes:
    """Modes that resolve waves of up to the angular frequency `highest` [rad/s] at these hulls."""
    reach = max(float(np.linalg.norm(h.triangles[..., :2], axis=-1).max()) for h in influence.hulls)
    width = min(hull_width(hull) for hull in influence.hulls)
    needed = 1.5 * highest**2 / gravity
    cutoff = max(needed, 12.0 / width)
    while True:
        modes = surface_modes(
            shortest=2.0 * math.pi / cutoff, reach=reach, depth=influence.depth, gravity=gravity
        )
        if modes.size <= MAX_WAVES or cutoff <= needed:
            return modes
        cutoff = max(0.9 * cutoff, needed)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lid:
    points: Array
    areas: Array
    rates: Array


def _lid(influence: Influence, gravity: float) -> _Lid:
    points, areas, rates = [], [], []
    for hull in influence.hulls:
        xy, area = hull.lid()
        points.append(xy)
        areas.append(area)
        rates.append(np.full(len(area), lid_rate(hull, gravity=gravity)))
    return _Lid(
        points=np.concatenate(points), areas=np.concatenate(areas), rates=np.concatenate(rates)
    )


def potentials(
    influence: Influence,
    omega: Array,
    *,
    directions: Sequence[float] = (0.0,),
    gravity: float,
    progress: Progress | None = None,
) -> tuple[Complex, Complex, Complex, Array]:
    """Mean potential on every panel at angular frequencies (w,) [rad/s].

    Returns:
        By unit motions (w, n, 6 x bodies); scattered from unit waves in `directions` [rad] (w, n, d); of
        those waves themselves (w, n, d) [m^2/s per m/s or m]; and what unit motions radiate to infinity, as
        damping over the water's density (w, 6 x bodies, 6 x bodies).
    """
    modes = response_modes(influence, highest=float(omega.max()), gravity=gravity)
    lid = _lid(influence, gravity)
    n, m = len(influence.areas), len(lid.areas)
    headings = np.asarray(directions, dtype=np.float64)
    radiated = np.empty((len(omega), n, influence.motions.shape[1]), complex)
    scattered = np.empty((len(omega), n, len(headings)), complex)
    incident = np.empty_like(scattered)
    outward = np.empty((len(omega), radiated.shape[2], radiated.shape[2]))
    terms = _SurfaceTerms.of(influence, modes, lid)
    bodies = radiated.shape[2]
    wavenumbers = wavenumber(omega, depth=influence.depth, gravity=gravity)
    waves = [influence.plane_waves(float(k), headings) for k in wavenumbers]
    met = [1j * gravity / w * wave.slope for w, wave in zip(omega, waves, strict=True)]
    solved = np.linalg.solve(
        influence.velocity, np.hstack([influence.motions, terms.received[:n], *met])
    )
    alone, pushed = solved[:, :bodies], solved[:, bodies : bodies + terms.rank]
    met_alone = solved[:, bodies + terms.rank :].reshape(n, len(omega), -1)
    answer = terms.received[n + m :] - influence.potential @ pushed
    on_hull, on_lid = terms.emitted[:, :n], terms.emitted[:, n:]
    back, back_lid = on_hull @ pushed, on_lid @ terms.received[n : n + m]
    for i, w in enumerate(omega):
        core = terms.core(w)
        first = np.hstack([alone, met_alone[:, i]])
        y = np.linalg.solve(
            np.eye(terms.rank) + core @ (back + 1j * w * back_lid), core @ (on_hull @ first)
        )
        found = influence.potential @ first + answer @ y
        radiated[i], scattered[i] = found[:, :bodies], found[:, bodies:]
        incident[i] = -1j * gravity / w * waves[i].value
        strengths = np.vstack([first - pushed @ y, -terms.received[n : n + m] @ y])[:, :bodies]
        outward[i] = _far_waves(
            influence, lid, strengths, float(w), float(wavenumbers[i]), gravity, modes.reach
        )
        if progress:
            progress(i + 1, len(omega))
    return radiated, scattered, incident, outward


def _far_waves(
    influence: Influence,
    lid: _Lid,
    strengths: Complex,
    w: float,
    k: float,
    gravity: float,
    reach: float,
) -> Array:
    """Power of the waves at infinity by unit motions, as damping over density (dofs, dofs) [m^3/s ...].

        B / rho = omega g k / (4 pi d(omega^2)/dk) integral of u_i u_j* over the directions

    u the transform, at the real wavenumber, of the surface's upward speed by sources and lid.
    """
    angles = ring_directions(2 * math.ceil(k * reach) + 12)
    wave = influence.plane_waves(k, angles)
    n = len(influence.areas)
    inside = np.exp(1j * k * (lid.points @ np.stack([np.cos(angles), np.sin(angles)])))
    rise = wave.source @ strengths[:n] - 1j * w / gravity * (
        (lid.areas[:, None] / inside).T @ strengths[n:]
    )
    deep = not math.isfinite(influence.depth)
    steepness = 1.0 if deep else math.tanh(k * influence.depth)
    slope = gravity * (
        steepness + (0.0 if deep else k * influence.depth * (1.0 - steepness**2))
    )  # d(omega^2) / dk
    shares = w * gravity * k / (4.0 * math.pi * slope) * 2.0 * math.pi / len(angles)
    return np.asarray(shares * (rise.conj().T @ rise).real)


@dataclass(frozen=True, kw_only=True, eq=False)
class _SurfaceTerms:
    """What sources and lid do through the surface, by patterns.

    Attributes:
        received: U, of every pattern at the panels' flow (n), the lid (m) and the panels' potential (n): (2 n + m, r).
        emitted: V*, from sources and lid to patterns (r', n + m); the lid's part is to be multiplied by i omega.
        rings: what pattern makes what through each ring of waves (rings, r, r').
        modes: the waves.
    """

    received: Complex
    emitted: Complex
    rings: Complex
    modes: SurfaceModes

    @classmethod
    def of(cls, influence: Influence, modes: SurfaceModes, lid: _Lid) -> _SurfaceTerms:
        received, emitted = [], []
        for k, weight, count in zip(modes.wavenumbers, modes.weights, modes.angles, strict=True):
            angles = ring_directions(int(count))
            share = np.sqrt(weight)
            wave = plane_waves(
                influence.points,
                influence.normals,
                influence.areas,
                k=complex(k),
                directions=angles,
                depth=modes.depth,
            )
            inside = np.exp(1j * k * (lid.points @ np.stack([np.cos(angles), np.sin(angles)])))
            emitted.append(
                share * np.hstack([-modes.gravity * wave.source, (lid.areas[:, None] / inside).T])
            )
            received.append(
                share * np.vstack([wave.slope, -lid.rates[:, None] * inside, wave.value])
            )
        wide, tall = np.hstack(received), np.vstack(emitted)
        left, right = _column_basis(wide), _column_basis(tall.conj().T).conj().T
        across, down = left.conj().T @ wide, tall @ right.conj().T
        rings = [across[:, a:b] @ down[a:b] for a, b in itertools.pairwise(modes.first)]
        return cls(received=left, emitted=right, rings=np.stack(rings), modes=modes)

    @property
    def rank(self) -> int:
        """Number r of patterns."""
        return int(self.received.shape[1])

    def core(self, omega: float) -> Complex:
        """From emitted to received patterns at an angular frequency (r, r')."""
        share = 1.0 / (self.modes.frequencies**2 - omega**2)
        return np.asarray(np.tensordot(share, self.rings, 1))


def _column_basis(table: Complex) -> Complex:
    """Orthonormal columns that span those of a table (n, m), by random combinations of them."""
    random = np.random.default_rng(0)
    tests = table @ random.standard_normal((table.shape[1], 8))
    scale, basis = np.linalg.norm(tests), np.zeros((len(table), 0), complex)
    while basis.shape[1] < min(table.shape):
        count = min(max(64, basis.shape[1] // 2), min(table.shape) - basis.shape[1])
        some = table @ random.standard_normal((table.shape[1], count))
        for _ in range(2):  # twice: to rounding
            some -= basis @ (basis.conj().T @ some)
            some = np.linalg.qr(some)[0]
        basis = np.hstack([basis, some])
        tests -= some @ (some.conj().T @ tests)
        if np.linalg.norm(tests) < RANK_TOLERANCE * scale:
            break
    return basis


# Over 80 lines: the docstring names what the dataset holds.
def coefficients(
    bodies: Sequence[FloatingBody],
    omega: npt.ArrayLike,
    *,
    directions: Sequence[float] = (0.0,),
    density: float = 1000.0,
    gravity: float = 9.81,
    depth: float = math.inf,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Added mass, radiation damping and wave forces, with Capytaine's names.

    Args:
        bodies: floating at rest, hulls in one frame.
        omega: angular frequencies (w,) above 0 [rad/s].
        directions: towards which the waves run, from the x axis [rad].
        density: of the water [kg/m^3].
        gravity: [m/s^2].
        depth: of the water [m].
        progress: called with the frequencies done and to do.

    Returns:
        `added_mass`, `radiation_damping` (omega, radiating_dof, influenced_dof); `Froude_Krylov_force`,
        `diffraction_force`, `excitation_force` (omega, wave_direction, influenced_dof), complex, per metre
        of amplitude; `infinite_added_mass`, `inertia_matrix`, `hydrostatic_stiffness` (influenced_dof,
        radiating_dof).

    Raises:
        ValueError: a frequency is not a finite number above 0, or what was asked for is too large for the memory.
    """
    frequencies = np.atleast_1d(np.asarray(omega, dtype=np.float64))
    if frequencies.ndim != 1 or not (np.isfinite(frequencies) & (frequencies > 0.0)).all():
        raise ValueError(f"omega is {omega!r}: give finite angular frequencies above 0 [rad/s]")
    panels = sum(len(body.hull.areas) for body in bodies)
    columns = 6 * len(bodies) + 2 * len(directions)
    check_memory(
        f"{panels} panels at {len(frequencies)} frequencies from {len(directions)} directions",
        16.0 * panels * (8.0 * panels + 2.0 * len(frequencies) * columns),
        "ask for fewer frequencies, directions or faces of hulls (max_faces)",
    )
    middle = np.mean([body.hull.centre for body in bodies], axis=0)
    influence = hull_influence(*(body.hull.moved(-middle) for body in bodies), depth=depth)
    radiated, scattered, incident, outward = potentials(
        influence, frequencies, directions=directions, gravity=gravity, progress=progress
    )
    k = wavenumber(frequencies, depth=depth, gravity=gravity)
    towards = np.stack([np.cos(directions), np.sin(directions)])
    turn = np.exp(1j * k[:, None] * (middle @ towards))[:, None]  # phases are those at the origin
    scattered, incident = turn * scattered, turn * incident
    reaction = -density * influence.loads @ radiated  # A + i B / omega
    swing = -1j * density * frequencies[:, None, None]
    krylov = (swing * (influence.loads @ incident)).swapaxes(1, 2)
    diffraction = (swing * (influence.loads @ scattered)).swapaxes(1, 2)
    names = dof_names([body.name for body in bodies])
    pair = ("omega", "radiating_dof", "influenced_dof")
    waves = ("omega", "wave_direction", "influenced_dof")
    square = ("influenced_dof", "radiating_dof")
    return xarray.Dataset(
        {
            "added_mass": (pair, reaction.real.swapaxes(1, 2)),
            "radiation_damping": (
                pair,
                density * outward,
            ),
            "Froude_Krylov_force": (waves, krylov),
            "diffraction_force": (waves, diffraction),
            "excitation_force": (waves, krylov + diffraction),
            "infinite_added_mass": (square, influence.added_mass(density)),
            "inertia_matrix": (square, _diagonal([body.mass_matrix for body in bodies])),
            "hydrostatic_stiffness": (
                square,
                _diagonal(
                    [
                        body.hull.stiffness(density=density, gravity=gravity, mass=body.mass)
                        for body in bodies
                    ]
                ),
            ),
        },
        coords={
            "omega": frequencies,
            "wave_direction": np.asarray(directions, dtype=np.float64),
            "radiating_dof": names,
            "influenced_dof": names,
            "rho": density,
            "g": gravity,
            "water_depth": depth,
        },
    )


def dof_names(bodies: Sequence[str]) -> list[str]:
    """Surge to Yaw of one body, BODY__Surge and so on of several."""
    if len(bodies) == 1:
        return list(DOFS)
    return [f"{body}__{dof}" for body in bodies for dof in DOFS]


def _diagonal(blocks: Sequence[Array]) -> Array:
    whole = np.zeros((6 * len(blocks), 6 * len(blocks)))
    for i, block in enumerate(blocks):
        whole[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = block
    return whole


def response_amplitudes(data: xarray.Dataset) -> xarray.DataArray:
    """Response amplitude operator (omega, wave_direction, radiating_dof), complex [m/m, rad/m].

    [ -omega^2 (M + A) - i omega B + C ] X = F
    """
    w = data.omega.values[:, None, None]
    added = data.added_mass.transpose("omega", "influenced_dof", "radiating_dof").values
    damping = data.radiation_damping.transpose("omega", "influenced_dof", "radiating_dof").values
    impedance = (
        -(w**2) * (data.inertia_matrix.values + added)
        - 1j * w * damping
        + data.hydrostatic_stiffness.values
    )
    force = data.excitation_force.transpose("omega", "influenced_dof", "wave_direction").values
    return xarray.DataArray(
        np.linalg.solve(impedance, force).swapaxes(1, 2),
        dims=("omega", "wave_direction", "radiating_dof"),
        coords={name: data[name] for name in ("omega", "wave_direction", "radiating_dof")},
        name="rao",
    )
