"""mjskip optimize: the best throw within what a thrower can do."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from typing import Any

import click
from rich.box import SIMPLE_HEAD
from rich.table import Table

from mjskip import __version__
from mjskip.cli.console import out, preparing, progress_bar
from mjskip.cli.options import (
    chosen_limits,
    chosen_scene,
    limit_options,
    throw_options,
    timestep_option,
)  # fmt: skip
from mjskip.cli.sweep import number, pair, shown
from mjskip.sweeps.optimize import GOALS, HAND, Best
from mjskip.sweeps.optimize import optimize as search

HAND_SCATTER = ", ".join(f"{name} {shown(name, sd)}" for name, sd in HAND.items())


@click.command()
@throw_options
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    help="What the thrower can do; every parameter of the throw named here is searched.",
)
@click.option("--goal", type=click.Choice(GOALS), default="skips", show_default=True)
@click.option(
    "--scatter",
    multiple=True,
    metavar="NAME=SD",
    help=f"Standard deviations of the hand about its aim.  [default: {HAND_SCATTER}]",
)
@click.option("--perfect", is_flag=True, help="A hand without scatter.")
@click.option("--members", default=32, show_default=True, metavar="N", help="Of an ensemble.")
@click.option("--population", default=24, show_default=True, metavar="N", help="Candidates.")
@click.option("--generations", default=20, show_default=True, metavar="N", help="At most.")
@click.option("--seed", default=0, show_default=True, metavar="N")
@timestep_option
@limit_options
@click.option("--threads", type=int, metavar="N", help="[default: all]")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout, SI units.")
def optimize(
    limits: tuple[str, ...],
    goal: Any,
    scatter: tuple[str, ...],
    perfect: bool,
    members: int,
    population: int,
    generations: int,
    seed: int,
    timestep: float | None,
    duration: float,
    max_contact: float,
    threads: int | None,
    as_json: bool,
    **throw: Any,
) -> None:
    """Find the throw of SCENE's stone with most skips, or the longest way, for a hand that scatters."""
    if perfect and scatter:
        raise click.UsageError("--perfect and --scatter exclude each other")
    ranges = dict(pair(text) for text in limits)
    hand = {} if perfect else dict(number(text) for text in scatter) or None
    with preparing():
        scene = chosen_scene(**throw)
    begun = time.perf_counter()
    with progress_bar("search", "generations") as progress:
        best = search(
            scene.stone,
            ranges,
            goal=goal,
            throw=scene.throw,
            water=scene.water,
            scatter=hand,
            members=members,
            population=population,
            generations=generations,
            timestep=float(scene.model.opt.timestep) if timestep is None else timestep,
            limits=chosen_limits(duration, max_contact),
            threads=threads,
            seed=seed,
            progress=progress,
        )
    seconds = time.perf_counter() - begun
    if as_json:
        click.echo(json.dumps(report(best, seconds)))
        return
    unit = "" if goal == "skips" else " m"
    out.print("aim for  " + ", ".join(shown_pair(name, best) for name in ranges))
    out.print(
        f"[bold green]{best.mean:.3g}{unit} {goal} on average[/], spread {best.deviation:.2g}; one in ten "
        f"does no better than {best.tenth:.3g}\n[dim]exactly as aimed: {best.aimed:.3g}; the ensemble that "
        f"the search saw: {best.searched:.3g}; {best.throws} throws in {seconds:.1f} s[/]"
    )
    out.print(neighbourhood(best))


def shown_pair(name: str, best: Best) -> str:
    """A parameter of the best throw, with its name."""
    return f"{name} [bold]{shown(name, getattr(best.throw, name))}[/]"


def neighbourhood(best: Best) -> Table:
    """How the mean falls off on both sides of the best throw, a row per parameter."""
    table = Table(header_style="cyan", box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("if it is")
    table.add_column("within 10% of the best")
    table.add_column(f"mean {best.goal} over its whole range")
    for name, around in best.neighbourhood.items():
        low, high = around.good
        means = " ".join(f"{value:.2g}" for value in around.mean)
        table.add_row(name, f"{shown(name, low)} to {shown(name, high)}", means)
    return table


def report(best: Best, seconds: float) -> dict[str, Any]:
    """What `--json` prints: SI units and radians."""
    found = asdict(best)
    for around in found["neighbourhood"].values():
        around |= {key: around[key].tolist() for key in ("values", "mean", "deviation")}
    return found | {"wall_seconds": seconds, "version": __version__}
