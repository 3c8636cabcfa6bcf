"""mjskip sweep: a grid of throws."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from mjskip.cli.options import chosen_scene, throw_options
from mjskip.sweeps.batch import AIRS
from mjskip.sweeps.design import NAMED, PARAMETERS, latin_hypercube, normal, span
from mjskip.sweeps.plot import check_picture, plot_sweep
from mjskip.sweeps.sweep import CHUNK
from mjskip.sweeps.sweep import sweep as run_sweep
from mjskip.throws.recording import Limits
from mjskip.throws.simulate import ENGINES
from mjskip.throws.throw import PARAMETERS as THROW

if TYPE_CHECKING:
    import xarray as xr

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)

UNITS = "degrees for angles, rev/s for spin and wobble, SI for the rest"


@click.command(epilog=f"Parameters: {', '.join(PARAMETERS)}; {UNITS}.")
@throw_options
@click.option(
    "--vary",
    multiple=True,
    metavar="NAME=LOW:HIGH:COUNT|A,B,...",
    help="A range or a list; each is a dimension.",
)
@click.option("--latin", multiple=True, metavar="NAME=LOW:HIGH", help="Latin hypercube samples.")
@click.option("--normal", "bell", multiple=True, metavar="NAME=MEAN:SD", help="Normal samples.")
@click.option("--samples", default=256, show_default=True, metavar="N", help="How many samples.")
@click.option(
    "--scatter", multiple=True, metavar="NAME=SD", help="Spread of the ensemble at every point."
)
@click.option("--members", default=32, show_default=True, metavar="N", help="Of the ensemble.")
@click.option("--seed", default=0, show_default=True, metavar="N")
@click.option("--engine", type=click.Choice(ENGINES), default="reference", show_default=True)
@click.option("--integrator", metavar="NAME", help="Of the engine.  [default: rk4, or the scene's]")
@click.option("--timestep", type=float, metavar="S", help="Time step.  [default: the scene's]")
@click.option("--air", type=click.Choice(AIRS), default="adaptive", show_default=True)
@click.option("--duration", type=float, default=5.0, show_default=True, metavar="S")
@click.option(
    "--save", type=click.Path(path_type=Path), metavar="FILE", help="Zarr store; resumable."
)
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw to a PNG.")
@click.option("--chunk", default=CHUNK, show_default=True, metavar="N", help="Throws per chunk.")
@click.option("--threads", type=int, metavar="N", help="On this machine.  [default: all]")
@click.option("--scheduler", metavar="TCP://HOST:PORT", help="Of a Dask cluster that does it.")
def sweep(
    vary: tuple[str, ...],
    latin: tuple[str, ...],
    bell: tuple[str, ...],
    samples: int,
    scatter: tuple[str, ...],
    members: int,
    seed: int,
    engine: Any,
    integrator: str | None,
    timestep: float | None,
    air: Any,
    duration: float,
    save: Path | None,
    plot: Path | None,
    chunk: int,
    threads: int | None,
    scheduler: str | None,
    **throw: Any,
) -> None:
    """Throw the stone of SCENE over a grid of parameters and count skips."""
    if plot is not None:
        check_picture(plot)
    axes = dict(_axis(text) for text in vary)
    points: dict[str, Any] = {}
    if latin:
        points |= latin_hypercube(dict(pair(t) for t in latin), count=samples, seed=seed)
    if bell:
        points |= normal(dict(pair(t) for t in bell), count=samples, seed=seed + 1)
    spread = {name: (0.0, sd) for name, sd in (number(text) for text in scatter)}
    with err.status("preparing: the first run on a machine compiles for some seconds"):
        scene = chosen_scene(**throw)
    begun = time.perf_counter()
    with bar("throws") as progress:
        data = run_sweep(
            scene,
            axes,
            samples=points,
            scatter=normal(spread, count=members, seed=seed + 2) if spread else None,
            engine=engine,
            integrator=integrator,
            timestep=timestep,
            limits=Limits(duration=duration),
            air=air,
            path=save,
            chunk=chunk,
            threads=threads,
            scheduler=scheduler,
            progress=progress,
        )
    out.print(summary(data, time.perf_counter() - begun))
    if save is not None:
        err.print(f"saved {save}")
    if plot is not None:
        plot_sweep(data, plot)
        err.print(f"wrote {plot}")


def summary(data: xr.Dataset, seconds: float) -> str:
    """A few lines: how many throws, what became of them, the best."""
    status, counts = np.unique(data["status"].values, return_counts=True)
    skips = data["skips"]
    lines = [
        f"{skips.size} throws in {seconds:.1f} s: "
        + ", ".join(f"{n} {s or 'not done'}" for s, n in zip(status, counts, strict=True))
    ]
    if bool(skips.notnull().any()):
        mean = skips.mean("member") if "member" in skips.dims else skips
        best = mean.isel(mean.argmax(...))
        place = ", ".join(
            f"{name} {shown(str(name), value.item())}"
            for name, value in best.coords.items()
            if name in PARAMETERS
        )
        lines.append(f"{float((skips >= 1).mean()):.0%} skip at least once")
        lines.append(f"[bold green]most skips: {best.item():.3g}[/]  {place}")
    bad = data["reason"].values[data["reason"].values != ""]
    lines += [f"[yellow]first of those without a result:[/] {bad[0]}"] if len(bad) else []
    return "\n".join(lines)


def shown(name: str, value: Any) -> str:
    """A parameter in the units of the command line."""
    if isinstance(value, str):
        return value
    if name not in THROW:
        return f"{value:.4g}"
    return THROW[name].text_of(value)


@contextmanager
def bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr: call what is yielded with what is done and to do."""
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), _Rate(),
        TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(), console=err, transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task(label, total=None)
        begun = False

        def update(done: int, total: int) -> None:
            nonlocal begun
            if not begun:  # what a store held already was not done now
                progress.reset(task, total=total, completed=done)
                begun = True
            progress.update(task, completed=done, total=total)

        yield update


class _Rate(ProgressColumn):
    """Throws per second."""

    def render(self, task: Task) -> Text:
        """The rate of a task as text."""
        return Text(f"{task.speed:.0f}/s" if task.speed else "")


def _split(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    name = name.strip().replace("-", "_")
    if not (equals and value) or name not in PARAMETERS:
        raise click.UsageError(
            f"{text!r} is not NAME=VALUES with a parameter: choose from {', '.join(PARAMETERS)}"
        )
    return name, value


def _numbers(name: str, values: list[str]) -> list[float]:
    factor = THROW[name].factor if name in THROW else 1.0
    try:
        return [float(value) * factor for value in values]
    except ValueError as error:
        raise click.UsageError(f"{name}: {error}") from error


def _axis(text: str) -> tuple[str, Any]:
    name, value = _split(text)
    if name in NAMED:
        return name, value.split(",")
    parts = value.split(":")
    if len(parts) == 3:
        if not parts[2].isdigit():
            raise click.UsageError(f"{text!r}: COUNT is a whole number")
        low, high = _numbers(name, parts[:2])
        return name, span(low, high, int(parts[2]))
    if len(parts) == 1:
        return name, _numbers(name, value.split(","))
    raise click.UsageError(f"{text!r} is neither LOW:HIGH:COUNT nor A,B,...")


def pair(text: str) -> tuple[str, tuple[float, float]]:
    name, value = _split(text)
    numbers = _numbers(name, value.split(":"))
    if len(numbers) != 2:
        raise click.UsageError(f"{text!r} needs two numbers with a colon between them")
    return name, (numbers[0], numbers[1])


def number(text: str) -> tuple[str, float]:
    name, value = _split(text)
    return name, _numbers(name, [value])[0]
