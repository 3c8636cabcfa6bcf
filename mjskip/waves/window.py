"""A square of water that follows its bodies and that waves leave: `waves` (equation 5) or `deep`.

Equations in `_window_kernels`. Within a quarter of the width from each edge friction on the potential grows with
the square of the depth into that layer, up to 38 times group speed over width (of waves a third of the width long).
Of the energy of waves from 8 cells to a third of the width less than 1% comes back into the middle, at any angle, and
the layer neither makes nor takes volume. Water outside is still, and knows no islands.
"""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_choice, check_count, check_number, check_positive
from mjskip.waves import _window_kernels as kernels
from mjskip.waves.coupling import (
    Surface,
    deep_impulse,
    deep_operator,
    deep_profile,
    wave_impulse,
    wave_profile,
)

Kind = Literal["waves", "deep"]
KINDS: tuple[Kind, ...] = get_args(Kind)

LAYER = 0.25
"""Width of the absorbing layer at each edge, as a fraction of the square's."""

ABSORPTION = 38.0
"""Friction at the very edge, in group speed over width: 30 to 45 keep the reflected energy below 1%."""

LONGEST = 1.0 / 3.0
"""Longest waves that the layer is made for, as a fraction of the width."""


def water_of(
    kind: Kind, *, cells: int = 64, spacing: float = 0.01, gravity: float = 9.81, density: float = 1000.0,
    wave_speed: float = 1.0, depth: float = math.inf, damping: float = 0.0, tension: float = 0.0,
) -> Array:  # fmt: skip
    """What does not change of a square of water: see `Window`."""
    check_choice("kind", kind, KINDS)
    check_count("cells", cells, low=16)
    check_positive(spacing=spacing, gravity=gravity, density=density)
    check_number("damping", damping, low=0.0, unit="1/s")
    check_number("tension", tension, low=0.0, unit="N/m")
    if not depth > 0.0:
        raise ValueError(f"depth is {depth!r}: give metres of water, or infinity")
    if kind == "waves":
        check_positive(wave_speed=wave_speed)
        if tension > 0.0 or math.isfinite(depth):
            raise ValueError(
                "the paper's equation (surface 'waves') has neither tension nor depth, all its waves run at "
                "wave_speed: leave them out, or use surface 'deep'"
            )
        group, symbol = wave_speed, np.zeros((cells, cells // 2 + 1))
    else:
        symbol = deep_operator(cells, spacing=spacing, depth=depth)
        group = _group_speed(2.0 * np.pi / (LONGEST * cells * spacing), gravity, depth, tension / density)  # fmt: skip
    edge = np.minimum(np.arange(cells), np.arange(cells)[::-1]) + 0.5
    layer = np.clip(1.0 - edge / (LAYER * cells), 0.0, 1.0)
    water = np.zeros(kernels.WATER)
    water[kernels.CELLS], water[kernels.SPACING] = cells, spacing
    water[kernels.GRAVITY], water[kernels.DENSITY] = gravity, density
    water[kernels.DAMPING], water[kernels.STIFFNESS] = damping, tension / density
    if kind == "waves":
        water[kernels.STENCIL] = wave_speed**2 / (6.0 * gravity * spacing**2)
    growth = ABSORPTION * group / (cells * spacing) * layer**2
    return np.concatenate([water, growth, symbol.ravel()])


def _group_speed(k: float, gravity: float, depth: float, stiffness: float) -> float:
    """d omega / d k of omega^2 = (g k + sigma k^3 / rho) tanh k H."""

    def omega(k: float) -> float:
        return math.sqrt((gravity * k + stiffness * k**3) * math.tanh(k * min(depth, 1e9)))

    return (omega(1.001 * k) - omega(0.999 * k)) / (0.002 * k)


def largest_timestep(water: Array) -> float:
    """dt with dt^2 (g + sigma k^2 / rho) G = 4 for the stiffest wave: beyond it energy has no lower bound [s]."""
    cells, spacing = int(water[kernels.CELLS]), water[kernels.SPACING]
    if water[kernels.STENCIL] > 0.0:  # of the nine-point Laplacian: (pi, 0)
        return 2.0 / math.sqrt(water[kernels.GRAVITY] * 32.0 * water[kernels.STENCIL])
    symbol = water[kernels.WATER + cells :].reshape(cells, -1)
    k2 = 4.0 * np.pi**2 * (
        np.fft.fftfreq(cells, spacing)[:, None] ** 2 + np.fft.rfftfreq(cells, spacing)[None, :] ** 2
    )  # fmt: skip
    stiffest = np.max((water[kernels.GRAVITY] + water[kernels.STIFFNESS] * k2) * symbol)
    return float(2.0 / math.sqrt(stiffest))


class Window:
    """A square of moving water.

    Attributes:
        water, state: for the kernels.
        spacing, cells: of the square.
        level: elevation z[n] (cells, cells) [m], x first: a view of the state.
        potential: phi[n-1/2] (cells, cells) [m^2/s], likewise.
        rate: vertical speed between the last two levels (cells, cells) [m/s], likewise.
        max_timestep: largest step for which its energy is one [s].
        absorbed: energy that friction and layer took so far [J], if an account is kept.
    """

    def __init__(
        self, kind: Kind, *, cells: int = 64, spacing: float = 0.01, gravity: float = 9.81,
        density: float = 1000.0, wave_speed: float = 1.0, depth: float = math.inf, damping: float = 0.0,
        tension: float = 0.0, centre: tuple[float, float] = (0.0, 0.0), account: bool = False,
    ) -> None:  # fmt: skip
        """Still water.

        Args:
            kind: "waves" (equation 5, all waves run at `wave_speed`) or "deep" (real waves of any depth).
            cells: along each side, at least 16; a product of small primes is fastest.
            spacing: of cells [m].
            gravity: [m/s^2].
            density: [kg/m^3].
            wave_speed: c of "waves" [m/s].
            depth: H of "deep" [m].
            damping: mu of equation (5), of the potential of "deep" [1/s].
            tension: surface tension of "deep" [N/m].
            centre: of the square [m]; its cells are those of a grid with one at (0, 0).
            account: whether to count in `absorbed` what friction takes.

        Raises:
            ValueError: a value is not allowed.
        """
        self.water = water_of(
            kind, cells=cells, spacing=spacing, gravity=gravity, density=density, wave_speed=wave_speed,
            depth=depth, damping=damping, tension=tension,
        )  # fmt: skip
        self.kind, self.cells, self.spacing, self.damping = kind, cells, spacing, damping
        self.max_timestep = largest_timestep(self.water)
        self._wave_speed, self._depth, self._gravity = wave_speed, depth, gravity
        self.state = np.zeros(kernels.STATE + 3 * cells * cells)
        self.state[kernels.FIRST_I : kernels.FIRST_J + 1] = [
            round(place / spacing - 0.5 * (cells - 1)) for place in centre
        ]
        self.level, self.potential, self.rate = self.state[kernels.STATE :].reshape(3, cells, cells)
        self._work = np.empty_like(self.state)
        self.absorbed = 0.0
        edge = self.water[kernels.WATER : kernels.WATER + cells]
        self._friction = damping + np.maximum(edge[:, None], edge) if account else None

    @property
    def origin(self) -> tuple[float, float]:
        """Place of the first cell [m]."""
        i, j = self.state[kernels.FIRST_I], self.state[kernels.FIRST_J]
        return float(i * self.spacing), float(j * self.spacing)

    def impulse(self) -> Array:
        """The response of these cells, for `SurfaceCoupling`."""
        if self.kind == "waves":
            return wave_impulse(
                wave_speed=self._wave_speed, gravity=self._gravity, spacing=self.spacing
            )
        return deep_impulse(self.cells, spacing=self.spacing, depth=self._depth)

    def profile(self, radius: float) -> Array:
        """The response of cells without end under bumps of a radius [m], for `SurfaceCoupling`."""
        if self.kind == "waves":
            return wave_profile(wave_speed=self._wave_speed, gravity=self._gravity, radius=radius)
        extent = math.sqrt(2.0) * self.cells * self.spacing
        return deep_profile(radius=radius, extent=extent, depth=self._depth)

    def surface(self, timestep: float) -> Surface:
        """The square as the coupling sees it, with the rate centred on the coming step [s]."""
        rate = np.empty((self.cells, self.cells))
        kernels.centred_rate(self.water, self.state, timestep, self._work, rate)
        x, y = self.origin
        return Surface(x=x, y=y, spacing=self.spacing, level=self.level.copy(), rate=rate)

    def step(self, timestep: float, pressure: Array | None = None) -> None:
        """Move on by a step [s] under a pressure on the cells (cells, cells) [Pa].

        Raises:
            ValueError: the step is too large.
        """
        if not 0.0 < timestep < self.max_timestep:
            raise ValueError(
                f"timestep is {timestep:g} s: cells of {self.spacing:g} m need one below {self.max_timestep:.3g} s"
            )
        before = self.potential.copy(), self.rate.copy()
        kernels.relax(self.water, self.state, timestep)
        if pressure is not None:
            kernels.press(self.water, self.state, pressure, timestep)
        kernels.flow(self.water, self.state, timestep)
        if self._friction is not None:
            self._count(before, pressure, timestep)

    def _count(self, before: tuple[Array, Array], pressure: Array | None, timestep: float) -> None:
        """Add dt <rho nu phi + (p' - p), G phi>, means of before and after; p' is p within the layer's friction."""
        assert self._friction is not None
        potential, rate = 0.5 * (before[0] + self.potential), 0.5 * (before[1] + self.rate)
        lost = self.water[kernels.DENSITY] * self._friction * potential
        if pressure is not None:
            uniform = 1.0 + 0.5 * timestep * self.water[kernels.DAMPING]
            lost += pressure * ((1.0 + 0.5 * timestep * self._friction) / uniform - 1.0)
        self.absorbed += timestep * self.spacing**2 * float(np.sum(lost * rate))

    def follow(self, x: float, y: float) -> None:
        """Move the square by whole cells until its middle is within one of a place [m]."""
        first = self.state[: kernels.LEFT_VOLUME].copy()
        kernels.follow(self.water, self.state, x, y)
        if (self.state[: kernels.LEFT_VOLUME] != first).any():
            kernels.apply_operator(self.water, self.potential, self.rate)

    @property
    def volume(self) -> float:
        """Of the square, and left behind by `follow` [m^3]: 0 but for rounding."""
        left = float(self.state[kernels.LEFT_VOLUME])
        return float(self.level.sum()) * self.spacing**2 + left

    def energy(self, timestep: float) -> float:
        """Of the square between its last two levels [J]: 1/2 rho (g z- z + (sigma / rho) ... + phi G phi)."""
        before = self.level - timestep * self.rate
        pull = self._gravity * self.level
        if self.water[kernels.STIFFNESS] > 0.0:
            pull = self._gravity * kernels.tension_pull(self.water, self.level)
        density = self.water[kernels.DENSITY]
        total = np.sum(before * pull) + np.sum(self.potential * self.rate)
        return float(0.5 * density * self.spacing**2 * total)
