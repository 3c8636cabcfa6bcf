"""What does the same throw do with the time step of a frame, 1/60 s?

Clanet's disc, frozen attitude, 3.5 m/s, 20/20, by MuJoCo's semi-implicit Euler and RK4. 3 s.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _common import main, picture, reference_scene, table

from mjskip import Limits, Trajectory, simulate

TITLE = "The time step: skips that are not there"

STEPS = (1.0 / 60.0, 1.0 / 120.0, 1.0 / 240.0, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
INTEGRATORS = ("Euler", "RK4")


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Exit speeds over time steps; short and full form are the same."""
    scene = reference_scene(spin=0.0)
    scene = replace(scene, water=replace(scene.water, gate="centre", law="lee2010"))
    limits = Limits(duration=0.5, max_contact=0.3, min_airtime=1e-3)
    rows = []
    for integrator in INTEGRATORS:
        for step in STEPS:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the warning is what this is about
                flight = simulate(
                    scene, integrator=integrator, timestep=step, frozen_attitude=True, limits=limits
                )
            velocity = after_touch(flight)
            energy = np.nan if velocity is None else np.sum(np.square(velocity)) / 3.5**2
            rows.append(
                {
                    "integrator": integrator,
                    "timestep": step,
                    "fraction": step * 3.5 / scene.stone.thickness,
                    "vx": velocity and velocity[0],
                    "vz": velocity and velocity[2],
                    "energy_out_in": energy,
                }
            )
    draw(rows, out / "timestep.png")
    coarse = rows[0]
    fine = rows[-1]
    factor = None if coarse["vz"] is None else coarse["vz"] / fine["vz"]
    return {"rows": rows, "factor": factor, "coarse": coarse, "fine": fine}


def after_touch(flight: Trajectory) -> tuple[float, ...] | None:
    """Velocity of the first dry row after the first wet one: no interpolation over so long a step."""
    wet = flight.clearance < 0.0
    dry_again = np.flatnonzero(~wet & (np.cumsum(wet) > 0))
    return tuple(flight.velocity[dry_again[0]]) if len(dry_again) else None


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    figure, ax = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for integrator, colour in zip(INTEGRATORS, ("#d9822b", "#1f5fa8"), strict=True):
        some = [r for r in rows if r["integrator"] == integrator and r["vz"] is not None]
        name = "semi-implicit Euler" if integrator == "Euler" else integrator
        x, y = [r["fraction"] for r in some], [r["vz"] for r in some]
        ax.loglog(x, y, "o-", color=colour, label=name, ms=5)
    ax.axhline(rows[-1]["vz"], color="k", lw=1, ls=":")
    ax.annotate(
        "1/60 s", (rows[0]["fraction"], rows[0]["vz"]), (-46, -4), textcoords="offset points"
    )
    ax.set(xlabel="time step × speed / thickness", ylabel="vertical exit speed [m/s]")
    ax.legend()
    figure.savefig(path)
    plt.close(figure)


def page(found: dict[str, Any]) -> str:
    rows = [
        (r["integrator"], f"{1e3 * r['timestep']:.3g}", r["fraction"], r["vx"], r["vz"],
         r["energy_out_in"])
        for r in found["rows"]
    ]  # fmt: skip
    coarse, fine = found["coarse"], found["fine"]
    return (
        picture("timestep.png", "Vertical speed at which the disc leaves, against the time step.")
        + f"\n\nAt 1/60 s semi-implicit Euler lets the disc leave at {coarse['vz']:.1f} m/s instead of "
        f"{fine['vz']:.3f}: wrong by a factor of {found['factor']:.0f}, with "
        f"{coarse['energy_out_in']:.1f} times the energy it came with. The drag of one step would exceed "
        "the momentum that there is: it is limited, and the run warns of the step. (Without the limit it was 10.4 m/s, "
        "a factor of 45, with nine times the energy.) Such skips are numerical, not physics.\n\n"
        "<details><summary>All steps</summary>\n\n"
        + table(
            ("MuJoCo integrator", "step [ms]", "× speed / thickness", "vx out", "vz out [m/s]",
             "kinetic energy out/in"),
            rows,
        )
        + "\n\n</details>"
    )  # fmt: skip


if __name__ == "__main__":
    main(run, page)
