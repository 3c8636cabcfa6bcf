"""`Renderer`: pictures of any MuJoCo model, with water in them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags, SingleArray
from mjskip.checks import check_count, check_switch, check_type
from mjskip.coupling.water_surface import PluginSea, WaterSurface, model_surface
from mjskip.draw import tiles
from mjskip.draw.appearance import WaterAppearance
from mjskip.draw.geoms import (
    CLEAR_OF_WATER,
    Ellipsoids,
    StaticGeoms,
    moving_geoms,
    outlines,
    sun_of,
)
from mjskip.draw.gl import offscreen, shaders_work
from mjskip.draw.passes import VIEW_ROWS, WaterPasses, gl, own_state, shrink_of
from mjskip.draw.surface import BLOCK, BORDER, Patch, ShaderSurface, patch_of
from mjskip.draw.surroundings import Surroundings
from mjskip.errors import RenderError

WATER_ID = -2
"""Both numbers of a pixel of water in a segmentation: background has -1, and everything else its id."""

_MARGIN = 3.0  # [m] of the bottom beyond the water that is of interest
_FARTHEST = 20.0  # [m]: half the side of the map of the bottom at most


class Renderer(mujoco.Renderer):  # type: ignore[misc]
    """`mujoco.Renderer` with water: the same constructor and methods, any model, any camera.

        with mjskip.Renderer(model, 480, 640, water=field) as renderer:
            renderer.update_scene(data, "side")
            picture = renderer.render()

    Water is drawn wherever nothing of the model is above its surface: to the horizon, still outside
    its field. What is seen through it and in it is the model's own: bodies that move as the camera sees
    them (their far side by ellipsoids of their size), and what stands still from pictures taken at the
    first `update_scene`, so move nothing of the world body afterwards. Light loses exp(-absorption length)
    on its way through the water to the eye.

    Depth is that of the nearest of water and geoms. In a segmentation water is (`WATER_ID`, `WATER_ID`).

    Attributes:
        water: what is drawn: may be set at any time.
        appearance: clear or turbid, smooth or ruffled: may be set at any time.
        spray: drops (n, 5) and a sheet (m, 4) that are drawn over it, as `mjskip.draw.spray` makes them.
        linear: True leaves colours as they come out of the laws of optics: no tone curve, no glints of
            the sun, no darkening of wet edges.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        height: int = 240,
        width: int = 320,
        max_geom: int = 10000,
        font_scale: mujoco.mjtFontScale = mujoco.mjtFontScale.mjFONTSCALE_150,
        *,
        water: Any = None,
        spacing: float | None = None,
        centre: tuple[float, float] = (0.0, 0.0),
        appearance: WaterAppearance | None = None,
        linear: bool = False,
    ) -> None:
        """Make a GL context; through EGL, which needs no display, unless MUJOCO_GL says otherwise.

        Args:
            model: compiled.
            height: of pictures [pixels].
            width: of pictures [pixels].
            max_geom: as `mujoco.Renderer`'s.
            font_scale: as `mujoco.Renderer`'s.
            water: a coupling of bodies and water, a `HeightField`, a recording of a surface, an
                array (nx, ny) of heights [m], or None for the moving water that the model brings by the
                plugin, or else still water at z = 0.
            spacing: side of a cell of an array [m].
            centre: of an array (x, y) [m].
            appearance: of the water.
            linear: whether colours are left as the laws of optics give them.

        Raises:
            ValueError: the picture is larger than the model's offscreen buffer, or the water is none.
            RenderError: no context can be made here, or it does not know GLSL 3.30.
        """
        self._gl_context: Any = None  # both are the base class's, and what `close` looks for
        self._mjr_context: Any = None
        self._passes: WaterPasses | None = None
        check_type(
            "model", model, mujoco.MjModel, "give what mujoco.MjModel.from_xml_path(file) makes"
        )
        height, width = check_count("height", height), check_count("width", width)
        room = model.vis.global_
        if width > room.offwidth or height > room.offheight:
            raise ValueError(
                f"the picture is {width} x {height} pixels and the model's offscreen buffer {room.offwidth} x "
                f'{room.offheight}: give the model <visual><global offwidth="{width}" offheight="{height}"/></visual>'
            )
        max_geom = check_count("max_geom", max_geom, high=2**31 - 1)
        check_type("font_scale", font_scale, mujoco.mjtFontScale, "give a mujoco.mjtFontScale")
        if appearance is not None:
            check_type("appearance", appearance, WaterAppearance)
        self.appearance = appearance or WaterAppearance()
        self.linear = check_switch("linear", linear)
        self._spacing, self._centre = spacing, centre
        self.water = water
        self.spray: tuple[SingleArray, SingleArray] | None = None
        self._surroundings: Surroundings | None = None
        self._time = 0.0
        self._data: Any = None
        self._brought: WaterSurface | PluginSea | None = None
        self._patch((0.0, 0.0))
        if not shaders_work():
            raise RenderError(
                "this OpenGL does not know GLSL 3.30: update its driver, or film with look='plain'"
            )
        with offscreen():
            super().__init__(model, height, width, max_geom, font_scale)
        with self._current(), own_state():
            self._passes = WaterPasses((width, height))
        self._sun = sun_of(model)
        self._standing, self._moving = StaticGeoms.of(model), moving_geoms(model)
        self._ellipsoids = Ellipsoids.of(model, self._moving)
        self._bodies = np.zeros((0, 16))
        self._outlines = np.zeros((0, 3)), np.zeros((0, 3))
        self._usual = True  # the scene holds what the model's geoms say
        self._surface = ShaderSurface()

    def close(self) -> None:
        """Give the GL context back."""
        if self._passes is not None and self._gl_context:
            with self._current():
                self._passes.free()
        self._passes, self._surroundings = None, None
        super().close()

    def update_scene(
        self,
        data: mujoco.MjData,
        camera: int | str | mujoco.MjvCamera = -1,
        scene_option: mujoco.MjvOption | None = None,
    ) -> None:
        """Gather what a camera sees, as `mujoco.Renderer.update_scene`.

        Args:
            data: of the renderer's model.
            camera: name, id, -1 for the free one, or a `mujoco.MjvCamera`.
            scene_option: what is drawn.
        """
        super().update_scene(data, camera, scene_option)
        if self._data is not data:
            self._brought = model_surface(self._model, data)
        if self._brought is not None:
            self._drop_triangles()
        self._usual = scene_option is None
        self._time, self._data = float(data.time), data
        self._bodies = self._ellipsoids.rows(data)
        low, high = outlines(self._model, data, self._moving)
        self._outlines = (
            np.concatenate([self._standing.low, low]), np.concatenate([self._standing.high, high])
        )  # fmt: skip
        if self._surroundings is None and self._passes is not None:
            self._draw_static(data, self._passes)

    def _drop_triangles(self) -> None:
        """The plugin puts its surface into every scene as translucent triangles: here the water itself is drawn."""
        kind = mujoco.mjtGeom.mjGEOM_TRIANGLE
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.type == kind and geom.objtype == mujoco.mjtObj.mjOBJ_UNKNOWN:
                geom.type = mujoco.mjtGeom.mjGEOM_LABEL  # which has no body

    def render(self, *, out: npt.NDArray[Any] | None = None) -> npt.NDArray[Any]:
        """The picture, depth or segmentation, as `mujoco.Renderer.render`.

        Args:
            out: to write to instead, of the same shape and kind as what is returned.

        Returns:
            (height, width, 3) colours from 0 to 255; depth (height, width) [m]; or segmentation
            (height, width, 2) of object ids and types.

        Raises:
            RuntimeError: the renderer is closed.
            ValueError: `out` has another shape.
        """
        if self._passes is None:
            raise RuntimeError("render cannot be called after close.")
        if self._depth_rendering or self._segmentation_rendering:
            return self._render_ids(out, self._passes)
        shape = (self._height, self._width, 3)
        if out is not None and out.shape != shape:
            raise ValueError(f"out has shape {out.shape}: give {shape}")
        usable = out is not None and out.dtype == np.uint8 and out.flags.c_contiguous
        image = out if usable and out is not None else np.empty(shape, np.uint8)
        with self._current():
            with self._hidden(), self._opaque():
                mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr_context)
                mujoco.mjr_render(self._rect, self._scene, self._mjr_context)
            gl().glFlush()  # it draws while the rest is made ready
            with own_state():
                view, patch = self._see(self._passes)
                self._take(self._passes)
                self._passes.draw(view, self._tiles(view, patch))
                if self.spray is not None:
                    self._passes.draw_spray(view, *self.spray)
                self._passes.read(image)
        if out is None or out is image:
            return image
        np.copyto(out, image, casting="unsafe")
        return out

    def _render_ids(self, out: npt.NDArray[Any] | None, passes: WaterPasses) -> npt.NDArray[Any]:
        """Depth and segmentation: MuJoCo's, and the water where it is nearer."""
        with self._opaque():
            found: npt.NDArray[Any] = super().render(out=out)
        with self._current(), own_state():
            view, _ = self._see(passes)
            self._take(passes)
            far = passes.distances(view)
        if self._depth_rendering:
            np.copyto(found, far, where=far > 0.0, casting="unsafe")
        elif self._segmentation_rendering:
            found[far > 0.0] = WATER_ID
        return found

    @property
    def _depth(self) -> float:
        """Of the water [m]."""
        return 3.0 if self._surroundings is None else -self._surroundings.deepest

    @contextlib.contextmanager
    def _current(self) -> Iterator[None]:
        with self._gl_context.as_current():
            yield

    @contextlib.contextmanager
    def _hidden(self) -> Iterator[None]:
        """From above, what stands under water is seen in the map of the bottom: MuJoCo need not draw it.

        A bottom without end stays, without its texture: what is nowhere else would be filled with sky.
        """
        hidden = []
        above = self._scene.camera[0].pos[2] > CLEAR_OF_WATER
        wide = 0.7 * self._scene.camera[0].frustum_far
        sunk = self._standing.sunk
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM:
                self._usual &= geom.type == mujoco.mjtGeom.mjGEOM_LABEL
            elif above and geom.objid in sunk:
                hidden.append((geom, geom.type, geom.matid, geom.size.copy()))
                if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
                    geom.type, geom.matid = mujoco.mjtGeom.mjGEOM_BOX, -1
                    geom.size[:] = wide, wide, 0.01
                else:
                    geom.type = mujoco.mjtGeom.mjGEOM_LABEL  # which has no body
        try:
            yield
        finally:
            for geom, kind, material, size in hidden:
                geom.type, geom.matid = kind, material
                geom.size[:] = size

    @contextlib.contextmanager
    def _opaque(self) -> Iterator[None]:
        """Translucent geoms are drawn opaque: MuJoCo gives them no depth, and the water would cover them."""
        changed = []
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and 0.0 < geom.rgba[3] < 1.0:
                changed.append((geom, float(geom.rgba[3]), geom.transparent))
                geom.rgba[3], geom.transparent = 1.0, 0
        try:
            yield
        finally:
            for geom, alpha, transparent in changed:
                geom.rgba[3], geom.transparent = alpha, transparent

    def _take(self, passes: WaterPasses) -> None:
        """What MuJoCo drew, for the water's passes."""
        if self._mjr_context.offSamples or self._surroundings is None:
            passes.model.copy_from(self._mjr_context.offFBO)

    def _tiles(self, view: SingleArray, patch: Patch) -> dict[str, Flags]:
        """Which program draws which tile."""
        size, depth, sunk = (self._width, self._height), self._depth, bool(view[0, 3] < 0.0)
        if sunk:
            return tiles.under_water(size)
        eye, sun = (view[k, :3].astype(np.float64) for k in (0, 8))
        water, whole, boxes = tiles.footprints(view, size)
        first = np.array(patch.origin) - (BORDER + 0.5) * patch.spacing
        waves = tiles.rough(boxes, self._surface.tallest, first, patch.spacing, depth)
        mirror, dive, shade = tiles.around_bodies(eye, sun, self._bodies[:, :4], depth)
        before = tiles.hidden_by(eye, *self._outlines)
        # what else a scene holds, marks of a user for instance, may be anywhere
        whole &= self._usual and not self._scene.nskin and not self._scene.nflex
        others = before, self._standing.boxes, mirror, dive, shade
        hidden, *special = (tiles.overlap(boxes, other) for other in others)
        return tiles.programs(water, whole, hidden, waves, *special)

    def _patch(self, focus: tuple[float, float], distance: float = 0.0) -> Patch:
        """What is drawn of the water now."""
        return patch_of(
            self._brought if self.water is None else self.water, focus=focus, time=self._time, spacing=self._spacing, centre=self._centre,
            data=self._data, distance=distance,
        )  # fmt: skip

    def _draw_static(self, data: mujoco.MjData, passes: WaterPasses) -> None:
        """Draw the bottom and the scenery once."""
        patch = self._patch((0.0, 0.0))
        size = patch.spacing * max(patch.elevation.shape)
        known = size > 2.0 * patch.spacing
        reach = 0.5 * size if known else float(self._model.stat.extent)
        x, y, _ = self._model.stat.center.tolist()
        centre = patch.centre if known else (x, y)
        with self._current(), own_state():
            self._surroundings = Surroundings(
                self._model, data, self._mjr_context, passes, centre=centre,
                reach=min(reach + _MARGIN, _FARTHEST),
            )  # fmt: skip
            if self._mjr_context.offSamples == 0:
                passes.adopt(self._mjr_context.offFBO)

    def _see(self, passes: WaterPasses) -> tuple[SingleArray, Patch]:
        """Hand the surface over, and fill in `water.glsl`'s View."""
        view = np.zeros((VIEW_ROWS, 4), np.float32)
        position, ahead = self._camera_rows(view)
        focus, distance = _looked_at(position, ahead)
        patch = self._patch(focus, distance)
        self._surface.fill(patch, blur=0.1 * self._depth)
        passes.put_surface(self._surface)
        # outer edge of the first cell
        first = np.array(patch.origin) - (BORDER + 0.5) * patch.spacing
        for row, values, side in (
            (5, self._surface.heights, patch.spacing),
            (6, self._surface.tallest, BLOCK * patch.spacing),
        ):
            scale = 1.0 / (np.array(values.shape[:2]) * side)
            view[row] = *(-first * scale), *scale
        view[7, :2] = patch.spacing, -self._depth
        view[0, 3] = 1.0 if position[2] > _height_at(patch, position) else -1.0
        sun, colour = self._sun
        view[8] = *sun, 0.0 if self.linear else self.appearance.wind
        view[9] = *colour, 0.6
        view[10] = *self.appearance.absorption, self._time
        view[11] = *self.appearance.scattered, float(self.linear)
        if self._surroundings is not None:
            view[12:16] = self._surroundings.rows
        view[15, 2] = len(self._bodies)
        view[16 : 16 + 4 * len(self._bodies)] = self._bodies.reshape(-1, 4)
        return view, patch

    def _camera_rows(self, view: SingleArray) -> tuple[Array, Array]:
        """Fill in the camera; its position and direction."""
        left, other = self._scene.camera  # a stereo pair, drawn from its middle
        position = 0.5 * (np.array(left.pos, np.float64) + other.pos)
        ahead, up = np.array(left.forward, np.float64), np.array(left.up, np.float64)
        near, far = float(left.frustum_near), float(left.frustum_far)
        flat = float(left.orthographic)
        scale = 1.0 if flat else near
        half_height = 0.5 * float(left.frustum_top - left.frustum_bottom) / scale
        half_width = float(left.frustum_width) / scale or half_height * self._width / self._height
        middle = float(left.frustum_center) / scale / half_width
        raised = 0.5 * float(left.frustum_top + left.frustum_bottom) / scale
        view[0, :3] = position
        view[1] = *(ahead + raised * up), flat
        view[2] = *(half_width * np.cross(ahead, up)), -middle
        view[3] = (
            *(half_height * up),
            2.0 * half_width / self._width * shrink_of(self._width, self._height),
        )
        view[4] = 1.0 / far, 1.0 / near - 1.0 / far, near, far - near
        return position, ahead


def _looked_at(position: Array, ahead: Array) -> tuple[tuple[float, float], float]:
    """Where a camera looks at the water (x, y), not far from it, and how far away what it looks at may be [m]."""
    away = -position[2] / ahead[2] if ahead[2] * position[2] < 0.0 else 3.0
    x, y, _ = position + min(away, 5.0) * ahead
    return (float(x), float(y)), float(min(away, 5.0 * abs(position[2]) + 5.0))


def _height_at(patch: Patch, position: Array) -> float:
    """Of the surface over or under a point [m]."""
    i, j = (
        round((at - first) / patch.spacing)
        for at, first in zip(position, patch.origin, strict=False)
    )
    nx, ny = patch.elevation.shape
    return float(patch.elevation[i, j]) if 0 <= i < nx and 0 <= j < ny else 0.0
