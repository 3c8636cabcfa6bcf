"""What does two-way water cost? Ratios and shares of processor time, one core.

    python scripts/bench_twoway.py

The default throw over waves at its own step, with the share of each part, in an endless lake and inside walls
of 512 x 512 cells; a stone that skips through 100 m of open lake, against a dense field of 16384 x 16384 cells
whose step is taken as 16 times that at 4096; and the default throw over a dense field of 1024 x 1024 cells,
whose skips must be those of the endless lake. About a minute.
"""

from __future__ import annotations

import json
import statistics
import time
from dataclasses import fields, replace
from typing import Any

import mujoco
import numpy as np

from mjskip import HeightField, Limits, Throw, Water, load_scene, simulate
from mjskip.hydro.stone import Stone
from mjskip.throws.engines import MujocoEngine
from mjskip.throws.reference import Integrator
from mjskip.throws.scene import Scene
from mjskip.waves.lake import Lake
from mjskip.waves.twoway import MovingSurface


def budget(scene: Scene) -> dict[str, float]:
    """Processor time of a scene's throw over waves, and of its parts by subtraction.

    The stone's part is that of bare engine steps, the record's what the same throw over still water takes
    besides (forces observed, states kept), the waves' the rest. Runs take turns; medians.
    """
    timestep = float(scene.model.opt.timestep)
    simulate(scene, surface="waves", limits=Limits(duration=0.3))  # compiled
    times: dict[str, list[float]] = {"waves": [], "still": [], "engine": []}
    for _ in range(9):
        for surface in ("waves", "still"):
            begun = time.process_time()
            run = simulate(scene, surface=surface)
            times[surface].append((time.process_time() - begun) / len(run.time))
            if surface == "waves":
                steps = len(run.time)
        with MujocoEngine(scene, None, timestep, frozen_attitude=False) as engine:
            engine.start()
            begun = time.process_time()
            mujoco.mj_step(engine.model, engine.data, steps)
            times["engine"].append((time.process_time() - begun) / steps)
    waves, still, bare = (statistics.median(times[name]) for name in ("waves", "still", "engine"))
    return {
        "real_time_factor": timestep / waves,
        "real_time_factor_best": timestep / min(times["waves"]),
        "us_per_step": 1e6 * waves,
        "steps": steps,
        "share_stone": bare / waves,
        "share_record": (still - bare) / waves,
        "share_waves": (waves - still) / waves,
    }


class Unsleeping(Scene):
    """A scene whose lake is inside walls and never sleeps: a dense field, to the last bit
    (`tests/test_lakes.py`)."""

    def lake(self) -> Lake:
        """Fresh water."""
        names = ("shape", "spacing", "wave_speed", "damping", "centre")
        return Lake(**{name: self.grid[name] for name in names}, sleep_amplitude=0.0)


def hundred_metres(*, sleep_amplitude: float = 1e-5, metres: float = 100.0) -> dict[str, float]:
    """A disc that is thrown anew wherever it gets too slow, until it is 100 m from the first throw."""
    stone = Stone.disc(0.05, 0.01, segments=24, density=2500.0)
    lake = Lake(sleep_amplitude=sleep_amplitude)
    timestep, skips, x, most, tiles = 5e-4, 0, 0.0, 0, 0
    spent, steps = 0.0, 0
    while x < metres:
        throw = Throw.from_degrees(speed=14, spin=30, attack=20, descent=6, height=0.1)
        disc = Integrator(
            stone,
            throw.state(stone, x=x, y=0.0),
            water=Water(),
            timestep=timestep,
            integrator="rk4",
        )
        surface = MovingSurface(lake, {"disc": disc.block})
        state, wet = disc.start(), False
        for _ in range(4000):
            begun = time.process_time()
            seen = surface.look({"disc": state})["disc"][0]
            surface.advance(timestep)
            spent += time.process_time() - begun
            steps += 1
            state = disc.advance(1)
            skips += int(wet and seen[16] >= 0.0)
            wet = bool(seen[16] < 0.0)
            if steps % 50 == 0:
                most, tiles = max(most, lake.memory), max(tiles, lake.awake_tiles)
            if state[0, 2] < -0.1 or state[0, 12] < 3.0:
                break
        surface.settle()
        x = float(state[0, 0])
    return {"skips": skips, "x": x, "step": spent / steps, "bytes": most, "tiles": tiles}


def bench() -> dict[str, Any]:
    """Measure; see the module's docstring."""
    scene = load_scene("lake")
    walled = replace(scene, grid=scene.grid | {"shape": (512, 512), "boundary": "reflect"})
    found: dict[str, Any] = {
        "default_throw": budget(scene),
        "in_walls_of_512_x_512": budget(walled),
    }
    hundred_metres(metres=1.0)
    open_lake = hundred_metres()
    field = HeightField((4096, 4096), threads=1)
    field.displace(0.0, 0.0, height=0.01, radius=5.0)
    times = []
    for _ in range(8):
        begun = time.process_time()
        field.step(5e-4)
        times.append(time.process_time() - begun)
    dense = 16.0 * statistics.median(times[2:])
    found["open_lake_100_m"] = {
        "skips": open_lake["skips"],
        "metres": open_lake["x"],
        "step_us": 1e6 * open_lake["step"],
        "megabytes": 1e-6 * open_lake["bytes"],
        "tiles": open_lake["tiles"],
        "dense_16384_step_ms_extrapolated_from_4096": 1e3 * dense,
        "dense_over_lake_time": dense / open_lake["step"],
        "dense_over_lake_memory": 2.0 * 4.0 * 16384**2 / open_lake["bytes"],
    }
    # half a cell aside, the cells of an even number lie where those of an endless lake do
    grid = scene.grid | {"shape": (1024, 1024), "centre": (0.5 * scene.grid["spacing"],) * 2}
    dense_scene = Unsleeping(
        **{f.name: getattr(scene, f.name) for f in fields(scene)} | {"grid": grid}
    )
    for name, own_dent in (("default", False), ("own_dent", True)):
        everywhere, awake = (
            simulate(each, surface="waves", own_dent=own_dent) for each in (dense_scene, scene)
        )
        n = min(len(everywhere.x), len(awake.x))
        found[f"dense_1024_and_endless_lake_{name}"] = {
            "skips": [everywhere.skips, awake.skips],
            "path_difference_um": 1e6 * float(np.abs(everywhere.x[:n] - awake.x[:n]).max()),
        }
    return found


if __name__ == "__main__":
    print(json.dumps(bench(), indent=2))
