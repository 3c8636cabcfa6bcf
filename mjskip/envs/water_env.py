"""A task as a Gymnasium environment, alone or many at once in a `mujoco.batch.Batch`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.random import default_rng

from mjskip._typing import Array, Flags, Image, SingleArray
from mjskip.checks import check_choice, check_count, fault
from mjskip.envs import _task_kernels as kernels
from mjskip.envs.simulation import BatchSimulation, Rows, Simulation, SingleSimulation
from mjskip.envs.task import Task
from mjskip.envs.variation import Options, Variation, check_options
from mjskip.envs.view import View
from mjskip.hydro.water import Water

LONGEST = 3600.0
"""A sea is met at a moment between 0 and this [s]."""

RENDER_MODES = ("human", "rgb_array")


class Episodes:
    """Rows of a simulation that begin and go on: what both kinds of environment share."""

    def __init__(
        self,
        task: Task,
        count: int,
        *,
        water: Water | Options | None,
        stone: Options | None,
        sea: Options | str | None = None,
        threads: int | None = None,
    ) -> None:
        self.task = task
        self._default = Variation(water, stone, sea, has=task.has)
        self.variation = self._default
        # of a batch, whose states have one size for good
        model = task.model if sea is None else task.compile(self._default.draw(default_rng(0)))
        self.simulation: Simulation = (
            SingleSimulation(model) if threads is None else BatchSimulation(model, count, threads)
        )
        task.allocate(count)
        self.info = task.info()
        space = task.observation_space
        self._low, self._high = space.low, space.high
        self._observation = np.zeros((count, *(space.shape or ())))
        self._sensors = task.sensors()
        self._action = np.zeros((count, *(task.action_space.shape or ())))
        self.reward = np.zeros(count)
        self.over = np.zeros(count, np.bool_)

    def vary(self, options: Options | None) -> None:
        """Take the options of a reset; without any, those the environment was made with."""
        options = check_options(options, {"water", *self.task.has})
        self.variation = (
            Variation(
                options.get("water"), options.get("stone"), options.get("sea"), has=self.task.has
            )
            if options
            else self._default
        )

    def begin(self, rows: Rows, rngs: list[np.random.Generator]) -> None:
        """Begin an episode in these rows; rngs are of all rows."""
        simulation, task = self.simulation, self.task
        choices = [self.variation.draw(rngs[row]) for row in rows]
        simulation.begin(rows, [task.compile(choice) for choice in choices])
        for row, choice in zip(rows, choices, strict=True):
            if choice.sea:  # which has no beginning
                simulation.set_time(int(row), float(rngs[row].uniform(0.0, LONGEST)))
        for row in rows:
            task.begin(simulation, int(row), rngs[row])
        simulation.forward(rows)
        self.reward[rows], self.over[rows] = 0.0, False

    def actions(self, given: Any, shape: tuple[int, ...]) -> Array:
        """Actions of this shape as doubles, cut to -1 to 1 (count, k).

        Raises:
            ValueError: they have another shape or are not finite.
        """
        try:
            array = np.asarray(given, np.float64)
        except (TypeError, ValueError):
            array = np.empty(0)
        sound = array.shape == shape
        if not (sound and kernels.cut_actions(array.reshape(self._action.shape), self._action)):
            raise fault("action", given, f"give finite numbers of shape {shape}")
        return self._action

    def advance(self, rows: Rows, action: Array, after_block: Callable[[], None]) -> None:
        """One action in these rows; `after_block` is called after every `frame_skip` steps."""
        simulation, task = self.simulation, self.task
        task.act(simulation, rows, action)
        self.reward[:] = 0.0
        self._block(rows)
        after_block()
        while task.whole_run and len(rows := rows[~self.over[rows]]):
            self._block(rows)
            after_block()

    def _block(self, rows: Rows) -> None:
        """`frame_skip` steps; a row that diverged is over."""
        simulation, task = self.simulation, self.task
        seen = simulation.advance(rows, task.frame_skip, self._sensors)
        task.judge(simulation, rows, seen, self.reward, self.over)
        lost = simulation.lost(rows)
        if len(lost):
            self.over[lost] = True

    def observations(self) -> Array:
        """Of all rows, within the bounds (count, n)."""
        self.task.observe(self.simulation, self._observation)
        out = np.empty(self._observation.shape)
        kernels.cut_observations(self._observation, self._low, self._high, out)
        return out


def _nothing() -> None:
    """Called after a block that nobody watches."""


class WaterEnv(gymnasium.Env[Array, SingleArray]):
    """One simulation of a task."""

    task_type: type[Task]
    """What is done."""

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012  gymnasium's

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        frame_skip: int | None = None,
        water: Water | Options | None = None,
        stone: Options | None = None,
        sea: Options | str | None = None,
        width: int = 480,
        height: int = 360,
        camera: str | int | None = None,
    ) -> None:
        """Make the simulation.

        Args:
            render_mode: "human" (a window), "rgb_array", or "rgb_array_list" where an action is a whole run; None
                draws nothing.
            frame_skip: engine steps for one action; the task's if None.
            water: a `Water`, or fields of it; numbers may be ranges (low, high) to draw from.
            stone: radius [m], thickness [m] and density [kg/m^3] of the stone, where there is one; ranges too.
            sea: waves and current where bodies radiate, as a text for `Sea.from_text` or by its keys in SI units and
                radians; ranges too.
            width, height: of pictures [pixels].
            camera: name or id; the task's if None.

        Raises:
            ValueError: an argument is unknown to this task, or not allowed.
        """
        task = self.task_type(frame_skip)
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / task.interval))}
        self.action_space, self.observation_space = task.action_space, task.observation_space
        self._episodes = Episodes(task, 1, water=water, stone=stone, sea=sea)
        self._view = View(width, height, task.camera if camera is None else camera)
        self._row = np.arange(1)
        self._shape = task.action_space.shape
        self._begun = False
        self._frames: list[Image] = []
        watch: dict[str | None, Callable[[], None]] = {
            "human": self._show,
            "rgb_array_list": lambda: self._frames.append(self._picture()),
        }
        self._after_block = watch.get(render_mode, _nothing)

    @property
    def model(self) -> mujoco.MjModel:
        """The model of this episode."""
        return self._episodes.simulation.data(0)[0]

    @property
    def data(self) -> mujoco.MjData:
        """Its data."""
        return self._episodes.simulation.data(0)[1]

    @property
    def frame_skip(self) -> int:
        """Engine steps for one action, or between two looks at a throw."""
        return self._episodes.task.frame_skip

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of everything that is drawn.
            options: "water" (a `Water`, or fields of it) and, where there is one, "stone" (radius [m],
                thickness [m], density [kg/m^3]) or "sea" (hs [m], tp [s], direction [rad] and so on, or a text for
                `Sea.from_text`); numbers may be ranges (low, high). They hold for this episode; without options
                those hold that the environment was made with.

        Raises:
            ValueError: an option is unknown or not allowed.
        """
        super().reset(seed=seed)
        self._episodes.vary(options)
        self._episodes.begin(self._row, [self.np_random])
        self._begun = True
        self._frames.clear()
        self._after_block()
        return self._episodes.observations()[0], self._info()

    def step(self, action: SingleArray) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Do one action.

        Args:
            action: (n,), each from -1 to 1; what they mean says the task.

        Returns:
            Observation (m,) in SI units, reward, terminated, False, info.
        """
        if not self._begun:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        episodes = self._episodes
        episodes.advance(self._row, episodes.actions(action, self._shape), self._after_block)
        return (
            episodes.observations()[0],
            float(episodes.reward[0]),
            bool(episodes.over[0]),
            False,
            self._info(),
        )

    def render(self) -> Image | list[Image] | None:  # type: ignore[override]
        """The picture (height, width, 3), colours from 0 to 255, for "rgb_array"; "human" has its window.

        For "rgb_array_list", where one action is a whole run: the pictures since the last call.
        """
        match self.render_mode:
            case "human":
                self._show()
            case "rgb_array":
                return self._picture()
            case "rgb_array_list":
                frames, self._frames[:] = list(self._frames), []
                return frames
            case _:
                gymnasium.logger.warn(
                    "render() without a render_mode draws nothing: give one to make()"
                )
        return None

    def _picture(self) -> Image:
        return self._view.picture(*self._episodes.simulation.data(0))

    def _show(self) -> None:
        self._view.show(*self._episodes.simulation.data(0), self._episodes.task.interval)

    def close(self) -> None:
        """Close the window and free what draws."""
        self._view.close()

    def _info(self) -> dict[str, Any]:
        return {key: value.item(0) for key, value in self._episodes.info.items()}


class WaterVectorEnv(VectorEnv[Any, Any, Any]):
    """Many simulations of a task in one `mujoco.batch.Batch`, on several threads.

    Row i is bit for bit what row i of a `SyncVectorEnv` of the same environments is, for the same seed. A row
    whose episode is over begins a new one at the next step, whose action it ignores ("next step" autoreset).
    """

    task_type: type[Task]
    """What is done."""

    metadata = {  # noqa: RUF012  gymnasium's
        "render_modes": ["rgb_array"],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        *,
        num_envs: int = 1,
        num_threads: int = 0,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        frame_skip: int | None = None,
        water: Water | Options | None = None,
        stone: Options | None = None,
        sea: Options | str | None = None,
        width: int = 480,
        height: int = 360,
        camera: str | int | None = None,
    ) -> None:
        """Make the simulations; arguments that are not named here are those of `WaterEnv`.

        Args:
            num_envs: rows.
            num_threads: that share the rows; 0 for as many as there are processors.
            max_episode_steps: actions after which an episode is cut off; None for no limit.
            render_mode: "rgb_array"; None draws nothing.

        Raises:
            ValueError: an argument is unknown to this task, or not allowed.
        """
        task = self.task_type(frame_skip)
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.num_envs = check_count("num_envs", num_envs)
        threads = check_count("num_threads", num_threads, low=0)
        self._limit = max_episode_steps
        self.single_action_space = task.action_space
        self.single_observation_space = task.observation_space
        self.action_space = batch_space(task.action_space, num_envs)
        self.observation_space = batch_space(task.observation_space, num_envs)
        self._episodes = Episodes(
            task, num_envs, water=water, stone=stone, sea=sea, threads=threads
        )
        self._view = View(width, height, task.camera if camera is None else camera)
        self._all = np.arange(num_envs)
        self._rngs: list[np.random.Generator] = []
        self._steps = np.zeros(num_envs, np.int64)
        self._finished = np.zeros(num_envs, np.bool_)
        self._shape = (num_envs, *(task.action_space.shape or ()))

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode in every row.

        Args:
            seed: of everything that is drawn: one for each row, or a number that row i adds i to.
            options: as for one environment, see `WaterEnv.reset`.

        Returns:
            Observations (num_envs, m) in SI units, and info.

        Raises:
            ValueError: an option is unknown or not allowed, or there are too few seeds.
        """
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise fault("seed", seed, f"give one number, or {self.num_envs} of them")
        if not self._rngs:
            self._rngs = [seeding.np_random(s)[0] for s in seeds]
        else:
            for row, one in enumerate(seeds):
                if one is not None:
                    self._rngs[row] = seeding.np_random(one)[0]
        self._episodes.vary(options)
        self._episodes.begin(self._all, self._rngs)
        self._steps[:], self._finished[:] = 0, False
        return self._episodes.observations(), self._info(self._all)

    def step(self, actions: Any) -> tuple[Array, Array, Flags, Flags, dict[str, Any]]:
        """One action for every row that goes on; the others begin anew.

        Args:
            actions: (num_envs, n), each from -1 to 1; what they mean says the task.

        Returns:
            Observations (num_envs, m) in SI units; rewards, terminated and truncated (num_envs,); info.
        """
        if not self._rngs:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        episodes, finished = self._episodes, self._finished
        action = episodes.actions(actions, self._shape)
        going, ended = self._all, self._all[:0]
        if finished.any():
            going, ended = np.flatnonzero(~finished), np.flatnonzero(finished)
        episodes.reward[:] = 0.0
        if len(going):
            episodes.advance(going, action, _nothing)
            self._steps[going] += 1
        if len(ended):
            episodes.vary(None)
            episodes.begin(ended, self._rngs)
            self._steps[ended] = 0
        over = episodes.over.copy()
        cut = np.zeros(self.num_envs, np.bool_)
        if self._limit is not None:
            cut = self._steps >= self._limit
        self._finished = over | cut
        info = self._info(self._all)
        return episodes.observations(), episodes.reward.copy(), over, cut, info

    def render(self) -> tuple[Image, ...] | None:
        """A picture (height, width, 3) of every row, colours from 0 to 255; None without a render_mode."""
        if self.render_mode is None:
            return None
        simulation = self._episodes.simulation
        return tuple(self._view.picture(*simulation.data(row)) for row in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free what draws.

        Args:
            kwargs: Gymnasium's; not used.
        """
        self._view.close()

    def _info(self, rows: Rows) -> dict[str, Any]:
        present = np.zeros(self.num_envs, np.bool_)
        present[rows] = True
        info: dict[str, Any] = {}
        for key, value in self._episodes.info.items():
            info[key], info[f"_{key}"] = value.copy(), present
        return info
