"""Lakes of any size: only the tiles of water that move are stored and stepped."""

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from mjskip import _tile_kernels as tiles
from mjskip import _wave_kernels as kernels
from mjskip._grid import checked_finite, checked_number, checked_shape, free_memory
from mjskip._stencil import (
    COURANT_LIMITS,
    SAFE_FRACTION,
    SAME_STEP,
    WEIGHTS,
    calming,
    paper_limit,
    reach_of,
    unstable,
)
from mjskip.errors import MjskipError
from mjskip.waves import FloatArray, SurfaceArray, SurfaceSample
from mjskip.waves.dense import round_head

TILE = tiles.TILE
STEPS_BETWEEN_BEDTIMES = 16
"""Steps between looks for tiles that may sleep: a look costs about as much as a step."""

NO_MASK = np.zeros((0, 0), np.float32)

SMALLEST_POOL = 8
"""Tiles there is always room for."""

Tile = tuple[int, int]


class Lake:
    """Water of any extent, endless by default, with the verbs of `HeightField`.

    Still water costs nothing: a tile of 64 x 64 cells is stored from the moment a neighbour's wave
    above `sleep_amplitude` reaches its rim, or a load does, until both of its last levels are within
    half that amplitude. Nine-point stencil, the same arithmetic as `HeightField`; with
    `sleep_amplitude=0` the elevation is that of one large grid, bit for bit. Otherwise sleeping
    water reflects or swallows waves below that amplitude, and `lost_volume` says how much water
    went with tiles that fell asleep.
    """

    def __init__(
        self,
        shape: tuple[int, int] | None = None,
        spacing: float = 0.02,
        wave_speed: float = 1.0,
        damping: float = 0.2,
        *,
        centre: tuple[float, float] = (0.0, 0.0),
        sleep_amplitude: float = 1e-5,
    ) -> None:
        """Make still water.

        Args:
            shape: cells along x and y inside reflecting walls, multiples of 64; None is endless.
            spacing: d, side of a cell [m].
            wave_speed: c [m/s].
            damping: mu [1/s].
            centre: (x, y) of the middle; of cell (0, 0) if the lake is endless [m].
            sleep_amplitude: waves below it are let go [m].

        Raises:
            ValueError: an argument is out of range.
        """
        self.shape = None if shape is None else checked_shape(shape)
        if self.shape is not None and any(n % TILE for n in self.shape):
            near = tuple(max(1, round(n / TILE)) * TILE for n in self.shape)
            raise ValueError(
                f"shape is {self.shape!r}: a lake is made of tiles of {TILE} cells; use {near!r}"
            )
        self.spacing = checked_number("spacing", spacing, "m", positive=True)
        self.wave_speed = checked_number("wave_speed", wave_speed, "m/s", positive=True)
        self.damping = checked_number("damping", damping, "1/s")
        self.sleep_amplitude = checked_number("sleep_amplitude", sleep_amplitude, "m")
        checked_finite("m", centre_x=centre[0], centre_y=centre[1])
        nx, ny = self.shape or (1, 1)
        self._origin = (
            centre[0] - (nx - 1) / 2 * self.spacing,
            centre[1] - (ny - 1) / 2 * self.spacing,
        )
        self._rows = np.zeros((3, TILE), np.float32)
        self.reset()

    # What the water is like ---------------------------------------------------------------------

    @property
    def max_timestep(self) -> float:
        """Largest stable step [s]."""
        return COURANT_LIMITS["nine_point"] * self.spacing / self.wave_speed

    @property
    def awake_tiles(self) -> int:
        """Tiles stored and stepped now."""
        return self._used - 1

    @property
    def memory(self) -> int:
        """Bytes that hold the water now."""
        spare = 2 * self._spare[0].nbytes if self._spare else 0
        return self._z.nbytes + self._prev.nbytes + self._neighbours.nbytes + spare

    def volume(self) -> float:
        """Water above the still level minus water missing below it [m^3]."""
        return float(self._z[1 : self._used].sum(dtype=np.float64)) * self.spacing**2

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is inside the walls."""
        if self.shape is None:
            return True
        at = (x - self._origin[0]) / self.spacing, (y - self._origin[1]) / self.spacing
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
            for at, origin, n in zip((x, y), self._origin, shape, strict=True)
        )
        places = [
            np.asarray(origin + (first + np.arange(n)) * self.spacing, np.float64)
            for origin, first, n in zip(self._origin, (i, j), shape, strict=True)
        ]
        return self._copy(self._z, i, j, shape), places[0], places[1]

    def sample(self, x: npt.ArrayLike, y: npt.ArrayLike) -> SurfaceSample:
        """Surface at points, bilinear; outside the lake the water is still.

        Args:
            x, y: (n,) or scalars [m].
        """
        columns = np.broadcast_arrays(
            np.atleast_1d(np.asarray(x, np.float64)), np.atleast_1d(np.asarray(y, np.float64))
        )
        at = (np.column_stack([c.ravel() for c in columns]) - self._origin) / self.spacing
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
                self._copy(pool, i0 - 1, j0 - 1, (i1 - i0 + 2, j1 - j0 + 2))
                for pool in (self._z, self._prev)
            )
            local = np.empty((len(points), 4))
            kernels.sample_points(
                z, prev, i1 - i0 + 1, 1, j1 - j0 + 1, kernels.REFLECT, at[points] - (i0, j0),
                self.spacing, self._last_timestep, local,
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
        checked_finite("m", x=x, y=y)
        checked_finite("N", force=force)
        checked_number("radius", radius, "m", positive=True)
        checked_number("density", density, "kg/m^3", positive=True)
        checked_number("gravity", gravity, "m/s^2", positive=True)
        head = self._round_head(x, y, radius, force / (density * gravity * self.spacing**2))
        if head is not None and force != 0.0:
            self._loads.append(head)

    def displace(self, x: float, y: float, *, height: float, radius: float) -> None:
        """Raise the surface by a smooth round bump: see `HeightField.displace`."""
        checked_finite("m", x=x, y=y, height=height)
        checked_number("radius", radius, "m", positive=True)
        reach = reach_of(radius, self.spacing)
        at = (x - self._origin[0]) / self.spacing, (y - self._origin[1]) / self.spacing
        span = [np.arange(math.ceil(p - reach), math.floor(p + reach) + 1) for p in at]
        distance = (span[0][:, None] - at[0]) ** 2 + (span[1][None, :] - at[1]) ** 2
        bump = (height * np.maximum(1.0 - distance / reach**2, 0.0) ** 2).astype(np.float32)
        self._add(bump, int(span[0][0]), int(span[1][0]), both_levels=True)
        self._wake_neighbours()

    def reset(self) -> None:
        """Still water at time 0, no loads, no tiles."""
        self._slots: dict[Tile, int] = {}
        self._names: list[Tile] = [(0, 0)]  # of each slot; slot 0 is the sleeping one
        self._used = 1
        self._z = np.zeros((SMALLEST_POOL, TILE, TILE), np.float32)
        self._prev = np.zeros_like(self._z)
        self._neighbours = np.zeros((SMALLEST_POOL, 9), np.int32)
        self._spare: tuple[SurfaceArray, SurfaceArray] | None = None  # made at a change of step
        self._loads: list[tuple[SurfaceArray, int, int]] = []
        self._last_timestep = 0.0
        self._steps = 0
        self.time = 0.0
        """Simulated time [s]."""
        self.lost_volume = 0.0
        """Water that went with tiles that fell asleep [m^3]."""

    # Two-way water ------------------------------------------------------------------------------

    def sibling(self) -> "Lake":
        """Still water of the same cells, walls and waves: what both do adds up."""
        other = Lake(
            self.shape, self.spacing, self.wave_speed, self.damping,
            sleep_amplitude=self.sleep_amplitude,
        )  # fmt: skip
        other._origin = self._origin
        return other

    def absorb(self, other: "Lake") -> None:
        """Take the waves of a sibling that stepped alongside, which is left still."""
        for tile, theirs in other._slots.items():
            slot = self._wake(tile)
            self._z[slot] += other._z[theirs]
            self._prev[slot] += other._prev[theirs]
        self._last_timestep = other._last_timestep or self._last_timestep
        self.lost_volume += other.lost_volume
        time = other.time
        other.reset()
        other.time = time
        self._wake_neighbours()

    @property
    def highest(self) -> float:
        """Greatest |elevation| [m]."""
        return float(np.abs(self._z[1 : self._used]).max(initial=0.0))

    def cells(self, i: int, j: int, shape: tuple[int, int]) -> SurfaceArray:
        """Elevation of a block of cells, a copy; still where there is no water."""
        return self._copy(self._z, i, j, shape)

    def add_block(self, x: float, y: float, points: FloatArray) -> tuple[float, float]:
        """Add elevation and vertical speed around a point to points (2, n, n).

        Returns:
            Position of the first cell of the block [m].
        """
        n = points.shape[1]
        i, j = (
            round((at - origin) / self.spacing) - n // 2
            for at, origin in zip((x, y), self._origin, strict=True)
        )
        level = self._copy(self._z, i, j, (n, n))
        points[0] += level
        if self._last_timestep > 0.0:
            points[1] += (level - self._copy(self._prev, i, j, (n, n))) / self._last_timestep
        return self._origin[0] + i * self.spacing, self._origin[1] + j * self.spacing

    def head(
        self, x: float, y: float, *, radius: float, volume: float
    ) -> tuple[SurfaceArray, int, int] | None:
        """A round head, (nx, ny) [m], of this volume [cells x m], and its first cell; see `press`."""
        return self._round_head(x, y, radius, volume)

    def bend(self, head: SurfaceArray, timestep: float) -> SurfaceArray:
        """What a head adds to the elevation in one step, on its cells and one more all round."""
        r = (self.wave_speed * timestep / self.spacing) ** 2
        edge, corner = (
            w * r / (1.0 + 0.5 * self.damping * timestep) for w in WEIGHTS["nine_point"]
        )
        block = np.zeros((head.shape[0] + 4, head.shape[1] + 4), np.float32)
        kernels.add_head(
            block, head, 2, 2, block.shape[0] - 1, 1, block.shape[1] - 1, kernels.REFLECT,
            edge, corner, NO_MASK,
        )  # fmt: skip
        return block[1:-1, 1:-1]

    def add_elevation(self, block: SurfaceArray, i: int, j: int) -> None:
        """Raise a block of cells, waking the tiles under it."""
        self._add(block, i, j)
        self._wake_neighbours()

    # Time ---------------------------------------------------------------------------------------

    def step(self, timestep: float) -> None:
        """Advance by one step [s].

        Raises:
            ValueError: the step is not a positive number, or larger than `max_timestep`.
            MjskipError: the tiles that are awake no longer fit into memory.
        """
        if not (math.isfinite(timestep) and timestep > 0.0):
            raise ValueError(f"the water's time step is {timestep!r} s: give a number above 0")
        if timestep > self.max_timestep:
            paper = paper_limit(self.spacing, self.wave_speed, self.damping)
            raise ValueError(unstable(timestep, self.max_timestep, paper))
        self._step(timestep)
        self._loads.clear()

    def advance(self, duration: float) -> int:
        """Advance by a duration [s] in equal stable steps, loads acting through all of them.

        Returns:
            Number of steps made.
        """
        checked_number("duration", duration, "s")
        steps = math.ceil(duration / (SAFE_FRACTION * self.max_timestep))
        for _ in range(steps):
            self._step(duration / steps)
        if steps:
            self._loads.clear()
        return steps

    def _step(self, timestep: float) -> None:
        r = (self.wave_speed * timestep / self.spacing) ** 2
        m = 0.5 * self.damping * timestep
        if abs(timestep - self._last_timestep) > SAME_STEP * timestep:
            self._retime(timestep)
        self._sweep((1.0 - m) / (1.0 + m), r / (1.0 + m))
        self._z, self._prev = self._prev, self._z
        edge, corner = (weight * r / (1.0 + m) for weight in WEIGHTS["nine_point"])
        for head, i, j in self._loads:
            self._press_once(head, i, j, edge, corner)
        self._last_timestep = timestep
        self.time += timestep
        self._steps += 1
        if self._steps % STEPS_BETWEEN_BEDTIMES == 0 and self.sleep_amplitude > 0.0:
            self._put_to_sleep()
        self._wake_neighbours()

    def _retime(self, timestep: float) -> None:
        """The previous level of this step's size, short waves calmed: as in `DenseWater`."""
        t0, t1, rate2 = self._last_timestep, timestep, (self.wave_speed / self.spacing) ** 2
        if t0 == 0.0:
            self._sweep(0.0, 0.5 * rate2 * t1 * t1)
            return
        half = 0.5 * self.damping
        self._sweep(-(t1 / t0) * (1.0 - half * t0), -0.5 * rate2 * t0 * t1)
        level, before = self._z, self._prev
        if self._spare is None or len(self._spare[0]) != len(level):
            self._spare = np.zeros_like(level), np.zeros_like(level)
        self._z, self._prev = self._spare
        used = np.s_[: self._used]
        np.subtract(level[used], before[used], out=self._z[used])
        calm = math.sqrt(calming(t0, t1)) * COURANT_LIMITS["nine_point"] ** 2 / 4.0
        for a in (calm, -calm):
            self._sweep(0.0, a)
            self._z, self._prev = self._prev, self._z
        self._z[used] *= np.float32(1.0 + half * t1)
        np.subtract(level[used], self._z[used], out=before[used])
        self._z, self._prev = level, before
        self._sweep(-1.0, 0.5 * rate2 * t1 * t1)

    def _sweep(self, q: float, s: float) -> None:
        tiles.step_tiles(
            self._z, self._prev, self._neighbours, 1, self._used, np.float32(q), np.float32(s),
            self._rows,
        )  # fmt: skip

    # Tiles --------------------------------------------------------------------------------------

    def _inside(self, tile: Tile) -> bool:
        return self.shape is None or all(
            0 <= t < n // TILE for t, n in zip(tile, self.shape, strict=True)
        )

    def _around(self, tile: Tile) -> Iterator[tuple[int, Tile]]:
        for direction in range(9):
            yield direction, (tile[0] + direction // 3 - 1, tile[1] + direction % 3 - 1)

    def _wake(self, tile: Tile) -> int:
        """Slot of a tile, still water if it slept."""
        slot = self._slots.get(tile)
        if slot is not None:
            return slot
        slot = self._used
        if slot + 1 == len(self._z):  # the kernel reads one cell into the slot after the last
            self._resize(2 * slot + 2)
        self._used += 1
        self._z[slot] = 0.0
        self._prev[slot] = 0.0
        self._slots[tile] = slot
        self._names.append(tile)
        self._introduce(slot)
        return slot

    def _introduce(self, slot: int) -> None:
        """Tell a tile its neighbours, and them the tile."""
        for direction, tile in self._around(self._names[slot]):
            other = self._slots.get(tile)
            if other is None:
                missing = tiles.SLEEPING if self._inside(tile) else tiles.WALL
                self._neighbours[slot, direction] = missing
            else:
                self._neighbours[slot, direction] = other
                self._neighbours[other, 8 - direction] = slot

    def _put_to_sleep(self) -> None:
        quiet = np.empty(self._used, np.int32)
        found = tiles.find_quiet(
            self._z, self._prev, self._used, np.float32(0.5 * self.sleep_amplitude), quiet
        )
        for slot in quiet[:found][::-1].tolist():  # from the last: those moved are not quiet
            self.lost_volume += float(self._z[slot].sum(dtype=np.float64)) * self.spacing**2
            tile = self._names[slot]
            del self._slots[tile]
            for direction, name in self._around(tile):
                if name in self._slots:
                    self._neighbours[self._slots[name], 8 - direction] = tiles.SLEEPING
            last = self._names.pop()
            self._used -= 1
            if last != tile:
                self._z[slot], self._prev[slot] = self._z[self._used], self._prev[self._used]
                self._names[slot] = last
                self._slots[last] = slot
                self._introduce(slot)
        if max(SMALLEST_POOL, 4 * self._used) < len(self._z):
            self._resize(max(SMALLEST_POOL, 2 * self._used + 2))

    def _wake_neighbours(self) -> None:
        calls = np.empty((8 * self._used, 2), np.int32)
        found = tiles.find_calls(
            self._z, self._neighbours, self._used, np.float32(self.sleep_amplitude), calls
        )
        callers = [(self._names[k], d) for k, d in calls[:found].tolist()]
        for (a, b), direction in callers:
            self._wake((a + direction // 3 - 1, b + direction % 3 - 1))

    def _resize(self, capacity: int) -> None:
        size = 2 * 4 * TILE * TILE * capacity
        free = free_memory()
        if size > 0.9 * free:
            raise MjskipError(
                f"{capacity} tiles of the lake need {size / 1e9:.3g} GB and {free / 1e9:.3g} GB are "
                "free: raise sleep_amplitude, damping or spacing"
            )
        for name in ("_z", "_prev", "_neighbours"):
            old = getattr(self, name)
            new = np.zeros((capacity, *old.shape[1:]), old.dtype)
            new[: self._used] = old[: self._used]
            setattr(self, name, new)
        self._spare = None

    # Cells --------------------------------------------------------------------------------------

    def _pieces(
        self, i: int, j: int, shape: tuple[int, int]
    ) -> Iterator[tuple[Tile, tuple[slice, slice], tuple[slice, slice]]]:
        """Tiles under a block of cells: name, where in the tile, where in the block."""
        for a in range(i // TILE, (i + shape[0] - 1) // TILE + 1):
            for b in range(j // TILE, (j + shape[1] - 1) // TILE + 1):
                if not self._inside((a, b)):
                    continue
                low = max(i, a * TILE), max(j, b * TILE)
                high = min(i + shape[0], (a + 1) * TILE), min(j + shape[1], (b + 1) * TILE)
                yield (
                    (a, b),
                    (slice(low[0] - a * TILE, high[0] - a * TILE),
                     slice(low[1] - b * TILE, high[1] - b * TILE)),
                    (slice(low[0] - i, high[0] - i), slice(low[1] - j, high[1] - j)),
                )  # fmt: skip

    def _copy(self, pool: SurfaceArray, i: int, j: int, shape: tuple[int, int]) -> SurfaceArray:
        block = np.zeros(shape, np.float32)
        for tile, there, here in self._pieces(i, j, shape):
            slot = self._slots.get(tile)
            if slot is not None:
                block[here] = pool[slot][there]
        return block

    def _add(self, block: SurfaceArray, i: int, j: int, *, both_levels: bool = False) -> None:
        nx, ny = block.shape
        for tile, there, here in self._pieces(i, j, (nx, ny)):
            if block[here].any():
                slot = self._wake(tile)
                self._z[slot][there] += block[here]
                if both_levels:
                    self._prev[slot][there] += block[here]

    def _round_head(
        self, x: float, y: float, radius: float, volume: float
    ) -> tuple[SurfaceArray, int, int] | None:
        """A round head of this volume [cells x m] and its first cell; None if it is all outside."""
        reach = reach_of(radius, self.spacing)
        at = (x - self._origin[0]) / self.spacing, (y - self._origin[1]) / self.spacing
        if self.shape is not None and not all(
            -reach < p < n - 1 + reach for p, n in zip(at, self.shape, strict=True)
        ):
            return None
        return round_head(at, reach, volume)

    def _press_once(self, head: SurfaceArray, i: int, j: int, edge: float, corner: float) -> None:
        """z += (edge, corner) Laplacian of the head, on the head's cells and one more all round."""
        i0, j0, i1, j1 = i - 1, j - 1, i + head.shape[0] + 1, j + head.shape[1] + 1
        if self.shape is not None:
            i0, j0, i1, j1 = max(i0, 0), max(j0, 0), min(i1, self.shape[0]), min(j1, self.shape[1])
        block = np.zeros((i1 - i0 + 2, j1 - j0 + 2), np.float32)
        kernels.add_head(
            block, head, i - i0 + 1, j - j0 + 1, i1 - i0 + 1, 1, j1 - j0 + 1, kernels.REFLECT,
            edge, corner, NO_MASK,
        )  # fmt: skip
        self._add(block[1:-1, 1:-1], i0, j0)
