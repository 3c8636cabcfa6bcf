"""mjskip run: throw, count, draw."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click
from rich.table import Table

from mjskip import __version__
from mjskip.cli.console import err, out, plain_table, preparing, progress_bar
from mjskip.cli.filming import (
    FILMING,
    check_film,
    check_stage,
    film,
    film_frames,
    film_options,
)
from mjskip.cli.options import (
    chosen_limits,
    chosen_scene,
    limit_options,
    sea_option,
    surface_option,
    throw_options,
    timestep_option,
)
from mjskip.files import check_target
from mjskip.throws.report import COLUMNS, skip_rows
from mjskip.throws.scene import Scene
from mjskip.throws.simulate import ENGINES, simulate_all
from mjskip.throws.throw import PARAMETERS
from mjskip.throws.trajectory import ENDS, Trajectory


@click.command()
@throw_options
@click.option("--engine", type=click.Choice(ENGINES), default="mujoco", show_default=True)
@click.option(
    "--integrator",
    metavar="NAME",
    help="mujoco: Euler, implicit, implicitfast, RK4; reference: euler, midpoint, rk4, adaptive.",
)
@timestep_option
@limit_options
@surface_option
@sea_option
@click.option("--frozen-attitude", is_flag=True, help="No spin, and the stone cannot turn.")
@film_options
@click.option("--save", type=click.Path(path_type=Path), metavar="FILE", help="Write NetCDF.")
@click.option(
    "--json", "as_json", is_flag=True, help="One JSON object on stdout instead of a table."
)
def run(
    engine: Any,
    integrator: str | None,
    timestep: float | None,
    duration: float,
    max_contact: float,
    surface: Any,
    frozen_attitude: bool,
    save: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Run SCENE (an MJCF file or a shipped scene): throw its stone and count the skips, or let float what floats.

    A scene is afloat if its water bears (plugin with preset floating, or mjskip.buoyancy) and it says nothing
    of a throw; mjskip.afloat in its <custom> decides otherwise.
    """
    filming = {name: options.pop(name) for name in FILMING}
    check_film(filming)
    if save is not None:
        if save.suffix != ".nc":
            raise click.UsageError(f"--save is {str(save)!r}: NetCDF files end in .nc")
        check_target(save)
    limits = chosen_limits(duration, max_contact)
    with preparing():
        scene = chosen_scene(**options)
        check_stage(scene, filming)
    with progress_bar(f"run of at most {duration:g} s", "steps") as progress:
        trajectories = simulate_all(
            scene,
            engine=engine,
            integrator=integrator,
            timestep=timestep,
            limits=limits,
            frozen_attitude=frozen_attitude,
            surface=surface,
            record=film_frames(filming),
            progress=progress,
        )
    chosen = trajectories[scene.body]
    if as_json:
        click.echo(json.dumps(report(scene, chosen), allow_nan=False))
    else:
        for trajectory in trajectories.values():
            out.print(headline(scene, trajectory))
            if trajectory.contacts and not scene.afloat:
                out.print(skip_table(trajectory))
            out.print(verdict(trajectory))
    if save is not None:
        chosen.save(save)
        err.print(f"saved {save}")
    film(scene, trajectories, filming)


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
    table = plain_table("\n", *(f"{name}\n{unit}" for name, (unit, _) in COLUMNS.items()))
    for row in skip_rows(trajectory):
        table.add_row(*row)
    return table


def headline(scene: Scene, trajectory: Trajectory) -> str:
    """One line: the stone and its throw."""
    name = trajectory.attributes["body"]
    throw, stone = trajectory.attributes["throw"], scene.stones[name]
    if trajectory.attributes.get("afloat"):
        return f"[bold]{name}[/] ({stone.mass:.3g} kg, {len(stone.faces)} triangles) afloat"
    text = {key: PARAMETERS[key].text_of(value) for key, value in throw.items()}
    return (
        f"[bold]{name}[/] ({1e3 * stone.mass:.3g} g, {len(stone.faces)} triangles) "
        f"at {text['speed']}, {text['spin']}, attack {text['attack']}, descent {text['descent']}"
    )


def verdict(trajectory: Trajectory) -> str:
    """One line: how many skips, and how it ended."""
    skips = trajectory.skips
    wall = trajectory.attributes["wall_seconds"]
    outcome = f"[bold green]{skips} skip{'' if skips == 1 else 's'}[/], "
    if trajectory.attributes.get("afloat"):
        away = math.dist(trajectory.position[-1][:2], trajectory.position[0][:2])
        outcome = f"[bold green]{away:.3g} m[/] from where it began, "
    return (
        f"{outcome}{ENDS[trajectory.end]}\n"
        f"[dim]{trajectory.attributes['engine']} {trajectory.attributes['integrator']}, "
        f"{1e3 * trajectory.attributes['timestep']:g} ms steps, "
        f"{trajectory.time[-1]:.2f} s simulated in {wall:.2f} s[/]\n"
    )
