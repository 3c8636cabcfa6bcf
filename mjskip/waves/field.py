"""The water surface: Lee & Baek's damped wave equation on a grid, driven by loads."""

import math
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from mjskip.waves import _wave_kernels as kernels
from mjskip.waves._grid import (
    checked_finite,
    checked_height,
    checked_load,
    checked_name,
    checked_number,
    checked_shape,
    positions,
)
from mjskip.waves._stencil import (
    BOUNDARIES,
    COURANT_LIMITS,
    SMALLEST_STEP,
    STENCILS,
    Boundary,
    Stencil,
    checked_step,
    paper_limit,
    reach_of,
    steps_for,
)
from mjskip.waves.dense import DenseWater, FloatArray, Head, SurfaceArray, round_head


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

    Steps of one size are best: each change costs four more sweeps, takes a little speed from waves
    shorter than some 12 cells (see `_stencil.calming`), and rounds speeds to the elevation's last
    bit over the smaller step.

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
        land: npt.ArrayLike | None = None,
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
            land: `shape`, True where an island or a pier leaves no water; waves reflect off it.
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

        self.land = None if land is None else np.array(land, np.bool_)
        if self.land is not None and self.land.shape != self.shape:
            raise ValueError(f"land has shape {self.land.shape}: give the field's, {self.shape}")
        if self.land is not None and self.land.all():
            raise ValueError("land covers every cell: leave some water")
        if self.land is not None and self.stencil == "paper_eq8":
            raise ValueError("stencil paper_eq8 knows no land: use nine_point or five_point")

        self._water = DenseWater(
            self.shape, self.wave_speed / self.spacing, self.damping, self.stencil, self.boundary,
            land=self.land, threads=threads,
        )  # fmt: skip
        self._loads: list[Head] = []
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
        return self._water.cells(self._water.z)

    @property
    def velocity(self) -> SurfaceArray:
        """(nx, ny) vertical speed [m/s] from the last two levels: half a step behind, a copy."""
        water = self._water
        if water.last_timestep == 0.0:
            return np.zeros(self.shape, np.float32)
        difference = water.cells(water.z) - water.cells(water.prev)
        return difference / np.float32(water.last_timestep)

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
        water = self._water
        kernels.sample_points(
            water.z, water.prev, water.i1, water.j0, water.j1, water.code, at,
            self.spacing, water.last_timestep, out,
        )  # fmt: skip
        return SurfaceSample(elevation=out[:, 0], slope=out[:, 1:3], vertical_speed=out[:, 3])

    def window(
        self, x: float, y: float, shape: tuple[int, int]
    ) -> tuple[SurfaceArray, FloatArray, FloatArray]:
        """A copy of the elevation around a point, still water outside the field.

        Args:
            x, y: middle [m], rounded to whole cells.
            shape: cells along x and y.

        Returns:
            Elevation (nx, ny) [m] and the positions of its cells along x (nx,) and y (ny,) [m].
        """
        first = [
            round((at - float(cells[0])) / self.spacing - (n - 1) / 2)
            for at, cells, n in zip((x, y), (self.x, self.y), shape, strict=True)
        ]
        block = np.zeros(shape, np.float32)
        there, here = (
            tuple(
                slice(max(i, 0) - shift, max(min(i + n, size) - shift, 0))
                for i, n, size, shift in zip(first, shape, self.shape, shifts, strict=True)
            )
            for shifts in ((0, 0), first)
        )
        block[here] = self.elevation[there]
        places = [
            np.asarray(cells[0] + (i + np.arange(n)) * self.spacing, np.float64)
            for cells, i, n in zip((self.x, self.y), first, shape, strict=True)
        ]
        return block, places[0], places[1]

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
        head_volume = checked_load(
            x, y, force=force, radius=radius, density=density, gravity=gravity, spacing=self.spacing
        )
        reach = reach_of(radius, self.spacing)
        at_x, at_y = (float(at[0]) for at in self._in_cells(np.array([x]), np.array([y])))
        nx, ny = self._water.i1 - 1, self._water.j1 - self._water.j0
        if self.boundary == "periodic":
            at_x, at_y = at_x % nx, at_y % ny
        if force != 0.0 and -reach < at_x < nx - 1 + reach and -reach < at_y < ny - 1 + reach:
            first = 1, self._water.j0
            self._loads.append(round_head((at_x, at_y), reach, head_volume, first=first))

    def displace(self, x: float, y: float, *, height: float, radius: float) -> None:
        """Raise the surface by a smooth round bump, leaving its vertical speed as it is.

        Args:
            x, y: centre [m].
            height: at the centre [m]; negative makes a hollow.
            radius: R of the profile (1 - r^2 / 2R^2)^2 [m], taken as at least 1.5 cells.

        Raises:
            ValueError: an argument is not finite, or radius is not positive.
        """
        checked_finite("m", x=x, y=y)
        checked_height(height)
        checked_number("radius", radius, "m", positive=True)
        reach = reach_of(radius, self.spacing)
        east, north = (self.x[:, None] - x) / self.spacing, (self.y[None, :] - y) / self.spacing
        profile = np.maximum(1.0 - (east**2 + north**2) / reach**2, 0.0) ** 2
        bump = (height * profile).astype(np.float32)
        if self.land is not None:
            bump[self.land] = 0.0
        self._water.cells(self._water.z)[...] += bump
        self._water.cells(self._water.prev)[...] += bump

    def set(self, elevation: npt.ArrayLike, vertical_speed: npt.ArrayLike = 0.0) -> None:
        """Replace the surface.

        Args:
            elevation: (nx, ny), or what broadcasts to it [m].
            vertical_speed: the same [m/s].

        Raises:
            ValueError: a value is not finite, or a shape does not fit.
        """
        z = np.broadcast_to(np.asarray(elevation, np.float32), self.shape)
        v = np.broadcast_to(np.asarray(vertical_speed, np.float32), self.shape)
        if not (np.isfinite(z).all() and np.isfinite(v).all()):
            raise ValueError("the elevation or vertical speed holds a value that is not finite")
        water = self._water
        water.reset()
        water.cells(water.z)[...] = z if self.land is None else np.where(self.land, 0.0, z)
        timestep = 0.5 * self.max_timestep
        water.start(timestep)
        back = np.float32(timestep + 0.5 * self.damping * timestep**2) * v
        water.cells(water.prev)[...] -= back if self.land is None else np.where(self.land, 0, back)

    def reset(self) -> None:
        """Still water at time 0, no loads."""
        self._water.reset()
        self._loads.clear()
        self.time = 0.0

    # Time ---------------------------------------------------------------------------------------

    def step(self, timestep: float) -> None:
        """Advance by one step [s].

        Raises:
            ValueError: the step is not a positive number, larger than `max_timestep`, or lost in rounding.
        """
        limit = self.max_timestep
        if not SMALLEST_STEP * limit <= timestep <= limit:
            checked_step(timestep, limit, self.paper_max_timestep)
        self._step(timestep)
        self._loads.clear()

    def advance(self, duration: float) -> int:
        """Advance by a duration [s] in equal stable steps, loads acting through all of them.

        Returns:
            Number of steps made.

        Raises:
            ValueError: the duration is negative, not finite, or more than ten thousand million steps.
        """
        steps = steps_for(duration, self.max_timestep)
        begun, left = self.time, steps
        while left:
            left -= self._water.steps(duration / steps, left, self._loads)
            self.time = begun + duration * (1.0 - left / steps)
        if steps:
            self._loads.clear()
        return steps

    def _step(self, timestep: float) -> None:
        self._water.step(timestep, self._loads)
        self.time += timestep

    def _in_cells(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions in cells, (0, 0) being the first stored cell."""
        return (
            (x - self.x[0]) / self.spacing + self._water.margin,
            (y - self.y[0]) / self.spacing + self._water.margin,
        )

    # Files --------------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write settings and state to a NumPy archive; `load` goes on from there to the last bit.

        Loads that wait for the next step are not kept.
        """
        settings = {
            "shape": self.shape,
            "spacing": self.spacing,
            "wave_speed": self.wave_speed,
            "damping": self.damping,
            "stencil": self.stencil,
            "boundary": self.boundary,
            "centre": self.centre,
        }
        water = self._water
        state = {"z": water.z, "prev": water.prev, "last_timestep": water.last_timestep}
        land = {} if self.land is None else {"land": self.land}
        with Path(path).open("wb") as file:
            np.savez(file, **settings, **state, **land, time=self.time)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> "HeightField":
        """Read what `save` wrote.

        Raises:
            ValueError: the file is not there or is no water surface.
        """
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
                stored = {name: archive[name] for name in archive.files}
            field = cls(
                tuple(stored["shape"].tolist()), float(stored["spacing"]),
                float(stored["wave_speed"]), float(stored["damping"]), str(stored["stencil"]),  # type: ignore[arg-type]
                str(stored["boundary"]), centre=tuple(stored["centre"].tolist()),  # type: ignore[arg-type]
                land=stored.get("land"),
            )  # fmt: skip
            field._water.z[...] = stored["z"]
            field._water.prev[...] = stored["prev"]
            field._water.last_timestep = float(stored["last_timestep"])
            field.time = float(stored["time"])
        except (OSError, KeyError, TypeError, ValueError, EOFError, BadZipFile) as problem:
            raise ValueError(
                f"{path} holds no water surface ({problem}): give a file that HeightField.save wrote"
            ) from problem
        return field
