"""Storage and stepping of tiles: pools of two levels, who is whose neighbour, waking and sleeping."""

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import numpy.typing as npt

from mjskip.errors import MjskipError
from mjskip.waves import _lake_kernels as tiles
from mjskip.waves import _wave_kernels as kernels
from mjskip.waves._grid import APART, aligned_zeros, free_memory
from mjskip.waves._stencil import (
    COURANT_LIMITS,
    WEIGHTS,
    coefficients,
    same_step,
    step_change_filter,
)
from mjskip.waves.dense import Head, SurfaceArray

TILE = tiles.TILE
STEPS_BETWEEN_BEDTIMES = 16
"""Steps between looks for tiles that may sleep: a look costs about as much as a step."""

SMALLEST_POOL = 8
"""Tiles there is always room for."""

MANY_TILES = 256
"""With more of them the room for a change of step is given back after it; with fewer that costs more."""

_EDGE, _CORNER = WEIGHTS["nine_point"]
_NO_SPONGE = np.zeros(TILE + 2, np.float32)

Tile = tuple[int, int]


class Shore:
    """Which cells are open water, tile by tile as it is asked for; lakes that add up share it."""

    def __init__(
        self,
        land: Callable[[int, int, int], npt.NDArray[np.bool_]],
        shape: tuple[int, int] | None,
    ) -> None:
        """Take land(i, j, side), True on land in a square of cells from (i, j) on, and the walls."""
        self._land, self._shape = land, shape
        self._known: dict[Tile, SurfaceArray | None] = {}

    def around(self, tile: Tile) -> SurfaceArray | None:
        """(TILE + 2, TILE + 2), 1 in water and 0 on land, of a tile and the cells about it; None if no land."""
        if tile not in self._known:
            dry = self._land(tile[0] * TILE - 1, tile[1] * TILE - 1, TILE + 2)
            wet = mirrored(np.where(dry, np.float32(0.0), np.float32(1.0)), tile, self._shape)
            self._known[tile] = None if wet.all() else wet
        return self._known[tile]


def mirrored(block: SurfaceArray, tile: Tile, shape: tuple[int, int] | None) -> SurfaceArray:
    """A tile and the cells about it, those beyond a wall set to what it mirrors."""
    if shape is not None:
        for axis in range(2):
            cells = np.moveaxis(block, axis, 0)
            if tile[axis] == 0:
                cells[0] = cells[1]
            if (tile[axis] + 1) * TILE == shape[axis]:
                cells[-1] = cells[-2]
    return block


class TiledWater:
    """Two levels of the surface in the tiles that are awake; see `_tile_kernels`.

    Attributes:
        shape: cells inside reflecting walls; None is endless.
        period: tiles after which an endless lake is itself again; None if it is not.
        z: the present level, (capacity, TILE, TILE); tiles are slots 1 .. used.
        prev: the level one step of `last_timestep` ago.
        neighbours: (capacity, 9) slots around each.
        slots: slot of each tile by its place.
        names: place of each slot's tile; slot 0 is the sleeping one.
        used: slots in use, the sleeping one included.
        last_timestep: [s]; 0 if the water has not moved yet.
        generation: grows whenever a slot is given or taken.
        lost: sum over the cells that fell asleep [m].
    """

    def __init__(
        self,
        shape: tuple[int, int] | None,
        rate: float,
        damping: float,
        sleep_amplitude: float,
        shore: Shore | None,
        period: tuple[int, int] | None,
    ) -> None:
        """Make still water; rate = c / d [1/s], damping mu [1/s], sleep_amplitude [m]."""
        self.shape, self.shore, self.period = shape, shore, period
        self._rate, self._damping, self._sleep_amplitude = rate, damping, sleep_amplitude
        self._sides = np.zeros((2, TILE + 2), np.float32)
        self.generation = 0
        self.reset()

    def reset(self) -> None:
        """Still water, no tiles."""
        self.slots: dict[Tile, int] = {}
        self.names: list[Tile] = [(0, 0)]
        self.used = 1
        self.z, self.prev = _pools(SMALLEST_POOL)
        self.neighbours = np.zeros((SMALLEST_POOL, 9), np.int32)
        self._calls = np.empty((8 * SMALLEST_POOL, 2), np.int32)
        self._spare: tuple[SurfaceArray, SurfaceArray] | None = None  # made at a change of step
        self._steps = self._last_bedtime = 0
        self.last_timestep = 0.0
        self.lost = 0.0
        self.generation += 1
        self._found: dict[tuple[int, ...], tuple[int, npt.NDArray[np.int32], bool]] = {}

    @property
    def memory(self) -> int:
        """Bytes that hold the water now."""
        spare = 2 * self._spare[0].nbytes if self._spare else 0
        return self.z.nbytes + self.prev.nbytes + self.neighbours.nbytes + spare

    # Time ---------------------------------------------------------------------------------------

    def coefficients(self, timestep: float) -> tuple[float, float]:
        """q and s of a step."""
        return coefficients(self._rate, self._damping, timestep)

    def weights(self, timestep: float) -> tuple[float, float]:
        """What edges and corners of a head add to the elevation in one step."""
        _, scale = self.coefficients(timestep)
        return _EDGE * scale, _CORNER * scale

    def step(self, timestep: float, heads: Iterable[Head] = ()) -> None:
        """One step under the heads [s]; the level before it is `prev` afterwards."""
        self.go_to_bed()
        self.retime(timestep)
        if self.shore is None:
            found = tiles.step_and_listen(
                self.z, self.prev, self.neighbours, self.used, *self.coefficients(timestep),
                self._sides, self._sleep_amplitude, self._calls,
            )  # fmt: skip
        else:
            m, r = 0.5 * self._damping * timestep, (self._rate * timestep) ** 2
            self._sweep(*self.coefficients(timestep), ashore=(1.0, m, r))
        self.z, self.prev = self.prev, self.z
        self._steps += 1
        if self.shore is None and not heads:
            self._answer(found)
            return
        for head, i, j in heads:
            self._press_once(head, i, j, *self.weights(timestep))
        self.wake_neighbours()

    def keeps_step(self, timestep: float) -> bool:
        """Whether the last step was as long as this [s]."""
        return same_step(self.last_timestep, timestep)

    @property
    def steps_till_bedtime(self) -> int:
        """Steps until tiles may fall asleep again."""
        return STEPS_BETWEEN_BEDTIMES - self._steps % STEPS_BETWEEN_BEDTIMES

    def go_to_bed(self) -> None:
        """Put calm tiles to sleep, if it is time: before a step."""
        due = self._steps % STEPS_BETWEEN_BEDTIMES == 0 and self._steps != self._last_bedtime
        if due and self._sleep_amplitude > 0.0:
            self._last_bedtime = self._steps
            self._put_to_sleep()
            self.wake_neighbours()

    @property
    def scratch(self) -> tuple[SurfaceArray, npt.NDArray[np.int32]]:
        """What the kernels need besides: cells beside a tile, and calls."""
        return self._sides, self._calls

    def glided(self, steps: int, found: int) -> None:
        """The kernel has made steps, after the last of which some calls were found."""
        if steps % 2:
            self.z, self.prev = self.prev, self.z
        self._steps += steps
        self._answer(found)

    def retime(self, timestep: float) -> None:
        """The previous level of this step's size, short waves calmed: as in `DenseWater`."""
        t0, t1, rate2 = self.last_timestep, timestep, self._rate**2
        if self.keeps_step(t1):
            return
        self.last_timestep = t1
        if t0 == 0.0:
            self._sweep(0.0, 0.5 * rate2 * t1 * t1)
            return
        half = 0.5 * self._damping
        self._sweep(-(t1 / t0) * (1.0 - half * t0), -0.5 * rate2 * t0 * t1)
        level, before = self.z, self.prev
        if self._spare is None or len(self._spare[0]) != len(level):
            self._spare = _pools(len(level))
        self.z, self.prev = self._spare
        used = np.s_[: self.used]
        np.subtract(level[used], before[used], out=self.z[used])
        calm = math.sqrt(step_change_filter(t0, t1)) * COURANT_LIMITS["nine_point"] ** 2 / 4.0
        for a in (calm, -calm):
            self._sweep(0.0, a)
            self.z, self.prev = self.prev, self.z
        self.z[used] *= np.float32(1.0 + half * t1)
        np.subtract(level[used], self.z[used], out=before[used])
        self.z, self.prev = level, before
        self._sweep(-1.0, 0.5 * rate2 * t1 * t1)
        if self.used > MANY_TILES:
            self._spare = None

    def _sweep(self, q: float, s: float, ashore: tuple[float, float, float] | None = None) -> None:
        """prev = z + q (z - prev) + s L(z); around land with keep, m and r of `step_masked`."""
        blocks = [] if self.shore is None else self._steps_ashore(*(ashore or (q, 0.0, s)))
        tiles.step_tiles(
            self.z, self.prev, self.neighbours, 1, self.used, q, s, self._sides
        )  # fmt: skip
        for slot, block in blocks:
            self.prev[slot] = block

    def _steps_ashore(self, keep: float, m: float, r: float) -> list[tuple[int, SurfaceArray]]:
        """The step of tiles with land in them: slots, and levels after it."""
        assert self.shore is not None
        blocks = []
        for tile, slot in self.slots.items():
            wet = self.shore.around(tile)
            if wet is None:
                continue
            i, j, side = tile[0] * TILE - 1, tile[1] * TILE - 1, TILE + 2
            z = mirrored(self.copy(self.z, i, j, (side, side)), tile, self.shape)
            after = np.zeros_like(z)
            after[1:-1, 1:-1] = self.prev[slot]
            kernels.step_masked(
                z, after, 1, TILE + 1, 1, TILE + 1, np.float32(keep), np.float32(m), np.float32(r),
                np.float32(_EDGE), np.float32(_CORNER), _NO_SPONGE, _NO_SPONGE, wet,
            )  # fmt: skip
            blocks.append((slot, after[1:-1, 1:-1]))
        return blocks

    def open_cells(self, i: int, j: int, shape: tuple[int, ...]) -> SurfaceArray:
        """A block of cells, 1 in water and 0 on land; empty if there is no land anywhere."""
        if self.shore is None:
            return tiles.NO_LAND
        block = np.ones(shape, np.float32)
        for tile, there, here in self._pieces(i, j, (shape[0], shape[1])):
            wet = self.shore.around(tile)
            if wet is not None:
                block[here] = wet[1:-1, 1:-1][there]
        return block

    # Tiles --------------------------------------------------------------------------------------

    def _inside(self, tile: Tile) -> bool:
        return self.shape is None or all(
            0 <= t < n // TILE for t, n in zip(tile, self.shape, strict=True)
        )

    def name_of(self, tile: Tile) -> Tile:
        """The one name of a tile."""
        period = self.period
        return tile if period is None else (tile[0] % period[0], tile[1] % period[1])

    def _around(self, tile: Tile) -> Iterator[tuple[int, Tile]]:
        for direction in range(9):
            yield (
                direction,
                self.name_of((tile[0] + direction // 3 - 1, tile[1] + direction % 3 - 1)),
            )

    def wake(self, tile: Tile) -> int:
        """Slot of a tile, still water if it slept."""
        tile = self.name_of(tile)
        slot = self.slots.get(tile)
        if slot is not None:
            return slot
        slot = self.used
        if slot == len(self.z):
            self._resize(slot + slot // 4 + SMALLEST_POOL)
        self.used += 1
        self.z[slot] = 0.0
        self.prev[slot] = 0.0
        self.slots[tile] = slot
        self.names.append(tile)
        self.generation += 1
        self._introduce(slot)
        return slot

    def _introduce(self, slot: int) -> None:
        """Tell a tile its neighbours, and them the tile."""
        for direction, tile in self._around(self.names[slot]):
            other = self.slots.get(tile)
            if other is None:
                missing = tiles.SLEEPING if self._inside(tile) else tiles.WALL
                self.neighbours[slot, direction] = missing
            else:
                self.neighbours[slot, direction] = other
                self.neighbours[other, 8 - direction] = slot

    def _put_to_sleep(self) -> None:
        quiet = np.empty(self.used, np.int32)
        found = tiles.find_quiet(self.z, self.prev, self.used, 0.5 * self._sleep_amplitude, quiet)
        for slot in quiet[:found][::-1].tolist():  # from the last: those moved are not quiet
            self.lost += float(self.z[slot].sum(dtype=np.float64))
            tile = self.names[slot]
            del self.slots[tile]
            for direction, name in self._around(tile):
                if name in self.slots:
                    self.neighbours[self.slots[name], 8 - direction] = tiles.SLEEPING
            last = self.names.pop()
            self.used -= 1
            if last != tile:
                self.z[slot], self.prev[slot] = self.z[self.used], self.prev[self.used]
                self.names[slot] = last
                self.slots[last] = slot
                self._introduce(slot)
        self.generation += bool(found)
        if max(SMALLEST_POOL, 4 * self.used) < len(self.z):
            self._resize(max(SMALLEST_POOL, 2 * self.used + 2))

    def wake_neighbours(self) -> None:
        """Wake every tile that a wave above the sleep amplitude has come next to."""
        found = tiles.find_calls(
            self.z, self.neighbours, self.used, self._sleep_amplitude, self._calls
        )
        self._answer(found)

    def _answer(self, found: int) -> None:
        """Wake those who were called."""
        if not found:
            return
        callers = [(self.names[k], d) for k, d in self._calls[:found].tolist()]
        for (a, b), direction in callers:
            self.wake((a + direction // 3 - 1, b + direction % 3 - 1))

    def _resize(self, capacity: int) -> None:
        size = 2 * 4 * TILE * TILE * capacity
        free = free_memory()
        if size > 0.9 * free:
            raise MjskipError(
                f"{capacity} tiles of the lake need {size / 1e9:.3g} GB and {free / 1e9:.3g} GB are "
                "free: raise sleep_amplitude, damping or spacing"
            )
        used = slice(self.used)
        old_z, old_prev, old_neighbours = self.z, self.prev, self.neighbours
        self.z, self.prev = _pools(capacity)
        self.neighbours = np.zeros((capacity, 9), np.int32)
        self.z[used], self.prev[used] = old_z[used], old_prev[used]
        self.neighbours[used] = old_neighbours[used]
        self._calls = np.empty((8 * capacity, 2), np.int32)
        self._spare = None

    # Cells --------------------------------------------------------------------------------------

    def slots_under(self, first: Tile, last: Tile, *, wake: bool = False) -> npt.NDArray[np.int32]:
        """Slots of the tiles from first to last, both included; those asleep or outside are 0 and -1.

        Args:
            first, last: tiles, not cells.
            wake: wake those asleep.
        """
        key = (*first, *last)
        known = self._found.get(key)
        if known is not None and known[0] == self.generation and (known[2] or not wake):
            return known[1]
        slots = np.empty((last[0] - first[0] + 1, last[1] - first[1] + 1), np.int32)
        for a in range(slots.shape[0]):
            for b in range(slots.shape[1]):
                tile = first[0] + a, first[1] + b
                if not self._inside(tile):
                    slots[a, b] = tiles.WALL
                else:
                    slots[a, b] = (
                        self.wake(tile)
                        if wake
                        else self.slots.get(self.name_of(tile), tiles.SLEEPING)
                    )
        if known is None or known[0] != self.generation:
            self._found.clear()
        self._found[key] = self.generation, slots, bool(np.all(slots != tiles.SLEEPING))
        return slots

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
                    self.name_of((a, b)),
                    (slice(low[0] - a * TILE, high[0] - a * TILE),
                     slice(low[1] - b * TILE, high[1] - b * TILE)),
                    (slice(low[0] - i, high[0] - i), slice(low[1] - j, high[1] - j)),
                )  # fmt: skip

    def copy(self, pool: SurfaceArray, i: int, j: int, shape: tuple[int, int]) -> SurfaceArray:
        """A block of cells of `z` or `prev`; still where there is no water."""
        block = np.zeros(shape, np.float32)
        for tile, there, here in self._pieces(i, j, shape):
            slot = self.slots.get(tile)
            if slot is not None:
                block[here] = pool[slot][there]
        return block

    def add(self, block: SurfaceArray, i: int, j: int, *, both_levels: bool = False) -> None:
        """Raise a block of cells, waking the tiles under it."""
        nx, ny = block.shape
        for tile, there, here in self._pieces(i, j, (nx, ny)):
            if block[here].any():
                slot = self.wake(tile)
                self.z[slot][there] += block[here]
                if both_levels:
                    self.prev[slot][there] += block[here]

    def _press_once(self, head: SurfaceArray, i: int, j: int, edge: float, corner: float) -> None:
        """z += (edge, corner) Laplacian of the head, on the head's cells and one more all round."""
        i0, j0, i1, j1 = i - 1, j - 1, i + head.shape[0] + 1, j + head.shape[1] + 1
        if self.shape is not None:
            i0, j0, i1, j1 = max(i0, 0), max(j0, 0), min(i1, self.shape[0]), min(j1, self.shape[1])
        block = np.zeros((i1 - i0 + 2, j1 - j0 + 2), np.float32)
        kernels.add_head(
            block, head, i - i0 + 1, j - j0 + 1, i1 - i0 + 1, 1, j1 - j0 + 1, kernels.REFLECT,
            edge, corner, self.open_cells(i0 - 1, j0 - 1, block.shape),
        )  # fmt: skip
        self.add(block[1:-1, 1:-1], i0, j0)


def _pools(capacity: int) -> tuple[SurfaceArray, SurfaceArray]:
    """Two pools of still tiles."""
    shape = (capacity, TILE, TILE)
    z, prev = (aligned_zeros(capacity * TILE, TILE, after=after) for after in (0, APART))
    return z.reshape(shape), prev.reshape(shape)
