"""What an environment is: its model, spaces, start, action, observation, reward and end, for many rows at once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, ClassVar

import mujoco
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from mjskip._typing import Array, Flags
from mjskip.checks import check_count
from mjskip.coupling.plugin import register_plugin
from mjskip.envs.simulation import Rows, Sensors, Simulation
from mjskip.envs.variation import Choice, apply


class Task(ABC):
    """One kind of environment.

    `gymnasium` knows a task as an environment (`WaterEnv`) or as many (`WaterVectorEnv`); both call the same
    compiled code, with one row or many.

    Attributes:
        action_space: of one row, a flat Box from -1 to 1.
        observation_space: of one row, a flat Box with finite bounds.
        frame_skip: engine steps for one action.
        interval: time from one observation to the next [s].
    """

    frame_skip_default: ClassVar[int]
    has: ClassVar[frozenset[str]] = frozenset()
    """What may differ besides the water: "stone", "sea"."""
    whole_run: ClassVar[bool] = False
    """One action is one run to its end; frame_skip is then how often it is looked at."""
    camera: ClassVar[str]
    """What draws by default: a camera of the model, or a body to look at from the side."""

    def __init__(self, frame_skip: int | None) -> None:
        register_plugin()
        default = self.frame_skip_default
        self.frame_skip = default if frame_skip is None else check_count("frame_skip", frame_skip)
        self.compile = lru_cache(maxsize=8)(self._compile)
        self.model = self.compile(Choice())
        self.interval = self.frame_skip * float(self.model.opt.timestep)
        low, high = self.bounds()
        self.observation_space = spaces.Box(np.asarray(low), np.asarray(high), dtype=np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (self.actions(),), dtype=np.float32)

    def _compile(self, choice: Choice) -> mujoco.MjModel:
        spec = self.spec()
        apply(choice, spec)
        return spec.compile()

    def sensors(self) -> Sensors:
        """Where the stone's wetted area and its number of contacts stand in the sensor data, if they count."""
        return None

    @abstractmethod
    def spec(self) -> mujoco.MjSpec:
        """The model, with the plugin's water."""

    @abstractmethod
    def bounds(self) -> tuple[list[float], list[float]]:
        """Least and greatest values of an observation; what is beyond is cut to them."""

    @abstractmethod
    def actions(self) -> int:
        """Numbers in an action."""

    @abstractmethod
    def allocate(self, count: int) -> None:
        """Make room for what the task remembers of each row."""

    @abstractmethod
    def begin(self, simulation: Simulation, row: int, rng: np.random.Generator) -> None:
        """Write the start of an episode into a row whose state is the model's default."""

    @abstractmethod
    def act(self, simulation: Simulation, rows: Rows, action: Array) -> None:
        """Turn actions (count, k), within the action space, into controls."""

    @abstractmethod
    def judge(
        self, simulation: Simulation, rows: Rows, seen: Flags | None, reward: Array, over: Flags
    ) -> None:
        """Reward (added) and end of rows that were just stepped, into arrays (count,).

        Args:
            seen: whether the stone was wet, and whether it touched ground, at each step (rows, steps, 2), if there
                are sensors.
        """

    @abstractmethod
    def observe(self, simulation: Simulation, observation: Array) -> None:
        """Fill observations (count, n), not yet cut to the bounds."""

    @abstractmethod
    def info(self) -> Mapping[str, npt.NDArray[Any]]:
        """Numbers about every row (count,), by name: arrays that stay, whose contents change."""
