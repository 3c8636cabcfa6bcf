"""What does the water cost? Ratios against a baseline measured in the same run (some minutes).

    python scripts/bench.py [--json FILE] [--only coupling,waves,drawing,plugin,sweep,twoway]

Every figure is a median of alternating repeats after a warm-up. Ratios hold across machines, times do not.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from importlib.metadata import version
from typing import Any

import mujoco

from mjskip import attach, load_scene

GOALS = {  # name of a ratio: (goal, whether the ratio should be below it)
    "coupling.Euler.dry.native_over_bare": (1.15, True),
    "coupling.RK4.dry.native_over_bare": (1.15, True),
    "coupling.Euler.wet.native_over_bare": (2.0, True),
    "coupling.RK4.wet.native_over_bare": (2.0, True),
    "waves.step_over_memcpy_500": (1.6, True),
    "waves.numpy_over_step_500": (15.0, False),
    "waves.two_threads_speedup_4096": (1.5, False),
    "waves.whole_over_endless_time": (50.0, False),
    "waves.whole_over_endless_memory": (50.0, False),
    "drawing.ratio": (10.0, False),
    "plugin.Euler.dry.plugin_over_bare": (1.15, True),
    "plugin.RK4.dry.plugin_over_bare": (1.15, True),
    "plugin.RK4.wet.plugin_over_bare": (1.7, True),
    "sweep.pebble_44_triangles.batch_over_python_loop": (30.0, False),
    "sweep.map.wall_s": (60.0, True),
}


def coupling() -> dict[str, Any]:
    """A step of the 44-triangle pebble with water over a bare `mj_step`.

    Without gravity and at a millimetre per second the stone stays where it is, dry or half immersed, for
    as many steps as are timed.
    """
    scene = load_scene("lake")
    found: dict[str, Any] = {}
    for integrator in ("Euler", "RK4"):
        for pose, height in (("dry", 1.0), ("wet", 0.0)):
            model = mujoco.MjModel.from_xml_path(str(scene.path))
            model.opt.gravity[:] = 0.0
            model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
            data = mujoco.MjData(model)

            def start(data: Any = data, model: Any = model, height: float = height) -> None:
                mujoco.mj_resetData(model, data)
                data.qpos[2] = height
                data.qvel[:3] = 1e-3, 0.0, -2e-4

            def steps(count: int, data: Any = data, model: Any = model) -> float:
                begun = time.perf_counter()
                mujoco.mj_step(model, data, nstep=count)
                return (time.perf_counter() - begun) / count

            times: dict[str, list[float]] = {"bare": [], "native": [], "python": []}
            for repeat in range(16):
                for route, count in (("bare", 2000), ("native", 2000), ("python", 100)):
                    with ExitStack() as stack:
                        if route != "bare":
                            stack.enter_context(attach(model, data, native=route == "native"))
                        start()
                        seconds = steps(count)
                        if repeat:  # the first warms up
                            times[route].append(seconds)
            median = {route: statistics.median(values) for route, values in times.items()}
            found[f"{integrator}.{pose}"] = {
                "bare_ns": 1e9 * median["bare"],
                "native_over_bare": median["native"] / median["bare"],
                "python_over_bare": median["python"] / median["bare"],
            }
    return found


PARTS: dict[str, Callable[[], dict[str, Any]] | str] = {
    "coupling": coupling,
    "waves": "bench_waves",
    "drawing": "bench_draw",
    "plugin": "bench_plugin",
    "sweep": "bench_sweep",
    "twoway": "bench_coupled",
}
"""Parts with a file of their own have a function `bench()` there."""


def flatten(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Leaves by dotted names."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def main() -> None:
    """Measure, print, and write JSON if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas between")
    arguments = parser.parse_args()
    results: dict[str, Any] = {}
    for part in arguments.only.split(","):
        if part not in PARTS:
            parser.error(f"no part {part!r}: choose from {', '.join(PARTS)}")
        measure = PARTS[part]
        results[part] = import_module(measure).bench() if isinstance(measure, str) else measure()
        for name, value in flatten(results[part], f"{part}.").items():
            goal = GOALS.get(name)
            met = ""
            if goal is not None:
                good = value <= goal[0] if goal[1] else value >= goal[0]
                met = (
                    f"  goal {'<=' if goal[1] else '>='} {goal[0]:g}: {'met' if good else 'MISSED'}"
                )
            shown = f"{value:12.4g}" if isinstance(value, float | int) else f"{value!s:>12}"
            print(f"{name:<44}{shown}{met}", flush=True)
    results["machine"] = {
        "processor": platform.processor() or platform.machine(),
        "python": platform.python_version(),
        "mjskip": version("mjskip"),
        "mujoco": version("mujoco"),
    }
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=2)


if __name__ == "__main__":
    main()
