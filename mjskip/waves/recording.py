"""The surface as it was, moment by moment: recorded while bodies feel it, replayed by whoever draws it.

    recorder = SurfaceRecorder(rate=60.0, linger=1.0, timestep=5e-4)
    ...                                     # the run: `recorder.record(field)` whenever `is_due`
    recording = recorder.recording
    recording.at(0.35).window(x, y, (200, 100))

A recording is made with a throw, `simulate(..., record=SurfaceFrames(rate=60.0))`, and lies in `Trajectory.surface`.
"""

from __future__ import annotations

import math
import tempfile
import threading
import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np

from mjskip._typing import Array, Integers, SingleArray
from mjskip.checks import check_number, check_positive
from mjskip.files import writing
from mjskip.waves.field import HeightField

MAX_MOMENTS = 1e6
"""Of a recording; one takes some ten to some thousand kilobytes."""

IN_MEMORY = 1 << 25
"""Bytes of a recording beyond which it goes into a temporary file."""


@dataclass(frozen=True, kw_only=True)
class SurfaceFrames:
    """When the surface is recorded.

    Attributes:
        rate: moments per second; each is taken at the nearest step.
        linger: how long the rings are followed after the run is over [s].

    Raises:
        ValueError: a number is out of range.
    """

    rate: float = 60.0
    linger: float = 0.0

    def __post_init__(self) -> None:
        check_positive(rate=self.rate)
        check_number("linger", self.linger, low=0.0, high=3600.0, unit="s")
        self._check_moments(self.rate * self.linger)

    def check_duration(self, duration: float, timestep: float) -> None:
        """Refuse a record of a run [s], in steps of this size [s], of too many moments.

        Raises:
            ValueError: says how many they are.
        """
        self._check_moments(min(self.rate, 1.0 / timestep) * duration + self.rate * self.linger)

    def _check_moments(self, count: float) -> None:
        if count > MAX_MOMENTS:
            raise ValueError(
                f"the surface would be recorded {count:.3g} times: at most {MAX_MOMENTS:g} are allowed; give a "
                "smaller rate (fps, slow), linger or duration"
            )


class SurfaceRecording:
    """What a surface was at some moments: the tiles that moved, to the last bit.

    Attributes:
        times: of the moments (k,), ascending [s].
    """

    def __init__(self, field: HeightField, timestep: float) -> None:
        """Begin without a moment; of this water, in a run of these steps [s]."""
        self._like, self._timestep = field.still_copy(), timestep
        self._times: list[float] = []
        self._names: list[Integers] = []
        self._places: list[int] = []
        self._size = 0
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._lock = threading.Lock()

    @property
    def times(self) -> Array:
        """Of the moments (k,), ascending [s]."""
        return np.array(self._times)

    @property
    def spacing(self) -> float:
        """Of the cells [m]."""
        return self._like.spacing

    def append(self, field: HeightField) -> None:
        """Record the water as it is, at its time.

        Raises:
            MjskipError: the folder of temporary files is full.
        """
        levels = np.ascontiguousarray(field.grid.z)
        with self._lock, writing(tempfile.gettempdir()):
            self._file.seek(self._size)
            self._file.write(levels.tobytes())
            self._times.append(field.time)
            self._names.append(field.grid.names.copy())
            self._places.append(self._size)
            self._size += levels.nbytes

    def at(self, time: float) -> HeightField:
        """The water at a time [s]: a field of its own, with the elevation and a vertical speed of 0.

        A recorded moment within half a step of it is given to the last bit; between two the elevation is
        interpolated. Before the first and after the last it is theirs.

        Raises:
            ValueError: nothing was recorded.
        """
        if not self._times:
            raise ValueError("nothing was recorded of this water")
        time = check_number("time", time, unit="s")
        after = int(np.searchsorted(self._times, time))
        k = min(max(after, 0), len(self._times) - 1)
        for near in (k - 1, k):
            if near >= 0 and abs(self._times[near] - time) <= 0.5001 * self._timestep:
                return self._moment(self._tiles(near), self._times[near])
        if after in (0, len(self._times)):
            return self._moment(self._tiles(k), self._times[k])
        earlier, later = self._times[k - 1], self._times[k]
        part = np.float32((time - earlier) / (later - earlier))
        blend: dict[tuple[int, int], SingleArray] = {}
        for weight, tiles in ((1 - part, self._tiles(k - 1)), (part, self._tiles(k))):
            for name, level in tiles.items():
                blend[name] = blend.get(name, np.float32(0.0)) + weight * level
        return self._moment(blend, time)

    def _tiles(self, k: int) -> dict[tuple[int, int], SingleArray]:
        """Levels of a moment by the names of their tiles."""
        names = self._names[k]
        shape = (len(names), *self._like.grid.tile)
        with self._lock:
            self._file.seek(self._places[k])
            data = self._file.read(4 * math.prod(shape))
        levels = np.frombuffer(data, np.float32).reshape(shape)
        return {(a, b): level for (a, b), level in zip(names.tolist(), levels, strict=True)}

    def _moment(self, tiles: dict[tuple[int, int], SingleArray], time: float) -> HeightField:
        field = self._like.still_copy()
        field.time = time
        levels: Any = list(tiles.values()) or np.zeros((0, *field.grid.tile), np.float32)
        names = np.array(list(tiles), np.int64).reshape(-1, 2)
        field.grid.restore({
            "names": names, "z": np.array(levels), "prev": np.array(levels), "lost": np.zeros(1),
            "last_timestep": np.zeros(()), "steps": np.zeros(()),
        })  # fmt: skip
        return field


class SurfaceRecorder:
    """Records a surface at equal intervals of time.

    Attributes:
        recording: what there is so far.
    """

    def __init__(self, frames: SurfaceFrames, field: HeightField, *, timestep: float) -> None:
        """Record this water, in a run of these steps [s]."""
        self.recording = SurfaceRecording(field, timestep)
        self._frames, self._timestep, self._next = frames, timestep, 0

    @property
    def due(self) -> float:
        """When the next moment is [s]."""
        return self._next / self._frames.rate

    def is_due(self, now: float) -> bool:
        """Whether this step is the nearest to a moment, at a time [s]."""
        return now > self.due - 0.5 * self._timestep

    def steps_until_due(self, now: float) -> int:
        """Steps until then from a time [s]."""
        return max(1, round((self.due - now) / self._timestep))

    def record(self, field: HeightField) -> None:
        """Record the water as it is now."""
        self.recording.append(field)
        while self.is_due(field.time):
            self._next += 1

    def linger(self, field: HeightField) -> None:
        """Follow the rings after the run is over."""
        end = field.time + self._frames.linger + 1e-9
        if self.is_due(field.time):
            self.record(field)
        while self.due <= end:
            field.advance(self.due - field.time)
            self.record(field)
