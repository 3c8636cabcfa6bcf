"""The water surface: Lee & Baek's damped wave equation on a grid, driven by loads that press on it."""

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from mjskip import _wave_kernels as kernels

Stencil = Literal["nine_point", "five_point", "paper_eq8"]
Boundary = Literal["reflect", "absorb", "periodic"]
STENCILS: tuple[Stencil, ...] = get_args(Stencil)
BOUNDARIES: tuple[Boundary, ...] = get_args(Boundary)

FloatArray = npt.NDArray[np.float64]
SurfaceArray = npt.NDArray[np.float32]

WEIGHTS: dict[Stencil, tuple[float, float]] = {
    "nine_point": (2.0 / 3.0, 1.0 / 6.0),
    "five_point": (1.0, 0.0),
    "paper_eq8": (2.0 / 3.0, 1.0 / 3.0),
}
"""Weights of the edge and the corner neighbours."""

COURANT_LIMITS: dict[Stencil, float] = {
    "nine_point": math.sqrt(3.0) / 2.0,
    "five_point": 1.0 / math.sqrt(2.0),
    "paper_eq8": math.sqrt(3.0) / 2.0,
}
"""Largest stable c t / d for any damping (von Neumann); no step is stable for `paper_eq8`."""

SPONGE_CELLS = 32
"""Width of the layer of growing friction outside an absorbing field."""

SPONGE_STRENGTH = 6.0
"""Integral of the layer's friction over its width, in units of c: e^-6 in amplitude, there and back."""

NARROWEST_LOAD = 1.5
"""Radius of the narrowest load, in cells: a narrower one would excite waves the grid cannot carry."""

CELLS_PER_THREAD = 1 << 20
"""Below this many cells a second thread costs more than it saves."""


@dataclass(frozen=True, kw_only=True)
class SurfaceSample:
    """The surface at n points.

    Attributes:
        elevation: (n,) above still water [m].
        slope: (n, 2) dz/dx and dz/dy.
        vertical_speed: (n,) of the surface [m/s], half a step behind the elevation.
    """

    elevation: FloatArray
    slope: FloatArray
    vertical_speed: FloatArray


class HeightField:
    """Elevation of a rectangle of water under z_tt = c^2 lap(z + p / (rho g)) - mu z_t.

    Rings from a 20 N push that lasts a hundredth of a second::

        lake = HeightField()
        lake.press(0.0, 0.0, force=20.0, radius=0.05)
        lake.advance(0.01)
        lake.advance(1.5)
        rings = lake.elevation

    The water starts still. Cell (i, j) is at `x[i]`, `y[j]`; the walls are half a cell beyond the
    outermost cells. Source: equations (5)-(9) of the paper with its slips repaired.
    """

    def __init__(
        self,
        shape: tuple[int, int] = (500, 500),
        spacing: float = 0.02,
        wave_speed: float = 1.0,
        damping: float = 0.2,
        stencil: Stencil = "nine_point",
        boundary: Boundary = "reflect",
        *,
        centre: tuple[float, float] = (0.0, 0.0),
        threads: int | None = None,
    ) -> None:
        """Make still water.

        Args:
            shape: cells along x and y, at least 3 each.
            spacing: d, side of a cell [m].
            wave_speed: c [m/s].
            damping: mu [1/s]; amplitudes decay as exp(-mu t / 2).
            stencil: "nine_point" (isotropic), "five_point" (equation 7) or "paper_eq8" (equation 8
                as printed: unstable at every step, here to show that).
            boundary: "reflect" (walls; volume is conserved), "absorb" (open water: waves leave
                through a layer of friction outside the field) or "periodic".
            centre: (x, y) of the middle of the field [m].
            threads: how many share a step; None picks by size. The result does not depend on it.

        Raises:
            ValueError: an argument is out of range, or the grid does not fit into memory.
        """
        self.shape = _checked_shape(shape)
        self.spacing = _checked_number("spacing", spacing, "m", positive=True)
        self.wave_speed = _checked_number("wave_speed", wave_speed, "m/s", positive=True)
        self.damping = _checked_number("damping", damping, "1/s")
        self.stencil: Stencil = _checked_name("stencil", stencil, STENCILS)
        self.boundary: Boundary = _checked_name("boundary", boundary, BOUNDARIES)
        if len(centre) != 2 or not all(math.isfinite(value) for value in centre):
            raise ValueError(f"centre is {centre!r}: give two finite numbers, (x, y) [m]")
        self.centre = (float(centre[0]), float(centre[1]))
        if threads is not None and threads < 1:
            raise ValueError(f"threads is {threads!r}: give at least 1, or None to pick by size")

        self._margin = SPONGE_CELLS if boundary == "absorb" else 0
        nx, ny = (n + 2 * self._margin for n in self.shape)
        self._i1, self._j0, self._j1 = nx + 1, kernels.FIRST, kernels.FIRST + ny
        stride = -(-(self._j1 + 1) // 16) * 16
        refuse_if_too_large(self.shape, 2 * 4 * (nx + 2) * stride)
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        self._threads = threads or max(1, min(cores, nx * ny // CELLS_PER_THREAD))
        self._z = aligned_zeros(nx + 2, stride)
        self._prev = aligned_zeros(nx + 2, stride)
        self._rows = [aligned_zeros(3, stride) for _ in range(self._threads)]
        self._pool: tuple[int, ThreadPoolExecutor] | None = None
        self._loads: list[tuple[SurfaceArray, int, int]] = []
        self._last_timestep = 0.0
        self.time = 0.0
        """Simulated time [s]."""
        self.x: FloatArray = self.centre[0] + (np.arange(shape[0]) - (shape[0] - 1) / 2) * spacing
        """(nx,) positions of the cells along x [m]."""
        self.y: FloatArray = self.centre[1] + (np.arange(shape[1]) - (shape[1] - 1) / 2) * spacing
        """(ny,) positions of the cells along y [m]."""

    # What the water is like ---------------------------------------------------------------------

    @property
    def elevation(self) -> SurfaceArray:
        """(nx, ny) [m], a view of the present surface: ask again after a step."""
        return self._cells(self._z)

    @property
    def velocity(self) -> SurfaceArray:
        """(nx, ny) vertical speed [m/s] from the last two levels: half a step behind, a copy."""
        if self._last_timestep == 0.0:
            return np.zeros(self.shape, np.float32)
        difference = self._cells(self._z) - self._cells(self._prev)
        return difference / np.float32(self._last_timestep)

    @property
    def max_timestep(self) -> float:
        """Largest stable step [s] for any damping: c t / d <= sqrt(3)/2, five-point 1/sqrt(2)."""
        return COURANT_LIMITS[self.stencil] * self.spacing / self.wave_speed

    @property
    def paper_max_timestep(self) -> float:
        """What equation (9), c < (d / 2t) sqrt(mu t + 2), would allow [s]: too much if mu > 0."""
        rate = (self.wave_speed / self.spacing) ** 2
        mu = self.damping
        return (mu + math.sqrt(mu * mu + 32.0 * rate)) / (8.0 * rate)

    def volume(self) -> float:
        """Water above the still level minus water missing below it [m^3]."""
        return float(self.elevation.sum(dtype=np.float64)) * self.spacing**2

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is inside the walls."""
        return (
            abs(x - self.centre[0]) <= 0.5 * self.shape[0] * self.spacing
            and abs(y - self.centre[1]) <= 0.5 * self.shape[1] * self.spacing
        )

    def sample(self, x: npt.ArrayLike, y: npt.ArrayLike) -> SurfaceSample:
        """Surface at points, bilinear; outside the field the water is still.

        Args:
            x, y: (n,) or scalars [m].
        """
        points_x, points_y = np.broadcast_arrays(
            np.atleast_1d(np.asarray(x, np.float64)), np.atleast_1d(np.asarray(y, np.float64))
        )
        at = np.column_stack(self._in_cells(points_x.ravel(), points_y.ravel()))
        out = np.empty((len(at), 4))
        kernels.sample_points(
            self._z, self._prev, self._i1, self._j0, self._j1, self._boundary_code, at,
            self.spacing, self._last_timestep, out,
        )  # fmt: skip
        return SurfaceSample(elevation=out[:, 0], slope=out[:, 1:3], vertical_speed=out[:, 3])

    # What acts on it ----------------------------------------------------------------------------

    def press(
        self,
        x: float,
        y: float,
        *,
        force: float,
        radius: float,
        density: float = 1000.0,
        gravity: float = 9.81,
    ) -> None:
        """Load the surface through the next `step` or `advance`; then the load is gone.

        The load enters as pressure head p / (rho g), so it moves water and makes none: a load that
        stays depresses the surface by the static head. Its profile is (1 - r^2 / 2R^2)^2, which has
        the second moment of a uniform disc of radius R. Parts outside the field are dropped.

        Args:
            x, y: centre [m].
            force: total, downward [N]; negative lifts.
            radius: R [m], taken as at least 1.5 cells.
            density: of the water [kg/m^3].
            gravity: [m/s^2].

        Raises:
            ValueError: an argument is not finite, or radius, density or gravity is not positive.
        """
        for name, value in (("x", x), ("y", y), ("force", force)):
            if not math.isfinite(value):
                raise ValueError(f"{name} is {value!r}: give a finite number")
        for name, value in (("radius", radius), ("density", density), ("gravity", gravity)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value!r}: give a finite number above 0")
        head_volume = force / (density * gravity * self.spacing**2)
        patch = self._round_patch(x, y, radius, head_volume)
        if patch is not None and force != 0.0:
            self._loads.append(patch)

    def displace(self, x: float, y: float, *, height: float, radius: float) -> None:
        """Raise the surface by a smooth round bump, leaving its vertical speed as it is.

        Args:
            x, y: centre [m].
            height: at the centre [m]; negative makes a hollow.
            radius: R of the profile (1 - r^2 / 2R^2)^2 [m], taken as at least 1.5 cells.

        Raises:
            ValueError: an argument is not finite, or radius is not positive.
        """
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(height)):
            raise ValueError(f"x, y, height are {x!r}, {y!r}, {height!r}: give finite numbers [m]")
        _checked_number("radius", radius, "m", positive=True)
        reach = math.sqrt(2.0) * max(radius / self.spacing, NARROWEST_LOAD)
        east, north = (self.x[:, None] - x) / self.spacing, (self.y[None, :] - y) / self.spacing
        profile = np.maximum(1.0 - (east**2 + north**2) / reach**2, 0.0) ** 2
        bump = (height * profile).astype(np.float32)
        self._cells(self._z)[...] += bump
        self._cells(self._prev)[...] += bump

    def reset(self) -> None:
        """Still water at time 0, no loads."""
        self._z[...] = 0.0
        self._prev[...] = 0.0
        self._loads.clear()
        self._last_timestep = 0.0
        self.time = 0.0

    # Time ---------------------------------------------------------------------------------------

    def step(self, timestep: float) -> None:
        """Advance by one step [s].

        Raises:
            ValueError: the step is not a positive number, or larger than `max_timestep`.
        """
        if not (math.isfinite(timestep) and timestep > 0.0):
            raise ValueError(f"the water's time step is {timestep!r} s: give a number above 0")
        if timestep > self.max_timestep:
            raise ValueError(
                f"the water's time step of {timestep:.6g} s is unstable: use at most "
                f"{self.max_timestep:.6g} s (equation (9) would allow "
                f"{self.paper_max_timestep:.6g} s), a larger spacing, or advance()"
            )
        self._step(timestep)
        self._loads.clear()

    def advance(self, duration: float) -> int:
        """Advance by a duration [s] in equal stable steps, loads acting through all of them.

        Returns:
            Number of steps made.

        Raises:
            ValueError: the duration is negative or not finite.
        """
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"duration is {duration!r} s: give a number of at least 0")
        # A hundredth below the limit, where rounding cannot make the shortest waves grow.
        steps = math.ceil(duration / (0.99 * self.max_timestep))
        for _ in range(steps):
            self._step(duration / steps)
        if steps:
            self._loads.clear()
        return steps

    # Inside -------------------------------------------------------------------------------------

    @property
    def _boundary_code(self) -> int:
        codes = {"reflect": kernels.REFLECT, "periodic": kernels.PERIODIC}
        return codes.get(self.boundary, kernels.OUTGOING)

    def _cells(self, grid: SurfaceArray) -> SurfaceArray:
        i, j = 1 + self._margin, self._j0 + self._margin
        return grid[i : i + self.shape[0], j : j + self.shape[1]]

    def _in_cells(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions in cells, (0, 0) being the first stored cell."""
        return (
            (x - self.x[0]) / self.spacing + self._margin,
            (y - self.y[0]) / self.spacing + self._margin,
        )

    def _round_patch(
        self, x: float, y: float, radius: float, volume: float
    ) -> tuple[SurfaceArray, int, int] | None:
        """A round head of this volume [cells x m] and its first cell; None if it is all outside."""
        reach = math.sqrt(2.0) * max(radius / self.spacing, NARROWEST_LOAD)
        at_x = (x - float(self.x[0])) / self.spacing + self._margin
        at_y = (y - float(self.y[0])) / self.spacing + self._margin
        nx, ny = self._i1 - 1, self._j1 - self._j0
        if self.boundary == "periodic":
            at_x, at_y = at_x % nx, at_y % ny
        elif not (-reach < at_x < nx - 1 + reach and -reach < at_y < ny - 1 + reach):
            return None
        i, j = math.ceil(at_x - reach), math.ceil(at_y - reach)
        head = np.empty(
            (math.floor(at_x + reach) - i + 1, math.floor(at_y + reach) - j + 1), np.float32
        )
        kernels.fill_head(head, at_x - i, at_y - j, reach, volume)
        return head, 1 + i, self._j0 + j

    def _step(self, timestep: float) -> None:
        r = (self.wave_speed * timestep / self.spacing) ** 2
        m = 0.5 * self.damping * timestep
        outgoing = math.sqrt(r)
        outgoing = (outgoing - 1.0) / (outgoing + 1.0)
        kernels.fill_ghosts(
            self._z, self._prev, self._i1, self._j0, self._j1, self._boundary_code,
            np.float32(outgoing),
        )  # fmt: skip
        if timestep != self._last_timestep:
            self._retime(timestep)
        if self._margin:
            self._sweep_with_sponge(m, r, timestep)
        else:
            self._sweep((1.0 - m) / (1.0 + m), r / (1.0 + m))
        if self.stencil == "paper_eq8":
            # The printed centre weight, -4/(mu t + 2) - 10/3 xi, less the one the kernel used.
            xi = r / (1.0 + m)
            cells = np.s_[1 : self._i1, self._j0 : self._j1]
            self._prev[cells] += np.float32(-4.0 / (1.0 + m) + 2.0 / 3.0 * xi) * self._z[cells]
        self._z, self._prev = self._prev, self._z
        edge, corner = (weight * r / (1.0 + m) for weight in WEIGHTS[self.stencil])
        for head, i, j in self._loads:
            kernels.add_head(
                self._z, head, i, j, self._i1, self._j0, self._j1, self._boundary_code,
                edge, corner,
            )  # fmt: skip
        self._last_timestep = timestep
        self.time += timestep

    def _retime(self, timestep: float) -> None:
        """Replace the previous level by the one a step of this size would have come from.

        With v = (z - z-)/t0 half an old step ago and a = c^2 L - mu v, the level one new step ago is
        z - t1 (v + a t0/2) + a t1^2/2: the kernel's own form with other coefficients. Water that
        has not moved yet (t0 = 0) starts at rest: z + a t1^2 / 2.
        """
        t0, t1 = self._last_timestep, timestep
        gain = 0.5 * t1 * (t1 - t0)
        backwards = -t1 / t0 - self.damping * gain / t0 if t0 > 0.0 else 0.0
        self._sweep(backwards, gain * (self.wave_speed / self.spacing) ** 2)

    def _sweep(self, q: float, s: float) -> None:
        """prev = z + q (z - prev) + s L(z) over all cells, in bands of rows shared by threads."""
        sweep = kernels.step_five if self.stencil == "five_point" else kernels.step_nine
        cuts = np.linspace(1, self._i1, self._threads + 1).astype(int).tolist()

        def band(k: int) -> None:
            sweep(
                self._z, self._prev, cuts[k], cuts[k + 1], self._j0, self._j1,
                np.float32(q), np.float32(s), self._rows[k],
            )  # fmt: skip

        if self._threads == 1:
            band(0)
            return
        if self._pool is None or self._pool[0] != os.getpid():  # threads do not survive a fork
            self._pool = os.getpid(), ThreadPoolExecutor(self._threads - 1)
        others = [self._pool[1].submit(band, k) for k in range(1, self._threads)]
        band(0)
        for other in others:
            other.result()
