"""Does a stone over its own waves settle with the grid, with where the grid lies, and with the step?

    python scripts/two_way.py [deep waves] [--quick]

Tables for docs/water.md: time of the first touch, its depth and the speed it ends with, by the pure integrator, for
five throws over grids of 2, 1, 0.5 and 0.25 cm that lie under the throw in six ways, and steps of 0.4 to 0.05 ms.
Some fifteen minutes for each kind of water; --quick leaves out the finest grid. Windows are 64 cm wide. The response is exact on cells
of 1 cm and more; on finer ones it is that of cells without end.
"""

from __future__ import annotations

import argparse
import math
import warnings
from dataclasses import dataclass

import numpy as np

from mjskip import Stone, Throw, Water, load_scene
from mjskip.errors import MjskipWarning
from mjskip.throws.two_way import TwoWayIntegrator
from mjskip.waves.window import Window

WIDTH = 0.64
OVER = 0.010
"""Time without load after which a touch is over [s]."""
LONGEST = 0.25
"""A touch that lasts longer is no skip [s]."""
OFFSETS = ((0.0, 0.0), (0.1, 0.0), (0.25, 0.0), (0.5, 0.0), (0.5, 0.5), (0.65, 0.2))
"""Of the grid under the same throw, in cells: what is physics does not depend on it."""


def throws() -> dict[str, tuple[Stone, Throw, Water]]:
    """The five throws of docs/water.md."""
    found = {}
    for name, path, changes in (
        ("lake, 12 m/s", "lake", {}),
        ("Clanet's disc, 70 rev/s", "clanet_disc", {"spin": 70 * 2 * math.pi}),
        ("Clanet's disc, 400 rev/s", "clanet_disc", {"spin": 400 * 2 * math.pi}),
        ("lake, 8 m/s", "lake", {"speed": 8.0}),
    ):
        scene = load_scene(path).rethrow(**changes)
        (body,) = scene.stones
        water = Water(air_density=scene.water.air_density)
        found[name] = scene.stones[body], scene.throws[body], water
    disc = Stone.disc(0.05, 0.01, segments=64, density=2500.0)
    tilt = math.radians(20.0)
    thrown = Throw(speed=8.0, spin=30 * 2 * math.pi, attack=tilt, descent=tilt, height=0.05)
    found["disc of 5 cm, 8 m/s"] = disc, thrown, Water()
    return found


@dataclass
class Touch:
    """The first touch: how long [ms], how deep [mm], and the vertical speed after it [m/s]."""

    time: float
    depth: float
    speed: float
    worst: float  # of the balance of energy, relative


def first_touch(
    name: str, kind: str, *, spacing: float, timestep: float, offset: tuple[float, float]
) -> Touch:
    """Follow one throw to the end of its first touch."""
    stone, thrown, water = throws()[name]
    window = Window(kind, cells=round(WIDTH / spacing), spacing=spacing, account=True)
    # a millimetre above the water, where the flight is done
    start = thrown.state(stone, x=offset[0] * spacing, y=offset[1] * spacing)
    run = TwoWayIntegrator(
        [stone], [start], window=window, water=water, timestep=timestep, exact=spacing > 0.0075
    )
    first, last, lowest, speed = math.nan, math.nan, math.inf, math.nan
    balance, worst, energy = run.imbalance, 0.0, run.energy
    while not (run.time > last + OVER or run.time > first + LONGEST):
        run.step()
        worst = max(worst, abs(run.imbalance - balance) / energy)
        if run.loads is not None and run.loads.loads.any():
            first = run.time if math.isnan(first) else first
            last, speed = run.time, run.states[0, 14]
            turn = run.states[0, 3:12].reshape(3, 3)
            lowest = min(lowest, run.states[0, 2] + (stone.vertices @ turn[2]).min())
    stayed = run.time > first + LONGEST
    return Touch(
        time=math.nan if stayed else 1e3 * (last - first), depth=-1e3 * lowest,
        speed=math.nan if stayed else speed, worst=worst,
    )  # fmt: skip


def span(values: list[float], digits: int) -> str:
    """The least and the greatest of some values, or the one that they all are; - where some stayed in."""
    if any(math.isnan(v) for v in values):
        return "-"
    shown = sorted({f"{v:.{digits}f}" for v in values}, key=float)
    return shown[0] if len(shown) == 1 else f"{shown[0]} to {shown[-1]}"


def row(name: str, kind: str, label: str, touches: list[Touch]) -> None:
    """Print one row of the table."""
    print(
        f"| {name} | {kind} | {label} | {span([t.time for t in touches], 1)} "
        f"| {span([t.depth for t in touches], 1)} | {span([t.speed for t in touches], 3)} "
        f"| {max(t.worst for t in touches):.0e} |",
        flush=True,
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("kinds", nargs="*", default=["deep", "waves"])
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", MjskipWarning)
    spacings = (0.02, 0.01, 0.005) if asked.quick else (0.02, 0.01, 0.005, 0.0025)
    print("| throw | water | grid [cm], step [ms] | first touch [ms] | depth [mm] | exit v_z [m/s] | energy closes to |")  # fmt: skip
    print("|---|---|---|---|---|---|---|")
    for kind in asked.kinds:
        for name in throws():
            for spacing in spacings:
                offsets = OFFSETS if spacing > 0.003 else OFFSETS[::3]
                touches = [
                    first_touch(name, kind, spacing=spacing, timestep=2e-4, offset=offset)
                    for offset in offsets
                ]
                row(name, kind, f"{100 * spacing:g}, 0.2", touches)
            for timestep in (4e-4, 1e-4, 5e-5):
                touch = first_touch(name, kind, spacing=0.01, timestep=timestep, offset=(0.0, 0.0))
                row(name, kind, f"1, {1e3 * timestep:g}", [touch])


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    main()
