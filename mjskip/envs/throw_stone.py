"""mjskip/ThrowStone-v0: one action is one throw."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags
from mjskip.coupling.plugin_keys import NAME, plugin_water
from mjskip.coupling.wet import body_stone
from mjskip.envs.simulation import Rows, Sensors, Simulation
from mjskip.envs.task import Task
from mjskip.envs.touches import LIMITS, ThrownStones, add_contact_sensor, stone_sensors
from mjskip.envs.water_env import WaterEnv, WaterVectorEnv
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.throws.scene import shipped_scenes
from mjskip.throws.throw import Throw

TURN = 2.0 * math.pi

ACTIONS: dict[str, tuple[float, float]] = {
    "speed": (2.0, 14.0),
    "spin": (0.0, 30.0 * TURN),
    "attack": (0.0, math.radians(45.0)),
    "descent": (0.0, math.radians(45.0)),
    "bank": (math.radians(-20.0), math.radians(20.0)),
}
"""What -1 and 1 mean, for each number of an action: arguments of `Throw` (m/s, rad/s, rad)."""

HEIGHTS = (0.2, 0.4)
"""From where it is thrown: drawn for every episode [m]."""


class ThrowStoneTask(Task):
    """The paper's pebble over the lake of scene `lake`; an episode is one action.

    Action (5): speed, spin, attack, descent, bank, see `ACTIONS`.
    Observation (6): height [m], radius [m], thickness [m], mass [kg], density of water and of air [kg/m^3].
    Reward: 1 for every skip and 0.1 for every metre. Terminated: always, after the action.
    """

    frame_skip_default = 40
    has = frozenset({"stone"})
    whole_run = True
    camera = "stone"

    def spec(self) -> mujoco.MjSpec:
        """Scene `lake`, with its water by the plugin."""
        spec = mujoco.MjSpec.from_file(str(shipped_scenes()["lake"]))
        spec.activate_plugin(NAME)
        spec.add_plugin(name="lake", plugin_name=NAME, active=True)
        sensor = spec.add_sensor(name="water", type=mujoco.mjtSensor.mjSENS_PLUGIN)
        for plugin in (spec.body("stone").plugin, sensor.plugin):
            plugin.name, plugin.plugin_name, plugin.active = "lake", NAME, True
        add_contact_sensor(spec)
        return spec

    def sensors(self) -> Sensors:
        """The wetted area and the contacts."""
        return stone_sensors(self.model)

    def bounds(self) -> tuple[list[float], list[float]]:
        """Of the observation."""
        return [0.0] * 6, [10.0, 1.0, 1.0, 100.0, 20000.0, 1000.0]

    def actions(self) -> int:
        """Five."""
        return len(ACTIONS)

    def allocate(self, count: int) -> None:
        """Stones of every row."""
        self._thrown = ThrownStones(count, float(self.model.opt.timestep), 0)
        self._seen = np.zeros((count, 6))
        self._stones: list[Stone | None] = [None] * count
        self._speed, self._time = np.zeros(count), np.zeros(count)

    def begin(self, simulation: Simulation, row: int, rng: np.random.Generator) -> None:
        """A height, and the stone's size and water as they were chosen."""
        stone, water = _stone_and_water(simulation.model(row))
        self._stones[row] = stone
        size = np.ptp(stone.vertices, axis=0)
        self._seen[row] = [
            rng.uniform(*HEIGHTS), 0.5 * size[0], size[2], stone.mass, water.density, water.air_density,
        ]  # fmt: skip
        self._thrown.begin(row, stone.radius)
        self._speed[row] = self._time[row] = 0.0

    def act(self, simulation: Simulation, rows: Rows, action: Array) -> None:
        """Throw."""
        for row in rows:
            low, high = np.array(list(ACTIONS.values())).T
            values = low + 0.5 * (action[row] + 1.0) * (high - low)
            chosen = dict(zip(ACTIONS, values.tolist(), strict=True))
            stone = self._stones[row]
            assert stone is not None
            throw = Throw(**chosen, height=float(self._seen[row, 0]))
            state = throw.state(stone, x=-4.0)
            # the pebble's centre of mass is the origin of its body
            simulation.qpos[row] = [*state.position, *state.q]
            turn = _rotation(state.q).T @ state.omega
            simulation.qvel[row] = [*state.velocity, *turn]
            self._speed[row] = throw.speed
            self._thrown.release(int(row), simulation.qpos)

    def judge(
        self, simulation: Simulation, rows: Rows, seen: Flags | None, reward: Array, over: Flags
    ) -> None:
        """Skips and metres; over when it has sunk, ploughs on, touches the ground or is out of time."""
        assert seen is not None
        qpos = np.ascontiguousarray(simulation.qpos)
        self._thrown.judge(rows, seen, qpos, reward, over)
        self._time[rows] += self.interval
        over[rows] |= self._time[rows] >= LIMITS.duration

    def observe(self, simulation: Simulation, observation: Array) -> None:
        """What is thrown, and over what."""
        observation[:] = self._seen

    def info(self) -> Mapping[str, npt.NDArray[Any]]:
        """Skips, distance [m], speed of the throw [m/s] and how long it was looked at [s]."""
        return {
            "skips": self._thrown.skips,
            "distance": self._thrown.distance,
            "speed": self._speed,
            "time": self._time,
        }


@lru_cache(maxsize=8)
def _stone_and_water(model: mujoco.MjModel) -> tuple[Stone, Water]:
    body = model.body("stone").id
    water = plugin_water(model, body)
    assert water is not None
    return body_stone(model, body), water


def _rotation(q: Array) -> Array:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, q)
    return matrix.reshape(3, 3)


class ThrowStoneEnv(WaterEnv):
    """One throw an episode, see `ThrowStoneTask`; "rgb_array_list" films it."""

    metadata = {  # noqa: RUF012  gymnasium's
        "render_modes": ["human", "rgb_array", "rgb_array_list"],
        "render_fps": 50,
    }

    task_type = ThrowStoneTask


class ThrowStoneVectorEnv(WaterVectorEnv):
    """Many of them at once."""

    task_type = ThrowStoneTask
