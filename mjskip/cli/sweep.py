"""mjskip sweep: a grid of throws, or of runs of a model in which nothing is thrown."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from rich.console import Group

from mjskip.cli.console import err, out, plain_table, preparing, progress_bar
from mjskip.cli.options import (
    chosen_limits,
    chosen_scene,
    limit_options,
    throw_options,
    timestep_option,
)  # fmt: skip
from mjskip.sweeps.batch import AIRS
from mjskip.sweeps.design import NAMED, PARAMETERS, latin_hypercube, normal, span
from mjskip.sweeps.models import CHUNK as RUNS
from mjskip.sweeps.models import STATES, open_model, parameters_of, sweep_model
from mjskip.sweeps.plot import check_picture, plot_sweep
from mjskip.sweeps.sweep import CHUNK
from mjskip.sweeps.sweep import sweep as run_sweep
from mjskip.throws.recording import Limits
from mjskip.throws.scene import is_afloat
from mjskip.throws.simulate import ENGINES
from mjskip.throws.throw import PARAMETERS as THROW

if TYPE_CHECKING:
    import xarray as xr


UNITS = "degrees for angles, rev/s for spin and wobble, SI for the rest"


# Over 80 lines: one parameter for each option of the command.
@click.command(
    epilog=f"Parameters of throws: {', '.join(PARAMETERS)}; {UNITS}. Where nothing is thrown: the water's, sea_hs, sea_tp "
    "and the like, x, y, z, roll, pitch, yaw, mass, keyframe, ctrl_ACTUATOR; results are sensors and "
    f"{', '.join(STATES)}."
)
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
@click.option(
    "--result",
    "results",
    multiple=True,
    metavar="NAME",
    help="Where nothing is thrown: a sensor or a state afloat; may be given several times.  [default: all states]",
)
@click.option(
    "--settle",
    type=float,
    metavar="S",
    help="Where nothing is thrown: time that does not count.  [default: half of the duration]",
)
@click.option("--engine", type=click.Choice(ENGINES), default="reference", show_default=True)
@click.option("--integrator", metavar="NAME", help="Of the engine.  [default: rk4, or the scene's]")
@timestep_option
@click.option("--air", type=click.Choice(AIRS), default="adaptive", show_default=True)
@limit_options
@click.option(
    "--save", type=click.Path(path_type=Path), metavar="FILE", help="Zarr store; resumable."
)
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw to a PNG.")
@click.option(
    "--chunk",
    type=int,
    metavar="N",
    help=f"Done and written together.  [default: {CHUNK} throws, or {RUNS} runs of a model]",
)
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
    results: tuple[str, ...],
    settle: float | None,
    engine: Any,
    integrator: str | None,
    timestep: float | None,
    air: Any,
    duration: float,
    max_contact: float,
    save: Path | None,
    plot: Path | None,
    chunk: int | None,
    threads: int | None,
    scheduler: str | None,
    **throw: Any,
) -> None:
    """Throw the stone of SCENE over a grid of parameters and count skips.

    Where nothing is thrown (a scene afloat, or any model with --result) run it and say how it floats and what its
    sensors show.
    """
    if plot is not None:
        check_picture(plot)
    runs = bool(results) or is_afloat(throw["scene"])
    known = _Known.of_model(throw["scene"]) if runs else _Known.of_throws()
    axes = dict(known.axis(text) for text in vary)
    points: dict[str, Any] = {}
    if latin:
        points |= latin_hypercube(dict(known.pair(t) for t in latin), count=samples, seed=seed)
    if bell:
        points |= normal(dict(known.pair(t) for t in bell), count=samples, seed=seed + 1)
    spread = {name: (0.0, sd) for name, sd in (known.number(text) for text in scatter)}
    grid: dict[str, Any] = {
        "samples": points,
        "scatter": normal(spread, count=members, seed=seed + 2) if spread else None,
    }
    kept: dict[str, Any] = {"path": save, "threads": threads, "scheduler": scheduler}
    begun = time.perf_counter()
    if runs:
        _refuse_throw(throw, engine, integrator, max_contact)
        with progress_bar("sweep", "runs") as progress:
            data = sweep_model(
                throw["scene"],
                axes,
                **grid,
                given=_water_given(throw),
                results=results or None,
                body=throw["body"],
                duration=duration,
                settle=settle,
                timestep=timestep,
                chunk=RUNS if chunk is None else chunk,
                progress=progress,
                **kept,
            )
        _finish(data, run_summary(data, known, time.perf_counter() - begun), save, plot)
        return
    with preparing():
        scene = chosen_scene(**throw)
    begun = time.perf_counter()
    with progress_bar("sweep", "throws") as progress:
        data = run_sweep(
            scene,
            axes,
            **grid,
            engine=engine,
            integrator=integrator,
            timestep=timestep,
            limits=chosen_limits(duration, max_contact),
            air=air,
            chunk=CHUNK if chunk is None else chunk,
            progress=progress,
            **kept,
        )
    _finish(data, summary(data, time.perf_counter() - begun), save, plot)


def _finish(data: xr.Dataset, text: Any, save: Path | None, plot: Path | None) -> None:
    """Say what was found and written."""
    out.print(text)
    if save is not None:
        err.print(f"saved {save}")
    if plot is not None:
        plot_sweep(data, plot)
        err.print(f"wrote {plot}")


def _refuse_throw(
    given: dict[str, Any], engine: str, integrator: str | None, max_contact: float
) -> None:
    """Nothing is thrown: what is said of a throw would be ignored."""
    wrong = [f"--{name}" for name in THROW if given.get(name) is not None]
    wrong += ["--integrator"] if integrator is not None else []
    wrong += [] if engine == "reference" else ["--engine"]
    wrong += ["--max-contact"] if max_contact != Limits.max_contact else []
    if wrong:
        raise click.UsageError(f"nothing is thrown in this sweep: leave out {', '.join(wrong)}")


def _water_given(given: dict[str, Any]) -> dict[str, Any]:
    """Options of the water as parameters of a model."""
    found = {name: given[name] for name in ("law", "gate") if given[name] is not None}
    switches = ("buoyancy", "skin_friction", "quadrature")
    return found | {n: ("off", "on")[given[n]] for n in switches if given[n] is not None}


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


def run_summary(data: xr.Dataset, known: _Known, seconds: float) -> Group:
    """A table of the runs: what was varied and what came of it, angles in degrees."""
    status, counts = np.unique(data["status"].values, return_counts=True)
    counted = ", ".join(f"{n} {s or 'not done'}" for s, n in zip(status, counts, strict=True))
    bad = data["reason"].values[data["reason"].values != ""]
    title = f"{data['status'].size} runs in {seconds:.1f} s: {counted}"
    title += f"\n[yellow]first of those without a result:[/] {bad[0]}" if len(bad) else ""
    results = [str(n) for n in data.data_vars if n not in ("status", "reason")]
    numbers = data[results].mean("member") if "member" in data.dims else data[results]
    rows = numbers.to_dataframe().reset_index()
    spare = [c for c in ("sample", "member") if c in rows and rows[c].nunique() == 1]
    rows = rows.drop(columns=spare)
    shown = [known.shown(str(c), data[c].attrs.get("units", "") if c in data else "") for c in rows]
    table = plain_table(
        *(f"{str(c).replace('_', ' ')}\n{u}" for c, (u, _) in zip(rows, shown, strict=True))
    )
    for row in rows.head(MAX_ROWS).itertuples(index=False):
        table.add_row(
            *(
                v if isinstance(v, str) else f"{v * factor:.4g}"
                for v, (_, factor) in zip(row, shown, strict=True)
            )
        )
    if len(rows) > MAX_ROWS:
        table.caption = f"the first {MAX_ROWS} of {len(rows)}: --save FILE keeps all"
    return Group(title, table)


MAX_ROWS = 40
"""Runs that are printed."""


@dataclass(frozen=True)
class _Known:
    """Parameters that can be varied here, with their SI units, and those that take words."""

    units: Mapping[str, str]
    named: Collection[str]

    @classmethod
    def of_throws(cls) -> _Known:
        return cls(PARAMETERS, NAMED)

    @classmethod
    def of_model(cls, scene: str) -> _Known:
        with preparing():
            return cls(*parameters_of(open_model(scene)[1]))

    def shown(self, name: str, unit: str) -> tuple[str, float]:
        """Unit at the command line, and the factor to it."""
        return ("deg", 180.0 / math.pi) if unit == "rad" else (unit.replace("m s-1", "m/s"), 1.0)

    def factor(self, name: str) -> float:
        """From the unit of the command line to SI."""
        if name in THROW:
            return THROW[name].factor
        return math.pi / 180.0 if self.units[name] == "rad" else 1.0

    def split(self, text: str) -> tuple[str, str]:
        name, equals, value = text.partition("=")
        name = name.strip()
        name = name if name in self.units else name.replace("-", "_")
        if not (equals and value) or name not in self.units:
            raise click.UsageError(
                f"{text!r} is not NAME=VALUES with a parameter: choose from {', '.join(self.units)}"
            )
        return name, value

    def numbers(self, name: str, values: list[str]) -> list[float]:
        try:
            return [float(value) * self.factor(name) for value in values]
        except ValueError as error:
            raise click.UsageError(f"{name}: {error}") from error

    def axis(self, text: str) -> tuple[str, Any]:
        name, value = self.split(text)
        if name in self.named:
            return name, value.split(",")
        parts = value.split(":")
        if len(parts) == 3:
            if not parts[2].isdigit():
                raise click.UsageError(f"{text!r}: COUNT is a whole number")
            low, high = self.numbers(name, parts[:2])
            return name, span(low, high, int(parts[2]))
        if len(parts) == 1:
            return name, self.numbers(name, value.split(","))
        raise click.UsageError(f"{text!r} is neither LOW:HIGH:COUNT nor A,B,...")

    def pair(self, text: str) -> tuple[str, tuple[float, float]]:
        name, value = self.split(text)
        numbers = self.numbers(name, value.split(":"))
        if len(numbers) != 2:
            raise click.UsageError(f"{text!r} needs two numbers with a colon between them")
        return name, (numbers[0], numbers[1])

    def number(self, text: str) -> tuple[str, float]:
        name, value = self.split(text)
        return name, self.numbers(name, [value])[0]


def pair(text: str) -> tuple[str, tuple[float, float]]:
    """NAME=LOW:HIGH of a parameter of throws."""
    return _Known.of_throws().pair(text)


def number(text: str) -> tuple[str, float]:
    """NAME=VALUE of a parameter of throws."""
    return _Known.of_throws().number(text)
