"""Figure 8: how fast does a stone lose its momentum, with and without spin?

8 m/s, flat stone and round pebble, ensembles of throws. 10 s short, 30 s full.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _common import in_parallel, main, picture, table
from _stones import COLOURS, fly, nominal, scattered, stone

TITLE = "Figure 8: momentum with and without spin"

KINDS = ("flat", "round")
SPINS = {"flat": (0.0, 400.0), "round": (0.0, 400.0)}
FRAMES = np.arange(0.0, 1.2, 1.0 / 60.0)


def momentum(job: tuple[str, float, int]) -> tuple[Any, int]:
    """P_x / P_x(0) at 60 frames/s, and skips; a stone that sank keeps its last value."""
    kind, spin, seed = job
    throw = nominal(kind, 8.0, spin)
    flight = fly(kind, throw if seed == 0 else scattered(throw, seed), duration=1.2, longest=9.0)
    return np.interp(FRAMES, flight.time, flight.P[:, 0] / flight.P[0, 0]), flight.skips


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Momentum over time; the first throw of each ensemble is the nominal one."""
    throws = 32 if quick else 128
    series = []
    for kind in KINDS:
        for spin in SPINS[kind]:
            results = in_parallel(momentum, itertools.product([kind], [spin], range(throws)))
            curves = np.array([curve for curve, _ in results])
            counts = np.array([count for _, count in results])
            first = _time_to(curves.mean(axis=0), 0.5)
            series.append(
                {
                    "stone": kind,
                    "spin": spin,
                    "nominal": curves[0],
                    "mean": curves.mean(axis=0),
                    "low": np.percentile(curves, 5, axis=0),
                    "high": np.percentile(curves, 95, axis=0),
                    "half_time": first,
                    "skips_nominal": int(counts[0]),
                    "skips_mean": counts.mean(),
                    "skips_std": counts.std(ddof=1),
                    "drop": _largest_drop(curves),
                }
            )
    draw(series, out / "fig8_momentum.png")
    return {"throws": throws, "time": FRAMES, "series": series}


def _time_to(curve: Any, level: float) -> float | None:
    below = np.flatnonzero(curve < level)
    return float(FRAMES[below[0]]) if len(below) else None


def _largest_drop(curves: Any) -> float:
    """Mean over throws of the largest loss within 50 ms, as a share of the first momentum."""
    window = 3
    return float((curves[:, :-window] - curves[:, window:]).max(axis=1).mean())


def draw(series: list[dict[str, Any]], path: Path) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.2), sharey=True, layout="constrained")
    for ax, kind in zip(axes, KINDS, strict=True):
        for one in (s for s in series if s["stone"] == kind):
            colour = COLOURS["flat"] if one["spin"] else COLOURS["round"]
            name = (
                f"{one['spin']:.0f} rad/s: {one['skips_mean']:.1f} ± {one['skips_std']:.1f} skips"
            )
            if not one["spin"]:
                name = f"no spin: {one['skips_mean']:.1f} ± {one['skips_std']:.1f} skips"
            ax.fill_between(FRAMES, one["low"], one["high"], color=colour, alpha=0.18, lw=0)
            ax.plot(FRAMES, one["nominal"], color=colour, label=name)
            ax.plot(FRAMES, one["mean"], color=colour, ls=":", lw=1.3)
        title = {"flat": "flat stone", "round": "round pebble"}[kind]
        begin = 8.0 * np.cos(np.radians(5.0)) * stone(kind).mass
        title = f"{title}, {1e3 * stone(kind).mass:.0f} g, $P_x(0)$ = {begin:.2g} kg m/s"
        ax.set(xlabel="time [s]", title=title, ylim=(0, 1.05), xlim=(0, 1.2))
        ax.legend(loc="lower left" if kind == "round" else (0.32, 0.1))
    axes[0].set_ylabel(r"momentum $P_x(t)/P_x(0)$")
    figure.savefig(path)
    plt.close(figure)


def page(found: dict[str, Any]) -> str:
    rows = [
        (
            s["stone"],
            f"{s['spin']:.0f}",
            s["skips_nominal"],
            f"{s['skips_mean']:.1f} ± {s['skips_std']:.1f}",
            s["half_time"],
            f"{100 * s['drop']:.0f}%",
            f"{100 * s['mean'][-1]:.0f}%",
        )
        for s in found["series"]
    ]
    return (
        picture(
            "fig8_momentum.png",
            f"Forward momentum at 60 frames/s. Line: the nominal throw; dotted: mean of {found['throws']} "
            "throws; band: 5 to 95%.",
        )
        + "\n\nStones and throws as in figure 7.\n\n"
        + table(
            (
                "stone",
                "spin [rad/s]",
                "skips, nominal",
                "skips, ensemble",
                "half lost after [s]",
                "largest loss in 50 ms",
                "left after 1.2 s",
            ),
            rows,
        )
    )


if __name__ == "__main__":
    main(run, page)
