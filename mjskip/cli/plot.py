"""mjskip plot: a page about saved throws, or a picture of a sweep."""

from __future__ import annotations

from pathlib import Path

import click

from mjskip.cli.console import err
from mjskip.draw.plot import plot_runs
from mjskip.sweeps.plot import plot_sweep
from mjskip.sweeps.store import is_sweep, open_sweep
from mjskip.throws.trajectory import Trajectory


@click.command()
@click.argument("runs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default="throw.png", show_default=True,
    metavar="FILE", help="Where to: .png, .svg or .pdf.",
)  # fmt: skip
@click.option(
    "--result", metavar="NAME", help="Of a sweep: what to draw.  [default: skips, or the first]",
)  # fmt: skip
def plot(runs: tuple[Path, ...], output: Path, result: str | None) -> None:
    """Draw what `mjskip run --save` wrote: paths, speed, attitude and energy; several overlay.

    Or what `mjskip sweep --save` wrote: a map, a curve with its spread or a cloud of points.
    """
    if any(is_sweep(path) for path in runs):
        if len(runs) > 1:
            raise click.UsageError("a sweep is drawn alone: give one FILE")
        plot_sweep(open_sweep(runs[0]), output, result=result)
        err.print(f"wrote {output}")
        return
    loaded: dict[str, Trajectory] = {}
    for number, path in enumerate(runs, 1):
        name = path.stem if path.stem not in loaded else f"{path.stem} ({number})"
        loaded[name] = Trajectory.load(path)
    plot_runs(loaded, output)
    err.print(f"wrote {output}")
