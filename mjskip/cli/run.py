"""mjskip run: throw, count, draw."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from mjskip import __version__
from mjskip.cli.options import Size, chosen_scene, throw_options
from mjskip.recording import Limits
from mjskip.render import check_camera, gl_renderer, is_software, render_frames, render_video
from mjskip.scene import Scene
from mjskip.simulate import ENGINES, SURFACES, simulate_all
from mjskip.throw import Throw
from mjskip.trajectory import Trajectory
from mjskip.video import check_folder, check_size, check_video_path

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


@click.command()
@throw_options
@click.option("--engine", type=click.Choice(ENGINES), default="mujoco", show_default=True)
@click.option(
    "--integrator",
    metavar="NAME",
    help="mujoco: Euler, implicit, implicitfast, RK4; reference: euler, midpoint, rk4, adaptive.",
)
@click.option("--timestep", type=float, metavar="S", help="Time step.  [default: the scene's]")
@click.option("--duration", type=float, default=5.0, show_default=True, metavar="S")
@click.option(
    "--surface",
    type=click.Choice(SURFACES),
    default="still",
    show_default=True,
    help="What stones feel: the undisturbed level, or the moving surface (two-way).",
)
@click.option("--own-dent", is_flag=True, help="Over waves, stones feel their own dent too.")
@click.option("--frozen-attitude", is_flag=True, help="No spin, and the stone cannot turn.")
@click.option(
    "--video", type=click.Path(path_type=Path), metavar="FILE", help="Write an h264 video."
)
@click.option(
    "--frames", type=click.Path(path_type=Path), metavar="FOLDER", help="Write PNG frames."
)
@click.option("--camera", default="side", show_default=True, metavar="NAME")
@click.option("--size", type=Size(), default="640x480", show_default=True)
@click.option("--fps", type=float, default=30.0, show_default=True)
@click.option("--save", type=click.Path(path_type=Path), metavar="FILE", help="Write NetCDF.")
@click.option(
    "--json", "as_json", is_flag=True, help="One JSON object on stdout instead of a table."
)
def run(
    engine: Any,
    integrator: str | None,
    timestep: float | None,
    duration: float,
    surface: Any,
    own_dent: bool,
    frozen_attitude: bool,
    video: Path | None,
    frames: Path | None,
    camera: str,
    size: tuple[int, int],
    fps: float,
    save: Path | None,
    as_json: bool,
    **throw: Any,
) -> None:
    """Throw the stone of SCENE (an MJCF file or a shipped scene) and count its skips."""
    if video is not None:
        check_video_path(video)
    if frames is not None:
        check_folder(frames)
    if save is not None:
        check_folder(save.parent)
    check_size(size)
    limits = Limits(duration=duration)
    with err.status("preparing: the first run on a machine compiles for some seconds"):
        scene = chosen_scene(**throw)
        check_camera(scene.model, camera)
        trajectories = simulate_all(
            scene,
            engine=engine,
            integrator=integrator,
            timestep=timestep,
            limits=limits,
            frozen_attitude=frozen_attitude,
            surface=surface,
            own_dent=own_dent,
        )
    chosen = trajectories[scene.body]
    if as_json:
        click.echo(json.dumps(report(scene, chosen), allow_nan=False))
    else:
        for trajectory in trajectories.values():
            out.print(headline(scene, trajectory))
            if trajectory.contacts:
                out.print(skip_table(trajectory))
            out.print(verdict(trajectory))
    if save is not None:
        chosen.save(save)
        err.print(f"saved {save}")
    if video is not None or frames is not None:
        renderer = gl_renderer()
        slow = "  (software: slow; a GPU driver with EGL would draw faster)"
        err.print(f"drawing with {renderer}{slow if is_software(renderer) else ''}")
        options: dict[str, Any] = {"camera": camera, "size": size, "fps": fps}
        for target, draw in ((video, render_video), (frames, render_frames)):
            if target is not None:
                with _bar(str(target)) as progress:
                    draw(scene, trajectories, target, **options, progress=progress)
                err.print(f"wrote {target}")


def report(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    """What `--json` prints: SI units; angles in degrees where the key says so."""
    simulated = float(trajectory.time[-1])
    wall = float(trajectory.attributes["wall_seconds"])
    energy = trajectory.energy
    return {
        "scene": str(scene.path),
        "body": scene.body,
        "engine": trajectory.attributes["engine"],
        "integrator": trajectory.attributes["integrator"],
        "timestep": trajectory.attributes["timestep"],
        "law": scene.water.law,
        "gate": scene.water.gate,
        "surface": trajectory.attributes["surface"],
        "skips": trajectory.skips,
        "end": trajectory.end,
        "contacts": [contact.summary() for contact in trajectory.contacts],
        "mass": trajectory.mass,
        "triangles": len(scene.stone.faces),
        "steps": len(trajectory.time) - 1,
        "sim_seconds": simulated,
        "wall_seconds": wall,
        "real_time_factor": simulated / wall,
        "energy_start": float(energy[0]),
        "energy_end": float(energy[-1]),
        "version": __version__,
    }


def skip_table(trajectory: Trajectory) -> Table:
    """The touches of one stone, a row each."""
    table = Table(header_style="cyan", box=None, pad_edge=False, padding=(0, 1))
    for heading, unit in (
        ("", ""),
        ("time", "s"),
        ("distance", "m"),
        ("in", "m/s"),
        ("out", "m/s"),
        ("attack", "deg"),
        ("bank", "deg"),
        ("depth", "mm"),
        ("contact", "ms"),
        ("airtime", "ms"),
    ):
        table.add_column(f"{heading}\n{unit}", justify="right")
    start = trajectory.x[0]
    for number, contact in enumerate(trajectory.contacts, 1):
        entry, left = contact.entry, contact.exit
        away = math.hypot(entry.position[0] - start[0], entry.position[1] - start[1])
        table.add_row(
            str(number),
            f"{entry.time:.3f}",
            f"{away:.2f}",
            f"{entry.speed:.2f}",
            f"{left.speed:.2f}" if left else "-",
            f"{math.degrees(entry.attack):.1f}",
            f"{math.degrees(entry.bank):.1f}",
            f"{1e3 * contact.depth:.1f}",
            f"{1e3 * (left.time - entry.time):.1f}" if left else "stayed",
            f"{1e3 * contact.airtime:.0f}" if left else "-",
        )
    return table


def headline(scene: Scene, trajectory: Trajectory) -> str:
    """One line: the stone and its throw."""
    name = trajectory.attributes["body"]
    throw, stone = Throw(**trajectory.attributes["throw"]), scene.stones[name]
    return (
        f"[bold]{name}[/] ({1e3 * stone.mass:.3g} g, {len(stone.faces)} triangles) "
        f"at {throw.speed:.3g} m/s, {throw.spin / (2.0 * math.pi):.3g} rev/s, "
        f"attack {math.degrees(throw.attack):.3g}°, descent {math.degrees(throw.descent):.3g}°"
    )


def verdict(trajectory: Trajectory) -> str:
    """One line: how many skips, and how it ended."""
    ends = {
        "sunk": "then it sank",
        "planing": "then it ploughed on without leaving the water",
        "at rest": "then it came to rest",
        "out of time": "when the time was up",
    }
    skips = trajectory.skips
    wall = trajectory.attributes["wall_seconds"]
    return (
        f"[bold green]{skips} skip{'' if skips == 1 else 's'}[/], {ends[trajectory.end]}\n"
        f"[dim]{trajectory.attributes['engine']} {trajectory.attributes['integrator']}, "
        f"{1e3 * trajectory.attributes['timestep']:g} ms steps, "
        f"{trajectory.time[-1]:.2f} s simulated in {wall:.2f} s[/]\n"
    )


@contextmanager
def _bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr: call what is yielded with the frames done and to do."""
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frames"),
        _Rate(),
        TimeRemainingColumn(),
        console=err,
        transient=True,
    ) as progress:
        task = progress.add_task(label, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


class _Rate(ProgressColumn):
    """Frames per second."""

    def render(self, task: Task) -> Text:
        """The rate of a task as text."""
        return Text(f"{task.speed:.0f}/s" if task.speed else "")
