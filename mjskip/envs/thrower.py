"""mjskip/Thrower-v0: an arm throws a stone that it holds by a grip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags
from mjskip.envs import _task_kernels as kernels
from mjskip.envs.simulation import Rows, Sensors, Simulation
from mjskip.envs.task import Task
from mjskip.envs.touches import LIMITS, ThrownStones, add_contact_sensor, stone_sensors
from mjskip.envs.water_env import WaterEnv, WaterVectorEnv
from mjskip.throws.scene import shipped_scenes

STONE_QPOS = 3
"""Where the stone's free joint begins, behind three hinges."""


class ThrowerTask(Task):
    """The arm, the grip, the stone and the water of scene `thrower`, with its limits of speed and torque.

    Action (4): target velocities of shoulder, elbow and wrist, as shares of the scene's ctrlrange; the grip lets go,
    for good, when the last number is above 0.
    Observation (19): angles of shoulder and elbow [rad], sine and cosine of the wrist's; velocities of the three
    [rad/s]; 1 while the stone is held; time over 5 s; the stone's position [m], velocity [m/s] and upper normal;
    its spin about that normal [rad/s].
    Reward: 1 for every skip, when it is complete, and 0.1 for every metre from where it was let go.
    Terminated: when the stone has sunk, ploughs on or touches the ground. Truncated after 5 s.
    """

    frame_skip_default = 10
    has = frozenset({"stone"})
    camera = "stone"

    def spec(self) -> mujoco.MjSpec:
        """The shipped scene."""
        spec = mujoco.MjSpec.from_file(str(shipped_scenes()["thrower"]))
        add_contact_sensor(spec)
        return spec

    def sensors(self) -> Sensors:
        """The wetted area and the contacts."""
        return stone_sensors(self.model)

    def bounds(self) -> tuple[list[float], list[float]]:
        """Of the observation."""
        high = [10.0, 10.0, 1.0, 1.0, 50.0, 50.0, 500.0, 1.0, 10.0, *[100.0] * 3, *[50.0] * 3, *[1.0] * 3, 500.0]  # fmt: skip
        low = [-value for value in high]
        low[7] = low[8] = 0.0
        return low, high

    def actions(self) -> int:
        """Three joints and the grip."""
        return int(self.model.nu) + 1

    def allocate(self, count: int) -> None:
        """Stones of every row."""
        self._thrown = ThrownStones(count, float(self.model.opt.timestep), STONE_QPOS)
        self._largest = self.model.actuator_ctrlrange[:, 1].copy()
        self._held, self._time = np.ones(count), np.zeros(count)
        self._speed, self._released = np.zeros(count), np.zeros(count)

    def begin(self, simulation: Simulation, row: int, rng: np.random.Generator) -> None:
        """The scene's own start."""
        model = simulation.model(row)
        mesh = model.mesh("pebble")
        first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
        corners = np.linalg.norm(model.mesh_vert[first : first + count], axis=1)
        self._thrown.begin(row, float(corners.max()))
        self._held[row] = 1.0
        self._time[row] = self._speed[row] = self._released[row] = 0.0

    def act(self, simulation: Simulation, rows: Rows, action: Array) -> None:
        """Velocities of the joints; the grip."""
        simulation.ctrl[:] = action[:, :-1] * self._largest
        lets_go = (action[:, -1] > 0.0) & (self._held > 0.0)
        if lets_go.any():
            for row in rows[lets_go[rows]]:
                simulation.eq_active[row] = 0
                self._held[row], self._released[row] = 0.0, self._time[row]
                velocity = simulation.qvel[row, STONE_QPOS : STONE_QPOS + 3]
                self._speed[row] = np.linalg.norm(velocity)
                self._thrown.release(int(row), simulation.qpos)

    def judge(
        self, simulation: Simulation, rows: Rows, seen: Flags | None, reward: Array, over: Flags
    ) -> None:
        """Skips and metres; over when the stone has sunk, ploughs on or touches the ground."""
        assert seen is not None
        self._thrown.judge(rows, seen, np.ascontiguousarray(simulation.qpos), reward, over)
        self._time[rows] += self.interval

    def observe(self, simulation: Simulation, observation: Array) -> None:
        """Arm, grip and stone."""
        qpos, qvel = np.ascontiguousarray(simulation.qpos), np.ascontiguousarray(simulation.qvel)
        kernels.observe_thrower(qpos, qvel, self._held, self._time, LIMITS.duration, observation)

    def info(self) -> Mapping[str, npt.NDArray[Any]]:
        """Skips, distance [m], time of release [s] and speed at release [m/s] (0 while the stone is held)."""
        return {
            "skips": self._thrown.skips,
            "distance": self._thrown.distance,
            "release": self._released,
            "speed": self._speed,
        }


class ThrowerEnv(WaterEnv):
    """One arm, see `ThrowerTask`."""

    task_type = ThrowerTask


class ThrowerVectorEnv(WaterVectorEnv):
    """Many of them at once."""

    task_type = ThrowerTask
