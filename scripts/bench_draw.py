"""What does a frame with water cost, beside MuJoCo's own picture of the same scene?

Frames of the default scene at 640 x 480 over 500 x 500 cells with rings on them. In one run, interleaved:
MuJoCo's bare pass (the baseline), the shaded picture, the shaded picture with one step of the water and 16
steps of the body in it, the plain look; then the share of each pass. Medians and least of wall and of
processor time (all threads), in milliseconds. Works on a machine with a graphics card unchanged, and says
what drew. Half a minute on two cores.

    python scripts/bench_draw.py [RESULT.json]
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import mujoco

import mjskip
from mjskip.draw.gl import gl_renderer, is_software, offscreen
from mjskip.draw.passes import WaterPasses, gl
from mjskip.draw.skin import Grid, WaterSkin, add_water

SIZE = (640, 480)
CELLS = (500, 500)
STEPS = 16  # of the body, a frame
FRAME = STEPS * 5e-4  # [s]
STEP = 0.02  # [m] between drawn vertices near the stone of the plain look
GOAL = 16.0  # [ms] of wall time for the whole frame on two cores that do nothing else


def bench(*, rounds: int = 40, warm_up: int = 4) -> dict[str, Any]:
    """Measure.

    Args:
        rounds: frames of each kind, after `warm_up` more.
    """
    scene = mjskip.load_scene("lake")
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_forward(model, data)
    water = mjskip.HeightField(CELLS, 0.02)
    for x in (-3.5, -2.9):
        water.displace(x, 0.0, height=0.01, radius=0.06)
    water.advance(0.2)
    spec = mujoco.MjSpec.from_file(str(scene.path))
    grid = Grid.around(step=STEP)
    add_water(spec, grid)
    skinned = spec.compile()
    with offscreen():
        bare, plain = (mujoco.Renderer(one, SIZE[1], SIZE[0]) for one in (model, skinned))
    skin, posed = WaterSkin(skinned, grid), mujoco.MjData(skinned)
    mujoco.mj_forward(skinned, posed)
    with bare, plain, mjskip.Renderer(model, SIZE[1], SIZE[0], water=water) as shaded:
        for renderer in (bare, plain, shaded):
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                renderer.scene.flags[flag] = 0

        def picture(renderer: mujoco.Renderer) -> None:
            renderer.update_scene(data, "side")
            renderer.render()

        def frame() -> None:
            water.advance(FRAME)
            mujoco.mj_step(model, data, STEPS)
            if data.time > 0.2:
                mujoco.mj_resetData(model, data)
            picture(shaded)

        def skinned_picture() -> None:
            plain.update_scene(posed, "side")
            skin.draw(plain.scene, water, focus=(-4.0, 0.0))
            plain.render()

        with mjskip.attach(model, data, water=scene.water):
            timed = _measure(
                {
                    "bare": lambda: picture(bare),
                    "shaded": lambda: picture(shaded),
                    "frame": frame,
                    "plain": skinned_picture,
                },
                rounds,
                warm_up,
            )
        parts = _parts(lambda: picture(shaded), rounds)
    least = {name: found["wall_least"] for name, found in timed.items()}
    drawn_by = gl_renderer()
    return {
        "question": "milliseconds a 640 x 480 frame, beside MuJoCo's bare pass of the same scene",
        "kinds": timed,
        "over_bare": {
            name: {
                "wall": found["wall"] / timed["bare"]["wall"],
                "cpu": found["cpu"] / timed["bare"]["cpu"],
            }
            for name, found in timed.items()
        },
        "parts": parts,
        "goal_ms": GOAL,
        "frame_least_ms": least["frame"],
        "cells": list(CELLS),
        "gl_renderer": drawn_by,
        "software": is_software(drawn_by),
        "mujoco": version("mujoco"),
        "mjskip": version("mjskip"),
    }


def _measure(
    kinds: dict[str, Callable[[], None]], rounds: int, warm_up: int
) -> dict[str, dict[str, float]]:
    """Medians and least [ms] of each kind, one after another in every round."""
    wall: dict[str, list[float]] = {name: [] for name in kinds}
    cpu: dict[str, list[float]] = {name: [] for name in kinds}
    for k in range(warm_up + rounds):
        for name, draw in kinds.items():
            clock, used = time.perf_counter(), time.process_time()
            draw()
            if k >= warm_up:
                wall[name].append(1e3 * (time.perf_counter() - clock))
                cpu[name].append(1e3 * (time.process_time() - used))
    return {
        name: {
            "wall": statistics.median(wall[name]), "wall_least": min(wall[name]),
            "cpu": statistics.median(cpu[name]), "cpu_least": min(cpu[name]),
        }
        for name in kinds
    }  # fmt: skip


def _parts(draw: Callable[[], None], rounds: int) -> dict[str, dict[str, float]]:
    """Medians [ms] of the passes of a shaded picture, each waited for; the rest is Python and NumPy."""
    spent: dict[str, tuple[list[float], list[float]]] = {}

    def timed(name: Callable[..., str], function: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any, **named: Any) -> Any:
            gl().glFinish()
            clock, used = time.perf_counter(), time.process_time()
            result = function(*arguments, **named)
            gl().glFinish()
            wall, cpu = spent.setdefault(name(*arguments), ([], []))
            wall.append(1e3 * (time.perf_counter() - clock))
            cpu.append(1e3 * (time.process_time() - used))
            return result

        return run

    kept = WaterPasses._fill, WaterPasses._read, WaterPasses.put_surface, mujoco.mjr_render
    WaterPasses._fill = timed(lambda passes, kind, *_: kind, kept[0])  # type: ignore[method-assign]
    WaterPasses._read = staticmethod(timed(lambda *_: "read-back", kept[1]))  # type: ignore[method-assign]
    WaterPasses.put_surface = timed(lambda *_: "upload", kept[2])  # type: ignore[method-assign]
    mujoco.mjr_render = timed(lambda *_: "MuJoCo", kept[3])
    try:
        for _ in range(rounds):
            draw()
    finally:
        WaterPasses._fill, WaterPasses.put_surface = kept[0], kept[2]  # type: ignore[method-assign]
        WaterPasses._read = staticmethod(kept[1])  # type: ignore[method-assign]
        mujoco.mjr_render = kept[3]
    return {
        name: {"wall": statistics.median(wall), "cpu": statistics.median(cpu)}
        for name, (wall, cpu) in spent.items()
    }


def main() -> None:
    """Print, and save if a name is given."""
    result = bench()
    print(json.dumps(result, indent=2))
    if len(sys.argv) > 1:
        with open(sys.argv[1], "w", encoding="utf-8") as file:
            json.dump(result, file, indent=2)


if __name__ == "__main__":
    main()
