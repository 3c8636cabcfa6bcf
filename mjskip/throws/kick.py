"""Stones of the pure integrator over moving water: free flights between kicks by loads and surface together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mjskip._typing import Array
from mjskip.hydro.stone import Stone
from mjskip.hydro.wrench import entry_address, wrench_address
from mjskip.rigid import _rigid_kernels as rigid
from mjskip.rigid.body import body_row
from mjskip.rigid.state import STATE
from mjskip.throws.reference import start_of
from mjskip.throws.throw import State
from mjskip.waves import _kick_kernels as kernels
from mjskip.waves.coupled import CoupledWater


class KickedStones:
    """What steps stones for `CoupledWater.advance`.

    Attributes:
        y: x, q, P, L of the stones (n, 13).
        context: what the C function `step` is given.
    """

    def __init__(
        self,
        stones: Sequence[Stone],
        starts: Sequence[State],
        *,
        timestep: float,
        gravity: Array,
        frozen_attitude: bool = False,
    ) -> None:
        """Take stones as they leave the hand; gravity (3,) [m/s^2]."""
        self.y = np.array([start_of(*pair) for pair in zip(stones, starts, strict=True)])
        self._rows = np.array([
            body_row(
                stone.mass, stone.inertia, gravity=gravity, forces=0, block=0,
                frozen_attitude=frozen_attitude,
            )
            for stone in stones
        ])  # fmt: skip
        self.context = np.zeros(kernels.KICK_TIMESTEP + 1)
        self.context[kernels.KICK_TIMESTEP] = timestep

    @property
    def step(self) -> int:
        """Address of `kick_step`."""
        return entry_address(kernels.kick_step)

    def states(self) -> Array:
        """States (n, 18) as they are."""
        states = np.empty((len(self.y), STATE))
        for row, y, state in zip(self._rows, self.y, states, strict=True):
            rigid.motion(row, y, state)
        return states

    def couple(self, water: CoupledWater) -> None:
        """Have the loads from this water, which was made for 0 stages."""
        arrays = water.words, self.y, self._rows
        words, y, rows = (array.ctypes.data for array in arrays)
        addresses = np.array([words, wrench_address(), y, rows], np.int64)
        self.context[: kernels.KICK_TIMESTEP] = addresses.view(np.float64)
