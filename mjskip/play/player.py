"""Showing a run at the pace of the clock: frames are dropped when there is no time, never queued."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mjskip._typing import Array
from mjskip.play.thrown import ThrowResult
from mjskip.throws.trajectory import Trajectory, pose_at
from mjskip.throws.wake import Wake
from mjskip.waves.lake import Lake

AFTER = 4.0
"""How long rings are shown after the stone's run is over [s]."""

FPS = 30.0
"""Frames per second at most."""

SLOWING, SINKING = 0.5, 0.35
"""After its run a stone goes on for about this time [s], and sinks at this speed [m/s]."""

MOST_AT_ONCE = 0.2
"""Time that the water moves on between two frames at most [s]: if the machine cannot keep up with it, the
show falls behind and says so, instead of falling silent."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One moment of a show.

    Attributes:
        thrown: what is shown.
        time: of the run [s].
        poses: centre of mass (3,) [m] and orientation (4,) by body.
        touches: of the chosen stone until now.
        lake: the water as it is now; only to be read, and only until the next frame.
        late: how far the show is behind the clock because the machine is too slow [s].
        last: whether no other follows.
    """

    thrown: ThrowResult
    time: float
    poses: Mapping[str, tuple[Array, Array]]
    touches: int
    lake: Lake
    late: float
    last: bool


class Pace:
    """From a clock to the time of a run; slow motion may change underway without a jump."""

    def __init__(self, clock: Callable[[], float], *, slow: float = 1.0) -> None:
        self._clock = clock
        self._since, self._from, self.factor = clock(), 0.0, slow
        self.late = 0.0

    @property
    def time(self) -> float:
        """Of the run, now [s]."""
        return self._from + (self._clock() - self._since) / self.factor

    def slow(self, factor: float) -> None:
        """Go on this many times slower than the clock."""
        self._from, self._since, self.factor = self.time, self._clock(), factor

    def hold(self, until: float) -> None:
        """Fall behind the clock: it is only `until` now."""
        self.late += max(0.0, self.time - until)
        self._from, self._since = until, self._clock()


class Replay:
    """A run shown again, water and all; time only goes forward."""

    def __init__(self, thrown: ThrowResult) -> None:
        self.thrown = thrown
        self.lake = _lake(thrown)
        flights = list(thrown.flights.values())
        self._wake = Wake(self.lake, flights, density=thrown.scene.water.density)
        self.end = max(float(flight.time[-1]) for flight in flights) + AFTER

    @property
    def time(self) -> float:
        """Of the run, as far as it is shown [s]."""
        return self._wake.time

    def advance(self, until: float, *, late: float = 0.0) -> Frame:
        """Move on to a time [s]."""
        until = min(until, self.end)
        self._wake.advance(until)
        contacts = self.thrown.chosen.contacts
        return Frame(
            thrown=self.thrown,
            time=until,
            poses={name: pose_after(flight, until) for name, flight in self.thrown.flights.items()},
            touches=sum(contact.entry.time <= until for contact in contacts),
            lake=self.lake,
            late=late,
            last=until >= self.end,
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


def _lake(thrown: ThrowResult) -> Lake:
    """Water to show: the scene's, endless where it has walls that a lake of tiles cannot have."""
    try:
        return thrown.scene.lake()
    except ValueError:
        grid = thrown.scene.grid
        kept = {k: grid[k] for k in ("spacing", "wave_speed", "damping") if k in grid}
        return Lake(**kept)


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
        pace = Pace(self._clock, slow=self._slow)
        while True:
            begun = self._clock()
            if pace.time > replay.time + MOST_AT_ONCE:
                pace.hold(replay.time + MOST_AT_ONCE)
            frame = replay.advance(pace.time, late=pace.late)
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
