"""What does a frame cost, and how much faster is a skin than a height field that is uploaded?

Draws frames of the default scene at 640 x 480 over a 500 x 500 surface with rings on it: shaded,
plain, and with a height-field geom; prints medians after a warm-up and their ratio. Takes half a minute on two cores.

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
import numpy as np

from mjskip import HeightField, Scene, load_scene, simulate
from mjskip.draw import optics
from mjskip.draw.gl import gl_renderer, is_software, offscreen
from mjskip.draw.skin import Grid
from mjskip.draw.stage import LOOKS, Stage

SIZE = (640, 480)
STEP = 0.02  # [m] between drawn vertices near the stone, as in a video of this scene


def bench(*, frames: int = 20, warm_up: int = 3) -> dict[str, Any]:
    """Measure both ways.

    Args:
        frames: drawn by each, after `warm_up` more.

    Returns:
        Milliseconds of wall and of processor time per frame by each way, their ratio, and what
        drew.
    """
    scene = load_scene("lake")
    trajectory = simulate(scene)
    water = scene.field()
    for x in (-3.5, -2.9):
        water.displace(x, 0.0, height=0.01, radius=0.06)
    water.advance(0.2)

    looks, parts = {}, {}
    for look in LOOKS:
        stage = Stage(
            scene, {scene.body: trajectory}, camera="side", size=SIZE, grid=Grid.around(step=STEP),
            look=look,
        )  # fmt: skip
        stage.open()
        try:
            looks[look] = _measure(lambda: stage.draw(0.1, water), frames, warm_up)  # noqa: B023
            if look == "shaded":
                parts = _parts(stage, water, frames, warm_up)
        finally:
            stage.close()
    skin = looks["plain"]
    uploaded = UploadedHeightField(scene, water)
    try:
        height_field = _measure(lambda: uploaded.draw(water), frames, warm_up)
    finally:
        uploaded.close()
    drawn_by = gl_renderer()
    return {
        "question": "milliseconds per 640 x 480 frame, skin against height-field upload",
        "skin_ms": skin["wall"],
        "skin_cpu_ms": skin["cpu"],
        "shaded_ms": looks["shaded"]["wall"],
        "shaded_cpu_ms": looks["shaded"]["cpu"],
        "shaded_parts_cpu_ms": parts,
        "goals_cpu_ms": {"shaded": 60, "plain": 30},
        "height_field_ms": height_field["wall"],
        "height_field_cpu_ms": height_field["cpu"],
        "ratio": height_field["wall"] / skin["wall"],
        "cells": list(water.shape),
        "size": list(SIZE),
        "frames": frames,
        "gl_renderer": drawn_by,
        "software": is_software(drawn_by),
        "mujoco": version("mujoco"),
        "mjskip": version("mjskip"),
    }


class UploadedHeightField:
    """The same scene with its water as a height-field geom, uploaded for every frame."""

    def __init__(self, scene: Scene, water: HeightField) -> None:
        spec = mujoco.MjSpec.from_file(str(scene.path))
        nx, ny = water.shape
        size = [0.5 * water.spacing * (nx - 1), 0.5 * water.spacing * (ny - 1), 0.2, 0.1]
        spec.add_hfield(name="water", nrow=ny, ncol=nx, size=size, userdata=[0.0] * (nx * ny))
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="water", material="water",
            pos=[*water.centre, -0.1], contype=0, conaffinity=0,
        )  # fmt: skip
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        # Renderer keeps the context that the upload needs to itself: the same from public parts
        with offscreen():
            from mujoco.rendering.classic import gl_context

            self._gl = gl_context.GLContext(*SIZE)
        self._gl.make_current()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = self._model.camera("side").id
        self._image = np.empty((SIZE[1], SIZE[0], 3), dtype=np.uint8)

    def draw(self, water: HeightField) -> np.ndarray:
        """One frame, the surface given anew."""
        # heights fill 0..1 of 0.2 m and rows run along y
        self._model.hfield_data[:] = (0.5 + water.elevation.T / 0.2).ravel()
        mujoco.mjr_uploadHField(self._model, self._context, 0)
        mujoco.mjv_updateScene(
            self._model, self._data, mujoco.MjvOption(), None, self._camera,
            mujoco.mjtCatBit.mjCAT_ALL, self._scene,
        )  # fmt: skip
        window = mujoco.MjrRect(0, 0, *SIZE)
        mujoco.mjr_render(window, self._scene, self._context)
        mujoco.mjr_readPixels(self._image, None, window, self._context)
        return self._image[::-1]

    def close(self) -> None:
        """Free the GL context."""
        self._context.free()
        self._gl.free()


def _parts(stage: Stage, water: HeightField, frames: int, warm_up: int) -> dict[str, float]:
    """Processor time of the kernels of one shaded frame [ms]; the rest is OpenGL and NumPy."""
    spent: dict[str, list[float]] = {}
    kept = {name: getattr(optics, name) for name in ("sketch", "find_smooth", "shade")}

    def timed(name: str, kernel: Callable[..., None]) -> Callable[..., None]:
        def run(*arguments: Any) -> None:
            begun = time.thread_time()
            kernel(*arguments)
            spent.setdefault(name, []).append(1e3 * (time.thread_time() - begun))

        return run

    for name, kernel in kept.items():
        setattr(optics, name, timed(name, kernel))
    try:
        _measure(lambda: stage.draw(0.1, water), frames, warm_up)
    finally:
        for name, kernel in kept.items():
            setattr(optics, name, kernel)
    return {name: sum(found) / (frames + warm_up) for name, found in spent.items()}


def _measure(draw: Callable[[], Any], frames: int, warm_up: int) -> dict[str, float]:
    """Medians over `frames` calls [ms]: wall clock, and processor time of all threads."""
    for _ in range(warm_up):
        draw()
    wall, cpu = [], []
    for _ in range(frames):
        clock, used = time.perf_counter(), time.process_time()
        draw()
        wall.append(1e3 * (time.perf_counter() - clock))
        cpu.append(1e3 * (time.process_time() - used))
    return {"wall": statistics.median(wall), "cpu": statistics.median(cpu)}


def main() -> None:
    """Print, and save if a name is given."""
    result = bench()
    print(json.dumps(result, indent=2))
    if len(sys.argv) > 1:
        with open(sys.argv[1], "w", encoding="utf-8") as file:
            json.dump(result, file, indent=2)


if __name__ == "__main__":
    main()
