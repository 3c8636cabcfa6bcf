"""How fast are many throws? Per second and core, against a Python loop around `mj_step` (about two minutes).

    python scripts/bench_sweep.py [--json FILE] [--map FILE.png]

- pebble, disc: throws per second of one core by the compiled batch, over the same throws at the same time step by
  a Python loop around `mj_step` with the callback in plain Python (RK4 both). Goal: at least 30, for the paper's
  pebble. Clanet's disc has six times the triangles, and those cost both the same.
- air: the same batch with long steps in the air over one without, for throws that mostly fly and for throws
  that mostly plough.
- threads: two over one.
- map: 4096 throws, attack x descent x an ensemble of 4, at 3.5 m/s. Goal: under a minute on two cores.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mjskip import Limits, Stone, Throw, Water, attach
from mjskip.sweeps.batch import processors, throw_all
from mjskip.sweeps.design import normal, span
from mjskip.sweeps.job import scene_of
from mjskip.sweeps.plot import plot_sweep
from mjskip.sweeps.sweep import sweep

DISC = Stone.disc(0.025, 0.00275, density=2700.0)
PEBBLE = Stone.pebble()
TIMESTEP = (
    3.5e-4  # advised for this disc at 3.5 m/s: at most half the thickness over the speed, 3.9e-4
)
LIMITS = Limits(duration=0.5)


def throws(count: int, **means: float) -> list[Throw]:
    """Throws scattered by a tenth around their means."""
    rng = np.random.default_rng(0)
    return [
        Throw.from_degrees(**{k: v * rng.uniform(0.9, 1.1) for k, v in means.items()})
        for _ in range(count)
    ]


def seconds(run: Callable[[], Any], *, repeats: int = 3) -> float:
    """Median processor time of this process, after a warm-up: what others do here does not count."""
    run()
    times = []
    for _ in range(repeats):
        begun = time.process_time()
        run()
        times.append(time.process_time() - begun)
    return statistics.median(times)


def python_loop(stone: Stone, these: list[Throw], water: Water, timestep: float) -> float:
    """Seconds per step of throws stepped from Python with the plain Python callback, RK4."""
    scene = scene_of(stone)
    scene.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    scene.model.opt.timestep = timestep
    data = mujoco.MjData(scene.model)
    axes = np.empty(9)
    steps = round(LIMITS.duration / timestep)
    begun = time.process_time()
    with attach(scene.model, data, water=water, native=False):
        for throw in these:
            mujoco.mj_resetData(scene.model, data)
            start = throw.state(stone)
            mujoco.mju_quat2Mat(axes, start.q)
            data.qpos[:] = [*start.position, *start.q]
            data.qvel[:] = [*start.velocity, *(axes.reshape(3, 3).T @ start.omega)]
            for _ in range(steps):
                mujoco.mj_step(scene.model, data)
    return (time.process_time() - begun) / (len(these) * steps)


def bench(picture: str | None = None) -> dict[str, Any]:
    """All figures; ratios hold across machines, times do not."""
    found: dict[str, Any] = {}
    few = throws(64, speed=3.5, spin=100, attack=20, descent=20, height=0.02)
    options: dict[str, Any] = {
        "water": Water(air_density=0.0), "timestep": TIMESTEP, "limits": LIMITS, "threads": 1,
    }  # fmt: skip
    pebbles = throws(64, speed=12, spin=15, attack=20, descent=6, height=0.3)
    for name, stone, these, how in (
        ("pebble_44_triangles", PEBBLE, pebbles, options | {"timestep": 5e-4, "water": Water()}),
        ("disc_256_triangles", DISC, few, options),
    ):
        cost, steps = {}, {}
        for air in ("fixed", "adaptive"):

            def go(air: Any = air, stone: Any = stone, these: Any = these, how: Any = how) -> Any:
                return throw_all(stone, these, air=air, **how)

            cost[air], steps[air] = seconds(go), float(go().steps.sum())
        loop = python_loop(stone, these[:3], how["water"], how["timestep"])
        found[name] = {
            "throws_per_second_and_core": len(these) / cost["fixed"],
            "python_loop_throws_per_second": len(these) / (loop * steps["fixed"]),
            "batch_over_python_loop": loop * steps["fixed"] / cost["fixed"],
            "batch_with_adaptive_air_over_python_loop": loop * steps["fixed"] / cost["adaptive"],
            "step_us": 1e6 * cost["fixed"] / steps["fixed"],
            "python_loop_step_us": 1e6 * loop,
        }
    cases = {
        "disc_that_ploughs": (DISC, few, options),
        "pebble_that_skips": (
            PEBBLE,
            pebbles,
            {"timestep": 5e-4, "limits": Limits(duration=1.0), "threads": 1},
        ),
        "pebble_from_a_bridge": (
            PEBBLE,
            throws(64, speed=12, spin=15, attack=20, descent=6, height=10.0),
            {"timestep": 5e-4, "limits": Limits(duration=1.6), "threads": 1},
        ),
    }
    for name, (stone, these, chosen) in cases.items():
        cost: dict[str, float] = {}
        steps: dict[str, float] = {}
        for air in ("fixed", "adaptive"):

            def run(
                air: Any = air, stone: Any = stone, these: Any = these, how: Any = chosen
            ) -> Any:
                return throw_all(stone, these, air=air, **how)

            steps[air] = float(run().steps.mean())
            cost[air] = seconds(run)
        found[f"air_{name}"] = {
            "steps_fixed": steps["fixed"],
            "steps_adaptive": steps["adaptive"],
            "throws_per_second_and_core": len(these) / cost["adaptive"],
            "faster": cost["fixed"] / cost["adaptive"],
        }
    wall: dict[int, list[float]] = {1: [], 2: []}
    many = throws(256, speed=3.5, spin=100, attack=20, descent=20, height=0.02)
    for _ in range(3):
        for threads, times in wall.items():
            begun = time.perf_counter()
            throw_all(DISC, many, **options | {"threads": threads})
            times.append(time.perf_counter() - begun)
    found["threads"] = {"two_over_one": min(wall[1]) / min(wall[2]), "processors": processors()}
    begun, spent = time.perf_counter(), time.process_time()
    data = sweep(
        DISC,
        {"attack": span(*np.radians([2, 60]), 32), "descent": span(*np.radians([2, 60]), 32)},
        scatter=normal({n: (0.0, np.radians(0.5)) for n in ("attack", "descent")}, count=4, seed=2),
        throw=Throw.from_degrees(speed=3.5, spin=100, height=0.0),
        water=Water(air_density=0.0),
        timestep=TIMESTEP,
    )
    found["map"] = {
        "throws": data.skips.size,
        "ok": int((data.status == "ok").sum()),
        "wall_s": time.perf_counter() - begun,
        "processor_s": time.process_time() - spent,
        "share_that_skips": float((data.skips >= 1).mean()),
    }
    if picture:
        plot_sweep(data, picture)
    return found


def main() -> None:
    """Measure, print, and write JSON and the map if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--map", metavar="FILE.png", help="draw the map there")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # a tenth faster than the advised step is for
    found = bench(arguments.map)
    for part, figures in found.items():
        for name, value in figures.items():
            print(f"{part + '.' + name:<52}{value:12.4g}")
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(found, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
