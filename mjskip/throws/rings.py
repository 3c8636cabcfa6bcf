"""The rings of stones that were thrown over still water, and did not feel them: for pictures of saved throws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mjskip._typing import Array
from mjskip.throws.scene import Scene
from mjskip.throws.trajectory import Trajectory
from mjskip.waves.driven import DrivenWater
from mjskip.waves.recording import SurfaceFrames, SurfaceRecorder, SurfaceRecording


def recorded_rings(
    scene: Scene, flights: Sequence[Trajectory], frames: SurfaceFrames
) -> SurfaceRecording:
    """The water of a scene as it gets back what the stones took; as `simulate(..., record=frames)` has it.

    Args:
        scene: whose water it is.
        flights: what the stones did; a row holds from its time until the next row's.
        frames: when to record.
    """
    steps = [np.diff(flight.time).min(initial=np.inf) for flight in flights]
    timestep = float(min(steps)) if np.isfinite(min(steps)) else 1.0 / frames.rate
    start = min(float(flight.time[0]) for flight in flights)
    stop = max(float(flight.time[-1]) for flight in flights)
    times: Array = start + timestep * np.arange(round((stop - start) / timestep) + 1.0)
    parts = [loads_between(flight, times) for flight in flights]
    forces, centres, areas = (np.stack(part, axis=1) for part in zip(*parts, strict=True))
    field = scene.field()
    field.time = start
    recorder = SurfaceRecorder(frames, field, timestep=timestep)
    water = DrivenWater(field, timestep=timestep, density=scene.water.density, recorder=recorder)
    water.extend(forces / timestep, centres, areas)
    water.finish()
    return recorder.recording


def loads_between(flight: Trajectory, times: Array) -> tuple[Array, Array, Array]:
    """Vertical impulse (m,) [N s], its mean place (m, 2) [m] and wetted area (m,) [m^2] between times (m + 1,).

    Differences of running integrals: over any interval the impulse is what the stone took.
    """
    held = np.diff(flight.time, append=flight.time[-1])  # the last row holds for no time
    force = flight.water_load * held
    weight = np.abs(force)  # which cannot cancel
    rows = np.column_stack([
        force, weight, weight[:, None] * flight.wetted_centre[:, :2], weight * flight.wetted_area,
    ])  # fmt: skip
    sums = np.zeros((len(flight.time), rows.shape[1]))
    np.cumsum(rows[:-1], axis=0, out=sums[1:])
    there = np.column_stack([np.interp(times, flight.time, column) for column in sums.T])
    between = np.diff(there, axis=0)
    total = np.maximum(between[:, 1], np.finfo(np.float64).tiny)[:, None]
    return between[:, 0], between[:, 2:4] / total, between[:, 4] / total[:, 0]
