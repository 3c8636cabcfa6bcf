"""Pictures and a window of an environment, with the water's surface in them."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any

import mujoco
import numpy as np

from mjskip._typing import Image
from mjskip.checks import check_count, fault
from mjskip.draw.renderer import Renderer

WATER = (0.10, 0.36, 0.50, 0.55)
"""Colour of the surface."""

CLOSING = 10.0
"""How long a window may take to close [s]."""

SIDE_VIEW = (2.6, 75.0, -14.0)
"""Distance [m], azimuth and elevation [degrees] of a camera that looks at a body."""

REACH = 60.0
"""The surface reaches so far to every side [m]."""


class View:
    """What draws; made when it is first needed."""

    def __init__(self, width: int, height: int, camera: str | int) -> None:
        self._width = check_count("width", width, low=16, high=4096)
        self._height = check_count("height", height, low=16, high=4096)
        self._camera = camera
        self._renderer: Any = None
        self._model: mujoco.MjModel | None = None
        self._window: Any = None
        self._threads: set[threading.Thread] = set()
        self._shown = 0.0

    def picture(self, model: mujoco.MjModel, data: mujoco.MjData) -> Image:
        """(height, width, 3), rows from the top.

        Raises:
            RenderError: no OpenGL context can be made here.
        """
        if self._renderer is None or self._model is not model:
            self._free()
            _make_room(model, self._width, self._height)
            self._renderer = Renderer(model, self._height, self._width)
            self._model = model
        self._renderer.update_scene(data, camera_of(model, self._camera))
        return np.array(self._renderer.render())

    def show(self, model: mujoco.MjModel, data: mujoco.MjData, interval: float) -> None:
        """In a window, no faster than it happens."""
        if self._window is not None and self._model is not model:
            self._close_window()
        if self._window is None:
            import mujoco.viewer

            before = set(threading.enumerate())
            self._window = mujoco.viewer.launch_passive(
                model, data, show_left_ui=False, show_right_ui=False
            )
            self._threads = set(threading.enumerate()) - before
            self._model = model
            with self._window.lock():
                aim = camera_of(model, self._camera)
                for field in (
                    "type",
                    "fixedcamid",
                    "trackbodyid",
                    "distance",
                    "azimuth",
                    "elevation",
                ):
                    setattr(self._window.cam, field, getattr(aim, field))
                add_surface(self._window.user_scn)
        if self._window.is_running():
            self._window.sync()
        time.sleep(max(0.0, self._shown + interval - time.monotonic()))
        self._shown = time.monotonic()

    def close(self) -> None:
        """Free everything; drawing again makes it anew."""
        self._free()
        self._close_window()

    def _free(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _close_window(self) -> None:
        if self._window is not None:
            with contextlib.suppress(Exception):
                self._window.close()
            for thread in self._threads:  # a process that ends while one still draws crashes
                thread.join(CLOSING)
            self._window = None


def camera_of(model: mujoco.MjModel, name: str | int) -> mujoco.MjvCamera:
    """A camera of the model by name or number, or one that looks at a body of this name from the side.

    Raises:
        ValueError: there is neither.
    """
    camera = mujoco.MjvCamera()
    cameras = [model.camera(k).name for k in range(model.ncam)]
    if name in cameras or (isinstance(name, int) and 0 <= name < model.ncam):
        camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        camera.fixedcamid = model.camera(name).id
        return camera
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, str(name))
    if body < 0:
        raise fault(
            "camera", name, f"use one of {', '.join(cameras) or 'no camera'}, or the name of a body"
        )
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = body
    camera.distance, camera.azimuth, camera.elevation = SIDE_VIEW
    return camera


def add_surface(scene: Any) -> None:
    """Put still water, a translucent plane at z = 0, into a scene of MuJoCo's."""
    if scene.ngeom >= scene.maxgeom:
        return
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_BOX,
        np.array([REACH, REACH, 0.0005]),
        np.array([0.0, 0.0, -0.0005]),
        np.eye(3).ravel(),
        np.array(WATER, np.float32),
    )
    scene.ngeom += 1


def _make_room(model: mujoco.MjModel, width: int, height: int) -> None:
    model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
    model.vis.global_.offheight = max(height, model.vis.global_.offheight)
