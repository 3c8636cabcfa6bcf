"""An OpenGL picture of a MuJoCo model: colours and distances in one pass."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip.draw.gl import offscreen
from mjskip.draw.optics import Eye
from mjskip.draw.video import Image

_MOST_GEOMS = 2000


class Canvas:
    """An offscreen buffer of a fixed size, and the scene that is drawn into it.

    `mujoco.Renderer` draws once for colours and again for distances; this reads both at once.

    Attributes:
        scene: what will be drawn, an `mujoco.MjvScene`.
    """

    def __init__(self, model: Any, *, size: tuple[int, int]) -> None:
        """Make the GL context.

        Raises:
            RenderError: none can be made here.
        """
        self._model = model
        self._size = size
        self.scene = mujoco.MjvScene(model, maxgeom=_MOST_GEOMS)
        self._option = mujoco.MjvOption()
        with offscreen():
            from mujoco.rendering.classic import gl_context

            self._gl: Any = gl_context.GLContext(*size)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self.scene.flags[flag] = 0  # each redraws everything; the water shows neither

    def close(self) -> None:
        """Free the GL context."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None

    def update(
        self, data: Any, *, camera: int, without: Callable[[int], bool] | None = None
    ) -> None:
        """Gather what a camera of the model sees, without the geoms for which that is true."""
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        view.fixedcamid = camera
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, view, mujoco.mjtCatBit.mjCAT_ALL, self.scene
        )
        if without is not None:
            for geom in self.scene.geoms[: self.scene.ngeom]:
                if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and without(int(geom.objid)):
                    geom.rgba[3] = 0.0  # MuJoCo skips what cannot be seen

    def eye(self) -> Eye:
        """The camera of the scene as it is drawn."""
        camera = self.scene.camera[0]  # two of a stereo pair: the same but for their separation
        wide, high = self._size
        position = 0.5 * (camera.pos + self.scene.camera[1].pos)
        return Eye(
            position=np.array(position, np.float64),
            forward=np.array(camera.forward, np.float64),
            up=np.array(camera.up, np.float64),
            half_height=float(camera.frustum_top / camera.frustum_near),
            aspect=wide / high,
        )

    def look_through(self, eye: Eye) -> None:
        """Draw from here instead."""
        for camera in self.scene.camera:
            camera.pos[:], camera.forward[:], camera.up[:] = eye.position, eye.forward, eye.up
            camera.frustum_top = eye.half_height * camera.frustum_near
            camera.frustum_bottom = -camera.frustum_top
            camera.frustum_center = 0.0
            camera.frustum_width = 0.0  # as the picture is

    def picture(self) -> Image:
        """Colours (height, width, 3), rows from the bottom."""
        wide, high = self._size
        image: Image = np.empty((high, wide, 3), np.uint8)
        self._render(image, None)
        return image

    def picture_and_distances(
        self, *, square: bool = False
    ) -> tuple[Image, npt.NDArray[np.float32]]:
        """Colours (height, width, 3) and distances along the view (height, width) [m]."""
        wide, high = self._size
        if square:
            wide = high = min(self._model.vis.global_.offwidth, self._model.vis.global_.offheight)
        image: Image = np.empty((high, wide, 3), np.uint8)
        depth = np.empty((high, wide), np.float32)
        self._render(image, depth)
        near = self._model.vis.map.znear * self._model.stat.extent
        far = self._model.vis.map.zfar * self._model.stat.extent
        # the buffer holds 1 at the near plane and 0 at the far one, linear in one over the distance
        depth *= np.float32(1.0 / near - 1.0 / far)
        depth += np.float32(1.0 / far) * (depth > 0.0)
        np.maximum(depth, np.float32(1e-9), out=depth)  # the sky is behind everything
        return image, np.reciprocal(depth, out=depth)

    def _render(self, image: Image, depth: npt.NDArray[np.float32] | None) -> None:
        self._gl.make_current()
        window = mujoco.MjrRect(0, 0, image.shape[1], image.shape[0])
        mujoco.mjr_render(window, self.scene, self._context)
        mujoco.mjr_readPixels(image, depth, window, self._context)
