"""mjskip/Float-v0: a raft with three thrusters keeps its station."""

from __future__ import annotations

import math
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

REACH = 2.0
"""The raft starts within so much of its station along x and y [m]."""

FAR = 8.0
"""Farther than this from its station it is lost [m]."""


class FloatTask(Task):
    """A raft of 0.8 x 0.5 x 0.16 m and 29 kg, two stern thrusters of 8 N, a bow thruster of 6 N.

    It starts at rest within 2 m of its station (x, y), at any heading; the station is the origin, the heading to keep is
    along +x.

    Action (3): thrust of port, starboard and bow, as shares of the greatest.
    Observation (14), in the raft's own axes: where the station is, ahead and to the left [m]; sine and cosine of the
    turn that is left; height of the raft's centre [m]; the vertical (3); velocity (3) [m/s]; angular velocity (3)
    [rad/s].
    Reward: -(distance [m] + 0.3 |heading error [rad]| + 0.05 mean(action^2)).
    In a sea it makes waves and scatters those that come (`Water.radiation`), and has the form drag of law birkhoff1944; an
    episode meets the sea at a moment that is drawn.
    Terminated: more than 8 m from the station, or capsized. Truncated after 20 s.
    """

    frame_skip_default = 10
    has = frozenset({"sea"})
    camera = "shore"

    def spec(self) -> mujoco.MjSpec:
        """The raft on its lake."""
        return mujoco.MjSpec.from_file(str(Path(__file__).parent / "assets" / "float.xml"))

    def bounds(self) -> tuple[list[float], list[float]]:
        """Of the observation."""
        high = [20.0, 20.0, 1.0, 1.0, 5.0, *[1.0] * 3, *[20.0] * 3, *[50.0] * 3]
        return [-value for value in high], high

    def actions(self) -> int:
        """Three thrusters."""
        return int(self.model.nu)

    def allocate(self, count: int) -> None:
        """Goal of every row."""
        self._goal, self._offset = np.zeros((count, 3)), np.zeros((count, 2))
        self._action = np.zeros((count, self.model.nu))
        # depth at which a box of this density floats
        self._height = float(0.08 - 0.16 * 0.45)

    def begin(self, simulation: Simulation, row: int, rng: np.random.Generator) -> None:
        """At rest, somewhere."""
        x, y = rng.uniform(-REACH, REACH, 2)
        half = 0.5 * rng.uniform(-math.pi, math.pi)
        simulation.qpos[row] = [x, y, self._height, math.cos(half), 0.0, 0.0, math.sin(half)]
        heading = math.remainder(2.0 * half, 2.0 * math.pi)
        self._offset[row] = math.hypot(x, y), abs(heading)

    def act(self, simulation: Simulation, rows: Rows, action: Array) -> None:
        """Thrust."""
        simulation.ctrl[:] = action
        self._action = action

    def judge(
        self, simulation: Simulation, rows: Rows, seen: Flags | None, reward: Array, over: Flags
    ) -> None:
        """How far it is, and whether it is lost."""
        qpos = np.ascontiguousarray(simulation.qpos)
        kernels.judge_float(rows, qpos, self._goal, self._action, FAR, self._offset, reward, over)

    def observe(self, simulation: Simulation, observation: Array) -> None:
        """Station and motion, in its own axes."""
        qpos, qvel = np.ascontiguousarray(simulation.qpos), np.ascontiguousarray(simulation.qvel)
        kernels.observe_float(qpos, qvel, self._goal, observation)

    def info(self) -> Mapping[str, npt.NDArray[Any]]:
        """Distance to the station [m] and heading error [rad]."""
        return {"distance": self._offset[:, 0], "heading_error": self._offset[:, 1]}


class FloatEnv(WaterEnv):
    """One raft, see `FloatTask`."""

    task_type = FloatTask


class FloatVectorEnv(WaterVectorEnv):
    """Many of them at once."""

    task_type = FloatTask
