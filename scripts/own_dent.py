"""Should a stone feel its own dent? Throws over still water and over waves without and with it.

    python scripts/own_dent.py

A table for docs/water.md: skips, time of the first touch, its depth and the speed it left with, over grids of 2, 1
and 0.5 cm that lie under the throw in six ways. A minute or two.
"""

from __future__ import annotations

import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

from mjskip import Limits, Water, load_scene, simulate
from mjskip.errors import DivergedError, MjskipWarning

DISC = """<mujoco model="disc">
  <option timestep="0.0002" integrator="RK4"/>
  <worldbody><body name="disc"><freejoint/>
    <geom type="cylinder" size="0.05 0.005" density="2500"/></body></worldbody>
</mujoco>"""
"""A disc of 5 cm, 1 cm thick."""

THROWS: dict[str, tuple[str, dict[str, float]]] = {
    "lake": ("lake", {}),
    "clanet 70 rev/s": ("clanet_disc", {"spin": 70 * 6.283185307}),
    "clanet 400 rev/s": ("clanet_disc", {"spin": 400 * 6.283185307}),
    "lake 8 m/s": ("lake", {"speed": 8.0}),
    "5 cm disc 8 m/s": (
        "disc.xml",
        {
            "speed": 8.0,
            "spin": 30 * 6.283185307,
            "attack": 0.3491,
            "descent": 0.3491,
            "height": 0.05,
        },
    ),
}
SPACINGS = (0.02, 0.01, 0.005)
OFFSETS = ((0.0, 0.0), (0.1, 0.0), (0.25, 0.0), (0.5, 0.0), (0.5, 0.5), (0.65, 0.2))
"""Of the grid under the same throw, in cells: what is physics does not depend on it."""


def row(
    name: str, *, spacing: float, surface: str, own_dent: bool, offset: tuple[float, float]
) -> dict[str, Any]:
    """One throw."""
    path, changes = THROWS[name]
    with tempfile.TemporaryDirectory() as folder:
        if path == "disc.xml":
            path = f"{folder}/{path}"
            Path(path).write_text(DISC)
        scene = load_scene(path)
    grid = {k: v for k, v in scene.grid.items() if k != "shape"}
    centre = (offset[0] * spacing, offset[1] * spacing)
    water = Water(air_density=scene.water.air_density)
    scene = replace(
        scene,
        grid={**grid, "spacing": spacing, "boundary": "absorb", "centre": centre},
        water=water,
    )
    scene = scene.rethrow(**changes)
    run = simulate(scene, surface=surface, own_dent=own_dent, limits=Limits(duration=2.0))
    first = run.contacts[0]
    out = first.exit
    return {
        "surface": surface if surface == "still" else ("own dent" if own_dent else "others'"),
        "skips": run.skips,
        "contact_ms": 1e3 * (out.time - first.entry.time) if out else float("nan"),
        "depth_mm": 1e3 * first.depth,
        "exit_vz": out.velocity[2] if out else float("nan"),
    }


def span(values: list[float], digits: int) -> str:
    """The least and the greatest of some values, or the one that they all are; - of none."""
    if not values:
        return "-"
    shown = sorted({f"{v:.{digits}f}" for v in values}, key=float)
    return shown[0] if len(shown) == 1 else f"{shown[0]} to {shown[-1]}"


def main() -> None:
    """Print the table: over the offsets of the grid the least and the greatest."""
    warnings.simplefilter("ignore", MjskipWarning)  # of stones that their dent has driven
    print(
        "| throw | surface | grid [cm] | skips | first touch [ms] | depth [mm] | exit v_z [m/s] |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in THROWS:
        cases = [("still", False, SPACINGS[0])]
        cases += [("waves", own, d) for own in (False, True) for d in SPACINGS]
        for surface, own, d in cases:
            rows, lost = [], 0
            for offset in OFFSETS[:1] if surface == "still" else OFFSETS:
                try:
                    rows.append(row(name, spacing=d, surface=surface, own_dent=own, offset=offset))
                except DivergedError:
                    lost += 1
            grid = "" if surface == "still" else f"{100 * d:g}"
            left = [r for r in rows if r["contact_ms"] == r["contact_ms"]]
            note = f" ({lost} diverged)" if lost else ""
            print(
                f"| {name} | {rows[0]['surface']} | {grid} | {span([r['skips'] for r in rows], 0)}{note} "
                f"| {span([r['contact_ms'] for r in left], 1)} | {span([r['depth_mm'] for r in left], 1)} "
                f"| {span([r['exit_vz'] for r in left], 3)} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
