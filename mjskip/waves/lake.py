"""The tiled lake: the verbs of `HeightField` over water that is stored only where it moves."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from mjskip.waves import _lake_kernels as tiles
from mjskip.waves import _wave_kernels as kernels
from mjskip.waves._grid import (
    checked_finite,
    checked_height,
    checked_load,
    checked_number,
    checked_shape,
)
from mjskip.waves._stencil import (
    COURANT_LIMITS,
    checked_step,
    paper_limit,
    reach_of,
    steps_for,
)
from mjskip.waves.dense import FloatArray, Head, SurfaceArray, round_head
from mjskip.waves.field import SurfaceSample
from mjskip.waves.tiled import TILE, Shore, TiledWater


class Lake:
    """Water of any extent, endless by default, with the verbs of `HeightField`.

    Still water costs nothing: a tile of 64 x 64 cells is stored from the moment a neighbour's wave
    above `sleep_amplitude` reaches its rim, or a load does, until both of its last levels are within
    half that amplitude. Nine-point stencil, the same arithmetic as `HeightField`; with
    `sleep_amplitude=0` the elevation is that of one large grid, bit for bit. Otherwise sleeping
    water reflects or swallows waves below that amplitude: what flows into it is gone, as much as that
    amplitude over the area that is awake, and `lost_volume` says how much went with tiles that fell asleep.

    Attributes:
        shape: cells inside walls; None if there are none.
        period: cells after which a periodic lake is itself again, or None.
        spacing, wave_speed, damping, sleep_amplitude: as given.
        origin: (x, y) of cell (0, 0) [m].
        water: the tiles.
    """

    def __init__(
        self,
        shape: tuple[int, int] | None = None,
        spacing: float = 0.02,
        wave_speed: float = 1.0,
        damping: float = 0.2,
        *,
        centre: tuple[float, float] = (0.0, 0.0),
        periodic: bool = False,
        sleep_amplitude: float = 1e-5,
        land: Callable[[FloatArray, FloatArray], npt.NDArray[np.bool_]] | None = None,
    ) -> None:
        """Make still water.

        Args:
            shape: cells along x and y inside reflecting walls, multiples of 64; None is endless.
            spacing: d, side of a cell [m].
            wave_speed: c [m/s].
            damping: mu [1/s].
            centre: (x, y) of the middle; of cell (0, 0) if the lake is endless [m].
            periodic: no walls: what leaves `shape` on one side comes in on the other, stones too.
            sleep_amplitude: waves below it are let go [m].
            land: tells of cells at x (n,) and y (m,) [m] whether they are land (n, m); waves reflect off it.

        Raises:
            ValueError: an argument is out of range, or land covers everything inside the walls.
        """
        size = None if shape is None else checked_shape(shape)
        if size is not None and any(n % TILE for n in size):
            near = tuple(max(1, round(n / TILE)) * TILE for n in size)
            raise ValueError(
                f"shape is {size!r}: a lake is made of tiles of {TILE} cells; use {near!r}"
            )
        if land is not None and not callable(land):
            raise ValueError(
                "land must tell of any cells: give a function of x (n,) and y (m,) that returns (n, m), such as "
                "mjskip.obstacles.Land(model)"
            )
        if periodic and size is None:
            raise ValueError("an endless lake cannot be periodic: give a shape")
        self.shape = None if periodic else size
        self.period = size if periodic else None
        self.spacing = checked_number("spacing", spacing, "m", positive=True)
        self.wave_speed = checked_number("wave_speed", wave_speed, "m/s", positive=True)
        self.damping = checked_number("damping", damping, "1/s")
        self.sleep_amplitude = checked_number("sleep_amplitude", sleep_amplitude, "m")
        checked_finite("m", centre_x=centre[0], centre_y=centre[1])
        nx, ny = size or (1, 1)
        self.origin = (
            centre[0] - (nx - 1) / 2 * self.spacing,
            centre[1] - (ny - 1) / 2 * self.spacing,
        )
        shore = None if land is None else Shore(self._land_in_cells(land), self.shape)
        self._flood(shore)
        self.reset()

    def _land_in_cells(
        self, land: Callable[[FloatArray, FloatArray], npt.NDArray[np.bool_]]
    ) -> Callable[[int, int, int], npt.NDArray[np.bool_]]:
        """The same by cells: of a square of them."""

        size = self.shape or self.period

        def positions(first: int, count: int, axis: int) -> FloatArray:
            cells = first + np.arange(count)
            cells = cells % self.period[axis] if self.period else cells
            return np.asarray(self.origin[axis] + cells * self.spacing, np.float64)

        if size and land(positions(0, size[0], 0), positions(0, size[1], 1)).all():
            raise ValueError("land covers every cell: leave some water")
        return lambda i, j, side: land(positions(i, side, 0), positions(j, side, 1))

    def _flood(self, shore: Shore | None) -> None:
        """Fill with water."""
        period = (self.period[0] // TILE, self.period[1] // TILE) if self.period else None
        self.water = TiledWater(
            self.shape, self.wave_speed / self.spacing, self.damping, self.sleep_amplitude, shore,
            period,
        )  # fmt: skip
        self._bent = np.empty((0, 0))

    # What the water is like ---------------------------------------------------------------------

    @property
    def max_timestep(self) -> float:
        """Largest stable step [s]."""
        return COURANT_LIMITS["nine_point"] * self.spacing / self.wave_speed

    @property
    def awake_tiles(self) -> int:
        """Tiles stored and stepped now."""
        return self.water.used - 1

    @property
    def memory(self) -> int:
        """Bytes that hold the water now."""
        return self.water.memory

    @property
    def lost_volume(self) -> float:
        """Water that went with tiles that fell asleep [m^3]."""
        return self.water.lost * self.spacing**2

    def volume(self) -> float:
        """Water above the still level minus water missing below it [m^3]."""
        return float(self.water.z[1 : self.water.used].sum(dtype=np.float64)) * self.spacing**2

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is inside the walls."""
        if self.shape is None:
            return True
        at = self.cell_at(x, y)
        return all(-0.5 <= p <= n - 0.5 for p, n in zip(at, self.shape, strict=True))

    def window(
        self, x: float, y: float, shape: tuple[int, int]
    ) -> tuple[SurfaceArray, FloatArray, FloatArray]:
        """A copy of the elevation around a point, still water where tiles sleep or there are none.

        Args:
            x, y: middle [m].
            shape: cells along x and y.

        Returns:
            Elevation (nx, ny) [m] and the positions of its cells along x (nx,) and y (ny,) [m].
        """
        i, j = (
            round((at - origin) / self.spacing - (n - 1) / 2)
            for at, origin, n in zip((x, y), self.origin, shape, strict=True)
        )
        places = [
            np.asarray(origin + (first + np.arange(n)) * self.spacing, np.float64)
            for origin, first, n in zip(self.origin, (i, j), shape, strict=True)
        ]
        return self.water.copy(self.water.z, i, j, shape), places[0], places[1]

    def sample(self, x: npt.ArrayLike, y: npt.ArrayLike) -> SurfaceSample:
        """Surface at points, bilinear; outside the lake the water is still.

        Args:
            x, y: (n,) or scalars [m].
        """
        columns = np.broadcast_arrays(
            np.atleast_1d(np.asarray(x, np.float64)), np.atleast_1d(np.asarray(y, np.float64))
        )
        at = (np.column_stack([c.ravel() for c in columns]) - self.origin) / self.spacing
        out = np.zeros((len(at), 4))
        nowhere = ~np.isfinite(at).all(axis=1)
        at[nowhere] = 0.0
        home = np.floor_divide(at, TILE).astype(np.int64)
        home = (home[:, 0] << 32) + home[:, 1]
        for name in np.unique(home):
            points = np.flatnonzero(home == name)
            # The cells around the points and one more for slopes; a wall mirrors, so it ends there.
            box = np.floor([at[points].min(axis=0) - 1, at[points].max(axis=0) + 3]).astype(int)
            (i0, i1), (j0, j1) = (
                (max(low, 0), min(high, n)) if n else (low, high)
                for low, high, n in zip(*box.tolist(), self.shape or (0, 0), strict=True)
            )
            if i1 <= i0 or j1 <= j0:
                continue
            z, prev = (
                self.water.copy(pool, i0 - 1, j0 - 1, (i1 - i0 + 2, j1 - j0 + 2))
                for pool in (self.water.z, self.water.prev)
            )
            local = np.empty((len(points), 4))
            kernels.sample_points(
                z, prev, i1 - i0 + 1, 1, j1 - j0 + 1, kernels.REFLECT, at[points] - (i0, j0),
                self.spacing, self.water.last_timestep, local,
            )  # fmt: skip
            out[points] = local
        out[nowhere] = 0.0
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
        """Load the surface through the next `step` or `advance`: see `HeightField.press`."""
        head_volume = checked_load(
            x, y, force=force, radius=radius, density=density, gravity=gravity, spacing=self.spacing
        )
        head = self.head(x, y, radius=radius, volume=head_volume)
        if head is not None and force != 0.0:
            self._loads.append(head)

    def displace(self, x: float, y: float, *, height: float, radius: float) -> None:
        """Raise the surface by a smooth round bump: see `HeightField.displace`."""
        checked_finite("m", x=x, y=y)
        checked_height(height)
        checked_number("radius", radius, "m", positive=True)
        reach = reach_of(radius, self.spacing)
        at = self.cell_at(x, y)
        span = [np.arange(math.ceil(p - reach), math.floor(p + reach) + 1) for p in at]
        distance = (span[0][:, None] - at[0]) ** 2 + (span[1][None, :] - at[1]) ** 2
        bump = (height * np.maximum(1.0 - distance / reach**2, 0.0) ** 2).astype(np.float32)
        first = int(span[0][0]), int(span[1][0])
        wet = self.water.open_cells(*first, bump.shape)
        self.water.add(bump * wet if wet.size else bump, *first, both_levels=True)
        self.water.wake_neighbours()

    def reset(self) -> None:
        """Still water at time 0, no loads, no tiles."""
        self.water.reset()
        self._loads: list[Head] = []
        self.time = 0.0
        """Simulated time [s]."""

    # Two-way water ------------------------------------------------------------------------------

    def sibling(self) -> Lake:
        """Still water of the same cells, walls and waves: what both do adds up."""
        other = Lake(
            self.shape or self.period, self.spacing, self.wave_speed, self.damping,
            periodic=self.period is not None, sleep_amplitude=self.sleep_amplitude,
        )  # fmt: skip
        other.origin = self.origin
        other._flood(self.water.shore)
        return other

    def absorb(self, other: Lake) -> None:
        """Take the waves of a sibling that is at the same time, which is left still.

        Raises:
            ValueError: the other lake is this one, or none of its siblings.
        """
        alike = ("shape", "period", "spacing", "wave_speed", "damping", "origin")
        if other is self or any(getattr(other, name) != getattr(self, name) for name in alike):
            raise ValueError("only a lake's sibling() can be absorbed by it")
        mine, theirs = self.water, other.water
        if theirs.last_timestep > 0.0 and mine.last_timestep != theirs.last_timestep:
            mine.retime(theirs.last_timestep)
        for tile, slot in theirs.slots.items():
            here = mine.wake(tile)
            mine.z[here] += theirs.z[slot]
            mine.prev[here] += theirs.prev[slot]
        mine.lost += theirs.lost
        time = other.time
        other.reset()
        other.time = time
        mine.wake_neighbours()

    @property
    def highest(self) -> float:
        """Greatest |elevation| [m]."""
        return float(np.abs(self.water.z[1 : self.water.used]).max(initial=0.0))

    def stirs(self, i: int, j: int, side: int) -> bool:
        """Whether a tile under a square of cells is awake."""
        slots = self.water.slots
        if slots:
            (a, b), (c, d) = _tiles_under(i, j, (side, side))
            for p in range(a, c + 1):
                for q in range(b, d + 1):
                    if self.water.name_of((p, q)) in slots:
                        return True
        return False

    def cell_at(self, x: float, y: float) -> tuple[float, float]:
        """A point in cells [m]."""
        return (x - self.origin[0]) / self.spacing, (y - self.origin[1]) / self.spacing

    def place_of(self, i: int, j: int) -> tuple[float, float]:
        """Where a cell is [m]."""
        return self.origin[0] + i * self.spacing, self.origin[1] + j * self.spacing

    def add_to_patch(self, i: int, j: int, points: FloatArray) -> float:
        """Add elevation and vertical speed from cell (i, j) on to points (2, n, n).

        Returns:
            Greatest |elevation| of the sum so far [m].
        """
        n, water = points.shape[1], self.water
        slots = water.slots_under(*_tiles_under(i, j, (n, n)))
        rate = 1.0 / water.last_timestep if water.last_timestep > 0.0 else 0.0
        highest: float = tiles.add_to_patch(
            water.z, water.prev, slots, i % TILE, j % TILE, rate, points
        )
        return highest

    def head(self, x: float, y: float, *, radius: float, volume: float) -> Head | None:
        """A round head, (nx, ny) [m], of this volume [cells x m], and its first cell; see `press`.

        None if it is all outside.
        """
        reach = reach_of(radius, self.spacing)
        p, q = self.cell_at(x, y)
        if self.shape is not None and not (
            -reach < p < self.shape[0] - 1 + reach and -reach < q < self.shape[1] - 1 + reach
        ):
            return None
        return round_head((p, q), reach, volume)

    def work_under(self, head: Head) -> float:
        """Sum over a head's cells of the head times the last step's change of elevation [m^2]."""
        heights, i, j = head
        water = self.water
        slots = water.slots_under(*_tiles_under(i, j, heights.shape))
        work: float = tiles.work_under(water.z, water.prev, slots, i % TILE, j % TILE, heights)
        return work

    def press_after(
        self, head: Head, timestep: float, *, weight: float, elsewhere: float, loss: float
    ) -> tuple[float, float]:
        """Add to the last free step what a head does in it, cut down to what the stone lost.

        Args:
            head: what is pressed, and where.
            timestep: of that step [s].
            weight: of a head of a metre on a cell [N].
            elsewhere: sum over all other waters that moved of the head times the free change of
                elevation [m^2].
            loss: energy that the stone lost [J].

        Returns:
            Share that was pressed, and the energy the waves gained by it [J].
        """
        water, (heights, i, j) = self.water, head
        high, wide = heights.shape[0] + 2, heights.shape[1] + 2
        if high > self._bent.shape[0] or wide > self._bent.shape[1]:
            self._bent = np.empty((high, wide))
        # One cell further than it reaches, so that nobody there need be called.
        first, last = _tiles_under(i - 2, j - 2, (high + 2, wide + 2))
        slots = water.slots_under(first, last, wake=True)
        share, gained = tiles.press(
            water.z, water.prev, slots, first[0] * TILE, first[1] * TILE, i, j,
            *(self.shape or (0, 0)), heights,
            water.open_cells(i - 2, j - 2, (high + 2, wide + 2)), self._bent, *water.weights(timestep), weight,
            elsewhere, loss,
        )  # fmt: skip
        return share, gained

    # Time ---------------------------------------------------------------------------------------

    def step(self, timestep: float) -> None:
        """Advance by one step [s].

        Raises:
            ValueError: the step is not a positive number, larger than `max_timestep`, or lost in rounding.
            MjskipError: the tiles that are awake no longer fit into memory.
        """
        limit = self.max_timestep
        checked_step(timestep, limit, paper_limit(self.spacing, self.wave_speed, self.damping))
        self._step(timestep)
        self._loads.clear()

    def advance(self, duration: float) -> int:
        """Advance by a duration [s] in equal stable steps, loads acting through all of them.

        Returns:
            Number of steps made.
        """
        steps = steps_for(duration, self.max_timestep)
        for _ in range(steps):
            self._step(duration / steps)
        if steps:
            self._loads.clear()
        return steps

    def _step(self, timestep: float) -> None:
        self.water.step(timestep, self._loads)
        self.time += timestep


def _tiles_under(i: int, j: int, shape: tuple[int, ...]) -> tuple[tuple[int, int], tuple[int, int]]:
    """First and last tile under a block of cells."""
    return (i // TILE, j // TILE), ((i + shape[0] - 1) // TILE, (j + shape[1] - 1) // TILE)
