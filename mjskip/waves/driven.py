"""Water under bodies that do not feel it: it is given back what they took, and makes rings to look at."""

from __future__ import annotations

import math

import numpy as np

from mjskip._typing import Array
from mjskip.waves.field import HeightField
from mjskip.waves.recording import SurfaceRecorder

SLICE = 2e-3
"""Longest time over which one mean load stands for a touch [s]: two centimetres at 10 m/s."""


class DrivenWater:
    """Replays the reactions of bodies into a surface, at their own steps.

    Over any number of steps the water is given exactly minus the vertical impulse that the bodies took.

    Attributes:
        field: the water; it may be behind the time by less than its largest step.
    """

    def __init__(
        self, field: HeightField, *, timestep: float, density: float, recorder: SurfaceRecorder | None = None
    ) -> None:  # fmt: skip
        """Drive this water; in steps of the bodies [s], `density` of the water [kg/m^3]."""
        self.field, self._recorder = field, recorder
        self._timestep, self._density = timestep, density
        self._behind = 0

    def extend(self, reactions: Array, centres: Array, areas: Array) -> None:
        """Move on by m steps under the reactions of n bodies.

        Args:
            reactions: vertical force of the water on each body (m, n) [N].
            centres: where it acts (m, n, 2) [m].
            areas: of the load: it spreads over a disc of this area (m, n) [m^2].
        """
        longest = max(1, int(SLICE / self._timestep))
        patience = max(1, int(self.field.max_timestep / self._timestep))
        wet = (reactions != 0.0).any(axis=1)
        step = 0
        while step < len(reactions):
            self._record()
            most = len(reactions) - step
            if self._recorder is not None:
                most = min(most, self._recorder.steps_until_due(self._now()))
            most = min(most, longest if wet[step] else patience - self._behind)
            until = step + most
            change = np.flatnonzero(wet[step:until] != wet[step])
            until = step + int(change[0]) if len(change) else until
            self._behind += until - step
            if wet[step]:
                self._behind -= until - step
                self.catch_up()
                self._behind = until - step
                self._press(reactions[step:until], centres[step:until], areas[step:until])
                self.catch_up()
            elif self._behind >= patience:
                self.catch_up()
            step = until

    def catch_up(self) -> None:
        """Bring the field to the present."""
        if self._behind:
            self.field.advance(self._behind * self._timestep)
            self._behind = 0

    def finish(self) -> None:
        """After the last step: let the recorder follow the rings as long as it wants to."""
        self.catch_up()
        if self._recorder is not None:
            self._recorder.linger(self.field)

    def _now(self) -> float:
        return self.field.time + self._behind * self._timestep

    def _record(self) -> None:
        if self._recorder is not None and self._recorder.is_due(self._now()):
            self.catch_up()
            self._recorder.record(self.field)

    def _press(self, reactions: Array, centres: Array, areas: Array) -> None:
        """Load the field with the mean over some steps; places are weighted by |force|, which cannot cancel."""
        weights = np.abs(reactions)
        for b in np.flatnonzero(weights.any(axis=0)):
            x, y = np.average(centres[:, b], axis=0, weights=weights[:, b])
            area = float(np.average(areas[:, b], weights=weights[:, b]))
            force = float(reactions[:, b].mean())
            if force != 0.0:
                radius = max(math.sqrt(area / math.pi), 1e-9)
                self.field.press(
                    float(x), float(y), force=force, radius=radius, density=self._density
                )
