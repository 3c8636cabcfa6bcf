"""Two-way coupling of bodies and a moving surface: implicit, with its energy closed.

The bodies' loads and the surface's answer to them are found together (equations in `_coupling_kernels`), with
one set of weights of a fixed radius that samples the surface and spreads the load. Energy, with m the damping's
mu dt / 2 and <,> the sum over cells times d^2:

    E[n+1/2] - E[n-1/2] = -dt sum_i f_i vn_i - dt rho mu <z_t, G^-1 z_t>  <= 0
    E = bodies + 1/2 rho g <z[n], z[n+1]> + 1/2 rho <(z[n+1] - z[n]) / dt, G^-1 (z[n+1] - z[n]) / dt>

Faces are loaded while they advance into the water themselves, against the surface there, without the loads of this
step and with them (the gate of the paper, by the motion of the centre of mass, has no such balance). G is what a pressure does to the surface,
z_tt = -G (g z + p / rho):

    waves  G = -(c^2 / g) lap, the paper's equation (5), nine-point
    deep   G = |k| tanh(|k| H)

Under a spot of radius e the paper's water is softer than real water by 1 / (e k0), k0 = g / c^2: its depression depends
on e for ever; that of deep water settles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mjskip._typing import Array, Image, Integers
from mjskip.hydro import _block as hydro
from mjskip.hydro.laws import LAWS, ForceLaw
from mjskip.hydro.packing import block_of, triangles_of
from mjskip.waves import _coupling_kernels as kernels

LOAD_RADIUS = 0.02
"""Radius e of the bump that spreads a face's load and samples the surface under it [m]."""

TOLERANCE = 1e-14
"""Of the loads, relative to the greatest: the energy then closes to rounding."""

MAX_FACES = 4000
"""Triangles of all bodies of one solve, after splitting: the matrix has as many rows."""

PROFILE_PER_RADIUS_SQUARED = 64
"""Entries of a response profile per squared radius of a bump: linear interpolation is good to 1e-3 of its peak."""

PROFILE_RADII = 8
"""Distance up to which a response profile reaches, in radii: beyond it that of deep water is below 3e-4 of its peak."""


def check_law(name: str) -> ForceLaw:
    """The law of this name, if it can be coupled: normal to the face and monotone in the normal speed.

    Raises:
        ValueError: it cannot.
    """
    law = LAWS[name]
    if law.friction or law.speed_squared:
        able = ", ".join(n for n, a in LAWS.items() if not (a.friction or a.speed_squared))
        raise ValueError(
            f"law is {name!r}, whose load does not fall to 0 with the normal speed or acts along the face: over "
            f"a surface that moves use one of {able}, or still water"
        )
    return law


def split_block(block: Array, longest: float) -> Array:
    """The same body with every triangle halved across its longest edge until no edge is longer [m].

    Raises:
        ValueError: the body has too many triangles then.
    """
    done, waiting = [], triangles_of(block)
    while len(waiting):
        edges = np.linalg.norm(np.roll(waiting, -1, axis=1) - waiting, axis=2)
        short = edges.max(axis=1) <= longest
        done.append(waiting[short])
        waiting, edges = waiting[~short], edges[~short]
        first, many = edges.argmax(axis=1), np.arange(len(waiting))
        a, b, c = (waiting[many, (first + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        waiting = np.concatenate(
            [np.stack([middle, b, c], axis=1), np.stack([a, middle, c], axis=1)]
        )
        if sum(map(len, done)) + len(waiting) > MAX_FACES:
            raise ValueError(
                f"a body of radius {block[hydro.RADIUS]:.3g} m has more than {MAX_FACES} triangles no longer than "
                f"{longest:g} m: use a larger load_radius"
            )
    return block_of(block, np.concatenate(done))


def wave_impulse(*, wave_speed: float, gravity: float, spacing: float) -> Array:
    """G of a unit on one cell for equation (5): -(c^2 / g) times the nine-point Laplacian (3, 3) [1/m]."""
    stencil = np.array([[1.0, 4.0, 1.0], [4.0, -20.0, 4.0], [1.0, 4.0, 1.0]]) / 6.0
    return -(wave_speed**2) / (gravity * spacing**2) * stencil


def deep_impulse(cells: int, *, spacing: float, depth: float = math.inf) -> Array:
    """G = |k| tanh(|k| H) of a unit on one cell of a periodic window (2 cells - 1, 2 cells - 1) [1/m]."""
    table = np.fft.irfft2(deep_operator(cells, spacing=spacing, depth=depth), s=(cells, cells))
    offsets = np.arange(1 - cells, cells) % cells
    return np.ascontiguousarray(table[np.ix_(offsets, offsets)])


def deep_operator(cells: int, *, spacing: float, depth: float = math.inf) -> Array:
    """G = |k| tanh(|k| H) of a periodic window, for `rfft2` (cells, cells // 2 + 1) [1/m]."""
    kx = 2.0 * np.pi * np.fft.fftfreq(cells, spacing)
    ky = 2.0 * np.pi * np.fft.rfftfreq(cells, spacing)
    k = np.asarray(np.hypot(kx[:, None], ky[None, :]), dtype=np.float64)
    return np.asarray(k * np.tanh(k * depth) if math.isfinite(depth) else k)


def wave_profile(*, wave_speed: float, gravity: float, radius: float) -> Array:
    """S_i G S_j / d^2 of two bumps on fine cells, against the square of their distance, for equation (5) [1/m^3]."""
    return _profile(lambda k: wave_speed**2 / gravity * k**2, radius)


def deep_profile(*, radius: float, depth: float = math.inf) -> Array:
    """The same for G = |k| tanh(|k| H)."""
    return _profile(lambda k: k * np.tanh(k * depth) if math.isfinite(depth) else k, radius)


def _profile(operator: Callable[[Array], Array], radius: float) -> Array:
    """1 / (2 pi) int G(k) s(k)^2 J0(k r) k dk, s = 48 J3(k e) / (k e)^3 the transform of the bump."""
    from scipy.interpolate import CubicSpline  # takes twice as long to import as MuJoCo
    from scipy.special import j0, jv

    # beyond 200 / e the integrand, which falls as k^-5 at the slowest, is below 1e-9 of its integral
    k: Array = (np.arange(20_000, dtype=np.float64) + 0.5) * (200.0 / radius / 20_000)
    x = k * radius
    density = operator(k) * (48.0 * jv(3, x) / x**3) ** 2 * k * (k[1] - k[0]) / (2.0 * np.pi)
    # smooth at the scale of a bump near by, ever smoother far away
    near = np.arange(4 * 32) / 32.0
    nodes = radius * np.concatenate([near, np.arange(16, 4 * PROFILE_RADII + 3) / 4.0])
    values = np.array([np.dot(density, j0(k * r)) for r in nodes])
    r = radius * np.sqrt(
        np.arange(PROFILE_RADII**2 * PROFILE_PER_RADIUS_SQUARED + 2) / PROFILE_PER_RADIUS_SQUARED
    )
    return np.asarray(CubicSpline(nodes, values)(r), dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A local block of the surface, as the coupling sees it at a step.

    Attributes:
        x, y: of its first cell [m].
        spacing: of its cells [m].
        level: z[n] (nx, ny) [m].
        rate: (z_free[n+1] - z[n-1]) / (2 dt), z_free the step without loads (nx, ny) [m/s].
        open_cells: (nx, ny), 0 on land; all open if omitted.
    """

    x: float
    y: float
    spacing: float
    level: Array
    rate: Array
    open_cells: Image | None = None


@dataclass(frozen=True, kw_only=True)
class Loads:
    """What one solve found.

    Attributes:
        points: where each wet face's load acts (m, 2) [m].
        arms: the same about the centre of mass of its body, world axes (m, 3) [m].
        normals: outward (m, 3).
        bodies: which body each belongs to (m,).
        loads: f_i along -n_i (m,) [N].
        speeds: vn_i, against the surface (m,) [m/s].
        wrenches: force and torque about the centre of mass of every body (n, 6) [N, N m].
        pressure: on the surface's cells (nx, ny) [Pa].
        sweeps: of Gauss-Seidel.
    """

    points: Array
    arms: Array
    normals: Array
    bodies: Integers
    loads: Array
    speeds: Array
    wrenches: Array
    pressure: Array
    sweeps: int

    @property
    def dissipation(self) -> float:
        """sum f_i vn_i [W]."""
        return float(np.dot(self.loads, self.speeds))


class SurfaceCoupling:
    """n bodies and a surface that act on each other, solved together step by step.

    Attributes:
        blocks, starts: of the bodies, split, in a row; for the kernels.
    """

    def __init__(
        self,
        blocks: Sequence[Array],
        *,
        spacing: float,
        impulse: Array | None = None,
        profile: Array | None = None,
        density: float = 1000.0,
        damping: float = 0.0,
        radius: float = LOAD_RADIUS,
        tolerance: float = TOLERANCE,
        longest_face: float = 1.0,
    ) -> None:
        """Prepare bodies for a kind of water.

        Args:
            blocks: of the bodies (`mjskip.hydro.wrench.pack`), with laws that `check_law` takes.
            spacing: of the surface's cells [m].
            impulse: the response of the water, `wave_impulse` or `deep_impulse`: exact on these cells.
            profile: instead of it, `wave_profile` or `deep_profile` of this radius: many times as fast, the
                response on fine cells. Energy then closes to the order of the cells.
            density: of the water [kg/m^3].
            damping: mu of equation (5) [1/s].
            radius: of the bumps that spread loads and sample the surface [m]; at least a cell.
            tolerance: of the loads.
            longest_face: longest edge of a face, in radii: longer ones are split.

        Raises:
            ValueError: the radius is smaller than a cell, or there are too many triangles.
        """
        if not radius >= spacing:
            raise ValueError(
                f"load_radius is {radius:g} m and cells are {spacing:g} m wide: give a radius of a cell at least"
            )
        if (impulse is None) == (profile is None):
            raise ValueError("give an impulse or a profile, one of them")
        split = [split_block(block, longest_face * radius) for block in blocks]
        self.starts = np.cumsum([0, *(len(block) for block in split)])
        self.blocks = np.concatenate(split)
        self._count = int(sum(block[hydro.N_FACES] for block in split))
        if self._count > MAX_FACES:
            raise ValueError(
                f"the bodies have {self._count} triangles no longer than {longest_face * radius:g} m, {MAX_FACES} at most can be "
                "solved together: use a larger load_radius"
            )
        self._response = (
            np.zeros((0, 0)) if impulse is None else np.ascontiguousarray(impulse, np.float64),
            np.zeros(0) if profile is None else np.ascontiguousarray(profile, np.float64),
            PROFILE_PER_RADIUS_SQUARED / radius**2,
        )
        self._spacing, self._density, self._damping = spacing, density, damping
        self._radius, self._tolerance = radius, tolerance
        self._side = math.floor(2.0 * radius / spacing) + 1
        m = self._count
        self._work = (
            np.zeros((m, kernels.FACE)),
            np.zeros((m, kernels.SPOT + self._side**2)),
            np.zeros((m, m)),
            np.zeros(m),
            np.zeros(m),
        )

    def loads(self, states: Array, surface: Surface, timestep: float) -> Loads:
        """Loads at poses and velocities as they are: for an integrator that moves the bodies itself.

        Args:
            states: of the bodies (n, 18).
            surface: under them.
            timestep: of the surface [s].
        """
        nothing = np.zeros((len(states), kernels.MOBILITY))
        return self._solve(states, states, surface, timestep, nothing, kick=0.0)

    def kick(
        self,
        y: Array,
        surface: Surface,
        timestep: float,
        *,
        rows: Array,
        others: Array | None = None,
    ) -> Loads:
        """Loads and the kick of the bodies by them over a step, at the poses as they are.

        Args:
            y: x, q, P, L of the bodies (n, 13); P and L are altered.
            surface: under them.
            timestep: [s].
            rows: of the bodies (n, BODY), from `mjskip.rigid.body.body_row`.
            others: force and torque of everything else (n, 6), which kick too; none if omitted.
        """
        n = len(y)
        others = np.zeros((n, 6)) if others is None else others
        states, means = np.empty((n, 18)), np.empty((n, 18))
        bodies = np.empty((n, kernels.MOBILITY))
        kernels.prepare_kick(y, rows, others, timestep, states, means, bodies)
        found = self._solve(states, means, surface, timestep, bodies, kick=0.5 * timestep)
        y[:, 7:13] += timestep * (found.wrenches + others)
        return found

    def _solve(
        self, states: Array, means: Array, surface: Surface, timestep: float, bodies: Array, *, kick: float
    ) -> Loads:  # fmt: skip
        level = np.ascontiguousarray(surface.level, dtype=np.float64)
        rate = np.ascontiguousarray(surface.rate, dtype=np.float64)
        land = surface.open_cells
        open_cells = np.ones(level.shape, np.uint8) if land is None else land
        extremes = [np.abs(field).max(initial=0.0) for field in (level, rate)]
        frame = np.array([surface.x, surface.y, surface.spacing, *extremes])
        faces, spots, _, speeds, loads = self._work
        count, sweeps = kernels.solve_loads(
            self.blocks, self.starts, states, means, (frame, level, rate, open_cells), self._radius,
            self._response, timestep / (2.0 * self._density * (1.0 + 0.5 * self._damping * timestep)),
            bodies, kick, self._tolerance, (*self._work, np.empty(level.shape)),
        )  # fmt: skip
        wrenches, pressure = np.zeros((len(states), 6)), np.zeros(level.shape)
        kernels.add_wrench(faces, count, loads, wrenches)
        kernels.add_pressure(faces, count, spots, self._side, loads, surface.spacing, pressure)
        return Loads(
            points=faces[:count, :2].copy(),
            arms=faces[:count, kernels.ARM : kernels.ARM + 3].copy(),
            normals=faces[:count, kernels.NORMAL : kernels.NORMAL + 3].copy(),
            bodies=faces[:count, kernels.BODY].astype(np.int64),
            loads=loads[:count].copy(),
            speeds=speeds[:count].copy(),
            wrenches=wrenches,
            pressure=pressure,
            sweeps=sweeps,
        )
