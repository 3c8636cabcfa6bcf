"""Figure 5 (waves): are rings of stencil (8) rounder than rings of stencil (7)?

A load that beats at the middle of the water makes rings of one wavelength; the radius of a crest on the axis
against that on the diagonal says how round they are. 20 s short, 60 s full.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _common import in_parallel, main, picture, table
from matplotlib.patches import Circle

from mjskip import HeightField

TITLE = "Figure 5: rings"

SPACING, SPEED = 0.02, 1.0
STENCILS = ("five_point", "nine_point")
COLOURS = {"five_point": "#d9822b", "nine_point": "#1f5fa8"}
WAVELENGTHS = (6, 8, 10, 12, 16, 24)


def rings(stencil: str, cells: float, size: int) -> HeightField:
    """Water around a load that beated until the rings nearly reached the edge."""
    field = HeightField(
        (size, size),
        SPACING,
        SPEED,
        0.0,
        stencil,
        "absorb",
        threads=1,  # type: ignore[arg-type]
    )
    period = cells * SPACING / SPEED
    step = 0.25 * SPACING / SPEED
    reach = 0.46 * size * SPACING
    for _ in range(int(reach / SPEED / step)):
        force = 2.0 * math.sin(2.0 * math.pi * field.time / period)
        field.press(0.0, 0.0, force=force, radius=0.25 * cells * SPACING)
        field.step(step)
    return field


def crest(field: HeightField, direction: float, near: float, cells: float) -> float:
    """Radius of the crest closest to `near` [m] in this direction [rad], by a parabola through it."""
    radius = np.arange(near - 0.75 * cells * SPACING, near + 0.75 * cells * SPACING, 0.1 * SPACING)
    wanted = np.column_stack([radius * math.cos(direction), radius * math.sin(direction)])
    height = _cubic(field, wanted)
    tops = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    k = tops[np.argmin(np.abs(radius[tops] - near))]
    a, b, c = height[k - 1 : k + 2]
    return float(radius[k] + 0.1 * SPACING * 0.5 * (a - c) / (a - 2.0 * b + c))


def _cubic(field: HeightField, points: Any) -> Any:
    """Elevation by cubic splines: bilinear sampling would move crests by a part of a cell."""
    from scipy.ndimage import map_coordinates

    at = (points - [field.x[0], field.y[0]]) / SPACING
    return map_coordinates(np.asarray(field.elevation, dtype=float), at.T, order=5)


def roundness(job: tuple[str, int, int]) -> dict[str, Any]:
    """Radii of one crest, 0.3 of the field from its middle."""
    stencil, cells, size = job
    field = rings(stencil, cells, size)
    near = 0.3 * size * SPACING
    axis = crest(field, 0.0, near, cells)
    diagonal = axis
    for direction in np.linspace(0.0, 0.25 * math.pi, 16):  # along the crest, not to its neighbour
        diagonal = crest(field, direction, diagonal, cells)
    return {
        "stencil": stencil,
        "cells": cells,
        "axis": axis,
        "diagonal": diagonal,
        "apart": 100.0 * (diagonal / axis - 1.0),
    }


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Roundness of rings of several wavelengths, and their picture."""
    size = 401 if quick else 601
    rows = in_parallel(roundness, [(s, n, size) for n in WAVELENGTHS for s in STENCILS])
    failed = HeightField((201, 201), SPACING, SPEED, 0.2, "paper_eq8", threads=1)
    failed.displace(0.0, 0.0, height=1e-3, radius=3 * SPACING)
    steps = 0
    while np.abs(failed.elevation).max() < 1.0 and steps < 200:
        failed.step(0.5 * SPACING / SPEED)
        steps += 1
    draw(rows, [rings(s, 6, 301) for s in STENCILS], failed, steps, out / "fig5_rings.png")
    return {"size": size, "rows": rows, "printed_steps": steps}


def draw(rows: Any, fields: Any, failed: HeightField, steps: int, path: Path) -> None:
    figure, axes = plt.subplots(
        1, 4, figsize=(14.5, 3.9), width_ratios=(1, 1, 1, 1.25), layout="constrained"
    )
    names = ("(7), five-point", "(8) repaired, nine-point")
    for ax, field, name in zip(axes, fields, names, strict=False):
        half = 100 * field.x[-1]
        shown = np.asarray(field.elevation).T
        level = np.percentile(np.abs(shown), 97)
        ax.imshow(
            shown, origin="lower", cmap="RdBu_r", vmin=-level, vmax=level, extent=(-half, half) * 2,
            interpolation="bicubic",
        )  # fmt: skip
        radius = 100 * crest(field, 0.0, 0.3 * 301 * SPACING, 6)
        ax.add_patch(Circle((0, 0), radius, fill=False, ls="--", lw=1.6, ec="black"))
        ax.set(title=name, xlabel="x [cm]", xlim=(-30, 230), ylim=(-30, 230))
    half = 100 * failed.x[-1]
    shown = np.asarray(failed.elevation).T
    level = np.abs(shown).max()
    axes[2].imshow(
        shown, origin="lower", cmap="RdBu_r", vmin=-level, vmax=level, extent=(-half, half) * 2
    )
    axes[2].set(
        title=f"(8) as printed, step {steps}", xlabel="x [cm]", xlim=(-65, 65), ylim=(-65, 65)
    )
    axes[2].text(
        0.5, 0.04, "a millimetre has become a metre", ha="center", transform=axes[2].transAxes
    )
    axes[0].set_ylabel("y [cm]")
    for ax in axes[:3]:
        ax.grid(False)
    for stencil in STENCILS:
        some = [r for r in rows if r["stencil"] == stencil]
        axes[3].plot(
            [r["cells"] for r in some], [r["apart"] for r in some], "o-", color=COLOURS[stencil],
            label=stencil.replace("_", "-"),
        )  # fmt: skip
    axes[3].axhline(0, color="k", lw=0.8)
    axes[3].set(xlabel="cells per wavelength", ylabel="diagonal radius over axis radius − 1 [%]")
    axes[3].legend()
    figure.savefig(path)
    plt.close(figure)


def page(found: dict[str, Any]) -> str:
    rows = [
        (r["stencil"], r["cells"], 100 * r["axis"], 100 * r["diagonal"], f"{r['apart']:+.2f}%")
        for r in found["rows"]
    ]
    return (
        picture(
            "fig5_rings.png",
            "Rings of 6 cells wavelength, one quarter, with a circle through the crest on the axis; "
            "equation (8) as printed; roundness of a crest against its wavelength.",
        )
        + "\n\n"
        + table(("stencil", "cells", "radius on axis [cm]", "on diagonal [cm]", "apart"), rows)
    )


if __name__ == "__main__":
    main(run, page)
