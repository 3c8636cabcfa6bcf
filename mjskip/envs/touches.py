"""Skips counted while they happen, from whether a stone is wet at each step."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.envs import _task_kernels as kernels
from mjskip.envs.simulation import Flags, Rows
from mjskip.throws.recording import Limits

LIMITS = Limits()
"""What counts as a skip, and when a stone's run is over."""

SKIP_REWARD, METRE_REWARD = 1.0, 0.1


class ThrownStones:
    """What `count` stones did since they were let go.

    Attributes:
        skips: touches after which the stone was in the air for `Limits().min_airtime` (count,).
        distance: horizontal, from where it was let go (count,) [m].
        free: whether it was let go (count,).
    """

    def __init__(self, count: int, timestep: float, address: int) -> None:
        """`address`: where the stone's free joint begins in qpos."""
        self._timestep, self._address = timestep, address
        self.skips, self.distance = np.zeros(count), np.zeros(count)
        self.free = np.zeros(count, np.bool_)
        self._contact, self._dry, self._counted = np.zeros(count), np.zeros(count), np.zeros(count)
        self._start, self._radius = np.zeros((count, 2)), np.zeros(count)

    def begin(self, row: int, radius: float) -> None:
        """A new stone of this bounding radius [m], not let go yet."""
        for array in (self.skips, self.distance, self._contact, self._dry, self._counted):
            array[row] = 0.0
        self.free[row], self._radius[row] = False, radius

    def let_go(self, row: int, qpos: Any) -> None:
        """The stone is free, from where it is now."""
        self.free[row] = True
        self._start[row] = qpos[row, self._address : self._address + 2]

    def judge(self, rows: Rows, wet: Flags, qpos: Any, reward: Array, over: Flags) -> None:
        """Go on by the steps of `wet` (rows, steps): add to rewards, say which stones are over.

        1 for every skip, when it is complete, and 0.1 for every metre. A stone is over that has sunk or has
        not left the water for `Limits().max_contact`.
        """
        kernels.count_skips(
            rows, wet, self._timestep, LIMITS.min_airtime, self.skips, self._contact, self._dry
        )
        kernels.judge_stone(
            rows, qpos, self._address, self._radius, self.skips, self._contact, self.free,
            LIMITS.sink_depth, LIMITS.max_contact, SKIP_REWARD, METRE_REWARD,
            self._start, self._counted, self.distance, reward, over,
        )  # fmt: skip
