"""Options about films and pictures, and drawing them with a progress bar."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from mjskip._typing import Progress
from mjskip.cli.console import err, progress_bar
from mjskip.cli.options import Size
from mjskip.draw.film import duel_of, render_duel, render_strip
from mjskip.draw.render import (
    LOOKS,
    Shot,
    check_camera,
    gl_renderer,
    is_software,
    render_frames,
    render_video,
    surface_frames,
)
from mjskip.draw.video import check_video_path
from mjskip.files import check_folder
from mjskip.throws.scene import Scene
from mjskip.throws.trajectory import Trajectory
from mjskip.waves.recording import SurfaceFrames

F = TypeVar("F", bound=Callable[..., Any])
FILE = click.Path(path_type=Path)
CAMERA = "side"
"""The camera if none is named and the scene has it."""

TARGETS = ("video", "frames", "strip", "picture", "side_by_side")
FILMING = (*TARGETS, *(field.name for field in fields(Shot)))


def film_options(function: F) -> F:
    """What to draw and how: together, what `check_film` and `film` take."""
    decorators = [
        click.option(
            "--video", type=FILE, metavar="FILE", help="Write a video: .mp4 (h264), .webp, .gif."
        ),
        click.option("--frames", type=FILE, metavar="FOLDER", help="Write PNG frames."),
        click.option(
            "--strip", type=click.IntRange(1, 100), metavar="N", help="Write N moments in one picture."
        ),
        click.option(
            "--picture", type=FILE, metavar="FILE",
            help="Where --strip writes.  [default: strip.png]",
        ),
        click.option("--side-by-side", is_flag=True, help="Each of two stones in its own half."),
        click.option(
            "--camera", metavar="NAME", help=f"[default: {CAMERA}, or the scene's first]"
        ),
        click.option("--size", type=Size(), default="640x480", show_default=True),
        click.option("--fps", type=float, default=30.0, show_default=True),
        click.option("--look", type=click.Choice(LOOKS), default="shaded", show_default=True),
        click.option(
            "--slow", type=float, default=1.0, show_default=True, metavar="N",
            help="Slow motion: N times slower.",
        ),
        click.option(
            "--linger", type=float, default=1.0, show_default=True, metavar="S",
            help="Seconds of film with the rings after the throw.",
        ),
        click.option("--trail/--no-trail", default=True, help="The stone's path, fading."),
        click.option("--marks/--no-marks", default=True, help="Rings where it touched."),
        click.option("--spray/--no-spray", default=True, help="Drops that fly; drawn only."),
        click.option("--forces/--no-forces", default=False, help="Arrows of water and air, wetted faces."),
        click.option("--caption/--no-caption", default=True, help="Speed, spin and skips."),
    ]  # fmt: skip
    for decorator in reversed(decorators):
        function = decorator(function)
    return function


def check_film(options: Mapping[str, Any]) -> None:
    """Refuse what cannot be drawn before anything is computed."""
    _shot(options)
    if options["video"] is not None:
        check_video_path(options["video"])
    if options["frames"] is not None:
        check_folder(options["frames"])
    if options["strip"] is not None:
        picture = _picture(options)
        check_folder(picture.parent)
        if picture.suffix.lower() != ".png":
            raise ValueError(f"picture name {picture}: use .png")
    elif options["picture"] is not None:
        raise ValueError("--picture says where --strip writes: give --strip N too")
    if options["side_by_side"] and options["video"] is None:
        raise ValueError("--side-by-side is about a video: give --video too")
    if not _draws(options):
        context = click.get_current_context()
        for name in set(FILMING) - set(TARGETS):
            if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                raise ValueError(
                    f"--{name} is about pictures: give --video, --frames or --strip too"
                )


def _picture(options: Mapping[str, Any]) -> Path:
    """Where --strip writes."""
    return options["picture"] or Path("strip.png")


def _draws(options: Mapping[str, Any]) -> bool:
    return any(options[name] is not None for name in ("video", "frames", "strip"))


def check_stage(scene: Scene, options: dict[str, Any]) -> None:
    """Choose a camera if none is named; refuse one that the scene lacks, and a duel without two stones."""
    named = options["camera"] is not None
    if not named:
        there = [scene.model.camera(k).name for k in range(scene.model.ncam)]
        options["camera"] = next((name for name in there if name and CAMERA not in there), CAMERA)
    if _draws(options) or named:
        check_camera(scene.model, options["camera"])
    if options["side_by_side"]:
        duel_of(scene, dict.fromkeys(scene.throws))  # type: ignore[arg-type]


def film_frames(options: Mapping[str, Any]) -> SurfaceFrames | None:
    """The moments of the water that are drawn; None if nothing is."""
    return surface_frames(_shot(options)) if _draws(options) else None


def film(scene: Scene, trajectories: Mapping[str, Trajectory], options: Mapping[str, Any]) -> None:
    """Draw all that was asked for."""
    if not _draws(options):
        return
    renderer = gl_renderer()
    slow = "  (software: slow; a GPU driver with EGL would draw faster)"
    err.print(f"drawing with {renderer}{slow if is_software(renderer) else ''}")
    shot = _shot(options)
    if options["video"] is not None:
        with _drawing(options["video"]) as progress:
            if options["side_by_side"]:
                sides = duel_of(scene, trajectories)
                render_duel(sides, options["video"], shot=shot, progress=progress)
            else:
                render_video(
                    scene, trajectories, options["video"], progress=progress, **asdict(shot)
                )
    if options["frames"] is not None:
        with _drawing(options["frames"]) as progress:
            render_frames(scene, trajectories, options["frames"], shot=shot, progress=progress)
    if options["strip"] is not None:
        with _drawing(_picture(options)) as progress:
            moments = options["strip"]
            render_strip(
                scene,
                trajectories,
                _picture(options),
                moments=moments,
                shot=shot,
                progress=progress,
            )


def _shot(options: Mapping[str, Any]) -> Shot:
    return Shot(**{key: value for key, value in options.items() if key not in TARGETS})


@contextmanager
def _drawing(target: Path) -> Iterator[Progress]:
    """A progress bar for what is drawn to a file or folder."""
    with progress_bar(str(target), "frames") as progress:
        yield progress
    err.print(f"wrote {target}")
