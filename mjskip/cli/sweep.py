"""mjskip sweep: a grid of throws."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from mjskip.cli.console import err, out, preparing, progress_bar
from mjskip.cli.options import (
    chosen_limits,
    chosen_scene,
    limit_options,
    throw_options,
    timestep_option,
)  # fmt: skip
from mjskip.sweeps.batch import AIRS
from mjskip.sweeps.design import NAMED, PARAMETERS, latin_hypercube, normal, span
from mjskip.sweeps.plot import check_picture, plot_sweep
from mjskip.sweeps.sweep import CHUNK
from mjskip.sweeps.sweep import sweep as run_sweep
from mjskip.throws.simulate import ENGINES
from mjskip.throws.throw import PARAMETERS as THROW

if TYPE_CHECKING:
    import xarray as xr


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
@timestep_option
@click.option("--air", type=click.Choice(AIRS), default="adaptive", show_default=True)
@limit_options
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
    max_contact: float,
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
    with preparing():
        scene = chosen_scene(**throw)
    begun = time.perf_counter()
    with progress_bar("sweep", "throws") as progress:
        data = run_sweep(
            scene,
            axes,
            samples=points,
            scatter=normal(spread, count=members, seed=seed + 2) if spread else None,
            engine=engine,
            integrator=integrator,
            timestep=timestep,
            limits=chosen_limits(duration, max_contact),
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
