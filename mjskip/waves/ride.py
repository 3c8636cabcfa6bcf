"""A stone and water moved on together in compiled code: many steps without leaving it."""

from __future__ import annotations

import math

import numpy as np

from mjskip.waves import _lake_kernels as tiles
from mjskip.waves._stencil import NARROWEST_LOAD, reach_of
from mjskip.waves.dense import FloatArray
from mjskip.waves.lake import Lake
from mjskip.waves.tiled import TILE

Tiles = tuple[tuple[int, int], tuple[int, int]]
"""First and last of a rectangle of tiles."""


class Ride:
    """A single stone between its own water and the common one; see `_tile_kernels.glide` and `fly`.

    Attributes:
        balance: what passed between stone and water, in the order of `_tile_kernels`.
    """

    def __init__(
        self,
        compiled: tuple[int, FloatArray, int, int, FloatArray],
        own: Lake,
        common: Lake,
        *,
        timestep: float,
        radius: float,
        side: int,
        weight: float,
        strength: float,
    ) -> None:
        """Take a stone.

        Args:
            compiled: addresses of the engine's hop, its context, addresses of the force kernel's two
                halves, and the stone's block.
            own: the water that the stone alone moves.
            common: water that must sleep wherever the stone glides; a sibling of its own.
            timestep: [s].
            radius: of the stone [m].
            side: of the patch it feels, in cells.
            weight: of a head of a metre on a cell [N].
            strength: of the head that a newton makes [cells x m/N].
        """
        self._compiled, self._own, self._common, self._timestep = compiled, own, common, timestep
        # a disc of 1.5 of its radii has more area than both faces of a flat stone; thicker ones do not glide
        size = 2 * math.ceil(reach_of(1.5 * radius, own.spacing)) + 1
        self._head = np.empty((size, size), np.float32)
        self._bent = np.empty((size + 2, size + 2))
        self.balance = np.zeros(6)
        self._numbers = np.zeros(tiles.NUMBERS)
        for name, value in (
            (tiles.ORIGIN_X, own.origin[0]),
            (tiles.ORIGIN_Y, own.origin[1]),
            (tiles.SPACING, own.spacing),
            (tiles.NARROWEST, NARROWEST_LOAD),
            (tiles.PATCH_SIDE, side),
            (tiles.TIMESTEP, timestep),
            (tiles.WEIGHT, weight),
            (tiles.STRENGTH, strength),
            (tiles.AMPLITUDE, own.sleep_amplitude),
        ):
            self._numbers[name] = value
        self._numbers[[tiles.DAMP, tiles.SCALE]] = own.water.coefficients(timestep)
        self._numbers[[tiles.EDGE, tiles.CORNER]] = own.water.weights(timestep)

    def glide(self, states: FloatArray, seen: FloatArray, shares: FloatArray) -> int:
        """Move on through a touch.

        Args:
            states: (n + 1, 18), the first row given, the others filled.
            seen: (n, 17) observed before each step.
            shares: (n,) of the reaction that the water was given.

        Returns:
            Steps made: up to n, none where the stone is dry, or its load or other waves need care.
        """
        water = self._own.water
        water.go_to_bed()
        most, around = min(len(shares), water.steps_till_bedtime), self._around(states[0])
        if most < 1 or around is None or water.shore or not water.keeps_step(self._timestep):
            return 0
        done, found = tiles.glide(
            *self._compiled, states, seen[:most], shares[:most],
            water.z, water.prev, water.neighbours, water.used, *water.scratch,
            water.slots_under(*around), *around[0], *(self._own.shape or (0, 0)),
            self._common.water.slots_under(*around), *around[0],
            self._numbers, self._head, self._bent, self.balance,
        )  # fmt: skip
        water.glided(done, found)
        self._own.time += done * self._timestep
        return done

    def fly(self, states: FloatArray, seen: FloatArray, reach: float) -> int:
        """Move on in the air: arguments as for `glide`.

        The stone does not feel the common water where that sleeps or is further than `reach` below it [m].
        """
        around = self._around(states[0])
        if around is None or not len(seen):
            return 0
        self._numbers[tiles.REACH] = reach
        done: int = tiles.fly(
            *self._compiled, states, seen,
            self._common.water.slots_under(*around), *around[0], self._numbers,
        )  # fmt: skip
        return done

    def _around(self, state: FloatArray) -> Tiles | None:
        """The nine tiles around a stone; None if it is nowhere."""
        x, y = self._own.cell_at(float(state[0]), float(state[1]))
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        a, b = int(x // TILE), int(y // TILE)
        return (a - 1, b - 1), (a + 1, b + 1)
