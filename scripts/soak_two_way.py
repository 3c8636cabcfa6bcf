"""Does water that moves ever blow up inside MuJoCo? Random throws with every law, and minutes of stones in one water.

    python scripts/soak_two_way.py [--throws 200] [--minutes 10]

First `--throws` random throws with each law that can be coupled, over `waves` and `deep`, with steps of 1, 0.5 and 0.2
ms and RK4, a tenth of a second each: how many diverged, and the greatest energy over that of the start. Then three
stones thrown again and again into one `deep` water for `--minutes` of wall time: finite, its volume, and memory.
Some ten minutes, then what is asked for.
"""

from __future__ import annotations

import argparse
import resource
import time
import warnings

import mujoco
import numpy as np

import mjskip
from mjskip import LAWS, Stone, Throw, Water, WaterSurface
from mjskip.errors import MjskipWarning

MONOTONE = [name for name, law in LAWS.items() if not (law.friction or law.speed_squared)]
STEPS = (1e-3, 5e-4, 2e-4)
DURATION = 0.1


def model_of(surface: str, law: str, timestep: float, *, stones: int = 1) -> mujoco.MjModel:
    """Pebbles over moving water."""
    spec, stone = mujoco.MjSpec(), Stone.pebble()
    spec.option.timestep, spec.option.integrator = timestep, mujoco.mjtIntegrator.mjINT_RK4
    mesh = spec.add_mesh(name="stone")
    mesh.uservert, mesh.userface = stone.vertices.ravel(), stone.faces.ravel()
    for n in range(stones):
        body = spec.worldbody.add_body(name=f"stone{n}")
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="stone", mass=stone.mass, contype=0)
    mjskip.add_water(spec, Water(law=law, air_density=0.0), surface=surface, sensor=False)
    return spec.compile()


def throw(data: mujoco.MjData, rng: np.random.Generator, n: int = 0) -> None:
    """Throw stone n anew from a random place at a random tilt."""
    thrown = Throw(
        speed=rng.uniform(1, 15), spin=rng.uniform(-500, 500), attack=rng.uniform(-0.2, 1.1),
        descent=rng.uniform(0.05, 1.4), height=rng.uniform(0.0, 0.02), bank=rng.uniform(-0.3, 0.3),
    )  # fmt: skip
    state = thrown.state(Stone.pebble(), x=data.qpos[0] if n else 0.0, y=0.05 * n)
    data.qpos[7 * n : 7 * n + 3], data.qpos[7 * n + 3 : 7 * n + 7] = state.position, state.q
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, state.q)
    data.qvel[6 * n : 6 * n + 3] = state.velocity
    data.qvel[6 * n + 3 : 6 * n + 6] = turn.reshape(3, 3).T @ state.omega


def energy(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Of the one stone."""
    motion = np.empty(6)
    mujoco.mj_forward(model, data)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, 1, motion, 0)
    spin = data.ximat[1].reshape(3, 3).T @ motion[:3]
    kinetic = 0.5 * model.body_mass[1] * motion[3:] @ motion[3:]
    kinetic += 0.5 * np.sum(model.body_inertia[1] * spin**2)
    return float(kinetic + 9.81 * model.body_mass[1] * data.xipos[1, 2])


def random_throws(count: int) -> None:
    """The first part."""
    print("| water | law | step [ms] | diverged | greatest energy / first |")
    print("|---|---|---|---|---|")
    for surface in ("waves", "deep"):
        for law in MONOTONE:
            for timestep in STEPS:
                rng = np.random.default_rng(1)
                model = model_of(surface, law, timestep)
                data, lost, greatest = mujoco.MjData(model), 0, 0.0
                for _ in range(count):
                    mujoco.mj_resetData(model, data)
                    throw(data, rng)
                    # potential energy below the water must not hide a gain
                    first, floor = energy(model, data), 9.81 * model.body_mass[1]
                    for _ in range(10):
                        mujoco.mj_step(model, data, round(DURATION / timestep / 10))
                        greatest = max(greatest, (energy(model, data) + floor) / (first + floor))
                    lost += bool(data.warning.number.sum() or not np.isfinite(data.qpos).all())
                print(f"| {surface} | {law} | {1e3 * timestep:g} | {lost} of {count} | {greatest:.6f} |", flush=True)  # fmt: skip


def soak(minutes: float) -> None:
    """The second part."""
    rng = np.random.default_rng(2)
    model = model_of("deep", "lee2010", 2e-4, stones=3)
    data = mujoco.MjData(model)
    water, thrown, steps, highest = WaterSurface(model, data), 0, 0, 0.0
    end = time.monotonic() + 60.0 * minutes
    volume = 0.0
    while time.monotonic() < end:
        for n in range(3):
            if thrown < 3 or data.qpos[7 * n + 2] < -0.5 or abs(data.qpos[7 * n] - data.qpos[0]) > 1.0:  # fmt: skip
                throw(data, rng, n)
                thrown += 1
        mujoco.mj_step(model, data, 100)
        steps += 100
        highest = max(highest, float(np.abs(water.level).max()))
        if not np.isfinite(data.qpos).all() or data.warning.number.sum():
            raise SystemExit(f"diverged after {steps} steps, {thrown} throws")
        total = float(water.level.sum()) * water.spacing**2 + water.left_behind[0]
        volume = max(volume, abs(total))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{thrown} throws, {steps} steps, all finite; waves up to {highest:.3f} m, volume made {volume:.1e} m^3 at "
        f"most, process {memory:.0f} MB"
    )


def main() -> None:
    """Both parts."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=10.0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore", MjskipWarning)
    random_throws(asked.throws)
    soak(asked.minutes)


if __name__ == "__main__":
    main()
