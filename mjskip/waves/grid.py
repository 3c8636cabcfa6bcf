"""Storage and stepping of the water: tiles of cells, active ones only, between walls, endless or periodic."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Flags, Integers, SingleArray
from mjskip.checks import check_memory
from mjskip.errors import MjskipError
from mjskip.waves import _block_kernels as blocks
from mjskip.waves import _tile_kernels as kernels
from mjskip.waves._medium_kernels import Medium, fill_open_edge, mirror_edge, step_mixed
from mjskip.waves._memory import SECOND_OFFSET, aligned_zeros
from mjskip.waves._stencil import (
    COURANT_LIMITS,
    MARGIN,
    WEIGHTS,
    Stencil,
    coefficients,
    same_step,
    sponge,
    step_change_filter,
)
from mjskip.waves._tile_kernels import COLUMNS, GENERAL, NEIGHBOUR_COLUMNS, ROWS, STILL, TILE, Tiles

STEPS_BETWEEN_CHECKS = 16
"""Steps between looks for calm tiles: a look costs about as much as a step."""

SMALLEST_POOL = 8
"""Tiles there is always room for, where tiles may be still."""

MANY_TILES = 256
"""With more of them the room for a change of step is given back after it; with fewer that costs more."""

STEPS_PER_PASS = 8
"""Steps made in one pass over memory: 2.2 times as fast as one at 4096 x 4096, where 4 are 1.9 times."""

CELLS_PER_THREAD = 1 << 21
"""With fewer cells to itself a thread costs more than it saves."""

Block = tuple[SingleArray, int, int]
"""Pressure heads [m] on a block of cells, and the cell that its first element lies on."""

Terrain = Callable[[int, int, int, int], Flags]
"""Which cells of a block (i, j, nx, ny) are land: (nx, ny)."""


class WaveGrid:
    """Two levels of the surface in the tiles that are active.

    Attributes:
        tiles: the arrays, for kernels; new ones when there was no room.
        medium: what general steps need besides.
        cells: stored along x and y, the margin of an absorbing field included; None if the grid is endless.
        tile: cells of a tile along x and y.
        is_whole: whether the field is one tile that is always active.
        margin: stored cells on each side that do not belong to the field.
        is_general: whether some tiles need a general step.
        last_timestep: [s]; 0 if the water has not moved yet.
    """

    def __init__(
        self,
        shape: tuple[int, int] | None,
        rate: float,
        damping: float,
        *,
        stencil: Stencil = "nine_point",
        absorbing: bool = False,
        periodic: bool = False,
        sleep_amplitude: float = 0.0,
        terrain: Terrain | None = None,
        threads: int | None = None,
    ) -> None:
        """Make still water.

        Args:
            shape: cells along x and y; None is endless.
            rate: c / d [1/s].
            damping: mu [1/s].
            stencil: see `HeightField`.
            absorbing: waves leave through a margin outside the field; not with sleep.
            periodic: what leaves on one side comes in on the other.
            sleep_amplitude: tiles whose waves are lower are given up [m]; 0 for none.
            terrain: tells where land is.
            threads: how many share a step; None picks by size.
        """
        self.margin = MARGIN if absorbing else 0
        self.cells = (
            None if shape is None else (shape[0] + 2 * self.margin, shape[1] + 2 * self.margin)
        )
        self.rate, self.damping, self.sleep_amplitude = rate, damping, sleep_amplitude
        self.stencil = stencil
        self._terrain = terrain
        self._periodic = periodic
        whole = self.cells is not None and sleep_amplitude == 0.0
        self.tile = self.cells if whole and self.cells else (TILE, TILE)
        self.is_general = terrain is not None or absorbing or stencil != "nine_point"
        size = self.tile[0] * self.tile[1]
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        self._threads = (threads or max(1, min(cores, size // CELLS_PER_THREAD))) if whole else 1
        self._bands = whole and not (self.is_general or periodic)
        """Whether rows can be shared by threads and stepped several times in one pass."""
        self._deep = self._bands and self.tile[0] // self._threads >= 2 * STEPS_PER_PASS
        self._cuts = np.linspace(0, self.tile[0], self._threads + 1).astype(int).tolist()
        self._workers: tuple[int, ThreadPoolExecutor] | None = None
        self.is_whole = whole
        self.reset()

    def reset(self) -> None:
        """Still water."""
        self._spare: tuple[SingleArray, SingleArray] | None = None  # made at a change of step
        self._steps = 0
        self.last_timestep = 0.0
        self._store(1 if self.is_whole else SMALLEST_POOL)
        if self.is_whole:
            self.activate((0, 0), (1, 1))

    # Room ---------------------------------------------------------------------------------------

    def _store(self, tiles: int) -> None:
        """Arrays with room for so many tiles, none of them active."""
        rows, columns = self.tile
        capacity = tiles + 1  # and the still one, which takes no memory until it is written to
        stride = -(-columns // 16) * 16
        if not self.is_whole:
            stride = columns
        elif stride % 32 == 0:
            stride += 16  # rows a power of two apart compete for the same cache lines
        self._check_memory(8 * tiles * rows * stride)
        neighbours = np.full((capacity, NEIGHBOUR_COLUMNS), STILL, np.int32)
        neighbours[STILL, [ROWS, COLUMNS, GENERAL]] = rows, columns, self.is_general
        table = 1 << (2 * capacity).bit_length()
        nx, ny = self.cells or (0, 0)
        masked = capacity if self.is_general else 0
        self.tiles = Tiles(
            first=_pool(capacity, rows, stride, after=0),
            second=_pool(capacity, rows, stride, after=SECOND_OFFSET),
            neighbours=neighbours,
            names=np.zeros((capacity, 2), np.int64),
            table=np.zeros(table, np.int32),
            numbers=np.array([1, 0, nx, ny, self._periodic, 0, 1], np.int64),
            water=np.zeros((masked, rows + 2, columns + 2), np.float32),
            lost=np.zeros(1),
            called=np.zeros((8 * capacity, 2), np.int32),
        )
        soft = self.rate if self.margin else 0.0
        self.medium = Medium(
            friction_x=sponge(rows, soft),
            friction_y=sponge(columns, soft),
            around=np.zeros((rows + 2, columns + 2) if masked else (0, 0), np.float32),
        )

    def _check_memory(self, size: int) -> None:
        if self.is_whole:
            what = f"shape is {self.tile[0]} x {self.tile[1]}: that grid"
            check_memory(what, size, "use fewer cells, a larger spacing, or HeightField.endless()")
            return
        try:
            check_memory("the moving water", size, "raise sleep_amplitude, damping or spacing")
        except ValueError as error:  # it has grown: no argument is at fault
            raise MjskipError(str(error)) from None

    def _resize(self, tiles: int) -> None:
        """Arrays with room for so many tiles, and the active ones in them."""
        old, used = self.tiles, np.s_[: self.tiles.numbers[kernels.USED]]
        self._store(tiles)
        for name in ("first", "second", "neighbours", "names", "water"):
            getattr(self.tiles, name)[used] = getattr(old, name)[used]
        self.tiles.numbers[:], self.tiles.lost[:] = old.numbers, old.lost
        self.tiles.numbers[kernels.FULL] = 0
        kernels.enter_all(self.tiles)
        self._spare = None

    def make_room(self) -> None:
        """Room for more tiles."""
        capacity = len(self.tiles.names) - 1
        self._resize(capacity + capacity // 4 + SMALLEST_POOL)

    @property
    def memory(self) -> int:
        """Bytes that hold the water now."""
        one = self.tiles.first[1:].nbytes
        return 2 * one + self.tiles.water.nbytes + (2 * one if self._spare else 0)

    # Tiles --------------------------------------------------------------------------------------

    @property
    def used(self) -> int:
        """Slots in use, the still one included."""
        return int(self.tiles.numbers[kernels.USED])

    @property
    def active_tiles(self) -> int:
        """Tiles stored and stepped now."""
        return self.used - 1

    @property
    def z(self) -> SingleArray:
        """The present level of the active tiles, (n, rows, columns)."""
        return self._levels()[0][1 : self.used, :, : self.tile[1]]

    @property
    def prev(self) -> SingleArray:
        """The level one step before, likewise."""
        return self._levels()[1][1 : self.used, :, : self.tile[1]]

    @property
    def names(self) -> Integers:
        """Places of the active tiles, (n, 2)."""
        return self.tiles.names[1 : self.used]

    def _levels(self) -> tuple[SingleArray, SingleArray]:
        first, second = self.tiles.first, self.tiles.second
        return (second, first) if self.tiles.numbers[kernels.PARITY] else (first, second)

    def activate(self, first: tuple[int, int], shape: tuple[int, ...]) -> None:
        """Activate all tiles under a block of cells."""
        while not kernels.activate_block(self.tiles, *first, *shape):
            self.make_room()
        self.survey()

    def activate_called(self) -> None:
        """Activate every tile that a wave above the sleep amplitude has come next to."""
        while not kernels.activate_called(self.tiles, self.sleep_amplitude):
            self.make_room()
        self.survey()

    def deactivate_calm_tiles(self) -> None:
        """Give calm tiles up: before a step, every so many."""
        self._steps = 1
        if self.sleep_amplitude == 0.0:
            return
        kernels.deactivate_calm_tiles(self.tiles, 0.5 * self.sleep_amplitude)
        if max(SMALLEST_POOL, 4 * self.used) < len(self.tiles.names):
            self._resize(max(SMALLEST_POOL, 2 * self.used + 2))
        self.activate_called()

    def survey(self) -> None:
        """Find out where land is in new tiles."""
        if not self.is_general:
            return
        first = int(self.tiles.numbers[kernels.SURVEYED])
        self.tiles.numbers[kernels.SURVEYED] = self.used
        for slot in range(first, self.used):
            rows, columns = self.tiles.neighbours[slot, [ROWS, COLUMNS]].tolist()
            a, b = self.tiles.names[slot].tolist()
            water = self.tiles.water[slot]
            water[...] = 1.0
            if self._terrain is None:
                continue
            i, j = a * self.tile[0] - 1, b * self.tile[1] - 1
            wet = ~self._terrain(i, j, rows + 2, columns + 2)
            if self.cells is not None and not self._periodic:  # a wall mirrors the land too
                x, y = (
                    np.clip(np.arange(k, k + n), 0, size - 1) - k
                    for k, n, size in zip((i, j), wet.shape, self.cells, strict=True)
                )
                wet = wet[np.ix_(x, y)]
            water[: rows + 2, : columns + 2] = wet
            if self.stencil == "nine_point" and not self.margin:
                self.tiles.neighbours[slot, GENERAL] = not wet.all()

    # Time ---------------------------------------------------------------------------------------

    def coefficients(self, timestep: float) -> tuple[float, float]:
        """q and s of a step."""
        return coefficients(self.rate, self.damping, timestep)

    def weights(self, timestep: float) -> tuple[float, float]:
        """What edges and corners of a head add to the elevation in one step."""
        m, r = 0.5 * self.damping * timestep, (self.rate * timestep) ** 2
        edge, corner = WEIGHTS[self.stencil]
        return edge * r / (1.0 + m), corner * r / (1.0 + m)

    def steps(self, timestep: float, most: int, heads: Sequence[Block]) -> int:
        """One step under the heads [s], or several in one pass over memory where that can be done; how many."""
        depth = min(most, STEPS_PER_PASS)
        if not self._deep or heads or depth == 1:
            self.step(timestep, heads)
            return 1
        self.retime(timestep)
        self._sweep_bands(*self.coefficients(timestep), depth)
        return depth

    def step(self, timestep: float, heads: Sequence[Block] = ()) -> None:
        """One step under the heads [s]."""
        self._steps += 1
        if self._steps > STEPS_BETWEEN_CHECKS:
            self.deactivate_calm_tiles()
        if self.margin:
            self._fill_edge(timestep)
        if not same_step(self.last_timestep, timestep):
            self.retime(timestep)
        q, s = coefficients(self.rate, self.damping, timestep)
        if self._bands:
            self._sweep_bands(q, s, 1)
        else:
            self._sweep(q, s, timestep=timestep)
            self.swap()
        for head, i, j in heads:
            self.press(head, i, j, timestep)
        if not self.is_whole:
            self.activate_called()

    def press(self, head: npt.NDArray[np.floating], i: int, j: int, timestep: float) -> None:
        """Add to the last step [s] what a head does in it."""
        if not self.is_whole:
            self.activate((i - 1, j - 1), (head.shape[0] + 2, head.shape[1] + 2))
        blocks.press_block(self.tiles, i, j, head, *self.weights(timestep))

    def state(self) -> dict[str, object]:
        """What `restore` needs."""
        return {
            "names": self.names, "z": self.z, "prev": self.prev, "lost": self.tiles.lost,
            "last_timestep": self.last_timestep, "steps": self._steps,
        }  # fmt: skip

    def restore(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from a state, to the last bit."""
        self.reset()
        for name in state["names"].tolist():
            first = name[0] * self.tile[0], name[1] * self.tile[1]
            self.activate(first, (1, 1))
        self.z[...], self.prev[...] = state["z"], state["prev"]
        self.tiles.lost[:] = state["lost"]
        self.last_timestep, self._steps = float(state["last_timestep"]), int(state["steps"])

    def swap(self) -> None:
        """The level before becomes the present one: at the end of a step."""
        numbers = self.tiles.numbers
        numbers[kernels.PARITY] = 0 if numbers[kernels.PARITY] else 1

    def start(self, timestep: float) -> None:
        """Let water that was just set at rest have come from a step of this size."""
        self._fill_edge(timestep)
        self.retime(timestep)

    def retime(self, timestep: float) -> None:
        """Replace the level before by the one a step of this size would have come from.

        The speed now is v = (z - z-) / t0 + a t0 / 2, with a = c^2 L - mu v, half an old step on.
        Short waves of v t1 are filtered, then z- = z - v t1 + a t1^2 / 2. All of it is the step's
        own form with other coefficients. Water that has not moved yet (t0 = 0) starts at rest.
        """
        t0, t1, rate2 = self.last_timestep, timestep, self.rate**2
        if same_step(t0, t1):
            return
        self.last_timestep = t1
        if t0 == 0.0:
            self._sweep(0.0, 0.5 * rate2 * t1 * t1)
            return
        half = 0.5 * self.damping
        self._sweep(-(t1 / t0) * (1.0 - half * t0), -0.5 * rate2 * t0 * t1)
        self._filter(step_change_filter(t0, t1), 1.0 + half * t1)
        self._sweep(-1.0, 0.5 * rate2 * t1 * t1)

    def _filter(self, strength: float, factor: float) -> None:
        """prev = z - factor (1 - strength (k / k_max)^4) (z - prev)."""
        present, before = self._levels()
        tiles, used = self.tiles, np.s_[1 : self.used]
        if self._spare is None:
            shape = present.shape
            self._spare = _pool(*shape, after=0), _pool(*shape, after=SECOND_OFFSET)
        speed, result = self._spare
        np.subtract(present[used], before[used], out=speed[used])
        part = math.sqrt(strength) * COURANT_LIMITS[self.stencil] ** 2 / 4.0
        parity = int(tiles.numbers[kernels.PARITY])
        tiles.numbers[kernels.PARITY] = 0
        for a in (part, -part):  # (1 + a L)(1 - a L) = 1 - strength (k / k_max)^4
            self.tiles = tiles._replace(first=speed, second=result)
            if self.margin:
                rows, columns = self.tile
                mirror_edge(speed[1], rows, columns)
            self._sweep(0.0, a)
            speed, result = result, speed
        self.tiles = tiles
        tiles.numbers[kernels.PARITY] = parity
        speed[used] *= np.float32(factor)
        np.subtract(present[used], speed[used], out=before[used])
        if self.used > MANY_TILES:
            self._spare = None

    def _fill_edge(self, timestep: float) -> None:
        """The open edge of an absorbing field, before a step [s]."""
        if self.margin:
            courant = self.rate * timestep
            present, before = self._levels()
            outgoing = np.float32((courant - 1.0) / (courant + 1.0))
            fill_open_edge(present[1], before[1], *self.tile, outgoing)

    def _sweep(self, q: float, s: float, *, timestep: float | None = None) -> None:
        """prev = z + q (z - prev) + s L(z) in all active tiles; with a time step [s] the whole of a step."""
        if self._bands:
            self._sweep_bands(q, s, 1, swap=False)
            return
        if not self.is_general:
            kernels.step_tiles(self.tiles, q, s)
            return
        numbers = self.general_numbers(q, s, timestep)
        inner = -1
        if self.margin:
            inner = 1 if timestep is None else self.margin
            if self._terrain or self.stencil != "nine_point":
                inner = 0
        step_mixed(self.tiles, self.medium, q, s, numbers, inner)
        if self.stencil == "paper_eq8" and timestep is not None:
            # The printed centre weight, -4/(mu t + 2) - 10/3 xi, less the one the kernel used.
            present, before = self._levels()
            m, r = 0.5 * self.damping * timestep, (self.rate * timestep) ** 2
            before += np.float32(-4.0 / (1.0 + m) + 2.0 / 3.0 * r / (1.0 + m)) * present

    def general_numbers(self, q: float, s: float, timestep: float | None) -> SingleArray:
        """What `step_mixed` wants to know: of z + q (z - prev) + s L(z), or of a step [s]."""
        keep, m, r, half = q, 0.0, s, 0.0
        if timestep is not None:
            keep, half = 1.0, 0.5 * timestep
            m, r = self.damping * half, (self.rate * timestep) ** 2
        return np.array([keep, m, r, *WEIGHTS[self.stencil], half], np.float32)

    def _sweep_bands(self, q: float, s: float, depth: int, *, swap: bool = True) -> None:
        """Several steps in one pass: bands that shrink towards each other, then the gaps between them."""
        grid, cuts = (*self._levels(), self.tiles.neighbours), self._cuts
        if self._threads == 1:
            kernels.step_band(*grid, 0, cuts[-1], q, s, depth, 0, 0)
        else:

            def band(k: int) -> None:
                inner = int(k > 0), int(k + 1 < self._threads)
                kernels.step_band(*grid, cuts[k], cuts[k + 1], q, s, depth, *inner)

            self._share(band)
            for cut in cuts[1:-1]:
                kernels.step_band(*grid, cut, cut, q, s, depth, -1, -1)
        if swap and depth % 2:
            self.swap()

    def _share(self, band: Callable[[int], None]) -> None:
        """Call band(0), band(1), ... each in a thread, and wait for all."""
        if (
            self._workers is None or self._workers[0] != os.getpid()
        ):  # threads do not survive a fork
            self._workers = os.getpid(), ThreadPoolExecutor(self._threads - 1)
        others = [self._workers[1].submit(band, k) for k in range(1, self._threads)]
        band(0)
        for other in others:
            other.result()


def _pool(capacity: int, rows: int, stride: int, *, after: int) -> SingleArray:
    """Still tiles."""
    return aligned_zeros(capacity * rows, stride, after=after).reshape(capacity, rows, stride)
