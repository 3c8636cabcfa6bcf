"""Figure 5 (throws): does spin bend the path, and does it make more skips?

One speed, spins of none, left and right, seen from above and from the side; with the scatter of an
ensemble. 10 s short, 30 s full.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _common import in_parallel, main, picture, table
from _stones import fly, nominal, scattered

TITLE = "Figure 5: bent and straight paths"

KIND, SPEED = "flat", 12.0
SPINS = (300.0, -300.0, 0.0)
COLOURS = {0.0: "#d9822b", 300.0: "#1f5fa8", -300.0: "#2e8b57"}


def path(job: tuple[float, int]) -> dict[str, Any]:
    """The way of one stone until its run is over, and where it touched."""
    spin, seed = job
    throw = nominal(KIND, SPEED, spin)
    flight = fly(KIND, throw if seed == 0 else scattered(throw, seed))
    step = max(1, len(flight.time) // 400)
    return {
        "x": flight.position[::step, 0],
        "y": flight.position[::step, 1],
        "z": flight.position[::step, 2],
        "touches": [contact.entry.position for contact in flight.contacts],
        "skips": flight.skips,
        "end": flight.position[-1],
    }


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Paths of ensembles; the first of each is the nominal throw."""
    throws = 32 if quick else 96
    paths = in_parallel(path, itertools.product(SPINS, range(throws)))
    by_spin = {spin: paths[k * throws : (k + 1) * throws] for k, spin in enumerate(SPINS)}
    draw(by_spin, out / "fig5_paths.png")
    rows = []
    for spin, some in by_spin.items():
        ends = np.array([one["end"] for one in some])
        counts = np.array([one["skips"] for one in some])
        rows.append(
            {
                "spin": spin,
                "skips": int(some[0]["skips"]),
                "skips_mean": counts.mean(),
                "skips_std": counts.std(ddof=1),
                "distance": ends[0, 0],
                "sideways": ends[0, 1],
                "sideways_mean": ends[:, 1].mean(),
                "sideways_std": ends[:, 1].std(ddof=1),
            }
        )
    return {"throws": throws, "speed": SPEED, "rows": rows}


def draw(by_spin: dict[float, list[dict[str, Any]]], path: Path) -> None:
    figure, (top, side) = plt.subplots(
        2, 1, figsize=(9.5, 5.2), sharex=True, height_ratios=(2.0, 1.0), layout="constrained"
    )
    for spin, some in by_spin.items():
        colour = COLOURS[spin]
        for one in some[1:]:
            top.plot(one["x"], one["y"], color=colour, lw=0.6, alpha=0.25)
        nominal_path = some[0]
        name = "no spin" if not spin else f"{spin:+.0f} rad/s"
        top.plot(nominal_path["x"], nominal_path["y"], color=colour, lw=2.2, label=name)
        touches = np.array(nominal_path["touches"])
        top.plot(touches[:, 0], touches[:, 1], "o", color=colour, ms=6, mec="white")
        if spin >= 0.0:
            side.plot(nominal_path["x"], 100 * nominal_path["z"], color=colour, lw=1.8)
            side.plot(touches[:, 0], 100 * touches[:, 2], "o", color=colour, ms=6, mec="white")
    side.axhline(0.0, color="#4aa3c7", lw=1.2)
    side.set(ylim=(-8, 14), xlabel="x [m]", ylabel="z [cm]")
    top.set_ylabel("y, to the left [m]")
    top.legend(loc="upper left", title=f"flat stone, {SPEED:.0f} m/s")
    figure.savefig(path)
    plt.close(figure)


def page(found: dict[str, Any]) -> str:
    rows = [
        (
            f"{r['spin']:+.0f}",
            r["skips"],
            f"{r['skips_mean']:.1f} ± {r['skips_std']:.1f}",
            r["distance"],
            f"{100 * r['sideways']:+.1f}",
            f"{100 * r['sideways_mean']:+.1f} ± {100 * r['sideways_std']:.1f}",
        )
        for r in found["rows"]
    ]
    return (
        picture(
            "fig5_paths.png",
            f"Above: from above, {found['throws']} throws each (thin) and the nominal one (thick); dots "
            "are touches. Below: from the side, nominal throws.",
        )
        + "\n\n"
        + table(
            (
                "spin [rad/s], left positive",
                "skips",
                "skips, ensemble",
                "distance [m]",
                "sideways at the end [cm]",
                "sideways, ensemble [cm]",
            ),
            rows,
        )
    )


if __name__ == "__main__":
    main(run, page)
