"""Films and pictures made of several: a duel side by side, and a strip of moments."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mjskip._typing import Array, Image
from mjskip.draw.overlay import caption
from mjskip.draw.render import DEFAULT_SHOT, Flights, Shot, frames, shot_times
from mjskip.draw.video import Progress, check_video_path, write_video
from mjskip.files import check_folder, whole_file
from mjskip.throws.trajectory import Trajectory

if TYPE_CHECKING:
    from mjskip.throws.scene import Scene

_GAP = 4  # pixels between the pictures of a strip
_ROW = 4  # most pictures side by side
_PAPER = 250  # grey between them


def render_duel(
    sides: Mapping[str, tuple[Scene, Flights]],
    path: str | Path,
    *,
    shot: Shot = DEFAULT_SHOT,
    progress: Progress | None = None,
) -> Path:
    """Write a film of two throws side by side, each on its own water, from the same moment on.

    Args:
        sides: scene and motion of the left and of the right, by their titles.
        path: .mp4, .mkv, .mov, .webp or .gif in a folder that exists.
        shot: how they are filmed; its size is that of each half.
        progress: called with the frames done and to do.

    Raises:
        ValueError: there are not two sides, or a setting cannot be used.
        SceneError: a scene has no such camera or body.
        RenderError: OpenGL or the encoder is missing or fails.
    """
    if len(sides) != 2:
        raise ValueError(f"a duel has two sides with different titles, not {len(sides)}")
    path = Path(path)
    check_video_path(path)
    total = max(len(shot_times(flights, shot)) for _, flights in sides.values())
    images = _pairs(sides, total, shot)
    with contextlib.closing(images):
        size = (2 * shot.size[0], shot.size[1])
        return write_video(images, path, size=size, fps=shot.fps, total=total, progress=progress)


def _pairs(
    sides: Mapping[str, tuple[Scene, Flights]], total: int, shot: Shot
) -> Generator[Image, None, None]:
    with contextlib.ExitStack() as stack:
        films = []
        for scene, flights in sides.values():
            times = shot_times(flights, shot)[0] + np.arange(total) / (shot.fps * shot.slow)
            films.append(
                stack.enter_context(contextlib.closing(frames(scene, flights, shot, times=times)))
            )
        for pair in zip(*films, strict=True):
            for title, image in zip(sides, pair, strict=True):
                caption(image, title, corner="top")
            both = np.concatenate(pair, axis=1)
            both[:, shot.size[0] - 1 : shot.size[0] + 1] = _PAPER
            yield both


def render_strip(
    scene: Scene,
    trajectory: Flights,
    path: str | Path,
    *,
    moments: int = 6,
    shot: Shot = DEFAULT_SHOT,
    progress: Progress | None = None,
) -> Path:
    """Write equally spaced moments of a throw as one PNG, in rows of four at most.

    Args:
        scene: where it was thrown.
        trajectory: what the stones did.
        path: .png in a folder that exists.
        moments: how many, at least 1; from the release on, as long as the stone is at the surface.
        shot: how it is filmed; its size is that of each picture.
        progress: called with the pictures done and to do.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise ValueError(f"picture name {path} ends in {path.suffix!r}: use .png")
    check_folder(path.parent)
    if not 1 <= moments <= 100:
        raise ValueError(f"moments is {moments!r}: give a whole number from 1 to 100")
    runs = trajectory if isinstance(trajectory, Mapping) else {scene.body: trajectory}
    follow = runs.get(scene.body) or next(iter(runs.values()))
    times = strip_times(follow, moments)
    pictures = []
    images = frames(scene, trajectory, shot, times=times, follow=follow)
    with contextlib.closing(images):
        for done, (time, image) in enumerate(zip(times, images, strict=True), start=1):
            caption(image, f"{time - times[0]:.2f} s", corner="top")
            pictures.append(image)
            if progress is not None:
                progress(done, moments)
    import mediapy

    with whole_file(path) as part:
        mediapy.write_image(part, compose(pictures))
    return path


def strip_times(flight: Trajectory, moments: int) -> Array:
    """Moments (n,) of a flight as long as the stone is in the air or at the surface [s]."""
    deep = flight.clearance < -0.1
    last = flight.time[int(np.argmax(deep))] if deep.any() else flight.time[-1]
    return np.linspace(flight.time[0], last, moments) if moments > 1 else flight.time[:1]


def compose(pictures: Sequence[Image]) -> Image:
    """Equal pictures as one, in rows of four at most, the rows as even as they can be."""
    rows = -(-len(pictures) // _ROW)
    columns = -(-len(pictures) // rows)
    high, wide, _ = pictures[0].shape
    sheet: Image = np.full(
        (rows * (high + _GAP) - _GAP, columns * (wide + _GAP) - _GAP, 3), _PAPER, np.uint8
    )
    for number, picture in enumerate(pictures):
        top, left = (number // columns) * (high + _GAP), (number % columns) * (wide + _GAP)
        sheet[top : top + high, left : left + wide] = picture
    return sheet


def duel_of(
    scene: Scene, trajectories: Mapping[str, Trajectory]
) -> dict[str, tuple[Scene, Flights]]:
    """The two stones of a scene, each alone on its water, for `render_duel`.

    Raises:
        ValueError: the scene has not two stones.
    """
    if len(trajectories) != 2:
        raise ValueError(
            f"side by side needs a scene with two stones, such as duel: this one has {len(trajectories)}"
        )
    return {name: (scene, {name: flight}) for name, flight in trajectories.items()}
