"""mjskip/Wade-v0: a quadruped crosses a ford."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags
from mjskip.envs import _task_kernels as kernels
from mjskip.envs.simulation import Rows, Simulation
from mjskip.envs.task import Task
from mjskip.envs.water_env import WaterEnv, WaterVectorEnv

FAR_BANK = 3.6
"""The ford is crossed when the trunk is beyond this x [m]; it starts at -0.6."""

LOWEST = -0.08
"""Height of the trunk's middle below which it lies in the water [m]; it stands at 0.2 in the ford."""

SWING = 0.6
"""Largest change of a joint's target from its standing angle [rad]."""


class WadeTask(Task):
    """A quadruped of boxes, 8 kg, 0.32 m high, with hips and knees; water 0.16 m deep over 2 m.

    Action (8): targets of hip and knee of the front left, front right, hind left and hind right leg, as shares of 0.6
    rad from standing.
    Observation (30): the trunk's position [m]; the vertical in its axes (3); sine and cosine of its heading; velocity
    in its axes (3) [m/s]; angular velocity (3) [rad/s]; angles (8) [rad] and velocities (8) [rad/s] of the joints.
    Reward: 10 for every metre across, -0.02 mean(action^2) a step, 10 on arriving.
    Terminated: on the far bank, or fallen. Truncated after 20 s.
    """

    frame_skip_default = 10
    camera = "follow"

    def spec(self) -> mujoco.MjSpec:
        """The ford."""
        return mujoco.MjSpec.from_file(str(Path(__file__).parent / "assets" / "wade.xml"))

    def bounds(self) -> tuple[list[float], list[float]]:
        """Of the observation."""
        joints = self.model.nu
        high = [20.0, 20.0, 5.0, *[1.0] * 5, *[20.0] * 3, *[50.0] * 3]
        high += [4.0] * joints + [100.0] * joints
        return [-value for value in high], high

    def actions(self) -> int:
        """Eight joints."""
        return int(self.model.nu)

    def allocate(self, count: int) -> None:
        """Progress of every row."""
        self._before, self._progress = np.zeros(count), np.zeros(count)
        self._crossed = np.zeros(count, np.bool_)
        self._action = np.zeros((count, self.model.nu))
        self._stand = self.model.key("stand")

    def begin(self, simulation: Simulation, row: int, rng: np.random.Generator) -> None:
        """Standing on the near bank, joints within 0.05 rad of their angles."""
        simulation.qpos[row] = self._stand.qpos
        simulation.qpos[row, 7:] += rng.uniform(-0.05, 0.05, self.model.nu)
        simulation.ctrl[row] = self._stand.ctrl
        self._before[row], self._progress[row] = self._stand.qpos[0], 0.0
        self._crossed[row] = False

    def act(self, simulation: Simulation, rows: Rows, action: Array) -> None:
        """Targets of the joints."""
        simulation.ctrl[:] = self._stand.ctrl + SWING * action
        self._action = action

    def judge(
        self, simulation: Simulation, rows: Rows, seen: Flags | None, reward: Array, over: Flags
    ) -> None:
        """How far it came, and whether it fell."""
        kernels.judge_wade(
            rows, np.ascontiguousarray(simulation.qpos), self._action, self._before, FAR_BANK, LOWEST,
            self._progress, self._crossed, reward, over,
        )  # fmt: skip

    def observe(self, simulation: Simulation, observation: Array) -> None:
        """Trunk and joints."""
        qpos, qvel = np.ascontiguousarray(simulation.qpos), np.ascontiguousarray(simulation.qvel)
        kernels.observe_wade(qpos, qvel, self.model.nu, observation)

    def info(self) -> Mapping[str, npt.NDArray[Any]]:
        """Metres across since the start, and whether it arrived."""
        return {"distance": self._progress, "crossed": self._crossed}


class WadeEnv(WaterEnv):
    """One quadruped, see `WadeTask`."""

    task_type = WadeTask


class WadeVectorEnv(WaterVectorEnv):
    """Many of them at once."""

    task_type = WadeTask
