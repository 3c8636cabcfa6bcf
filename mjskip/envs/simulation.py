"""One simulation, or many in a `mujoco.batch.Batch`, behind one face: arrays with a row for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import mujoco
import numpy as np

from mjskip._typing import Flags, Integers

Rows = Integers
Sensors = tuple[int, int] | None
"""Two places in the sensor data."""

NONE: Rows = np.empty(0, np.int64)
DIVERGED = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Counters of positions, velocities and accelerations that were not finite."""


class Simulation(Protocol):
    """Attributes are live (count, ...) arrays: writing one changes the state."""

    count: int
    qpos: Any
    qvel: Any
    ctrl: Any
    eq_active: Any

    def begin(self, rows: Rows, models: Sequence[mujoco.MjModel]) -> None:
        """Give these rows their models, and every state its default."""

    def set_time(self, row: int, time: float) -> None:
        """Let a row that has begun be at another time [s]."""

    def forward(self, rows: Rows) -> None:
        """Work out what follows from states that were written."""

    def advance(self, rows: Rows, steps: int, sensors: Sensors) -> Flags | None:
        """Step; whether two numbers of the sensor data were above 0 at each (rows, steps, 2).

        None if there are no `sensors`.
        """

    def lost(self, rows: Rows) -> Rows:
        """Rows that have diverged since they began: MuJoCo counts it, and begins them anew or stops them."""

    def model(self, row: int) -> mujoco.MjModel:
        """The model of one row."""

    def data(self, row: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one row, for drawing."""


class SingleSimulation:
    """One simulation."""

    count = 1

    def __init__(self, model: mujoco.MjModel) -> None:
        self._load(model)

    def _load(self, model: mujoco.MjModel) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        data = self._data
        self.qpos, self.qvel, self.ctrl = data.qpos[None], data.qvel[None], data.ctrl[None]
        self.eq_active = data.eq_active[None]
        self._sensors, self._warnings = data.sensordata, data.warning.number[DIVERGED]

    def begin(self, rows: Rows, models: Sequence[mujoco.MjModel]) -> None:
        """Give it its model, and its state the default."""
        if models[0] is not self._model:
            self._load(models[0])
        mujoco.mj_resetData(self._model, self._data)

    def set_time(self, row: int, time: float) -> None:
        """Let it be at another time."""
        self._data.time = time

    def forward(self, rows: Rows) -> None:
        """Work out what follows from the state."""
        mujoco.mj_forward(self._model, self._data)

    def advance(self, rows: Rows, steps: int, sensors: Sensors) -> Flags | None:
        """Step; see `Simulation`."""
        model, data = self._model, self._data
        if sensors is None:
            mujoco.mj_step(model, data, steps)
            return None
        above = np.empty((1, steps, 2), np.bool_)
        numbers, step, (first, second) = self._sensors, mujoco.mj_step, sensors
        for k in range(steps):
            step(model, data)
            above[0, k, 0], above[0, k, 1] = numbers[first] > 0.0, numbers[second] > 0.0
        return above

    def lost(self, rows: Rows) -> Rows:
        """Its row if it diverged."""
        item = self._warnings.item  # an array's any() takes longer than all else here
        return rows if item(0) or item(1) or item(2) else NONE

    def model(self, row: int) -> mujoco.MjModel:
        """The model."""
        return self._model

    def data(self, row: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data."""
        return self._model, self._data


class BatchSimulation:
    """A `mujoco.batch.Batch`: each row is bit for bit what `SingleSimulation` makes of it."""

    def __init__(self, model: mujoco.MjModel, count: int, threads: int) -> None:
        from mujoco.batch import Batch

        self.count = count
        self._batch = Batch(model, nsim=count, nthread=threads)
        self._models: list[mujoco.MjModel] = [model] * count
        batch = self._batch
        self.qpos, self.qvel, self.ctrl = batch.qpos, batch.qvel, batch.ctrl
        self.eq_active = batch.eq_active
        self._warnings = batch.warning[:, DIVERGED, 1]

    def begin(self, rows: Rows, models: Sequence[mujoco.MjModel]) -> None:
        """Give these rows their models, and every state its default.

        Raises:
            ValueError: their states are not of the size that those of the batch have.
        """
        changed = [(r, m) for r, m in zip(rows, models, strict=True) if m is not self._models[r]]
        if changed:
            wanted = list(self._models)
            for row, model in changed:
                wanted[row] = model
            try:
                self._batch.set_models(wanted)
            except mujoco.FatalError as error:
                raise ValueError(
                    "sea: all episodes of a batch are in still water, or all in a sea; give sea= to make_vec"
                ) from error
            self._models = wanted
        self._batch.reset(rows, stage=mujoco.mjtStage.mjSTAGE_NONE)

    def set_time(self, row: int, time: float) -> None:
        """Let a row be at another time."""
        self._batch.time[row] = time

    def forward(self, rows: Rows) -> None:
        """Work out what follows from states that were written."""
        self._batch.forward(rows)

    def advance(self, rows: Rows, steps: int, sensors: Sensors) -> Flags | None:
        """Step; see `Simulation`."""
        ids = None if len(rows) == self.count else rows
        if sensors is None:
            self._batch.step(ids, nstep=steps)
            return None
        recorded = self._batch.rollout(steps, record=("sensordata",), ids=ids)
        return np.asarray(recorded["sensordata"][:, :, sensors] > 0.0)

    def lost(self, rows: Rows) -> Rows:
        """Rows that diverged."""
        return np.asarray(rows[self._warnings[rows].any(axis=1)])

    def model(self, row: int) -> mujoco.MjModel:
        """The model of one row."""
        return self._models[row]

    def data(self, row: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one row, for drawing."""
        model, data = self._models[row], mujoco.MjData(self._models[row])
        self._batch.get_data(row, data)
        mujoco.mj_forward(model, data)
        return model, data
