"""The water surface: Lee & Baek's damped wave equation on a grid, driven by loads."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags, PathLike, SingleArray
from mjskip.checks import (
    check_array,
    check_choice,
    check_count,
    check_memory,
    check_number,
    check_positive,
    check_vector,
    fault,
)
from mjskip.files import reading, whole_file
from mjskip.waves import _block_kernels as kernels
from mjskip.waves._cells import CellBlocks, TerrainMask, checked_shape
from mjskip.waves._stencil import (
    BOUNDARIES,
    COURANT_LIMITS,
    MARGIN,
    STENCILS,
    Boundary,
    Stencil,
    checked_step,
    is_ordinary_step,
    paper_limit,
    steps_for,
)
from mjskip.waves.grid import Block, WaveGrid

MAX_THREADS = 1024

LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True, kw_only=True)
class SurfaceSample:
    """The surface at n points.

    Attributes:
        elevation: (n,) above still water [m].
        slope: (n, 2) dz/dx and dz/dy.
        vertical_speed: (n,) of the surface [m/s], half a step behind the elevation.
    """

    elevation: Array
    slope: Array
    vertical_speed: Array


class HeightField(CellBlocks):
    """Elevation of water under z_tt = c^2 lap(z + p / (rho g)) - mu z_t: a rectangle of it, or endless.

    Rings from a 20 N push that lasts a hundredth of a second::

        water = HeightField()
        water.press(0.0, 0.0, force=20.0, radius=0.05)
        water.advance(0.01)
        water.advance(1.5)
        rings = water.elevation

    Steps of one size are best: each change costs four more sweeps, takes a little speed from waves
    of few cells (a thousandth of the energy at 24 cells a wave, 40% at 4), and rounds speeds to the
    elevation's last bit over the smaller step.

    With a `sleep_amplitude` only tiles of 64 x 64 cells that move are stored and stepped: from the moment a
    neighbour's wave above that amplitude reaches their rim, or a load does, until both of their last levels
    are within half of it. Water that is not stored is still, and swallows or reflects waves below the
    amplitude: what flows into it is gone, as much as the amplitude over the area that moves, and `lost_volume`
    says how much went with tiles that were given up.

    The water starts still. Cell (i, j) is at `x[i]`, `y[j]`; the walls are half a cell beyond the
    outermost cells. Source: equations (5)-(9) of the paper with its slips repaired.

    Attributes:
        shape: cells along x and y; None if endless.
        spacing, wave_speed, damping, stencil, centre, sleep_amplitude: as given.
        boundary: "reflect", "absorb" or "periodic" as given; "endless".
        grid: the cells and how they are stepped.
        time: simulated time [s].
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
        terrain_mask: npt.ArrayLike | TerrainMask | None = None,
        sleep_amplitude: float = 0.0,
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
            terrain_mask: `shape`, True where an island or a pier leaves no water, or a function of the cells'
                x (nx,) and y (ny,) [m] that returns it; waves reflect off it.
            sleep_amplitude: waves below it are let go [m]; 0 to step all cells always.
            threads: how many share a step; None picks by size. The result does not depend on it.

        Raises:
            ValueError: an argument is out of range, or the grid does not fit into memory.
        """
        self.shape: tuple[int, int] | None = checked_shape(shape)
        self.stencil: Stencil = check_choice("stencil", stencil, STENCILS)
        self.boundary: str = check_choice("boundary", boundary, BOUNDARIES)
        if threads is not None:
            threads = check_count("threads", threads, high=MAX_THREADS)
        self._describe(spacing, wave_speed, damping, centre, sleep_amplitude)
        if boundary == "absorb" and self.sleep_amplitude > 0.0:
            raise ValueError(
                "an absorbing field does not sleep: leave sleep_amplitude at 0, or use HeightField.endless()"
            )
        self.terrain_mask: Flags | TerrainMask | None = None
        if terrain_mask is not None:
            self.terrain_mask = self._checked_mask(terrain_mask)
        self._make_grid(threads)

    @classmethod
    def endless(
        cls,
        *,
        spacing: float = 0.02,
        wave_speed: float = 1.0,
        damping: float = 0.2,
        centre: tuple[float, float] = (0.0, 0.0),
        terrain_mask: TerrainMask | None = None,
        sleep_amplitude: float = 1e-5,
    ) -> HeightField:
        """Make still water without an end: only what moves is stored, and all verbs are those of a rectangle.

        `elevation`, `velocity`, `x` and `y` are those of the rectangle about all that moves; `set` puts an array
        about the centre.

        Args:
            spacing, wave_speed, damping, sleep_amplitude: as of `HeightField`.
            centre: (x, y) of the middle of cell (0, 0) [m].
            terrain_mask: whether cells at x (nx,) and y (ny,) [m] are land: (nx, ny).

        Raises:
            ValueError: an argument is out of range.
        """
        field = cls.__new__(cls)
        field.shape, field.stencil, field.boundary = None, "nine_point", "endless"
        field._describe(spacing, wave_speed, damping, centre, sleep_amplitude)
        if terrain_mask is not None and not callable(terrain_mask):
            raise ValueError(
                "terrain_mask of endless water must tell of any cells: give a function of x (n,) and y (m,) that "
                "returns (n, m)"
            )
        field.terrain_mask = terrain_mask
        field._make_grid(None)
        return field

    def _describe(
        self, spacing: float, wave_speed: float, damping: float, centre: tuple[float, float],
        sleep_amplitude: float,
    ) -> None:  # fmt: skip
        check_positive(spacing=spacing, wave_speed=wave_speed)
        self.spacing, self.wave_speed = float(spacing), float(wave_speed)
        self.damping = check_number("damping", damping, low=0.0, unit="1/s")
        x, y = check_vector("centre", centre, 2).tolist()
        self.centre: tuple[float, float] = (x, y)
        self.sleep_amplitude = check_number("sleep_amplitude", sleep_amplitude, low=0.0, unit="m")

    def _checked_mask(self, given: npt.ArrayLike | TerrainMask) -> Flags:
        assert self.shape is not None
        try:
            mask = np.array(given(self.x, self.y) if callable(given) else given, np.bool_)
        except TypeError as error:
            raise fault(
                "terrain_mask",
                given,
                "give an array, or a function of x (nx,) and y (ny,) that returns it",
            ) from error
        if mask.shape != self.shape:
            raise ValueError(f"terrain_mask has shape {mask.shape}: give the field's, {self.shape}")
        if mask.all():
            raise ValueError("terrain_mask covers every cell: leave some water")
        if self.stencil == "paper_eq8":
            raise ValueError("stencil paper_eq8 knows no terrain: use nine_point or five_point")
        return mask

    def _make_grid(self, threads: int | None) -> None:
        self._threads = threads
        self._margin = MARGIN if self.boundary == "absorb" else 0
        self.grid = WaveGrid(
            self.shape, self.wave_speed / self.spacing, self.damping, stencil=self.stencil,
            absorbing=self.boundary == "absorb", periodic=self.boundary == "periodic",
            sleep_amplitude=self.sleep_amplitude, threads=threads,
            terrain=None if self.terrain_mask is None else self._is_land,
        )  # fmt: skip
        self._loads: list[Block] = []
        self.time = 0.0

    # What the water is like ---------------------------------------------------------------------

    @property
    def x(self) -> Array:
        """(nx,) positions of the cells along x [m]."""
        (i, _), (nx, _) = self._extent()
        return self._positions(0, i, nx)

    @property
    def y(self) -> Array:
        """(ny,) positions of the cells along y [m]."""
        (_, j), (_, ny) = self._extent()
        return self._positions(1, j, ny)

    @property
    def elevation(self) -> SingleArray:
        """(nx, ny) [m], not to be written to: ask again after a step; `set` changes it."""
        return self._whole(0)

    @property
    def velocity(self) -> SingleArray:
        """(nx, ny) vertical speed [m/s] from the last two levels: half a step behind."""
        if self.grid.last_timestep == 0.0:
            return np.zeros(self._extent()[1], np.float32)
        return (self._whole(0) - self._whole(1)) / np.float32(self.grid.last_timestep)

    @property
    def max_timestep(self) -> float:
        """Largest stable step [s] for any damping: c t / d <= sqrt(3)/2, five-point 1/sqrt(2)."""
        return COURANT_LIMITS[self.stencil] * self.spacing / self.wave_speed

    @property
    def paper_max_timestep(self) -> float:
        """What equation (9), c < (d / 2t) sqrt(mu t + 2), would allow [s]: too much if mu > 0."""
        return paper_limit(self.spacing, self.wave_speed, self.damping)

    @property
    def active_tiles(self) -> int:
        """Tiles stored and stepped now."""
        return self.grid.active_tiles

    @property
    def memory(self) -> int:
        """Bytes that hold the water now."""
        return self.grid.memory

    @property
    def lost_volume(self) -> float:
        """Water that went with tiles that were given up [m^3]."""
        return float(self.grid.tiles.lost[0]) * self.spacing**2

    @property
    def highest(self) -> float:
        """Greatest |elevation| of all cells [m]."""
        return float(np.abs(self.grid.z).max(initial=0.0))

    def volume(self) -> float:
        """Water above the still level minus water missing below it [m^3]."""
        cells = self._whole(0) if self._margin else self.grid.z
        return float(cells.sum(dtype=np.float64)) * self.spacing**2

    def sample(self, x: npt.ArrayLike, y: npt.ArrayLike) -> SurfaceSample:
        """Surface at points, bilinear; outside walls the water is still.

        Args:
            x, y: (n,) or scalars [m].

        Raises:
            ValueError: a coordinate is no finite number.
        """
        points_x, points_y = np.broadcast_arrays(
            np.atleast_1d(check_array("x", x)), np.atleast_1d(check_array("y", y))
        )
        at = np.column_stack(self._in_cells(points_x.ravel(), points_y.ravel()))
        out = np.empty((len(at), 4))
        kernels.sample_points(
            self.grid.tiles, 1 if self._margin else 0, at, self.spacing,
            self.grid.last_timestep, out,
        )  # fmt: skip
        return SurfaceSample(elevation=out[:, 0], slope=out[:, 1:3], vertical_speed=out[:, 3])

    def window(
        self, x: float, y: float, shape: tuple[int, int]
    ) -> tuple[SingleArray, Array, Array]:
        """A copy of the elevation around a point, still water outside the walls.

        Args:
            x, y: middle [m], rounded to whole cells.
            shape: cells along x and y.

        Returns:
            Elevation (nx, ny) [m] and the positions of its cells along x (nx,) and y (ny,) [m].
        """
        x, y = check_number("x", x, unit="m"), check_number("y", y, unit="m")
        shape = checked_shape(shape, low=1)
        check_memory(
            f"a window of {shape[0]} x {shape[1]} cells", 16.0 * math.prod(shape), "give fewer"
        )
        places = self._in_cells(x, y)
        i, j = (
            self._whole_cell(float(p) - (n - 1) / 2) - self._margin
            for p, n in zip(places, shape, strict=True)
        )
        block = self._read((i, j), shape)[0]
        if self._margin and self.shape is not None:  # what is there is no part of the field
            for axis, (first, n) in enumerate(zip((i, j), self.shape, strict=True)):
                cells = first + np.arange(shape[axis])
                np.moveaxis(block, axis, 0)[(cells < 0) | (cells >= n)] = 0.0
        return block, self._positions(0, i, shape[0]), self._positions(1, j, shape[1])

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
        the second moment of a uniform disc of radius R. Parts outside walls are dropped.

        Args:
            x, y: centre [m].
            force: total, downward [N]; negative lifts.
            radius: R [m], taken as at least 1.5 cells.
            density: of the water [kg/m^3].
            gravity: [m/s^2].

        Raises:
            ValueError: an argument is not finite, or radius, density or gravity is not positive.
        """
        force = check_number("force", force, unit="N")
        check_positive(radius=radius, density=density, gravity=gravity)
        volume = force / (density * gravity * self.spacing**2)
        if not abs(volume) <= LARGEST:
            raise fault("force", force, "that is more than single precision holds on this water")
        block = self._round_block(x, y, radius)
        if block is not None and force != 0.0:
            head, i, j, centre, reach = block
            kernels.fill_round_head(head, *centre, reach, volume)
            self._loads.append((head, i, j))

    def displace(self, x: float, y: float, *, height: float, radius: float) -> None:
        """Raise the surface by a smooth round bump, leaving its vertical speed as it is.

        Args:
            x, y: centre [m].
            height: at the centre [m]; negative makes a hollow.
            radius: R of the profile (1 - r^2 / 2R^2)^2 [m], taken as at least 1.5 cells.

        Raises:
            ValueError: an argument is not finite, or radius is not positive.
        """
        height = check_number("height", height, unit="m")
        if abs(height) > LARGEST:
            raise fault("height", height, "give a number that single precision holds [m]")
        check_positive(radius=radius)
        block = self._round_block(x, y, radius)
        if block is None:
            return
        bump, i, j, _, reach = block
        margin = self._margin
        at_x = self._positions(0, i - margin, bump.shape[0])
        at_y = self._positions(1, j - margin, bump.shape[1])
        east, north = (at_x[:, None] - x) / self.spacing, (at_y[None, :] - y) / self.spacing
        profile = np.maximum(1.0 - (east**2 + north**2) / reach**2, 0.0) ** 2
        self._raise((height * profile).astype(np.float32), (i, j))

    def set(self, elevation: npt.ArrayLike, vertical_speed: npt.ArrayLike = 0.0) -> None:
        """Replace the surface.

        Args:
            elevation: (nx, ny), or what broadcasts to it [m]; of endless water any array, put about the centre,
                with still water around it.
            vertical_speed: the same [m/s].

        Raises:
            ValueError: a value is no finite number, or a shape does not fit.
        """
        z, v = check_array("elevation", elevation), check_array("vertical_speed", vertical_speed)
        shape = self.shape or z.shape
        if len(shape) != 2:
            raise fault("elevation", elevation, "give an array (nx, ny) for endless water")
        z, v = np.broadcast_to(z, shape), np.broadcast_to(v, shape)
        first = (self._margin,) * 2 if self.shape else tuple(round(-(n - 1) / 2) for n in shape)
        self.grid.reset()
        self._raise(z.astype(np.float32), (first[0], first[1]), inside=True)
        timestep = 0.5 * self.max_timestep
        self.grid.start(timestep)
        back = np.float32(timestep + 0.5 * self.damping * timestep**2) * v.astype(np.float32)
        self._raise(None, (first[0], first[1]), before=-back, inside=True)
        self.grid.activate_called()

    def still_copy(self) -> HeightField:
        """Still water of the same cells, terrain and waves, at time 0."""
        field = copy.copy(self)
        field._make_grid(self._threads)
        return field

    def reset(self) -> None:
        """Still water at time 0, no loads."""
        self.grid.reset()
        self._loads.clear()
        self.time = 0.0

    # Time ---------------------------------------------------------------------------------------

    def step(self, timestep: float) -> None:
        """Advance by one step.

        Args:
            timestep: of the step [s].

        Raises:
            ValueError: the step is not a positive number, larger than `max_timestep`, or lost in rounding.
            MjskipError: the tiles that move no longer fit into memory.
        """
        if not (isinstance(timestep, float) and is_ordinary_step(timestep, self.max_timestep)):
            checked_step(timestep, self.max_timestep, self.paper_max_timestep)
        self.grid.step(timestep, self._loads)
        self.time += timestep
        self._loads.clear()

    def advance(self, duration: float) -> int:
        """Advance in equal stable steps, loads acting through all of them.

        Args:
            duration: [s].

        Returns:
            Number of steps made.

        Raises:
            ValueError: the duration is negative, not finite, or more than ten thousand million steps.
            MjskipError: the tiles that move no longer fit into memory.
        """
        duration = check_number("duration", duration, low=0.0, unit="s")
        steps = steps_for(duration, self.max_timestep)
        begun, left = self.time, steps
        while left:
            left -= self.grid.steps(duration / steps, left, self._loads)
            self.time = begun + duration * (1.0 - left / steps)
        if steps:
            self._loads.clear()
        return steps

    # Files --------------------------------------------------------------------------------------

    def save(self, path: PathLike) -> None:
        """Write settings and state to a NumPy archive; `load` goes on from there to the last bit.

        Loads that wait for the next step are not kept, nor is a terrain mask that is a function.

        Args:
            path: the file; it appears whole or not at all.

        Raises:
            MjskipError: the folder does not exist or cannot be written to, or the disk is full.
        """
        names = (
            "spacing",
            "wave_speed",
            "damping",
            "stencil",
            "boundary",
            "centre",
            "sleep_amplitude",
            "time",
        )
        settings = {name: getattr(self, name) for name in names}
        mask = self.terrain_mask
        if mask is not None:
            settings["terrain_mask"] = np.empty(0) if callable(mask) else mask
        with whole_file(path) as part, part.open("wb") as file:
            np.savez(file, shape=self.shape or (), **settings, **self.grid.state())  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: PathLike, *, terrain_mask: TerrainMask | None = None) -> HeightField:
        """Read what `save` wrote.

        Args:
            path: the file.
            terrain_mask: the function that the water was made with, if it was one.

        Raises:
            MjskipError: the file is not there or is no water surface.
        """
        with reading(path, what="a water surface", writer="HeightField.save"):
            # opened here: np.load leaves a file open that is no archive
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
                stored = {name: archive[name] for name in archive.files}
            numbers: dict[str, Any] = {
                name: float(stored[name])
                for name in ("spacing", "wave_speed", "damping", "sleep_amplitude")
            }
            centre = tuple(stored["centre"].tolist())
            mask = stored.get("terrain_mask")
            if mask is not None and mask.shape == (0,) and terrain_mask is None:
                raise ValueError("its terrain_mask was a function: give it to load() again")
            if not stored["shape"].size:
                field = cls.endless(**numbers, centre=centre, terrain_mask=terrain_mask)
            else:
                field = cls(
                    tuple(stored["shape"].tolist()), **numbers, centre=centre,
                    stencil=str(stored["stencil"]), boundary=str(stored["boundary"]),  # type: ignore[arg-type]
                    terrain_mask=mask,
                )  # fmt: skip
            field.grid.restore(stored)
            field.time = float(stored["time"])
        return field
