"""Storage and stepping of a rectangle of water: two levels, ghosts, margin, obstacles, threads."""

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from mjskip.waves import _wave_kernels as kernels
from mjskip.waves._grid import APART, aligned_zeros, refuse_if_too_large
from mjskip.waves._stencil import (
    COURANT_LIMITS,
    SPONGE_CELLS,
    WEIGHTS,
    Boundary,
    Stencil,
    calming,
    coefficients,
    same_step,
    sponge,
)
from mjskip.waves._tile_kernels import fill_head

STEPS_PER_PASS = 8
"""Steps made in one pass over memory: 2.2 times as fast as one at 4096 x 4096, where 4 are 1.9 times."""

FloatArray = npt.NDArray[np.float64]
SurfaceArray = npt.NDArray[np.float32]
Head = tuple[SurfaceArray, int, int]
"""A pressure head [m] and the stored cell that its first element lies on."""

CELLS_PER_THREAD = 1 << 21
"""With fewer cells to itself a thread costs more than it saves."""


class DenseWater:
    """Two levels of the surface in grids with ghosts around them; see `_wave_kernels`.

    Attributes:
        z: the present level; cells are rows 1..i1 and columns j0..j1.
        prev: the level one step of `last_timestep` ago.
        margin: cells on each side that belong to the absorbing layer, not to the field.
        last_timestep: [s]; 0 if the water has not moved yet.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        rate: float,
        damping: float,
        stencil: Stencil,
        boundary: Boundary,
        *,
        land: npt.NDArray[np.bool_] | None,
        threads: int | None,
    ) -> None:
        """Make still water.

        Args:
            shape: cells of the field.
            rate: c / d [1/s].
            damping: mu [1/s].
            stencil, boundary: as in `HeightField`.
            land: `shape`, True where there is no water.
            threads: how many share a step; None picks by size.
        """
        self.shape, self.stencil = shape, stencil
        self._rate, self._damping = rate, damping
        self.margin = SPONGE_CELLS if boundary == "absorb" else 0
        nx, ny = (n + 2 * self.margin for n in shape)
        self.i1, self.j0, self.j1 = nx + 1, kernels.FIRST, kernels.FIRST + ny
        stride = -(-(self.j1 + 1) // 16) * 16
        refuse_if_too_large(shape, (2 if land is None else 3) * 4 * (nx + 2) * stride)
        self.z = aligned_zeros(nx + 2, stride)
        self.prev = aligned_zeros(nx + 2, stride, after=APART)
        self.last_timestep = 0.0
        self.code = kernels.BOUNDARY_CODES[boundary]

        self.open = np.zeros((0, 0), np.float32)
        if land is not None:
            self.open = aligned_zeros(nx + 2, stride)
            self.open[...] = 1.0
            self.cells(self.open)[...] = ~land
            # A wall mirrors the land too, and so does the edge of an absorbing margin.
            code = kernels.PERIODIC if boundary == "periodic" else kernels.REFLECT
            kernels.fill_ghosts(
                self.open, self.open, self.i1, self.j0, self.j1, code, np.float32(0)
            )
        soft = rate if self.margin else 0.0
        self._sponge = sponge(nx, 1, nx + 2, soft), sponge(ny, self.j0, stride, soft)
        self._no_sponge = np.zeros(nx + 2, np.float32), np.zeros(stride, np.float32)

        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        self._threads = threads or max(1, min(cores, nx * ny // CELLS_PER_THREAD))
        self._spare: tuple[SurfaceArray, SurfaceArray] | None = None  # made at a change of step
        self._pool: tuple[int, ThreadPoolExecutor] | None = None
        self._mirrors = (stencil, boundary, land is None) == ("nine_point", "reflect", True)
        self._deep = self._mirrors and nx // self._threads >= 2 * STEPS_PER_PASS
        self._cuts = {
            margin: np.linspace(1 + margin, nx + 1 - margin, self._threads + 1).astype(int).tolist()
            for margin in (0, self.margin)
        }

    def cells(self, grid: SurfaceArray) -> SurfaceArray:
        """The field's part of a grid, a view (nx, ny)."""
        i, j = 1 + self.margin, self.j0 + self.margin
        return grid[i : i + self.shape[0], j : j + self.shape[1]]

    def reset(self) -> None:
        """Still water."""
        self.z[...] = 0.0
        self.prev[...] = 0.0
        self.last_timestep = 0.0

    def steps(self, timestep: float, most: int, heads: Sequence[Head]) -> int:
        """One step under the heads [s], or several in one pass over memory where that can be done; how many."""
        depth = min(most, STEPS_PER_PASS)
        if not self._deep or heads or depth == 1:
            self.step(timestep, heads)
            return 1
        self._retime(timestep)
        self._sweep_deep(*coefficients(self._rate, self._damping, timestep), depth)
        return depth

    def step(self, timestep: float, heads: Sequence[Head]) -> None:
        """One step under the heads [s]."""
        r = (self._rate * timestep) ** 2
        m = 0.5 * self._damping * timestep
        if not self._mirrors:
            self._fill_ghosts(timestep)
        self._retime(timestep)
        if self.open.size:
            self._sweep_masked(1.0, m, r, timestep)
        elif self.stencil == "paper_eq8":
            self._sweep_printed(m, r)
        else:
            self._sweep(*coefficients(self._rate, self._damping, timestep), self.margin)
            if self.margin:
                self._sweep_margin(m, r, timestep)
        self.z, self.prev = self.prev, self.z
        for head, i, j in heads:
            edge, corner = (weight * r / (1.0 + m) for weight in WEIGHTS[self.stencil])
            kernels.add_head(
                self.z, head, i, j, self.i1, self.j0, self.j1, self.code, edge, corner, self.open
            )

    def start(self, timestep: float) -> None:
        """Let water that was just set at rest have come from a step of this size."""
        self._fill_ghosts(timestep)
        self._retime(timestep)

    def _retime(self, timestep: float) -> None:
        """Replace the previous level by the one a step of this size would have come from.

        The speed now is v = (z - z-) / t0 + a t0 / 2, with a = c^2 L - mu v, half an old step on.
        Short waves of v t1 are calmed, then z- = z - v t1 + a t1^2 / 2. All of it is the kernel's
        own form with other coefficients. Water that has not moved yet (t0 = 0) starts at rest.
        """
        t0, t1, rate2 = self.last_timestep, timestep, self._rate**2
        if same_step(t0, t1):
            return
        self.last_timestep = t1
        if t0 == 0.0:
            self._apply(0.0, 0.5 * rate2 * t1 * t1)
            return
        half = 0.5 * self._damping
        self._apply(-(t1 / t0) * (1.0 - half * t0), -0.5 * rate2 * t0 * t1)
        level, before = self.z, self.prev
        self.z, self.prev = self._spare = self._spare or (np.zeros_like(level), level.copy())
        np.subtract(level, before, out=self.z)
        calm = math.sqrt(calming(t0, t1)) * COURANT_LIMITS[self.stencil] ** 2 / 4.0
        for a in (calm, -calm):  # (1 + a L)(1 - a L) = 1 - calming (k / k_max)^4
            self._fill_ghosts(timestep, plain=True)
            self._apply(0.0, a)
            self.z, self.prev = self.prev, self.z
        self.z *= np.float32(1.0 + half * t1)
        np.subtract(level, self.z, out=before)
        self.z, self.prev = level, before
        self._apply(-1.0, 0.5 * rate2 * t1 * t1)

    def _apply(self, q: float, s: float) -> None:
        """prev = z + q (z - prev) + s L(z) everywhere, without the margin's friction."""
        if self.open.size:
            self._sweep_masked(q, 0.0, s, 0.0)
        else:
            self._sweep(q, s, 0)

    def _fill_ghosts(self, timestep: float, *, plain: bool = False) -> None:
        mirrored = plain and self.code == kernels.OUTGOING
        courant = self._rate * timestep
        kernels.fill_ghosts(
            self.z, self.prev, self.i1, self.j0, self.j1,
            kernels.REFLECT if mirrored else self.code,
            np.float32((courant - 1.0) / (courant + 1.0)),
        )  # fmt: skip

    def _sweep(self, q: float, s: float, margin: int) -> None:
        """prev = z + q (z - prev) + s L(z) inside the margin, rows shared by threads."""
        cuts = self._cuts[margin]
        j0, j1 = self.j0 + margin, self.j1 - margin

        def band(k: int) -> None:
            rows = self.z, self.prev, cuts[k], cuts[k + 1], j0, j1, q, s
            if self.stencil == "five_point":
                kernels.step_five(*rows)
            else:
                kernels.step_nine(*rows, self._mirrors)

        self._share(band)

    def _sweep_deep(self, q: float, s: float, depth: int) -> None:
        """Several steps in one pass: bands that shrink towards each other, then the gaps between them."""
        cuts = self._cuts[0]

        def band(k: int) -> None:
            inner = int(k > 0), int(k + 1 < self._threads)
            kernels.step_nine_deep(
                self.z, self.prev, cuts[k], cuts[k + 1], self.j0, self.j1, q, s, depth, *inner
            )

        self._share(band)
        for cut in cuts[1:-1]:
            kernels.step_nine_deep(
                self.z, self.prev, cut, cut, self.j0, self.j1, q, s, depth, -1, -1
            )
        if depth % 2:
            self.z, self.prev = self.prev, self.z

    def _share(self, band: Callable[[int], None]) -> None:
        """Call band(0), band(1), ... each in a thread, and wait for all."""
        if self._threads == 1:
            band(0)
            return
        if self._pool is None or self._pool[0] != os.getpid():  # threads do not survive a fork
            self._pool = os.getpid(), ThreadPoolExecutor(self._threads - 1)
        others = [self._pool[1].submit(band, k) for k in range(1, self._threads)]
        band(0)
        for other in others:
            other.result()

    def _sweep_margin(self, m: float, r: float, timestep: float) -> None:
        """The same step in the absorbing margin, with its friction."""
        i1, j0, j1, margin = self.i1, self.j0, self.j1, self.margin
        edge, corner = WEIGHTS[self.stencil]
        friction_x, friction_y = (np.float32(0.5 * timestep) * part for part in self._sponge)
        for frame in (
            (1, 1 + margin, j0, j1),
            (i1 - margin, i1, j0, j1),
            (1 + margin, i1 - margin, j0, j0 + margin),
            (1 + margin, i1 - margin, j1 - margin, j1),
        ):
            kernels.step_sponge(
                self.z, self.prev, *frame, np.float32(m), np.float32(r),
                np.float32(edge), np.float32(corner), friction_x, friction_y,
            )  # fmt: skip

    def _sweep_masked(self, keep: float, m: float, r: float, timestep: float) -> None:
        """The same step around obstacles, margin and all: `keep` is 1 in a step."""
        edge, corner = WEIGHTS[self.stencil]
        friction_x, friction_y = (np.float32(0.5 * timestep) * part for part in self._sponge)
        kernels.step_masked(
            self.z, self.prev, 1, self.i1, self.j0, self.j1, np.float32(keep), np.float32(m),
            np.float32(r), np.float32(edge), np.float32(corner), friction_x, friction_y, self.open,
        )  # fmt: skip

    def _sweep_printed(self, m: float, r: float) -> None:
        """Equation (8) as printed."""
        edge, corner = WEIGHTS[self.stencil]
        kernels.step_sponge(
            self.z, self.prev, 1, self.i1, self.j0, self.j1, np.float32(m), np.float32(r),
            np.float32(edge), np.float32(corner), *self._no_sponge,
        )  # fmt: skip
        # The printed centre weight, -4/(mu t + 2) - 10/3 xi, less the one the kernel used.
        cells = np.s_[1 : self.i1, self.j0 : self.j1]
        excess = -4.0 / (1.0 + m) + 2.0 / 3.0 * r / (1.0 + m)
        self.prev[cells] += np.float32(excess) * self.z[cells]


def round_head(
    centre: tuple[float, float], reach: float, volume: float, *, first: tuple[int, int] = (0, 0)
) -> Head:
    """A round head of this volume [cells x m] about a centre given in cells.

    Args:
        centre: in cells from the first one.
        reach: of the load, in cells.
        volume: sum of the head over its cells [m].
        first: stored row and column of the first cell.
    """
    x, y = centre
    i, j = math.ceil(x - reach), math.ceil(y - reach)
    head = np.empty((math.floor(x + reach) - i + 1, math.floor(y + reach) - j + 1), np.float32)
    fill_head(head, x - i, y - j, reach, volume)
    return head, first[0] + i, first[1] + j
