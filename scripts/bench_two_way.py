"""What moving water costs inside MuJoCo's step: a pebble with RK4, in bare steps.

    python scripts/bench_two_way.py [--json out.json]

Medians of interleaved runs of one process, over a whole throw (some 0.25 s with its touches) and of a step with all
of the stone's bottom in the water. Half a minute.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import mujoco
import numpy as np

import mjskip
from mjskip import Stone, Throw

STEP = 2e-4
THROW = Throw(speed=12.0, spin=94.2, attack=0.349, descent=0.349, height=0.05)


def model(surface: str | None, *, cells: int = 64, bodies: int = 1) -> mujoco.MjModel:
    """A pebble over a kind of water, or over none."""
    stone = Stone.pebble()
    vertices = " ".join(f"{x:.17g}" for x in stone.vertices.ravel())
    faces = " ".join(map(str, stone.faces.ravel()))
    keys = f'<config key="surface" value="{surface}"/>'
    if surface in ("waves", "deep"):
        keys += f'<config key="size" value="{0.01 * cells}"/>'
    plugin = f"""<extension><plugin plugin="mjskip.water"><instance name="w">{keys}</instance></plugin></extension>"""
    wet = '<plugin instance="w"/>' if surface else ""
    body = f'<body name="stone"><freejoint/><geom type="mesh" mesh="s" mass="{stone.mass}"/>{wet}</body>'
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{STEP}" integrator="RK4"/>{plugin if surface else ""}
        <asset><mesh name="s" vertex="{vertices}" face="{faces}" inertia="exact"/></asset>
        <worldbody>{body * bodies}</worldbody></mujoco>"""
    )


def thrown(model: mujoco.MjModel) -> mujoco.MjData:
    """The stone as it leaves the hand."""
    data, state = mujoco.MjData(model), THROW.state(Stone.pebble())
    data.qpos[:3], data.qpos[3:7], data.qvel[:3] = state.position, state.q, state.velocity
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, state.q)
    data.qvel[3:] = turn.reshape(3, 3).T @ state.omega
    return data


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    mjskip.register_plugin()
    kinds = {
        "bare": model(None),
        "still": model("still"),
        "waves 64": model("waves"),
        "deep 64": model("deep"),
        "deep 128": model("deep", cells=128),
    }
    flight = {kind: [] for kind in kinds}
    touch = {kind: [] for kind in kinds}
    air = {kind: [] for kind in kinds}
    wet = {}
    for kind, m in kinds.items():  # the middle of the first touch
        d = thrown(m)
        while d.time < 0.022:
            mujoco.mj_step(m, d)
        wet[kind] = d
    count = mujoco.mj_stateSize(kinds["deep 64"], mujoco.mjtState.mjSTATE_INTEGRATION)
    assert count > 0
    for _ in range(9):
        for kind, m in kinds.items():
            d = thrown(m)
            start = time.process_time()
            mujoco.mj_step(m, d, 1000)
            flight[kind].append((time.process_time() - start) / 1000)
            start, steps = time.process_time(), 0
            for _ in range(40):
                mujoco.mj_copyData(d, m, wet[kind])
                begin = time.process_time()
                mujoco.mj_step(m, d, 20)
                steps += 20
                touch[kind].append((time.process_time() - begin) / 20)
            mujoco.mj_resetData(m, d)
            d.qpos[2] = 5.0
            start = time.process_time()
            mujoco.mj_step(m, d, 500)
            air[kind].append((time.process_time() - start) / 500)
    found = {}
    print("| | whole throw | in the water | in the air |")
    print("|---|---|---|---|")
    for kind in kinds:
        times = [statistics.median(each[kind]) for each in (flight, touch, air)]
        bare = [statistics.median(each["bare"]) for each in (flight, touch, air)]
        found[kind] = [1e6 * t for t in times]
        shown = " | ".join(
            f"{1e6 * t:.1f} us ({t / b:.1f})" for t, b in zip(times, bare, strict=True)
        )
        print(f"| {kind} | {shown} |")
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
