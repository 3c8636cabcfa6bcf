"""Showing a run at the pace of the clock: frames are dropped when there is no time, never queued."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mjskip._typing import Array
from mjskip.play.thrown import ThrowResult
from mjskip.throws.rings import recorded_rings
from mjskip.throws.trajectory import Trajectory, pose_at
from mjskip.waves.field import HeightField
from mjskip.waves.recording import SurfaceFrames

RINGS_AFTER = 4.0
"""How long rings are shown after the stone's run is over [s]."""

FPS = 30.0
"""Frames per second at most."""

SLOWING, SINKING = 0.2, 0.35
"""After its run a stone goes on for about this time [s], and sinks at this speed [m/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One moment of a show.

    Attributes:
        thrown: what is shown.
        time: of the run [s].
        poses: centre of mass (3,) [m] and orientation (4,) by body.
        touches: of the chosen stone until now.
        water: as it was then.
        last: whether no other follows.
    """

    thrown: ThrowResult
    time: float
    poses: Mapping[str, tuple[Array, Array]]
    touches: int
    water: HeightField
    last: bool


class PlaybackClock:
    """From a clock to the time of a run; slow motion may change underway without a jump."""

    def __init__(self, clock: Callable[[], float], *, slow: float = 1.0) -> None:
        self._clock = clock
        self._since, self._from, self.factor = clock(), 0.0, slow

    @property
    def time(self) -> float:
        """Of the run, now [s]."""
        return self._from + (self._clock() - self._since) / self.factor

    def slow(self, factor: float) -> None:
        """Go on this many times slower than the clock."""
        self._from, self._since, self.factor = self.time, self._clock(), factor


class Replay:
    """A run shown again, with the water that was recorded with it."""

    def __init__(self, thrown: ThrowResult) -> None:
        self.thrown = thrown
        flights = list(thrown.flights.values())
        self._water = thrown.chosen.surface or recorded_rings(
            thrown.scene, flights, surface_frames()
        )
        self.end = max(float(flight.time[-1]) for flight in flights) + RINGS_AFTER

    def at(self, time: float) -> Frame:
        """The frame at a time [s]."""
        time = min(time, self.end)
        contacts = self.thrown.chosen.contacts
        return Frame(
            thrown=self.thrown,
            time=time,
            poses={name: pose_after(flight, time) for name, flight in self.thrown.flights.items()},
            touches=sum(contact.entry.time <= time for contact in contacts),
            water=self._water.at(time),
            last=time >= self.end,
        )


def pose_after(flight: Trajectory, time: float) -> tuple[Array, Array]:
    """The pose at a time, and how a stone goes on after its run: drawn only.

    What planes on slows down and sinks; what sank sinks on; what is at rest stays.
    """
    position, attitude = pose_at(flight, time)
    since = time - float(flight.time[-1])
    if since <= 0.0 or flight.end == "at rest":
        return position, attitude
    speed = flight.velocity[-1] * [1.0, 1.0, 0.0]
    ahead = speed * SLOWING * (1.0 - math.exp(-since / SLOWING))
    late = max(since - SLOWING, 0.0) if flight.end != "sunk" else since
    return position + ahead - [0.0, 0.0, SINKING * late], attitude


def surface_frames() -> SurfaceFrames:
    """The moments of the water that a show needs."""
    return SurfaceFrames(rate=FPS, linger=RINGS_AFTER)


class Player:
    """A thread that shows runs, the newest instead of the one before."""

    def __init__(
        self,
        draw: Callable[[Frame], None],
        *,
        failed: Callable[[Exception], None],
        clock: Callable[[], float] = time.perf_counter,
        fps: float = FPS,
    ) -> None:
        """Start the thread.

        Args:
            draw: called with every frame, in the thread.
            failed: called with what `draw` or the water raised; the show is over then.
            clock: seconds from somewhere.
            fps: frames per second at most.
        """
        self._draw, self._failed, self._clock = draw, failed, clock
        self._wait = 1.0 / fps
        self._changed = threading.Condition()
        self._next: ThrowResult | None = None
        self._halted = False
        self._closed = False
        self._slow = 1.0
        self.playing = False
        self._thread = threading.Thread(target=self._run, name="mjskip player", daemon=True)
        self._thread.start()

    def play(self, thrown: ThrowResult) -> None:
        """Show a run from its beginning."""
        with self._changed:
            self._next, self._halted, self.playing = thrown, False, True
            self._changed.notify()

    def slow(self, factor: float) -> None:
        """Show what follows this many times slower."""
        with self._changed:
            self._slow = factor
            self._changed.notify()

    def halt(self) -> None:
        """Stop showing. No frame is drawn any more once this returns, unless called from `draw`."""
        with self._changed:
            self._next, self._halted = None, True
            self._changed.notify()
            if threading.current_thread() is not self._thread:
                self._changed.wait_for(lambda: not self.playing or self._closed, timeout=5.0)

    def close(self) -> None:
        """End the thread."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            with self._changed:
                self.playing = self._next is not None
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._next is not None or self._closed)
                if self._closed:
                    return
                thrown, self._next = self._next, None
            assert thrown is not None
            try:
                self._show(thrown)
            except Exception as error:  # a page that went away, water that will not move
                self._failed(error)

    @property
    def _interrupted(self) -> bool:
        return self._closed or self._halted or self._next is not None

    def _show(self, thrown: ThrowResult) -> None:
        replay = Replay(thrown)
        pace = PlaybackClock(self._clock, slow=self._slow)
        while True:
            begun = self._clock()
            frame = replay.at(pace.time)
            self._draw(frame)
            if frame.last:
                return
            with self._changed:
                self._changed.wait_for(
                    lambda: self._interrupted or self._slow != pace.factor,
                    timeout=max(0.0, self._wait - (self._clock() - begun)),
                )
                if self._interrupted:
                    return
                pace.slow(self._slow)
