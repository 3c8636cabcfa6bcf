"""Curves of floating bodies over frequency and time: `mjskip hydro --plot`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from mjskip.errors import RenderError
from mjskip.files import whole_file
from mjskip.hydro.response import DOFS

SHOWN = (0, 2, 4)
"""Surge, heave and pitch in head waves; sway and roll take their place abeam."""


def draw_hydro(data: xarray.Dataset, path: Path) -> None:
    """Added mass, damping, responses and decays of every body, one column each.

    Raises:
        RenderError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise RenderError("drawing curves needs matplotlib: pip install 'mjskip[plot]'") from error
    bodies = data.attrs["bodies"]
    figure = Figure(figsize=(5.2 * len(bodies) + 0.8, 10.5), layout="constrained")
    axes: Any = figure.subplots(4, len(bodies), squeeze=False)
    omega = data.omega.values
    for n, name in enumerate(bodies):
        column = axes[:, n]
        for k in range(6):
            row = 6 * n + k
            own: Any = {"color": f"C{k}", "label": DOFS[k]}
            heaviest = float(data.inertia_matrix.values[row, row])
            column[0].plot(omega, data.added_mass.values[:, row, row] / heaviest, **own)
            column[1].plot(omega, data.radiation_damping.values[:, row, row] / heaviest, **own)
            column[2].plot(omega, np.abs(data.rao.values[:, 0, row]), **own)
            if np.isfinite(data.decay.values[:, row]).any():
                column[3].plot(data.time.values, data.decay.values[:, row], **own)
            period = float(data.natural_period.values[row])
            if math.isfinite(period):
                column[2].axvline(2.0 * math.pi / period, color=f"C{k}", lw=0.6, ls=":")
        column[0].set_title(name)
        for place, text in zip(
            column,
            (
                "added mass / inertia",
                "damping / inertia [1/s]",
                "response [m/m, rad/m]",
                "decay from 1",
            ),
            strict=True,
        ):
            place.set_ylabel(text)
            place.grid(alpha=0.3)
        top = np.nanpercentile(np.abs(data.rao.values[:, 0, 6 * n : 6 * n + 6]), 99.0)
        column[2].set_ylim(0.0, 1.1 * max(float(top), 1.0))
        column[2].set_xlabel("angular frequency [rad/s]")
        column[3].set_xlabel("time [s]")
        column[0].legend(ncols=3, fontsize=8)
    with whole_file(path) as part:
        figure.savefig(part, dpi=110, format="png")
