"""Pictures of sweeps: what the dimensions suggest, a map, a curve with its spread or a cloud of points."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjskip._typing import Array
from mjskip.errors import MjskipError
from mjskip.files import check_folder, whole_file
from mjskip.sweeps.design import MEMBER, SAMPLE
from mjskip.throws.throw import PARAMETERS

if TYPE_CHECKING:
    import xarray as xr

SHOWN = {p.unit: (p.shown_unit, 1.0 / p.factor) for p in PARAMETERS.values() if p.factor != 1.0}
"""Units that people read, and the factor to them."""

MAX_PANELS = 9

MAX_COLOURS = 10
"""Whole numbers that a map shows in a colour each."""


def plot_sweep(
    data: xr.Dataset, path: str | os.PathLike[str], *, result: str | None = None, dpi: int = 120
) -> None:
    """Draw one result of a sweep to a PNG (or whatever the suffix says).

    Two numeric dimensions make a map of the mean over the ensemble, in which a line goes around the region
    where at least half of the throws skip; one makes a curve with the middle four fifths of the ensemble;
    samples make a cloud of points. One dimension more makes a panel (a map) or a line (a curve) per value.

    Args:
        data: what `sweep` returned or `open_sweep` read.
        path: of the picture.
        result: one of the numbers in it; skips, or the first, if None.
        dpi: dots per inch.

    Raises:
        MjskipError: no matplotlib, or more dimensions than a picture has.
        ValueError: there is no such result.
    """
    numbers = [str(name) for name, values in data.data_vars.items() if values.dtype.kind == "f"]
    result = result or ("skips" if "skips" in numbers else numbers[0])
    if result not in numbers:
        raise ValueError(f"no result {result!r}: choose from {', '.join(numbers)}")
    check_picture(path)
    data = data.assign({result: (data[result].dims, _shown(data[result]), data[result].attrs)})
    from matplotlib.figure import Figure

    wide = [str(d) for d in data.dims if data.sizes[d] > 1 and d != MEMBER]
    numeric = [d for d in wide if d != SAMPLE and data[d].dtype.kind == "f"]
    if SAMPLE in wide:
        kind, across = "cloud", [SAMPLE]
    elif len(numeric) >= 2:
        # the two longest are the map, the later one upwards
        longest = sorted(numeric, key=lambda d: -data.sizes[d])[:2]
        kind, across = "map", [d for d in numeric if d in longest]
    elif numeric:
        kind, across = "curve", numeric
    else:
        raise MjskipError("nothing varies in numbers in this sweep: there is nothing to draw")
    rest = [d for d in wide if d not in across]
    if len(rest) > 1:
        raise MjskipError(
            f"{', '.join(rest)} vary besides {', '.join(across)}: choose values of all but one, for "
            "example data.isel(" + ", ".join(f"{d}=0" for d in rest[1:]) + ")"
        )
    data = data.isel({d: 0 for d in data.dims if data.sizes[d] == 1 and d != MEMBER})
    panels = [data] if not rest else [data.isel({rest[0]: k}) for k in range(data.sizes[rest[0]])]
    if len(panels) > MAX_PANELS:
        panels = [panels[k] for k in np.linspace(0, len(panels) - 1, MAX_PANELS).astype(int)]
    places = 1 if kind == "curve" else len(panels)  # curves share one
    columns = min(places, 3)
    rows = math.ceil(places / columns)
    figure = Figure(figsize=(1.2 + 4.6 * columns, 0.9 + 3.6 * rows), dpi=dpi, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    drawn: Any = None
    for k, panel in enumerate(panels):
        label = "" if not rest else _value(panel[rest[0]])
        drawn = _KINDS[kind](axes[k % places], panel, across, result, label, data)
    for spare in axes[places:]:
        spare.set_axis_off()
    if drawn is not None:
        counts = _counts(data, result)
        figure.colorbar(drawn, ax=list(axes), label=_result_label(data, result), ticks=counts)
    figure.suptitle(_title(data), fontsize=9)
    with whole_file(path) as part:
        figure.savefig(part)


def check_picture(path: str | os.PathLike[str]) -> None:
    """Fail before a long sweep rather than after it.

    Raises:
        MjskipError: no matplotlib, no such folder, or a suffix that it cannot write.
    """
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError as error:
        raise MjskipError("plots need a package more: pip install 'mjskip[plot]'") from error
    path = Path(path)
    known = FigureCanvasBase.get_supported_filetypes()
    if path.suffix.removeprefix(".").lower() not in known:
        raise MjskipError(f"{path} is no picture: end its name with .png, .svg or .pdf")
    check_folder(path.parent)


def _map(axes: Any, data: xr.Dataset, across: list[str], result: str, label: str, all_: Any) -> Any:
    from matplotlib.lines import Line2D

    x, y = (_shown(data[d]) for d in across)
    mean = _mean(data[result]).transpose(across[1], across[0]).values
    drawn = axes.pcolormesh(x, y, mean, shading="nearest", **_colours(all_, result))
    if np.isnan(mean).any():
        axes.set_facecolor("0.8")
    skips = data["skips"] if "skips" in data else data[result] * np.nan  # a run has none
    share = _mean((skips >= 1).where(skips.notnull()))
    part = share.transpose(across[1], across[0]).fillna(0.0).values
    if part.min() < 0.5 <= part.max():
        axes.contour(x, y, part, levels=[0.5], colors="white", linewidths=2.0)
        line = Line2D([], [], color="white", linewidth=2.0, label="half of the throws skip")
        axes.legend(handles=[line], loc="upper right", fontsize=8, facecolor="0.35", labelcolor="w")
    axes.set(xlabel=_label(data[across[0]]), ylabel=_label(data[across[1]]), title=label)
    return drawn


def _curve(
    axes: Any, data: xr.Dataset, across: list[str], result: str, label: str, all_: Any
) -> Any:
    x = _shown(data[across[0]])
    values = data[result]
    (line,) = axes.plot(x, _mean(values).values, marker="o", markersize=3, label=label)
    if MEMBER in values.dims:
        low, high = (values.quantile(q, MEMBER).values for q in (0.1, 0.9))
        axes.fill_between(x, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
        axes.set_title("mean, and the middle four fifths of the ensemble", fontsize=8)
    axes.set(xlabel=_label(data[across[0]]), ylabel=_result_label(data, result))
    if label:
        axes.legend(fontsize=8)
    return None


def _cloud(
    axes: Any, data: xr.Dataset, across: list[str], result: str, label: str, all_: Any
) -> Any:
    names = [str(n) for n, c in data.coords.items() if c.dims == (SAMPLE,) and n != SAMPLE]
    values = _mean(data[result]).values
    low, high = _ends(all_, result)
    if len(names) == 1:
        axes.scatter(_shown(data[names[0]]), values, s=12)
        axes.set(xlabel=_label(data[names[0]]), ylabel=_result_label(data, result), title=label)
        return None
    drawn = axes.scatter(
        _shown(data[names[0]]), _shown(data[names[1]]), c=values, s=16, vmin=low, vmax=high
    )
    axes.set(xlabel=_label(data[names[0]]), ylabel=_label(data[names[1]]), title=label)
    return drawn


_KINDS = {"map": _map, "curve": _curve, "cloud": _cloud}


def _mean(values: xr.DataArray) -> xr.DataArray:
    return values.mean(MEMBER) if MEMBER in values.dims else values


def _counts(data: xr.Dataset, result: str) -> Array | None:
    """The whole numbers that a map has to show, if they are few; None if a scale is continuous."""
    values = _mean(data[result]).values
    values = values[np.isfinite(values)]
    if not len(values) or np.any(values != np.round(values)) or np.ptp(values) > MAX_COLOURS - 1:
        return None
    return np.arange(values.min(), values.max() + 1.0)


def _colours(data: xr.Dataset, result: str) -> dict[str, Any]:
    """Of a map: one for each of a few whole numbers (two for yes and no), else a scale."""
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm

    counts = _counts(data, result)
    if counts is None or len(counts) < 2:
        low, high = _ends(data, result)
        return {"cmap": "viridis", "vmin": low, "vmax": high}
    edges = np.append(counts - 0.5, counts[-1] + 0.5)
    return {
        "cmap": colormaps["viridis"].resampled(len(counts)),
        "norm": BoundaryNorm(edges, len(counts)),
    }


def _ends(data: xr.Dataset, result: str) -> tuple[float, float]:
    """Colour limits for all panels: of what is drawn."""
    mean = _mean(data[result])
    if not bool(mean.notnull().any()):
        return 0.0, 1.0
    low, high = float(mean.min()), float(mean.max())
    return low, high if high > low else low + 1.0


def _shown(values: xr.DataArray) -> Array:
    return np.asarray(values.values * SHOWN.get(values.attrs.get("units", ""), ("", 1.0))[1])


def _unit(values: xr.DataArray) -> str:
    units = str(values.attrs.get("units", ""))
    units = SHOWN.get(units, (units, 1.0))[0]
    return "" if units in ("", "1") else f" [{units.replace(' s-1', '/s').replace(' m-3', '/m³')}]"


def _label(values: xr.DataArray) -> str:
    return f"{str(values.name).replace('_', ' ')}{_unit(values)}"


def _result_label(data: xr.Dataset, result: str) -> str:
    mean = "mean " if MEMBER in data[result].dims else ""
    return f"{mean}{_label(data[result])}"


def _value(values: xr.DataArray) -> str:
    if values.dtype.kind != "f":
        return str(values.item())
    unit = _unit(values).strip(" []")
    return f"{str(values.name).replace('_', ' ')} {float(_shown(values)):.4g} {unit}".rstrip()


def _title(data: xr.Dataset) -> str:
    made = json.loads(data.attrs.get("request", "{}"))
    if not made:
        return ""
    sizes = made["design"]["dimensions"]
    shape = " × ".join(f"{n} {k}" for k, n in sizes.items())
    total = math.prod(sizes.values())
    if "model" in made:
        given = ", ".join(f"{name} {value}" for name, value in made["given"].items())
        return (
            f"{made['model'].partition(' ')[0]} {made['body']} {given}\n{total} runs ({shape}), "
            f"{made['duration']:g} s without the first {made['settle']:g}, {1e3 * made['timestep']:.3g} ms steps"
        )
    stone, throw = made["stone"], made["throw"]
    varied = {*made["design"]["axes"], *made["design"]["samples"]}
    law = [] if "law" in varied else [made["water"]["law"]]
    fixed = {name: p for name, p in PARAMETERS.items() if throw[name] and name not in varied}
    parts = [f"{name} {p.text_of(throw[name])}" for name, p in fixed.items()]
    return (
        f"{1e3 * stone['mass']:.3g} g, radius {1e3 * stone['radius']:.3g} mm, {', '.join(parts + law)}\n"
        f"{total} throws ({shape}), {made['engine']}, "
        f"{1e3 * made['timestep']:.3g} ms steps"
    )
