"""Skips counted while they happen, from whether a stone is wet, or touches the ground, at each step."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mjskip._typing import Array, Flags
from mjskip.envs import _task_kernels as kernels
from mjskip.envs.simulation import Rows, Sensors
from mjskip.throws.recording import Limits

LIMITS = Limits()
"""What counts as a skip, and when a stone's run is over."""

SKIP_REWARD, METRE_REWARD = 1.0, 0.1


def add_contact_sensor(spec: mujoco.MjSpec) -> None:
    """Let the model say how many contacts the stone has: with the bottom or a bank, as the water is no geom."""
    spec.add_sensor(
        name="ground",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname="stone",
        intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1],
    )


def stone_sensors(model: mujoco.MjModel) -> Sensors:
    """Where the stone's wetted area and its number of contacts stand in the sensor data."""
    return int(model.sensor("water").adr[0]) + 6, int(model.sensor("ground").adr[0])


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
        self.skips, self.distance = np.zeros(count, np.int64), np.zeros(count)
        self.free, self._grounded = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self._contact, self._dry, self._counted = np.zeros(count), np.zeros(count), np.zeros(count)
        self._start, self._radius = np.zeros((count, 2)), np.zeros(count)

    def begin(self, row: int, radius: float) -> None:
        """A new stone of this bounding radius [m], not let go yet."""
        for array in (self.skips, self.distance, self._contact, self._dry, self._counted):
            array[row] = 0
        self.free[row], self._grounded[row], self._radius[row] = False, False, radius

    def release(self, row: int, qpos: Any) -> None:
        """The stone is free, from where it is now."""
        self.free[row] = True
        self._start[row] = qpos[row, self._address : self._address + 2]

    def judge(self, rows: Rows, seen: Flags, qpos: Any, reward: Array, over: Flags) -> None:
        """Go on by some steps: add to rewards, say which stones are over.

        1 for every skip, when it is complete, and 0.1 for every metre. A stone is over that has sunk, has not left
        the water for `Limits().max_contact`, or touches the ground: what the ground throws up again is no skip.

        Args:
            seen: whether a stone was wet, and whether it touched the ground, at each step (rows, steps, 2).
        """
        kernels.count_skips(
            rows,
            seen,
            self._timestep,
            LIMITS.min_airtime,
            self.skips,
            self._contact,
            self._dry,
            self._grounded,
        )
        kernels.judge_stone(
            rows, qpos, self._address, self._radius, self.skips, self._contact, self._grounded, self.free,
            LIMITS.sink_depth, LIMITS.max_contact, SKIP_REWARD, METRE_REWARD,
            self._start, self._counted, self.distance, reward, over,
        )  # fmt: skip
