"""mjskip inspect: what water would act on in a model."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import get_args

import click

from mjskip.coupling.attach import Coupling
from mjskip.coupling.loading import load_model
from mjskip.coupling.report import Report, report_of
from mjskip.coupling.wet import HullOptions, Interior
from mjskip.errors import MjskipWarning
from mjskip.hydro.water import Water


@click.command()
@click.argument("model", type=click.Path(path_type=Path))
@click.option("--bodies", metavar="RULE", help='Names, "all", or "group N".  [default: free trees]')
@click.option("--geoms", metavar="RULE", help='Names, "all", "collision", or "group N".')
@click.option("--density", type=float, default=1000.0, show_default=True, metavar="KG/M3")
@click.option("--resolution", type=int, default=HullOptions.resolution, show_default=True)
@click.option("--max-faces", type=int, default=HullOptions.max_faces, show_default=True)
@click.option(
    "--interior", type=click.Choice(get_args(Interior)), default="flooded", show_default=True
)
@click.option("--strict", is_flag=True, help="Refuse open meshes instead of taking convex hulls.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def inspect(
    model: Path,
    bodies: str | None,
    geoms: str | None,
    density: float,
    resolution: int,
    max_faces: int,
    interior: Interior,
    strict: bool,
    as_json: bool,
) -> None:
    """Which geoms of MODEL (an MJCF file) are wet and why, how it floats, and what that costs."""
    report = inspect_model(
        model,
        bodies=bodies,
        geoms=geoms,
        water=Water.floating(density=density),
        options=HullOptions(
            resolution=resolution, max_faces=max_faces, interior=interior, strict=strict
        ),
    )
    click.echo(json.dumps(report.to_dict()) if as_json else str(report))


def inspect_model(
    file: Path, *, bodies: str | None, geoms: str | None, water: Water, options: HullOptions
) -> Report:
    """The report of an MJCF file; what is doubtful stands in it and not among the warnings."""
    compiled = load_model(file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MjskipWarning)
        coupling = Coupling(
            compiled,
            None,
            water,
            bodies=_rule(bodies),
            geoms=_rule(geoms),
            options=options,
            native=True,
        )
        return report_of(coupling)


def _rule(text: str | None) -> str | list[str | int] | None:
    """A rule as Python takes it: a keyword, or names and ids with commas between them."""
    if text is None or text in ("all", "collision") or text.split()[:1] == ["group"]:
        return text
    parts = [part.strip() for part in text.split(",")]
    return [int(part) if part.isdigit() else part for part in parts]
