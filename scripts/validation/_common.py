"""What the validation scripts share: single touches, parallel maps, tables and the look of figures."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from mjskip import (
    Contact,
    Limits,
    Scene,
    Stone,
    Throw,
    Trajectory,
    Water,
    integrate,
    load_scene,
)
from mjskip.hydro.laws import LAWS as FORCE_LAWS

DOCS = Path(__file__).resolve().parents[2] / "docs"
PICTURES = DOCS / "validation"

WORKERS = 2
"""Processes: a run holds Python's lock for much of its time, so threads would not help."""

LEFT = 1e-3
"""Time in the air that makes an exit of a single touch [s]: short, so that a slow exit still counts."""

LAWS = tuple(law for law in FORCE_LAWS if law != "none")

COLOURS = {
    "lee2010": "#1f5fa8",
    "nagahiro2005": "#d9822b",
    "rosellini2005": "#2e8b57",
    "bocquet2003": "#8d4a9e",
    "lee2010_forward": "#6fa3d8",
    "rosellini2005_forward": "#7cc49a",
    "rayleigh1876_forward": "#c0392b",
    "birkhoff1944": "#7f8c8d",
}

mpl.use("Agg")
mpl.rcParams.update(
    {
        "figure.dpi": 150,
        "savefig.bbox": "tight",
        "font.size": 11,
        "axes.titlesize": 11,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.alpha": 0.25,
        "grid.linewidth": 0.6,
        "legend.frameon": False,
        "legend.fontsize": 9.5,
        "lines.linewidth": 1.8,
    }
)


def clanet_disc(*, segments: int = 64) -> Stone:
    """The aluminium disc of Clanet, Hersen & Bocquet (2004): R 2.5 cm, 2.75 mm, 14.6 g."""
    return Stone.disc(0.025, 0.00275, segments=segments, density=2700.0)


def touch(
    stone: Stone,
    *,
    speed: float = 3.5,
    spin: float = 65.0,
    attack: float = 20.0,
    descent: float = 20.0,
    frozen: bool = False,
    timestep: float = 1e-4,
    method: str = "rk4",
    longest: float = 0.3,
    **water: Any,
) -> Trajectory:
    """One touch that begins as the stone is let go, without air [degrees, rev/s]."""
    throw = Throw.from_degrees(speed=speed, spin=spin, attack=attack, descent=descent, height=0.0)
    return integrate(
        stone,
        throw,
        water=Water(air_density=0.0, **water),
        integrator=method,
        timestep=timestep,
        frozen_attitude=frozen,
        limits=Limits(duration=longest + 0.02, max_contact=longest, min_airtime=LEFT),
    )


def reference_scene(*, spin: float) -> Scene:
    """The scene of Clanet's disc, touching the water as it is let go at 3.5 m/s, 20/20 [rev/s]."""
    tilt = math.radians(20.0)
    return load_scene("clanet_disc").rethrow(
        speed=3.5, attack=tilt, descent=tilt, spin=2.0 * math.pi * spin, height=0.0
    )


def first(stone: Stone, **options: Any) -> Contact:
    """The first touch of `touch`."""
    return touch(stone, **options).contacts[0]


def leaves(stone: Stone, **options: Any) -> bool:
    """Whether the stone comes out of a touch."""
    return first(stone, **options).exit is not None


def contact_time(contact: Contact) -> float:
    """How long it took [s]; not a number if the stone never left."""
    return math.nan if contact.exit is None else contact.exit.time - contact.entry.time


def threshold(yes: Callable[[float], bool], low: float, high: float, *, steps: int = 11) -> float:
    """Smallest value that is a yes, by bisection from a no and a yes; nan if `high` is a no."""
    if not yes(high):
        return math.nan
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if yes(middle) else (middle, high)
    return high


def in_parallel(function: Callable[..., Any], jobs: Iterable[Any]) -> list[Any]:
    """function(job) for every job, in order, on all workers."""
    jobs = list(jobs)
    with ProcessPoolExecutor(WORKERS) as pool:
        return list(pool.map(function, jobs, chunksize=max(1, len(jobs) // (8 * WORKERS))))


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def picture(name: str, caption: str) -> str:
    """A figure with its caption, in Markdown."""
    return f"![{caption}](validation/{name})\n\n*{caption}*"


def plain(value: Any) -> Any:
    """The same for JSON: no NumPy types, None for what is not a number."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def main(run: Callable[..., dict[str, Any]], page: Callable[[dict[str, Any]], str]) -> None:
    """Run one question by itself: its part of the page to the screen, its figures into a folder."""
    parser = argparse.ArgumentParser(description=run.__doc__)
    parser.add_argument("--quick", action="store_true", help="the short form")
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder for figures")
    parser.add_argument("--json", action="store_true", help="print the numbers instead of the page")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    found = plain(run(quick=arguments.quick, out=arguments.out))
    print(json.dumps(found, indent=1) if arguments.json else page(found))
    print(f"\n({time.perf_counter() - begun:.1f} s)")
