"""What a film needs of a model beside its free bodies: the joints at every step, the surface at its moments."""

from __future__ import annotations

import mujoco
import numpy as np

from mjskip._typing import Array
from mjskip.coupling.attach import Coupling
from mjskip.coupling.water_surface import (
    SQUARE,
    SQUARE_SPACING,
    PluginSea,
    WaterSurface,
    sea_square,
)
from mjskip.waves.field import HeightField
from mjskip.waves.recording import SurfaceFrames, SurfaceRecorder, SurfaceRecording

WINDOW = 512
"""Cells a side of what is recorded of a square of water that follows the bodies."""


class ModelRecorder:
    """Follows a run, step by step.

    Attributes:
        qpos: of every step so far, the first before any, each (nq,).
    """

    def __init__(
        self, data: mujoco.MjData, *, timestep: float, frames: SurfaceFrames | None,
        surface: WaterSurface | PluginSea | Coupling | None, middle: tuple[float, float],
    ) -> None:  # fmt: skip
        """Begin.

        Args:
            data: of the run, before its first step.
            timestep: [s].
            frames: when the surface is kept; None if it is not.
            surface: the moving water; None if it is still.
            middle: of the part of it that is kept (x, y) [m].
        """
        self.qpos = [data.qpos.copy()]
        self._surface, self._recorder = surface, None
        if surface is not None and frames is not None:
            self._field = _field_of(surface, middle)
            self._recorder = SurfaceRecorder(frames, self._field, timestep=timestep)
            self._keep_surface(data)

    @property
    def recording(self) -> SurfaceRecording | None:
        """Of the surface."""
        return None if self._recorder is None else self._recorder.recording

    def step(self, data: mujoco.MjData) -> None:
        """Keep what there is after a step."""
        self.qpos.append(data.qpos.copy())
        if self._recorder is not None and self._recorder.is_due(data.time):
            self._keep_surface(data)

    def _keep_surface(self, data: mujoco.MjData) -> None:
        assert self._recorder is not None
        assert self._surface is not None
        self._field.set(_heights(self._surface, data, self._field))
        self._field.time = float(data.time)
        self._recorder.record(self._field)


def _field_of(
    surface: WaterSurface | PluginSea | Coupling, middle: tuple[float, float]
) -> HeightField:
    """A still field with the cells that are kept; places of cells are whole steps for a `WaterSurface`."""
    spacing, cells = SQUARE_SPACING, SQUARE
    if isinstance(surface, WaterSurface):
        spacing, cells = surface.spacing, WINDOW
    x, y = (spacing * (round(at / spacing) + 0.5) for at in middle)
    return HeightField((cells, cells), spacing, centre=(x, y))


def _heights(
    surface: WaterSurface | PluginSea | Coupling, data: mujoco.MjData, field: HeightField
) -> Array:
    """Elevation in the cells of a field [m]."""
    assert field.shape is not None
    cells: list[Array] = [np.arange(n, dtype=np.float64) - 0.5 * (n - 1) for n in field.shape]
    axes = [at + field.spacing * cell for at, cell in zip(field.centre, cells, strict=True)]
    if not isinstance(surface, WaterSurface):
        return sea_square(surface, data, axes[0], axes[1])
    heights = np.zeros(field.shape)
    first = [
        round((o - axis[0]) / field.spacing) for o, axis in zip(surface.origin, axes, strict=True)
    ]
    whole, part = [], []
    for start, have, room in zip(first, surface.level.shape, field.shape, strict=True):
        low, high = max(start, 0), min(start + have, room)
        whole.append(slice(low, max(low, high)))
        part.append(slice(low - start, max(low, high) - start))
    heights[tuple(whole)] = surface.level[tuple(part)]
    return heights
