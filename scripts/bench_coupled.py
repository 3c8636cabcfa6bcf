"""What does two-way water cost? Ratios and shares of processor time, one core.

    python scripts/bench_coupled.py

The default throw and `duel` over waves at their own step, against the same throw over still water and against bare
engine steps made in turns; and how many calls of Python functions a throw makes. A minute.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from dataclasses import replace
from typing import Any

import mujoco

from mjskip import Limits, Scene, load_scene, simulate_all
from mjskip.throws.engines import MujocoEngine


def budget(scene: Scene, *, runs: int = 7) -> dict[str, float]:
    """Processor time a step of a scene's throws over waves, and of its parts by subtraction.

    The engine's part is that of bare engine steps, the record's what the same throw over still water takes
    besides (forces, states kept), the waves' the rest. Runs take turns; medians.
    """
    timestep = float(scene.model.opt.timestep)
    for surface in ("waves", "still"):
        simulate_all(scene, surface=surface, limits=Limits(duration=0.3))  # compiled
    times: dict[str, list[float]] = {"waves": [], "still": [], "engine": []}
    steps = 0
    for _ in range(runs):
        for surface in ("waves", "still"):
            begun = time.process_time()
            flights = simulate_all(scene, surface=surface)
            count = max(len(flight.time) for flight in flights.values())
            times[surface].append((time.process_time() - begun) / count)
            steps = count if surface == "waves" else steps
        with MujocoEngine(scene, None, timestep, frozen_attitude=False) as engine:
            begun = time.process_time()
            mujoco.mj_step(engine.model, engine.data, 2000)
            times["engine"].append((time.process_time() - begun) / 2000)
    waves, still, bare = (statistics.median(times[name]) for name in ("waves", "still", "engine"))
    return {
        "real_time_factor": timestep / waves,
        "real_time_factor_best": timestep / min(times["waves"]),
        "us_per_step": 1e6 * waves,
        "us_per_step_best": 1e6 * min(times["waves"]),
        "us_per_step_still": 1e6 * still,
        "us_per_step_engine": 1e6 * bare,
        "steps": steps,
        "share_stone": bare / waves,
        "share_record": (still - bare) / waves,
        "share_waves": (waves - still) / waves,
    }


def calls(scene: Scene, *, surface: str) -> int:
    """Calls of Python functions, C functions included, that one run makes."""
    counted = 0

    def count(_frame: Any, event: str, _argument: Any) -> None:
        nonlocal counted
        counted += event in ("call", "c_call")

    simulate_all(scene, surface=surface)  # type: ignore[arg-type]
    sys.setprofile(count)
    try:
        simulate_all(scene, surface=surface)  # type: ignore[arg-type]
    finally:
        sys.setprofile(None)
    return counted


def bench() -> dict[str, Any]:
    """Measure; see the module's docstring."""
    lake, duel = load_scene("lake"), load_scene("duel")
    walled = replace(lake, grid=lake.grid | {"shape": (512, 512), "boundary": "reflect"})
    return {
        "default_throw": budget(lake),
        "in_walls_of_512_x_512": budget(walled),
        "duel": budget(duel),
        "python_calls": {
            f"{scene.path.stem}_{surface}": calls(scene, surface=surface)
            for scene in (lake, duel)
            for surface in ("still", "waves")
        },
    }


if __name__ == "__main__":
    print(json.dumps(bench(), indent=2))
