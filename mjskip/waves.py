"""The water surface: Lee & Baek's damped wave equation on a grid, driven by loads."""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mjskip import _wave_kernels as kernels
from mjskip._grid import (
    aligned_zeros,
    checked_finite,
    checked_name,
    checked_number,
    checked_shape,
    positions,
    refuse_if_too_large,
)
from mjskip._stencil import (
    BOUNDARIES,
    COURANT_LIMITS,
    SAFE_FRACTION,
    SPONGE_CELLS,
    STENCILS,
    WEIGHTS,
    Boundary,
    Stencil,
    paper_limit,
    reach_of,
    sponge,
    unstable,
)

FloatArray = npt.NDArray[np.float64]
SurfaceArray = npt.NDArray[np.float32]

CELLS_PER_THREAD = 1 << 21
"""With fewer cells to itself a thread costs more than it saves."""


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
        self.shape = checked_shape(shape)
        self.spacing = checked_number("spacing", spacing, "m", positive=True)
        self.wave_speed = checked_number("wave_speed", wave_speed, "m/s", positive=True)
        self.damping = checked_number("damping", damping, "1/s")
        self.stencil: Stencil = checked_name("stencil", stencil, STENCILS)
        self.boundary: Boundary = checked_name("boundary", boundary, BOUNDARIES)
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
        rate = self.wave_speed / self.spacing if self._margin else 0.0
        self._sponge = (sponge(nx, 1, nx + 2, rate), sponge(ny, self._j0, stride, rate))
        self._code = kernels.BOUNDARY_CODES[boundary]
        self._sweeper = kernels.step_five if stencil == "five_point" else kernels.step_nine
        self._cuts = {
            margin: np.linspace(1 + margin, nx + 1 - margin, self._threads + 1).astype(int).tolist()
            for margin in (0, self._margin)
        }
        self._pool: tuple[int, ThreadPoolExecutor] | None = None
        self._loads: list[tuple[SurfaceArray, int, int]] = []
        self._last_timestep = 0.0
        self.time = 0.0
        """Simulated time [s]."""
        self.x: FloatArray = positions(self.shape[0], self.centre[0], self.spacing)
        """(nx,) positions of the cells along x [m]."""
        self.y: FloatArray = positions(self.shape[1], self.centre[1], self.spacing)
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
        return paper_limit(self.spacing, self.wave_speed, self.damping)

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
            self._z, self._prev, self._i1, self._j0, self._j1, self._code, at,
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
        checked_finite("m", x=x, y=y)
        checked_finite("N", force=force)
        checked_number("radius", radius, "m", positive=True)
        checked_number("density", density, "kg/m^3", positive=True)
        checked_number("gravity", gravity, "m/s^2", positive=True)
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
        checked_finite("m", x=x, y=y, height=height)
        checked_number("radius", radius, "m", positive=True)
        reach = reach_of(radius, self.spacing)
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
            raise ValueError(unstable(timestep, self.max_timestep, self.paper_max_timestep))
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
        steps = math.ceil(duration / (SAFE_FRACTION * self.max_timestep))
        for _ in range(steps):
            self._step(duration / steps)
        if steps:
            self._loads.clear()
        return steps

    # Inside -------------------------------------------------------------------------------------

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
        reach = reach_of(radius, self.spacing)
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
            self._z, self._prev, self._i1, self._j0, self._j1, self._code,
            np.float32(outgoing),
        )  # fmt: skip
        if timestep != self._last_timestep:
            self._retime(timestep)
        if self.stencil != "paper_eq8":
            self._sweep((1.0 - m) / (1.0 + m), r / (1.0 + m), self._margin)
        if self._margin or self.stencil == "paper_eq8":
            self._sweep_slowly(m, r, timestep)
        self._z, self._prev = self._prev, self._z
        for head, i, j in self._loads:
            edge, corner = (weight * r / (1.0 + m) for weight in WEIGHTS[self.stencil])
            kernels.add_head(
                self._z, head, i, j, self._i1, self._j0, self._j1, self._code,
                edge, corner,
            )  # fmt: skip
        self._last_timestep = timestep
        self.time += timestep

    def _retime(self, timestep: float) -> None:
        """Replace the previous level by the one a step of this size would have come from.

        With v = (z - z-)/t0 half an old step ago and a = c^2 L - mu v, the level one new step ago
        is z - t1 (v + a t0/2) + a t1^2/2: the kernel's own form with other coefficients. Water
        that has not moved yet (t0 = 0) starts at rest: z + a t1^2 / 2.
        """
        t0, t1 = self._last_timestep, timestep
        gain = 0.5 * t1 * (t1 - t0)
        backwards = -t1 / t0 - self.damping * gain / t0 if t0 > 0.0 else 0.0
        self._sweep(backwards, gain * (self.wave_speed / self.spacing) ** 2, 0)

    def _sweep(self, q: float, s: float, margin: int) -> None:
        """prev = z + q (z - prev) + s L(z) inside the margin, rows shared by threads."""
        cuts = self._cuts[margin]
        j0, j1 = self._j0 + margin, self._j1 - margin

        def band(k: int) -> None:
            self._sweeper(
                self._z, self._prev, cuts[k], cuts[k + 1], j0, j1, np.float32(q), np.float32(s),
                self._rows[k],
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

    def _sweep_slowly(self, m: float, r: float, timestep: float) -> None:
        """The same step for the absorbing margin, or everywhere for the stencil as printed."""
        i1, j0, j1, margin = self._i1, self._j0, self._j1, self._margin
        frame = [
            (1, 1 + margin, j0, j1),
            (i1 - margin, i1, j0, j1),
            (1 + margin, i1 - margin, j0, j0 + margin),
            (1 + margin, i1 - margin, j1 - margin, j1),
        ]
        printed = self.stencil == "paper_eq8"
        edge, corner = WEIGHTS[self.stencil]
        friction = np.float32(0.5 * timestep)
        for rows in [(1, i1, j0, j1)] if printed else frame:
            kernels.step_sponge(
                self._z, self._prev, *rows, np.float32(m), np.float32(r),
                np.float32(edge), np.float32(corner),
                friction * self._sponge[0], friction * self._sponge[1],
            )  # fmt: skip
        if printed:
            # The printed centre weight, -4/(mu t + 2) - 10/3 xi, less the one the kernel used.
            cells = np.s_[1:i1, j0:j1]
            excess = -4.0 / (1.0 + m) + 2.0 / 3.0 * r / (1.0 + m)
            self._prev[cells] += np.float32(excess) * self._z[cells]
