"""What does plugin mjskip.water cost beside `attach` and the bare step? (about a minute)

    python scripts/bench_plugin.py [--json FILE]

Steps of the 44-triangle pebble without gravity, dry and half immersed, all routes in turn in one run.
Ratios hold across machines, times do not.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from contextlib import ExitStack
from typing import Any

import mujoco

from mjskip import attach, load_scene
from mjskip.coupling.plugin import register_plugin

ROUTES = ("bare", "attach", "plugin", "plugin_and_sensor")
REPEATS = 101
STEPS = 300


def bench() -> dict[str, Any]:
    """Microseconds per step by integrator, pose and route, and ratios over the bare step."""
    register_plugin()
    models = {route: _compile(route) for route in ROUTES}
    found: dict[str, Any] = {}
    for integrator in ("Euler", "RK4"):
        for pose, height in (("dry", 1.0), ("wet", 0.0)):
            times = {route: [] for route in ROUTES}
            for repeat in range(REPEATS + 1):
                for route in ROUTES:
                    seconds = _steps(route, models[route], integrator, height)
                    if repeat:  # the first warms up
                        times[route].append(seconds)
            medians = {route: 1e6 * statistics.median(times[route]) for route in ROUTES}
            ratios = {route: _ratio(times[route], times["bare"]) for route in ROUTES[1:]}
            found[f"{integrator}.{pose}"] = {
                **{f"{route}_us": value for route, value in medians.items()},
                **{f"{route}_over_bare": value for route, value in ratios.items()},
            }
    return found


def _ratio(times: list[float], bare: list[float]) -> float:
    """Median over repeats, each beside the bare steps of the same moment."""
    return statistics.median(a / b for a, b in zip(times, bare, strict=True))


def _compile(route: str) -> Any:
    spec = mujoco.MjSpec.from_file(str(load_scene("lake").path))
    if route.startswith("plugin"):
        spec.activate_plugin("mjskip.water")
        spec.add_plugin(name="lake", plugin_name="mjskip.water", active=True)
        stone = spec.body("stone")
        stone.plugin.name = "lake"
        stone.plugin.plugin_name = "mjskip.water"
        stone.plugin.active = True
    if route == "plugin_and_sensor":
        sensor = spec.add_sensor(type=mujoco.mjtSensor.mjSENS_PLUGIN)
        sensor.plugin.name = "lake"
        sensor.plugin.plugin_name = "mjskip.water"
        sensor.plugin.active = True
    model = spec.compile()
    model.opt.gravity[:] = 0.0
    return model


def _steps(route: str, model: Any, integrator: str, height: float) -> float:
    """Seconds for one step."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data = mujoco.MjData(model)
    data.qpos[2] = height
    data.qvel[:3] = 1e-3, 0.0, -2e-4
    with ExitStack() as stack:
        if route == "attach":
            stack.enter_context(attach(model, data))
        begun = time.thread_time()  # other processes do not count
        mujoco.mj_step(model, data, nstep=STEPS)
        return (time.thread_time() - begun) / STEPS


def main() -> None:
    """Print the table; write it as JSON too if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", metavar="FILE")
    path = parser.parse_args().json
    found = bench()
    for case, row in found.items():
        print(case, "  ".join(f"{name} {value:.3g}" for name, value in row.items()))
    if path:
        with open(path, "w") as file:
            json.dump(found, file, indent=2)


if __name__ == "__main__":
    main()
