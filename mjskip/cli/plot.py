"""mjskip plot: a page about saved throws."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from mjskip.plot import plot_runs
from mjskip.trajectory import Trajectory

err = Console(stderr=True, highlight=False)


@click.command()
@click.argument(
    "runs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RUN.nc..."
)
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default="throw.png", show_default=True,
    metavar="FILE", help="Where to: .png, .svg or .pdf.",
)  # fmt: skip
def plot(runs: tuple[Path, ...], output: Path) -> None:
    """Draw what `mjskip run --save` wrote: paths, speed, attitude and energy; several overlay."""
    loaded: dict[str, Trajectory] = {}
    for number, path in enumerate(runs, 1):
        name = path.stem if path.stem not in loaded else f"{path.stem} ({number})"
        loaded[name] = Trajectory.load(path)
    plot_runs(loaded, output)
    err.print(f"wrote {output}")
