"""mjskip inspect: what water would act on in a model."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from mjskip.coupling.attach import Coupling
from mjskip.coupling.loading import load_model
from mjskip.coupling.plugin_keys import plugin_settings
from mjskip.coupling.selection import GeomRule
from mjskip.coupling.wet import INTERIORS, HullOptions
from mjskip.errors import MjskipWarning
from mjskip.hydro.water import Water


@click.command()
@click.argument("model", type=click.Path(path_type=Path))
@click.option("--bodies", metavar="RULE", help='Names, "all", or "group N".  [default: free trees]')
@click.option("--geoms", metavar="RULE", help='Names, "all", "collision", or "group N".')
@click.option("--density", type=float, metavar="KG/M3", help="Of the water.  [default: 1000]")
@click.option(
    "--resolution", type=int, help=f"Segments of round geoms.  [default: {HullOptions.resolution}]"
)
@click.option(
    "--max-faces", type=int, help=f"Of one hull; 0 for all.  [default: {HullOptions.max_faces}]"
)
@click.option("--interior", type=click.Choice(INTERIORS), help="Of open boats.  [default: flooded]")
@click.option("--strict", is_flag=True, help="Refuse open meshes instead of taking convex hulls.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def inspect(
    model: Path,
    bodies: str | None,
    geoms: str | None,
    density: float | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Which geoms of MODEL (an MJCF file) are wet and why, how it floats, and what that costs.

    Where bodies carry the plugin mjskip.water, its keys hold unless an option says otherwise.
    """
    given = {key: value for key, value in options.items() if value}
    if options["max_faces"] is not None:
        given["max_faces"] = options["max_faces"]
    compiled = load_model(model)
    settings = next(
        (found for b in range(1, compiled.nbody) if (found := plugin_settings(compiled, b))), None
    )
    base, water = (
        (settings.options, settings.water) if settings else (HullOptions(), Water.floating())
    )
    if settings is not None and geoms is None:
        rule: GeomRule = settings.geoms
    else:
        rule = _rule(geoms)
    if density is not None:
        water = replace(water, density=density)
    with warnings.catch_warnings():  # what is doubtful stands in the report
        warnings.simplefilter("ignore", MjskipWarning)
        report = Coupling(
            compiled,
            None,
            water,
            bodies=_rule(bodies),
            geoms=rule,
            options=replace(base, **given),
        ).report()
    click.echo(json.dumps(report.to_dict()) if as_json else str(report))


def _rule(text: str | None) -> str | list[str | int] | None:
    """A rule as Python takes it: a keyword, or names and ids with commas between them."""
    if text is None or text in ("all", "collision") or text.split()[:1] == ["group"]:
        return text
    parts = [part.strip() for part in text.split(",")]
    return [int(part) if part.isdigit() else part for part in parts]
