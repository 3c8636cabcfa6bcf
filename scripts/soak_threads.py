"""Do threads mix up anything? Four of them with still and moving water, the plugin, `attach` and `mujoco.batch`.

    python scripts/soak_threads.py [--seconds 60] [--threads 4]

Every thread runs kinds of work in a random order, makes its models anew each time, and compares what it finds with what
one thread alone found, to the last bit. Prints JSON: rounds by kind, differences, memory. Takes what is asked for, and
some seconds to compile.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import threading
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mujoco import batch

import mjskip
from mjskip.errors import MjskipWarning

STEPS = 40


def model_of(surface: str | None) -> mujoco.MjModel:
    """A pebble that is thrown at a shallow angle; in the plugin's water, or in none."""
    spec, stone = mujoco.MjSpec(), mjskip.Stone.pebble()
    spec.option.timestep = 5e-4
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    mesh = spec.add_mesh(name="stone")
    mesh.uservert, mesh.userface = stone.vertices.ravel(), stone.faces.ravel()
    body = spec.worldbody.add_body(name="stone", pos=[0.0, 0.0, 0.002])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="stone", density=2600.0, contype=0)
    if surface is not None:
        mjskip.add_water(spec, mjskip.Water(air_density=0.0), surface=surface, sensor=False)
    return spec.compile()


def stepped(surface: str | None, *, attached: bool = False) -> np.ndarray:
    """Where the stone of a model is after some steps."""
    model = model_of(surface)
    data = mujoco.MjData(model)
    data.qvel[:] = (8.0, 0.0, -1.0, 0.0, 0.0, 60.0)
    if attached:
        with mjskip.attach(model, data, water=mjskip.Water(air_density=0.0)):
            mujoco.mj_step(model, data, STEPS)
    else:
        mujoco.mj_step(model, data, STEPS)
    return np.concatenate([data.qpos, data.qvel])


def batched() -> np.ndarray:
    """The same of sixteen worlds, on two threads of their own."""
    many = batch.Batch(model_of("still"), 16, 2)
    speeds, places = many.bind("qvel"), many.bind("qpos")
    speeds[:] = (8.0, 0.0, -1.0, 0.0, 0.0, 60.0)
    speeds[:, 0] += 0.1 * np.arange(16)
    many.step(nstep=STEPS)
    return np.concatenate([places.ravel(), speeds.ravel()])


def thrown() -> np.ndarray:
    """A throw over waves by the run's own coupled step."""
    limits = mjskip.Limits(duration=0.05)
    run = mjskip.simulate("lake", engine="reference", surface="waves", limits=limits)
    return run.position.ravel()


def rings() -> np.ndarray:
    """A field of its own that is pushed."""
    water = mjskip.HeightField((128, 96))
    water.press(0.0, 0.0, force=20.0, radius=0.05)
    water.advance(0.1)
    return water.elevation.ravel()


KINDS: dict[str, Callable[[], np.ndarray]] = {
    "attach": lambda: stepped(None, attached=True),
    "plugin, still": lambda: stepped("still"),
    "plugin, waves": lambda: stepped("waves"),
    "plugin, deep": lambda: stepped("deep"),
    "mujoco.batch": batched,
    "throw over waves": thrown,
    "rings": rings,
}


def memory() -> float:
    """Of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def soak(seconds: float, *, count: int = 4, seed: int = 0) -> dict[str, object]:
    """Rounds by kind, and what was wrong."""
    warnings.simplefilter("ignore", MjskipWarning)
    expected = {kind: work() for kind, work in KINDS.items()}
    rounds: Counter[str] = Counter()
    wrong: list[str] = []
    sizes: list[float] = []
    end = time.monotonic() + seconds

    def run(number: int) -> None:
        generator = random.Random(f"{seed} {number}")
        while time.monotonic() < end and not wrong:
            kind = generator.choice(sorted(KINDS))
            try:
                if not np.array_equal(KINDS[kind](), expected[kind]):
                    wrong.append(f"{kind} is another")
            except Exception as error:  # whatever it is, it is told
                wrong.append(f"{kind}: {error!r}")
            rounds[kind] += 1
            if number == 0:
                sizes.append(memory())

    threads = [threading.Thread(target=run, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    settled = sizes[len(sizes) // 6] if sizes else 0.0
    return {
        "seconds": seconds,
        "threads": count,
        "rounds": dict(sorted(rounds.items())),
        "wrong": wrong,
        "memory_mb_after_a_sixth": round(settled, 1),
        "memory_mb_at_the_end": round(sizes[-1], 1) if sizes else 0.0,
    }


def main() -> int:
    """Print what happened."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--threads", type=int, default=4)
    options = parser.parse_args()
    found = soak(options.seconds, count=options.threads)
    print(json.dumps(found, indent=1))
    return int(bool(found["wrong"]))


if __name__ == "__main__":
    sys.exit(main())
