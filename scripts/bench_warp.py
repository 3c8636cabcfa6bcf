"""How many worlds does MuJoCo Warp step a second, with water and without, beside C on all cores?

    python scripts/bench_warp.py [--device cuda:0] [--worlds 64 1024] [--integrator Euler] [--law NAME] [--json FILE]

The 44-triangle pebble half immersed, without gravity. C is `mujoco.batch.Batch` with the engine plugin, one thread a
core. Without `--device` Warp takes a graphics card if there is one. On a processor, where Warp serves tests, its rate is in
time of the one thread it uses, C's by the clock. Some three minutes, most of them Warp compiling for the first time.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from pathlib import Path

import mujoco
import mujoco_warp
import numpy as np
import warp as wp
from mujoco.batch import Batch

import mjskip.warp
from mjskip import LAWS, Stone, register_plugin

MODEL = """
<mujoco>
  <option timestep="0.0005" integrator="{integrator}" gravity="0 0 0"/>
  <extension><plugin plugin="mjskip.water"><instance name="w">
    <config key="law" value="{law}"/></instance></plugin></extension>
  <asset><mesh name="stone" inertia="exact" vertex="{vertex}" face="{face}"/></asset>
  <worldbody><body><freejoint/><plugin instance="w"/>
    <geom type="mesh" mesh="stone" density="2600" contype="0" conaffinity="0"/></body></worldbody>
</mujoco>"""

REPEATS, STEPS = 7, 10


def pebble(integrator: str, law: str) -> mujoco.MjModel:
    """The pebble with plugin mjskip.water."""
    register_plugin()
    stone = Stone.pebble()
    texts = (" ".join(f"{v:.9g}" for v in a.ravel()) for a in (stone.vertices, stone.faces))
    vertex, face = texts
    return mujoco.MjModel.from_xml_string(
        MODEL.format(integrator=integrator, law=law, vertex=vertex, face=face)
    )


def warp_seconds(model: mujoco.MjModel, worlds: int, device: str | None) -> dict[str, float]:
    """Median time of a step of all worlds, bare and with water, taken in turn."""
    bare = mjskip.warp.strip_plugin(model)
    with wp.ScopedDevice(device):
        made = {}
        for kind in ("bare", "water"):
            m, d = mujoco_warp.put_model(bare), mujoco_warp.make_data(bare, nworld=worlds)
            if kind == "water":
                mjskip.warp.attach(m, model)
            mujoco_warp.step(m, d)  # compiles
            made[kind] = (m, d)
        # on the processor Warp works in this thread: its own time, which others hardly disturb
        clock = time.thread_time if wp.get_device().is_cpu else time.perf_counter
        taken: dict[str, list[float]] = {kind: [] for kind in made}
        for _ in range(REPEATS):
            for kind, (m, d) in made.items():
                mujoco_warp.reset_data(m, d)
                wp.synchronize()
                begun = clock()
                for _ in range(STEPS):
                    mujoco_warp.step(m, d)
                wp.synchronize()
                taken[kind].append((clock() - begun) / STEPS)
    return {kind: statistics.median(values) for kind, values in taken.items()}


def c_seconds(model: mujoco.MjModel, worlds: int) -> float:
    """The same of C with the plugin, on all cores."""
    batch = Batch(model, nsim=worlds, nthread=os.cpu_count() or 1)
    taken = []
    for _ in range(REPEATS):
        batch.reset()
        begun = time.perf_counter()
        batch.step(nstep=STEPS)
        taken.append((time.perf_counter() - begun) / STEPS)
    return statistics.median(taken)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="of Warp, such as cpu or cuda:0")
    parser.add_argument("--worlds", type=int, nargs="+", default=[64, 1024])
    parser.add_argument("--integrator", default="Euler", choices=["Euler", "RK4", "implicitfast"])
    parser.add_argument("--law", default="lee2010", choices=list(LAWS))
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    wp.config.quiet = True
    device = wp.get_device(arguments.device)
    model = pebble(arguments.integrator, arguments.law)
    print(
        f"{device.name} ({device.alias}), {arguments.integrator}, {arguments.law}; C on {os.cpu_count()} cores"
    )
    print(f"{'worlds':>7} {'water / bare':>13} {'Warp, worlds x steps/s':>23} {'C':>12}")
    figures = []
    for worlds in arguments.worlds:
        seconds = warp_seconds(model, worlds, arguments.device)
        c = c_seconds(model, worlds)
        ratio = seconds["water"] / seconds["bare"]
        rates = worlds / np.array([seconds["water"], c])
        print(f"{worlds:7d} {ratio:13.3f} {rates[0]:23.3g} {rates[1]:12.3g}", flush=True)
        figures.append(
            {"worlds": worlds, "water_over_bare": ratio, "warp": rates[0], "c": rates[1]}
        )
    if arguments.json:
        text = {
            "device": device.name,
            "integrator": arguments.integrator,
            "law": arguments.law,
            "figures": figures,
        }
        arguments.json.write_text(json.dumps(text, indent=1))


if __name__ == "__main__":
    main()
