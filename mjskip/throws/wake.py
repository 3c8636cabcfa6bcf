"""The water's side of a throw: what the stone took from the water, the water gets back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from mjskip.throws.trajectory import Trajectory

Array = npt.NDArray[np.float64]

SLICE = 2e-3
"""Longest time over which one mean load stands for a touch [s]: two centimetres at 10 m/s."""

_FOOTPRINT = 1.0  # smallest radius of a load, in cells: a touch begins with no wetted area


class Loaded(Protocol):
    """The part of `mjskip.HeightField` that a wake needs."""

    @property
    def spacing(self) -> float: ...

    def press(self, x: float, y: float, *, force: float, radius: float, density: float) -> None: ...

    def advance(self, duration: float) -> object: ...


def give_back(
    field: Loaded,
    impulse: float,
    duration: float,
    *,
    centre: tuple[float, float],
    wetted_area: float,
    density: float,
) -> None:
    """Press on the water with minus the vertical impulse that a stone took from it.

    Args:
        field: the water; the load acts through its next `advance(duration)`.
        impulse: vertical impulse of the water on the stone over that time [N s].
        duration: [s].
        centre: where it acts (x, y) [m].
        wetted_area: of the stone [m^2]; the load spreads over a disc of this area.
        density: of the water [kg/m^3].
    """
    if impulse != 0.0 and density > 0.0:
        radius = max(math.sqrt(wetted_area / math.pi), _FOOTPRINT * field.spacing)
        field.press(centre[0], centre[1], force=impulse / duration, radius=radius, density=density)


class Wake:
    """Replays the reactions of recorded stones into a water surface.

    A row of a trajectory holds from its time until the next row's: over any interval the water is
    given exactly minus the vertical impulse that the rows gave to the stones.
    """

    def __init__(
        self, field: Loaded, trajectories: Sequence[Trajectory], *, density: float
    ) -> None:
        self._field = field
        self._loads = [_Load(trajectory) for trajectory in trajectories]
        self._density = density
        self.time = 0.0

    def advance(self, until: float) -> None:
        """Move the water on to this time [s], loaded wherever a stone is wet meanwhile."""
        while self.time < until:
            end = until
            for load in self._loads:
                end = min(end, load.next_event(self.time, until))
            if end - self.time < 1e-9:  # rounding of an event: nothing can happen in it
                self.time = end if end > self.time else until
                continue
            for load in self._loads:
                impulse, centre, area = load.between(self.time, end)
                give_back(
                    self._field,
                    impulse,
                    end - self.time,
                    centre=centre,
                    wetted_area=area,
                    density=self._density,
                )
            self._field.advance(end - self.time)
            self.time = end


class _Load:
    """Running integrals of one trajectory's vertical load, so that any interval is a difference."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._time = np.asarray(trajectory.time, dtype=np.float64)
        held = np.diff(self._time, append=self._time[-1])  # the last row holds for no time
        force = trajectory.water_load * held
        # where and how wide: means weighted by |force|, which cannot cancel
        weight = np.abs(force)
        columns = [
            force,
            weight,
            weight * trajectory.wetted_centre[:, 0],
            weight * trajectory.wetted_centre[:, 1],
            weight * trajectory.wetted_area,
        ]
        self._sums = np.zeros((len(self._time), len(columns)))
        np.cumsum(np.column_stack(columns)[:-1], axis=0, out=self._sums[1:])
        wet = (trajectory.water_load != 0.0).astype(np.int8)
        self._changes = self._time[np.flatnonzero(np.diff(wet)) + 1]
        self._starts_wet = bool(wet[0])

    def next_event(self, now: float, until: float) -> float:
        """When the load next begins, ends, or must be averaged anew [s]."""
        passed = int(np.searchsorted(self._changes, now + 1e-12, side="right"))
        change = float(self._changes[passed]) if passed < len(self._changes) else until
        wet = self._starts_wet ^ (passed % 2 == 1)
        if wet and now < self._time[-1]:
            return min(change, now + SLICE, until)
        return min(change, until)

    def between(self, start: float, stop: float) -> tuple[float, tuple[float, float], float]:
        """Impulse [N s], its mean place (x, y) [m] and mean wetted area [m^2] over an interval."""
        impulse, weight, x, y, area = self._integral(stop) - self._integral(start)
        if weight <= 0.0:
            return 0.0, (0.0, 0.0), 0.0
        return float(impulse), (float(x / weight), float(y / weight)), float(area / weight)

    def _integral(self, time: float) -> Array:
        return np.array([np.interp(time, self._time, column) for column in self._sums.T])
