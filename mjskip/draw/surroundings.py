"""What stands still about the water, drawn by MuJoCo once: the bottom from above, the scenery all around."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from mjskip.draw.passes import VIEW_ROWS, Target, Texture, WaterPasses, gl

_ABOVE = (
    0.25  # [m]: the bottom is drawn from here down, so that banks are on the map and trees are not
)
_DEEPEST = 30.0  # [m] below that
_LARGEST = 2048  # texels a side of the map
_TEXEL = 0.01  # [m] if the map is not too large for that
_LIFT = 0.3  # [m] above the water where the scenery is taken
_SOUNDINGS = 512  # points a side of the map of its height
_RANGES = 256  # pixels a side of each picture of how far the scenery is
_FACE = 512  # pixels a side of each of its pictures

# OpenGL's sides of a cube: where each looks, and what is up in it
_SIDES = (
    ((1, 0, 0), (0, -1, 0)), ((-1, 0, 0), (0, -1, 0)), ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, -1)), ((0, 0, 1), (0, -1, 0)), ((0, 0, -1), (0, -1, 0)),
)  # fmt: skip


class Surroundings:
    """Textures of the bottom and of the scenery among the inputs of `WaterPasses`.

    Attributes:
        rows: (4, 4) of `water.glsl`'s View: ground, depths, place, around.
        deepest: height of the lowest point of the bottom [m].
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        context: Any,
        passes: WaterPasses,
        *,
        centre: tuple[float, float],
        reach: float,
    ) -> None:
        """Draw them.

        Args:
            model: compiled.
            data: of it, with its bodies placed.
            context: MuJoCo's, current.
            passes: that will read them.
            centre: of the water that is of interest (x, y) [m].
            reach: of it, half a side of the map of the bottom [m].
        """
        self._model, self._data, self._context, self._passes = model, data, context, passes
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + model.nsite + 100)
        for flag in ("SHADOW", "REFLECTION", "FOG", "HAZE"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = 0
        self._target = Target(
            (context.offWidth, context.offHeight), {"picture": "RGBA8"}, depth=True
        )
        extent = float(model.stat.extent)
        near, far = model.vis.map.znear * extent, model.vis.map.zfar * extent
        skybox = bool(np.any(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX))
        self.deepest = -_DEEPEST
        self.rows = np.zeros((4, 4), np.float32)
        self._draw_bottom(centre, reach)
        self._draw_scenery(centre, near, far)
        self.rows[3, :2] = 1.0 / near - 1.0 / far, skybox
        self._target.free()

    def _draw_bottom(self, centre: tuple[float, float], reach: float) -> None:
        """From straight above, by parallel rays, piece by piece."""
        most = int(gl().glGetIntegerv(gl().GL_MAX_TEXTURE_SIZE))
        count = min(_LARGEST, most, 2 ** math.ceil(math.log2(2.0 * reach / _TEXEL)))
        texel = 2.0 * reach / count
        bottom = Texture((count, count), "RGBA8", repeat="MIRRORED_REPEAT", levels="NEAREST")
        depths = Texture((count, count), "DEPTH32F_STENCIL8", smooth=False)
        wide, high = (min(size, count) for size in self._target.size)
        corner = np.array(centre) - reach
        self._gather((*centre, _ABOVE))
        near = 0.01
        for camera in self._scene.camera:
            camera.orthographic = 1
            camera.forward[:], camera.up[:] = (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)
            camera.frustum_near, camera.frustum_far = near, near + _DEEPEST
            camera.frustum_top = 0.5 * high * texel
            camera.frustum_bottom = -camera.frustum_top
            camera.frustum_center, camera.frustum_width = 0.0, 0.5 * wide * texel
        for first in range(0, count, wide):
            for row in range(0, count, high):
                size = min(wide, count - first), min(high, count - row)
                middle = corner + texel * (np.array([first, row]) + 0.5 * np.array([wide, high]))
                for camera in self._scene.camera:
                    camera.pos[:] = (*middle, _ABOVE + near)
                self._render((wide, high))
                for texture in (bottom, depths):
                    _copy(texture, texture.target, (first, row), size)
        bottom.make_levels()
        self.rows[0] = *corner, 0.5 / reach, _ABOVE + near
        self.rows[1, :3] = near, _DEEPEST, texel
        view = np.zeros((VIEW_ROWS, 4), np.float32)
        view[12:16] = self.rows
        self._passes.inputs["bottom"] = bottom
        heights, found = self._passes.converted("SOUNDING", depths, _SOUNDINGS, view)
        self._passes.inputs["soundings"] = heights
        self.deepest = float(found.min())
        depths.free()

    def _draw_scenery(self, centre: tuple[float, float], near: float, far: float) -> None:
        """The sides of a cube; one over the distance ahead is linear in what a depth buffer holds."""
        side = min(_FACE, *self._target.size)
        scenery = Texture((side, side), "RGBA8", cube=True)
        ranges = Texture((_RANGES, _RANGES), "R32F", smooth=False, cube=True)
        depths = Texture((side, side), "DEPTH32F_STENCIL8", smooth=False)
        place = (*centre, _LIFT)
        self._gather(place)
        for number, (forward, up) in enumerate(_SIDES):
            for camera in self._scene.camera:
                camera.orthographic = 0
                camera.pos[:], camera.forward[:], camera.up[:] = place, forward, up
                camera.frustum_near, camera.frustum_far = near, far
                camera.frustum_top, camera.frustum_bottom = near, -near
                camera.frustum_center, camera.frustum_width = 0.0, near
            self._render((side, side))
            _copy(scenery, gl().GL_TEXTURE_CUBE_MAP_POSITIVE_X + number, (0, 0), (side, side))
            _copy(depths, depths.target, (0, 0), (side, side))
            texture, found = self._passes.converted("RANGE", depths, _RANGES)
            texture.free()
            ranges.put(found, number)
        depths.free()
        self._passes.inputs |= {"scenery": scenery, "ranges": ranges}
        self.rows[2] = *place, 1.0 / far

    def _gather(self, place: tuple[float, float, float]) -> None:
        camera = mujoco.MjvCamera()  # planes without end are laid about it
        camera.lookat[:], camera.distance = place, 0.01
        still = int(mujoco.mjtCatBit.mjCAT_STATIC)
        mujoco.mjv_updateScene(
            self._model, self._data, mujoco.MjvOption(), None, camera, still, self._scene
        )
        for light in self._scene.lights[: self._scene.nlight]:
            light.specular[:] = 0.0  # it belongs to an eye elsewhere

    def _render(self, size: tuple[int, int]) -> None:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        mujoco.mjr_render(mujoco.MjrRect(0, 0, *size), self._scene, self._context)
        self._target.copy_from(self._context.offFBO)
        gl().glBindFramebuffer(gl().GL_READ_FRAMEBUFFER, self._target.buffer)
        gl().glReadBuffer(gl().GL_COLOR_ATTACHMENT0)


def _copy(texture: Texture, face: Any, place: tuple[int, int], size: tuple[int, int]) -> None:
    gl().glBindTexture(texture.target, texture.name)
    gl().glCopyTexSubImage2D(face, 0, *place, 0, 0, *size)
