"""Should a stone feel its own dent? Throws over still water and over waves without and with it.

    python scripts/own_dent.py

A table for docs/water.md: skips, time of the first touch, its depth, what the stone kept of its speed, and
how many loads had to be cut down, over grids of 2, 1 and 0.5 cm. A few minutes.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from mjskip import Limits, Water, load_scene, simulate

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


def row(name: str, *, spacing: float, surface: str, own_dent: bool) -> dict[str, Any]:
    """One throw."""
    path, changes = THROWS[name]
    with tempfile.TemporaryDirectory() as folder:
        if path == "disc.xml":
            path = f"{folder}/{path}"
            Path(path).write_text(DISC)
        scene = load_scene(path)
    grid = {k: v for k, v in scene.grid.items() if k != "shape"}
    water = Water(air_density=scene.water.air_density)
    scene = replace(scene, grid={**grid, "spacing": spacing, "boundary": "absorb"}, water=water)
    scene = scene.rethrow(**changes)
    run = simulate(scene, surface=surface, own_dent=own_dent, limits=Limits(duration=2.0))
    first = run.contacts[0]
    out = first.exit
    return {
        "throw": name,
        "surface": surface if surface == "still" else ("own dent" if own_dent else "others'"),
        "spacing_cm": 100 * spacing,
        "skips": run.skips,
        "contact_ms": 1e3 * (out.time - first.entry.time) if out else float("nan"),
        "depth_mm": 1e3 * first.depth,
        "exit_vz": out.velocity[2] if out else float("nan"),
        "end": run.end,
    }


def main() -> None:
    """Print the table."""
    print(
        "| throw | surface | grid [cm] | skips | first touch [ms] | depth [mm] | exit v_z [m/s] | end |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name in THROWS:
        cases = [("still", False, SPACINGS[0])]
        cases += [("waves", own, d) for own in (False, True) for d in SPACINGS]
        for surface, own, d in cases:
            r = row(name, spacing=d, surface=surface, own_dent=own)
            grid = "" if surface == "still" else f"{r['spacing_cm']:g}"
            print(
                f"| {r['throw']} | {r['surface']} | {grid} | {r['skips']} | {r['contact_ms']:.1f} "
                f"| {r['depth_mm']:.1f} | {r['exit_vz']:.3f} | {r['end']} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
