"""mjskip hydro: added mass, damping, natural periods and responses of what floats in a model."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
import xarray
from rich.table import Table

from mjskip._typing import Progress
from mjskip.cli.console import err, out, progress_bar
from mjskip.coupling.floating import floating_bodies
from mjskip.coupling.loading import load_model
from mjskip.errors import MjskipWarning
from mjskip.files import check_target, whole_file
from mjskip.hydro.decay import RESTORED, decays, natural_periods
from mjskip.hydro.panels import hull_influence
from mjskip.hydro.response import DOFS, FloatingBody, coefficients, response_amplitudes
from mjskip.throws.scene import shipped_scenes

COUNT = 40
"""Frequencies unless told otherwise."""
RESOLVED = 4.0
"""Mean sides of a panel in the shortest waves that it resolves."""

MAX_FREQUENCIES = 10_000
"""Frequencies that may be asked for: a solution of the panels each."""


def _range(context: Any, option: Any, value: str | None) -> tuple[float, float, int] | None:
    """LOW:HIGH:COUNT as numbers."""
    if value is None:
        return None
    try:
        low, high, count = value.split(":")
        found = float(low), float(high), int(count)
    except ValueError:
        raise click.BadParameter(f"{value!r}: give LOW:HIGH:COUNT, as 1:12:40 [rad/s]") from None
    if not (0.0 < found[0] < found[1] < math.inf and 2 <= found[2] <= MAX_FREQUENCIES):
        raise click.BadParameter(
            f"{value!r}: give 0 < LOW < HIGH and a COUNT from 2 to {MAX_FREQUENCIES}"
        )
    return found


@click.command()
@click.argument("model")
@click.option(
    "--omega",
    callback=_range,
    metavar="LOW:HIGH:COUNT",
    help=f"Angular frequencies [rad/s].  [default: {COUNT} that span the natural periods]",
)
@click.option(
    "--direction",
    "directions",
    type=float,
    multiple=True,
    default=(0.0,),
    metavar="DEGREES",
    help="Where waves run to, from the x axis; may be given several times.  [default: 0]",
)
@click.option("--depth", type=float, default=math.inf, metavar="M", help="Of the water.")
@click.option("--density", type=float, default=1000.0, show_default=True, metavar="KG/M^3")
@click.option("--save", type=click.Path(path_type=Path), metavar="FILE.nc", help="Write NetCDF.")
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE.png", help="Draw curves.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object instead of tables.")
def hydro(
    model: str,
    omega: tuple[float, float, int] | None,
    directions: tuple[float, ...],
    depth: float,
    density: float,
    save: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Added mass, radiation damping, natural periods, responses and decays of every floating body of MODEL.

    MODEL is an MJCF file or a shipped scene. Bodies are taken as they float at rest; names are Capytaine's.
    """
    for target, ending in ((save, ".nc"), (plot, ".png")):
        if target is not None:
            if target.suffix != ending:
                raise click.UsageError(f"{str(target)!r}: such files end in {ending}")
            check_target(target)
    if not depth > 0.0:
        raise ValueError(f"depth is {depth!r}: give metres of water")
    with progress_bar(f"hydrodynamics of {model}", "frequencies") as progress:
        data = analysed(model, omega, directions, depth=depth, density=density, progress=progress)
    if as_json:
        click.echo(json.dumps(report(data), allow_nan=False))
    else:
        _print(data)
    if save is not None:
        with whole_file(save) as part:  # by way of memory: HDF5 does not survive a full disk
            part.write_bytes(_flat(data).to_netcdf(engine="h5netcdf", invalid_netcdf=False))
        err.print(f"saved {save}")
    if plot is not None:
        from mjskip.draw.hydro import draw_hydro

        draw_hydro(data, plot)
        err.print(f"drew {plot}")


def analysed(
    name: str,
    omega: tuple[float, float, int] | None,
    directions: tuple[float, ...],
    *,
    depth: float,
    density: float,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Everything that is printed: coefficients, `rao`, `natural_period`, `decay`."""
    model = load_model(shipped_scenes().get(name, Path(name)))
    gravity = float(-model.opt.gravity[2])
    bodies = floating_bodies(model, density=density)
    shortest = RESOLVED * max(body.hull.panel_size for body in bodies)
    highest = math.sqrt(2.0 * math.pi * gravity / shortest)
    if omega is None:
        slowest, fastest = _natural_span(bodies, density, gravity, depth)
        low, high = 0.35 * slowest, 1.6 * fastest
        omega = low, max(min(high, highest), 1.5 * low), COUNT
    elif omega[1] > highest:
        warnings.warn(
            f"omega goes to {omega[1]:g} rad/s and the panels of the largest hull resolve waves of {shortest:.2g} m and "
            f"longer, up to {highest:.3g} rad/s: take curves beyond that as rough",
            MjskipWarning,
            stacklevel=2,
        )
    data = coefficients(
        bodies,
        np.linspace(*omega),
        directions=[math.radians(d) for d in directions],
        density=density,
        gravity=gravity,
        depth=depth,
        progress=progress,
    )
    data["rao"] = response_amplitudes(data)
    data["natural_period"] = natural_periods(data)
    data["decay"] = decays(bodies, density=density, gravity=gravity, depth=depth)
    data.attrs["model"] = name
    data.attrs["bodies"] = [body.name for body in bodies]
    return data


def _natural_span(
    bodies: Sequence[FloatingBody], density: float, gravity: float, depth: float
) -> tuple[float, float]:
    """Lowest and highest natural frequency [rad/s], with the added mass at infinity."""
    found = []
    for body in bodies:
        added = hull_influence(body.hull, depth=depth).added_mass(density)
        stiffness = body.hull.stiffness(density=density, gravity=gravity, mass=body.mass)
        for k in RESTORED:
            ratio = stiffness[k, k] / (body.mass_matrix + added)[k, k]
            if ratio > 1e-9:
                found.append(math.sqrt(ratio))
    return (min(found), max(found)) if found else (2.0, 6.0)


def report(data: xarray.Dataset) -> dict[str, Any]:
    """What `--json` prints."""

    def plain(values: Any) -> Any:
        array = np.asarray(values, dtype=object)
        return np.where(
            np.isfinite(np.asarray(values, dtype=float)), array, np.array(None)
        ).tolist()

    names = (
        "added_mass", "radiation_damping", "infinite_added_mass", "inertia_matrix", "hydrostatic_stiffness",
        "natural_period", "decay",
    )  # fmt: skip
    return {
        "model": data.attrs["model"],
        "bodies": data.attrs["bodies"],
        "omega": plain(data.omega),
        "wave_direction": plain(data.wave_direction),
        "dofs": data.radiating_dof.values.tolist(),
        "time": plain(data.time),
        **{name: plain(data[name].values) for name in names},
        "rao_amplitude": plain(np.abs(data.rao.values)),
        "excitation_amplitude": plain(np.abs(data.excitation_force.values)),
    }


def _flat(data: xarray.Dataset) -> xarray.Dataset:
    """Complex numbers as a dimension `complex` of re and im, as Capytaine writes them."""
    flat = data.copy()
    for name in list(flat.data_vars):
        if np.iscomplexobj(flat[name].values):
            parts = [flat[name].real, flat[name].imag]
            flat[name] = xarray.concat(parts, dim=xarray.Variable("complex", ["re", "im"]))
    return flat


def _print(data: xarray.Dataset) -> None:
    bodies = data.attrs["bodies"]
    for n, name in enumerate(bodies):
        table = Table(title=f"{name}: {float(data.inertia_matrix.values[6 * n, 6 * n]):.4g} kg")
        for title in ("", "A(inf)", "A", "B", "at rad/s", "natural period [s]", "largest response"):
            table.add_column(title, justify="left" if title == "" else "right")
        for k, dof in enumerate(DOFS):
            row = 6 * n + k
            period = float(data.natural_period.values[row])
            at = (
                int(np.argmin(np.abs(data.omega.values - 2.0 * math.pi / period)))
                if math.isfinite(period)
                else len(data.omega) // 2
            )
            responses = np.abs(data.rao.values[:, :, row])
            unit = "m/m" if k < 3 else "rad/m"
            table.add_row(
                dof,
                f"{float(data.infinite_added_mass.values[row, row]):.4g}",
                f"{float(data.added_mass.values[at, row, row]):.4g}",
                f"{float(data.radiation_damping.values[at, row, row]):.4g}",
                f"{float(data.omega.values[at]):.3g}",
                f"{period:.4g}" if math.isfinite(period) else "none",
                f"{responses.max():.3g} {unit}",
            )
        out.print(table)
