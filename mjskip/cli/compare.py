"""mjskip compare: MuJoCo against the pure integrator."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

import click
from rich.table import Table

from mjskip import __version__
from mjskip.cli.console import out, plain_table, preparing, progress_bar
from mjskip.cli.options import chosen_scene, throw_options
from mjskip.throws.comparison import LADDER, Comparison, Differences
from mjskip.throws.comparison import compare as compare_solvers
from mjskip.throws.simulate import largest_timestep, warm_up


@click.command()
@throw_options
@click.option(
    "--timestep",
    "timesteps",
    type=float,
    multiple=True,
    metavar="S",
    help=f"Time step, may be repeated; multiples of the smallest.  [default: {LADDER}]",
)
@click.option(
    "--json", "as_json", is_flag=True, help="One JSON object on stdout instead of tables."
)
def compare(timesteps: tuple[float, ...], as_json: bool, **throw: Any) -> None:
    """Throw the stone of SCENE by every solver at every time step, through its first touch."""
    with preparing():
        scene = chosen_scene(**throw)
        warm_up()
    with progress_bar("compare", "runs") as progress:
        result = compare_solvers(scene, timesteps=timesteps or LADDER, progress=progress)
    advised = largest_timestep(scene.stone, scene.throw.speed)
    if as_json:
        click.echo(json.dumps(_report(scene.path, scene.body, result, advised), allow_nan=False))
        return
    end = "to its end" if result.left else "(it does not end: followed for a while)"
    out.print(
        f"{scene.body} of {scene.path.name}: in flight until {result.touch_begins:.4f} s, then through "
        f"the first touch until {result.touch_ends:.4f} s {end}.\nLargest differences from the yardstick "
        "(pure integrator, DOP853, relative tolerance 1e-10):"
    )
    out.print(_rows_table(result))
    out.print("MuJoCo RK4 against pure RK4, largest differences at the same time step:")
    out.print(_agreement_table(result))
    out.print("Observed order of convergence (three finest steps; - where all is rounding):")
    out.print(_order_table(result))
    out.print(
        f"Advised time step for this throw: at most {1e3 * advised:.2g} ms.\nThrough a touch order is lost: "
        "the force has a kink whenever a corner of a triangle meets the surface."
    )


def _report(path: Any, body: str, result: Comparison, advised: float) -> dict[str, Any]:
    def in_degrees(row: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in row.items():
            angle = key.endswith("_attitude")
            number = math.degrees(value) if angle else value
            bad = isinstance(number, float) and not math.isfinite(number)
            found[f"{key}_deg" if angle else key] = None if bad else number
        return found

    return {
        "scene": str(path),
        "body": body,
        "yardstick": "reference adaptive (DOP853, rtol 1e-10)",
        "touch_begins": result.touch_begins,
        "touch_ends": result.touch_ends,
        "left_the_water": result.left,
        "rows": [in_degrees(asdict(row)) for row in result.rows],
        "mujoco_rk4_against_pure_rk4": [in_degrees(asdict(row)) for row in result.agreement],
        "observed_order": [asdict(order) for order in result.orders],
        "advised_timestep": advised if math.isfinite(advised) else None,
        "version": __version__,
    }


def _rows_table(result: Comparison) -> Table:
    table = plain_table("solver", "step\nms", *HEADINGS, "a step\nµs", left=("solver",))
    last = ""
    for row in result.rows:
        solver = f"{row.engine} {row.integrator}"
        if last and solver != last:
            table.add_section()
        cost = "diverged" if math.isnan(row.step_seconds) else f"{1e6 * row.step_seconds:.0f}"
        table.add_row(solver if solver != last else "", *_cells(row), cost)
        last = solver
    return table


def _agreement_table(result: Comparison) -> Table:
    table = plain_table("step\nms", *HEADINGS)
    for row in result.agreement:
        table.add_row(*_cells(row))
    return table


HEADINGS = ("flight\nm", "\ndeg", "touch\nm", "\ndeg")


def _cells(row: Differences) -> list[str]:
    """Time step [ms] and differences [m, degrees]."""
    lengths = (row.flight_position, row.touch_position)
    angles = (math.degrees(row.flight_attitude), math.degrees(row.touch_attitude))
    numbers = [number for pair in zip(lengths, angles, strict=True) for number in pair]
    return [f"{1e3 * row.timestep:g}", *("-" if math.isnan(n) else f"{n:.1e}" for n in numbers)]


def _order_table(result: Comparison) -> Table:
    table = plain_table("solver", "smooth flight", "touch", left=("solver",))
    for order in result.orders:
        cells = ["-" if v is None else f"{v:.2f}" for v in (order.smooth_flight, order.touch)]
        table.add_row(f"{order.engine} {order.integrator}", *cells)
    return table
