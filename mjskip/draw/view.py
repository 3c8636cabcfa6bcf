"""MuJoCo's own viewer with the stones thrown live: forces through `attach`, the water as a skin."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from mjskip.coupling.bodies import find_body
from mjskip.draw.skin import Grid, WaterSkin, add_water
from mjskip.draw.surface import Patch, patch_of
from mjskip.errors import RenderError
from mjskip.throws.engines import MujocoEngine
from mjskip.throws.run import Run
from mjskip.throws.scene import Scene
from mjskip.throws.simulate import Surface, check_surface, warm_up

FPS = 60.0
"""Frames per second at most."""

MAX_FRAME_STEP = 0.1
"""Time between two frames at most [s]: on a machine that is too slow the throw is shown late instead."""

WINDOW = (8.0, 6.0)
"""Size of the water about the stone whose waves are drawn [m]."""

ENTER = 257
"""Key code of GLFW: throw again."""

_HELP = (
    "mjskip view needs a display; without one, draw a video with mjskip run --video or open mjskip play in a "
    "browser"
)


@dataclass(frozen=True, kw_only=True)
class Watched:
    """What a viewer showed.

    Attributes:
        frames: given to the viewer.
        simulated: time that passed in the simulation [s].
        late: how much more passed on the clock because the machine is too slow [s].
        throws: made, the first included.
    """

    frames: int
    simulated: float
    late: float
    throws: int


def view(
    scene: Scene,
    *,
    surface: Surface = "still",
    slow: float = 1.0,
    seconds: float = math.inf,
    ready: Callable[[], None] | None = None,
) -> Watched:
    """Throw the stones of a scene in MuJoCo's viewer until its window is closed; Enter throws again.

    Args:
        scene: what to throw, and how.
        surface: "still": stones feel the undisturbed level; "waves": the moving surface.
        slow: how many times slower than it is.
        seconds: close the window after this time on the clock.
        ready: called when the window is there.

    Raises:
        ValueError: an option is not allowed.
        RenderError: there is no display.
        DivergedError: a force or a motion is not finite.
    """
    check_surface(surface, scene)
    if not 1.0 <= slow <= 1000.0:
        raise ValueError(f"slow is {slow!r}: give how many times slower, from 1 to 1000")
    if not seconds > 0.0:
        raise ValueError(f"seconds is {seconds!r}: give a time above 0")
    check_display()
    warm_up()
    grid = Grid.around(step=0.03)
    spec = mujoco.MjSpec.from_file(str(scene.path))
    add_water(spec, grid)
    scene = replace(scene, model=spec.compile())
    timestep = float(scene.model.opt.timestep)
    with MujocoEngine(scene, None, timestep, frozen_attitude=False) as engine:
        show = _Show(scene, engine, surface, grid)
        show.advance(1)  # what must be compiled is, before there is a window that would stand still
        show.throw_again()
        return _watch(show, slow=slow, seconds=seconds, ready=ready)


def _watch(
    show: _Show, *, slow: float, seconds: float, ready: Callable[[], None] | None
) -> Watched:
    import mujoco.viewer

    pressed: list[int] = []
    engine, timestep = show.engine, show.timestep
    simulated, frames, late, throws = 0.0, 0, 0.0, 1
    others = set(threading.enumerate())
    viewer = mujoco.viewer.launch_passive(
        engine.model, engine.data, key_callback=pressed.append, show_left_ui=False,
        show_right_ui=False,
    )  # fmt: skip
    with viewer:
        with viewer.lock():
            _aim(viewer.cam, engine.model, show.body)
        if ready is not None:
            ready()
        begun = clock = time.perf_counter()
        owed = 0.0
        while viewer.is_running() and time.perf_counter() - begun < seconds:
            frame_began = time.perf_counter()
            owed += (frame_began - clock) / slow
            clock = frame_began
            if owed > MAX_FRAME_STEP:
                late += owed - MAX_FRAME_STEP
                owed = MAX_FRAME_STEP
            steps = int(owed / timestep)
            owed -= steps * timestep
            with viewer.lock():
                if ENTER in pressed:
                    show.throw_again()
                    throws += 1
                pressed.clear()
                show.advance(steps)
                show.draw()
            simulated += steps * timestep
            viewer.sync()
            frames += 1
            time.sleep(max(0.0, 1.0 / FPS - (time.perf_counter() - frame_began)))
    # the window's own thread must be done before what it draws goes away, and before Python ends
    for thread in set(threading.enumerate()) - others:
        thread.join(timeout=10.0)
    return Watched(frames=frames, simulated=simulated, late=late, throws=throws)


class _Show:
    """The stones, their water, and the skin that is the water's picture."""

    def __init__(self, scene: Scene, engine: MujocoEngine, surface: Surface, grid: Grid) -> None:
        self.engine, self.body = engine, scene.body
        self.timestep = float(engine.model.opt.timestep)
        self._scene, self._surface = scene, surface
        self._start = engine.data.qpos.copy(), engine.data.qvel.copy()
        self._skin = WaterSkin(engine.model, grid)
        # the viewer draws a skin from where the model says its vertices are bound
        bound = engine.model.skin_vert
        self._bound = SimpleNamespace(skinvert=bound, skinnormal=np.empty_like(bound))
        self._sea = engine.surface()
        self.run = self._new_run()

    def throw_again(self) -> None:
        """Still water, and the stones as they leave the hand."""
        model, data = self.engine.model, self.engine.data
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = self._start
        self.run = self._new_run()

    def advance(self, steps: int) -> None:
        """Move stones and water on."""
        if steps:
            self.run.advance(steps)

    def draw(self) -> None:
        """Write the water into the skin."""
        mujoco.mj_forward(self.engine.model, self.engine.data)
        x, y, _ = self.engine.data.xipos[find_body(self.engine.model, self.body)]
        if self._sea is not None:
            patch = patch_of(self._sea, focus=(float(x), float(y)), data=self.engine.data)
        else:
            water = self.run.show()
            shape = tuple(int(size / water.spacing) for size in WINDOW)
            heights, at_x, at_y = water.window(float(x), float(y), (shape[0], shape[1]))
            middle = float(at_x[[0, -1]].mean()), float(at_y[[0, -1]].mean())
            patch = Patch(heights, water.spacing, middle)
        self._skin.draw(self._bound, patch, focus=(float(x), float(y)))

    def _new_run(self) -> Run:
        return Run(
            self._scene, self.engine, self.timestep,
            field=None if self._sea is not None else self._scene.field(), feel=self._surface == "waves",
        )  # fmt: skip


def _aim(camera: Any, model: Any, body: str) -> None:
    """Behind and to the right of the stone, following it."""
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = find_body(model, body)
    camera.distance, camera.azimuth, camera.elevation = 1.6, 50.0, -16.0


def check_display() -> None:
    """Raise unless a window can be opened here: MuJoCo's viewer would wait for ever.

    Raises:
        RenderError: what is missing, and what to do instead.
    """
    if sys.platform == "darwin":
        return  # mjpython's business, which says so itself
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RenderError(f"there is no display here (DISPLAY is not set): {_HELP}")
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # glfw's errors: what they say is not what to do
        if not glfw.init():
            shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
            raise RenderError(f"the display {shown!r} does not answer: {_HELP}")
        try:
            glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
            window = glfw.create_window(16, 16, "", None, None)
            if not window:
                raise RenderError(
                    "the display has no OpenGL (Debian: apt install libgl1 libgl1-mesa-dri): "
                    f"{_HELP}"
                )
            glfw.destroy_window(window)
        finally:
            glfw.terminate()
