"""Draw what happened: replay a trajectory into pictures of the stone and the water it moved."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import gaussian_filter1d

from mjskip._typing import Array, Image
from mjskip.checks import check_path
from mjskip.draw.forces import draw_loads, loads_at
from mjskip.draw.gl import gl_renderer as gl_renderer
from mjskip.draw.gl import is_software as is_software
from mjskip.draw.overlay import Overlay, numbers_at
from mjskip.draw.overlay import caption as write_caption
from mjskip.draw.skin import Grid
from mjskip.draw.stage import LOOKS as LOOKS
from mjskip.draw.stage import Look as Look
from mjskip.draw.stage import Stage, largest_radius
from mjskip.draw.stage import check_camera as check_camera
from mjskip.draw.video import (
    Progress,
    check_fps,
    check_size,
    check_video_path,
    write_pngs,
    write_video,
)
from mjskip.files import check_folder
from mjskip.throws.rings import recorded_rings
from mjskip.throws.trajectory import Trajectory, pose_at
from mjskip.waves.recording import SurfaceFrames, SurfaceRecording

if TYPE_CHECKING:
    from mjskip.hydro.stone import Stone
    from mjskip.throws.scene import Scene

Flights = Trajectory | Mapping[str, Trajectory]
"""The motion of the scene's chosen stone, or of several by the names of their bodies."""

_STEP = 0.3  # of the stone's radius: between vertices near it, if the water's cells are no larger
_SLACK = 0.10  # [s] over which a camera that follows starts and stops
_TICK = 5e-3  # [s] between the points of its path


MAX_PIXELS = 1e11
"""Of a film: three hours of it at 30 frames a second of 640x480."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """How a throw is filmed.

    Attributes:
        camera: by its name in the scene.
        size: width and height, even [pixels].
        fps: frames per second.
        slow: how many times slower than it was; 1 is its own speed.
        look: "shaded", or "plain" which is quicker.
        linger: how long the film goes on with the rings after the throw is over [s of film].
        trail: whether the stone's path fades behind it; not of what floats.
        marks: whether a ring stays where it touched; not of what floats.
        caption: whether speed, spin and skips, or of what floats time, trim and heel, are written into the corner.
        spray: whether drops fly; drawn only, see `mjskip.draw.spray`.
        forces: whether arrows of the forces, wetted faces and centres of buoyancy are drawn over it.

    Raises:
        ValueError: a size, rate or name that cannot be used.
    """

    camera: str = "side"
    size: tuple[int, int] = (640, 480)
    fps: float = 30.0
    slow: float = 1.0
    look: Look = "shaded"
    linger: float = 1.0
    trail: bool = True
    marks: bool = True
    caption: bool = True
    spray: bool = True
    forces: bool = False

    def __post_init__(self) -> None:
        check_size(self.size)
        check_fps(self.fps)
        if not 1.0 <= self.slow <= 1000.0:
            raise ValueError(f"slow is {self.slow!r}: give how many times slower, from 1 to 1000")
        if self.look not in LOOKS:
            raise ValueError(f"look is {self.look!r}: use one of {', '.join(LOOKS)}")
        if not 0.0 <= self.linger <= 3600.0:
            raise ValueError(f"linger is {self.linger!r} s: give a number from 0 to 3600")
        self.check_length(math.floor(self.linger * self.fps))

    def check_length(self, count: int) -> None:
        """Refuse a film of so many frames that is too long to be drawn.

        Raises:
            ValueError: says how many pixels it has.
        """
        width, height = self.size
        pixels = count * width * height
        if pixels > MAX_PIXELS:
            raise ValueError(
                f"the film has {count} frames of {width}x{height}, {pixels:.3g} pixels: at most {MAX_PIXELS:g} are "
                "allowed; give a smaller size, fps, linger or slow"
            )


DEFAULT_SHOT = Shot()
"""How a throw is filmed if nothing else is said."""


def render_video(
    scene: Scene,
    trajectory: Flights,
    path: str | Path,
    *,
    camera: str = "side",
    size: tuple[int, int] = (640, 480),
    fps: float = 30.0,
    slow: float = 1.0,
    look: Look = "shaded",
    linger: float = 1.0,
    trail: bool = True,
    marks: bool = True,
    caption: bool = True,
    spray: bool = True,
    forces: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write a video of a throw: h264, or an animated WebP or GIF.

    It has floor((duration slow + linger) fps) + 1 frames: of the throw, and of the rings after it.

    Args:
        scene: where it was thrown.
        trajectory: what the stone did; a mapping from body names when there are several stones.
        path: .mp4, .mkv, .mov, .webp or .gif in a folder that exists.
        camera: by its name in the scene.
        size: width and height, even [pixels].
        fps: frames per second.
        slow: how many times slower than it was; 1 is its own speed.
        look: "shaded", or "plain" which is quicker.
        linger: how long the film goes on with the rings after the throw is over [s of film].
        trail: whether the stone's path fades behind it; not of what floats.
        marks: whether a ring stays where it touched; not of what floats.
        caption: whether speed, spin and skips, or of what floats time, trim and heel, are written into the corner.
        spray: whether drops fly; drawn only, see `mjskip.draw.spray`.
        forces: whether arrows of the forces, wetted faces and centres of buoyancy are drawn over it.
        progress: called with the frames done and to do.

    Returns:
        The path.

    Raises:
        ValueError: a size, rate, name or folder that cannot be used.
        SceneError: the scene has no such camera or body.
        RenderError: OpenGL or the encoder is missing or fails.
    """
    path = check_path("path", path)
    check_video_path(path)
    shot = Shot(
        camera=camera, size=size, fps=fps, slow=slow, look=look, linger=linger, trail=trail,
        marks=marks, caption=caption, spray=spray, forces=forces,
    )  # fmt: skip
    images = frames(scene, trajectory, shot)
    with contextlib.closing(images):
        total = len(shot_times(trajectory, shot))
        return write_video(images, path, size=size, fps=fps, total=total, progress=progress)


def render_frames(
    scene: Scene,
    trajectory: Flights,
    folder: str | Path,
    *,
    shot: Shot = DEFAULT_SHOT,
    progress: Progress | None = None,
) -> list[Path]:
    """Write a throw as frame_0000.png and so on into a folder that exists; see `render_video`."""
    folder = Path(folder)
    check_folder(folder)
    images = frames(scene, trajectory, shot)
    with contextlib.closing(images):
        total = len(shot_times(trajectory, shot))
        return write_pngs(images, folder, total=total, progress=progress)


def frames(
    scene: Scene,
    trajectory: Flights,
    shot: Shot = DEFAULT_SHOT,
    *,
    times: Array | None = None,
    follow: Trajectory | None = None,
) -> Generator[Image, None, None]:
    """The pictures (height, width, 3) of a throw, one at a time; see `render_video`.

    Bodies and water are only shown, never stepped: the water is that which was recorded with the throw
    (`Trajectory.surface`). A throw without a recording is given one, of still water that gets back what it
    gave to the stones.

    Args:
        scene: where it was thrown.
        trajectory: what the stones did.
        shot: how it is filmed.
        times: ascending moments to draw [s]; those of the film if None.
        follow: the flight that a camera that follows keeps in its middle to the end; None for the scene's
            stone until it ploughs on, see `followed`.
    """
    if times is None:
        times = shot_times(trajectory, shot)
    flights = _by_body(scene, trajectory)
    body = scene.body if scene.body in flights else next(iter(flights))
    spacing = scene.field().spacing
    grid = Grid.around(step=max(spacing, _STEP * largest_radius(scene.model, body)))
    stage = Stage(
        scene,
        flights,
        camera=shot.camera,
        size=shot.size,
        grid=grid,
        look=shot.look,
        spray=shot.spray,
    )
    # the stage opens here, not at the first picture: what is wrong shows before a file is begun
    stage.open()
    if follow is None:
        centres = followed(flights[body], times)
    else:
        centres = np.array([pose_at(follow, time)[0] for time in times.tolist()])
    water = surface_of(scene, flights, shot)
    return _play(stage, water, times, centres, flights, body, shot, scene.stones)


def surface_frames(shot: Shot) -> SurfaceFrames:
    """The moments of the water that a film shows: record a throw with them, and it shows the water that was."""
    return SurfaceFrames(rate=shot.fps * shot.slow, linger=shot.linger / shot.slow)


def surface_of(scene: Scene, flights: Mapping[str, Trajectory], shot: Shot) -> SurfaceRecording:
    """The water as it was recorded with the throw, or rings made for the film."""
    for flight in flights.values():
        if flight.surface is not None:
            return flight.surface
    return recorded_rings(scene, list(flights.values()), surface_frames(shot))


def _play(
    stage: Stage,
    water: SurfaceRecording,
    times: Array,
    centres: Array,
    flights: Mapping[str, Trajectory],
    body: str,
    plan: Shot,
    stones: Mapping[str, Stone],
) -> Generator[Image, None, None]:
    overlays = [
        Overlay(flight, trail=plan.trail, marks=plan.marks, number=number)
        for number, flight in enumerate(flights.values())
        if not flight.attributes.get("afloat")
    ]
    with contextlib.closing(stage):
        for time, centre in zip(times.tolist(), centres, strict=True):
            image = stage.draw(time, water.at(time), centre=centre)
            for overlay in overlays:
                overlay.draw(image, time, stage.eye)
            if plan.forces and time <= flights[body].time[-1]:
                loads = [loads_at(flight, stones[name], time) for name, flight in flights.items()]
                for one in loads:
                    draw_loads(image, one, stage.eye)
                write_caption(image, loads[list(flights).index(body)].text, corner="top")
            if plan.caption:
                slowed = f"  ·  {plan.slow:g} times slower" if plan.slow > 1.0 else ""
                write_caption(image, numbers_at(flights[body], time) + slowed)
            yield image


def followed(flight: Trajectory, times: Array) -> Array:
    """What a camera that follows looks at (n, 3) [m].

    The stone while it skips; when it ploughs on, the place where it came down for the last time, so
    that the rings stay in the picture. It starts and stops gently.
    """
    start, stop = float(flight.time[0]), float(flight.time[-1])
    if flight.end == "planing" and flight.contacts:
        stop = min(stop, flight.contacts[-1].entry.time)
    margin = 4.0 * _SLACK
    ticks = np.arange(start - margin, stop + margin + _TICK, _TICK)
    path = [np.interp(np.clip(ticks, start, stop), flight.time, x) for x in flight.position.T]
    smooth = [gaussian_filter1d(x, _SLACK / _TICK, mode="nearest") for x in path]
    return np.column_stack([np.interp(times, ticks, x) for x in smooth])


def frame_times(
    trajectory: Flights, *, fps: float = 30.0, slow: float = 1.0, linger: float = 0.0
) -> Array:
    """When the pictures of a throw are taken (n,) [s]: from its first row to its last, and linger."""
    return shot_times(trajectory, Shot(fps=fps, slow=slow, linger=linger))


def shot_times(trajectory: Flights, shot: Shot) -> Array:
    """When the pictures of a shot are taken (n,) [s]."""
    several = list(trajectory.values()) if isinstance(trajectory, Mapping) else [trajectory]
    if not several or any(len(one.time) == 0 for one in several):
        raise ValueError("the trajectory has no rows: nothing to draw")
    start = min(float(one.time[0]) for one in several)
    stop = max(float(one.time[-1]) for one in several)
    rate = shot.fps * shot.slow
    count = math.floor((stop - start) * rate + shot.linger * shot.fps + 1e-6) + 1
    shot.check_length(count)
    return start + np.arange(count) / rate


def _by_body(scene: Scene, trajectory: Flights) -> dict[str, Trajectory]:
    if isinstance(trajectory, Mapping):
        return dict(trajectory)
    return {scene.body: trajectory}
