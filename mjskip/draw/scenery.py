"""What the optics of the water needs to know of a MuJoCo model: sun, sky, bottom, stones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip.coupling.bodies import free_bodies
from mjskip.draw.canvas import Canvas
from mjskip.draw.optics import EMPTY, Ellipsoid, Eye, Lake, Panorama

Array = npt.NDArray[np.float64]

_DEEP = -3.0  # [m]: the bottom where the model has none
_STEP = 0.25  # [m] between the points where the bottom is sounded
_PANORAMA_HEIGHT = 0.3  # [m] above the water
_BEYOND = 12.0  # [m]: past the edge of the field


def lake_of(
    model: Any, data: Any, canvas: Canvas, *, field: Mapping[str, Any], stones: list[int]
) -> Lake:
    """The light and the ground of a model.

    Args:
        model: compiled.
        data: of it, with its bodies placed.
        canvas: that draws it.
        field: settings of the water that is simulated, as a scene holds them.
        stones: bodies that move.
    """
    extent = 0.5 * max(field.get("shape", (500, 500))) * field.get("spacing", 0.02)
    reach = min(extent, 40.0) + _BEYOND
    middle = field.get("centre", (0.0, 0.0))
    start = np.array(middle) - reach
    count = math.ceil(2.0 * reach / _STEP) + 1
    return Lake(
        sun=_sun(model),
        sky=_sky(model),
        bottom=_soundings(model, data, start, count),
        place=np.array([*start, _STEP]),
        panorama=_panorama(model, data, canvas, (*middle, _PANORAMA_HEIGHT), stones),
    )


def _panorama(
    model: Any, data: Any, canvas: Canvas, place: tuple[float, float, float], stones: list[int]
) -> Panorama:
    """Four pictures to the sides, resampled to what `Panorama` holds."""

    def left_out(geom: int) -> bool:
        flat = int(model.geom_type[geom]) == mujoco.mjtGeom.mjGEOM_PLANE
        return flat or int(model.geom_bodyid[geom]) in stones

    if all(left_out(geom) for geom in range(model.ngeom)):
        return EMPTY
    rows, columns = 160, 2048
    low, high = -0.02, 0.6
    sharp = (np.arange(columns) + 0.5) / columns * 4.0 - 1.0
    folded = np.where(sharp <= 1.0, sharp, 2.0 - sharp)
    east = np.where(sharp <= 1.0, 1.0, -1.0) * (1.0 - np.abs(folded))
    scale = np.hypot(east, folded)
    across = np.column_stack([east, folded]) / scale[:, None]  # unit vectors round about
    tangents = low + (np.arange(rows) + 0.5) / rows * (high - low)
    colours = np.empty((rows, columns, 4), np.uint8)
    up = np.array([0.0, 0.0, 1.0])
    for k in range(4):
        forward = np.array(
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]][k]
        )
        eye = Eye(position=np.array(place), forward=forward, up=up, half_height=1.0, aspect=1.0)
        canvas.update(data, camera=0, without=left_out)
        canvas.look_through(eye)
        picture, distance = canvas.picture_and_distances(square=True)
        side = len(picture)
        ahead = across @ forward[:2]
        mine = np.flatnonzero(ahead >= np.abs(across @ eye.right[:2]))
        right = np.clip((0.5 + 0.5 * (across @ eye.right[:2]) / ahead)[mine] * side, 0, side - 1)
        above = np.clip((0.5 + 0.5 * np.outer(tangents, 1.0 / ahead[mine])) * side, 0, side - 1)
        i, j = above.astype(int), np.broadcast_to(right.astype(int), above.shape)
        colours[:, mine, :3] = picture[i, j]
        near = 250.0 * ahead[mine] / distance[i, j]
        colours[:, mine, 3] = np.clip(near, 0.0, 255.0)
    scenery = np.flatnonzero((colours[..., 3] > 0).any(axis=1))
    if len(scenery) == 0:
        return EMPTY
    # from afar things are lower than from near by: keep as much sky again above the highest
    top = min(2 * int(scenery[-1]) + 8, rows)
    return Panorama(
        colours=np.ascontiguousarray(colours[:top]),
        place=place,
        tangents=(low, low + (high - low) * top / rows),
    )


def ellipsoids_of(model: Any, data: Any, bodies: list[int]) -> list[Ellipsoid]:
    """The geoms of these bodies, each as an ellipsoid about as large."""
    found = []
    for geom in range(model.ngeom):
        if int(model.geom_bodyid[geom]) in bodies:
            found.append(
                Ellipsoid(
                    centre=data.geom_xpos[geom].copy(),
                    rotation=data.geom_xmat[geom].reshape(3, 3).copy(),
                    semi_axes=_semi_axes(model, geom),
                    colour=_colour(model, geom),
                )
            )
    return found


def _semi_axes(model: Any, geom: int) -> Array:
    # the box about a geom; for a mesh that of its vertices in the geom's frame
    half = model.geom_aabb[geom][3:]
    return np.asarray(np.maximum(half, 1e-3), np.float64)


def _colour(model: Any, geom: int) -> Array:
    material = int(model.geom_matid[geom])
    if material < 0:
        return np.array(model.geom_rgba[geom][:3], np.float64)
    colour = np.array(model.mat_rgba[material][:3], np.float64)
    for texture in model.mat_texid[material]:
        if texture >= 0:
            return np.asarray(colour * _texels(model, int(texture)).mean(axis=(0, 1)))
    return colour


def _texels(model: Any, texture: int) -> Array:
    """Colours (height, width, 3) of a texture, 0 to 1."""
    high, wide = int(model.tex_height[texture]), int(model.tex_width[texture])
    channels = int(model.tex_nchannel[texture])
    first = int(model.tex_adr[texture])
    raw = model.tex_data[first : first + high * wide * channels]
    return np.asarray(raw.reshape(high, wide, channels)[..., :3] / 255.0)


def _sun(model: Any) -> Array:
    """Towards the brightest directional light; ahead on the left if there is none."""
    best, sun = 0.0, np.array([0.579, 0.644, 0.5])
    for light in range(model.nlight):
        strength = float(np.sum(model.light_diffuse[light]))
        toward = -np.asarray(model.light_dir[light], np.float64)
        if strength > best and toward[2] > 0.05:
            best, sun = strength, toward
    return np.asarray(sun / np.linalg.norm(sun))


def _sky(model: Any, steps: int = 64) -> Array:
    """Colours (steps, 3) of the skybox by the vertical part of the direction, 0 to 1."""
    heights = np.linspace(0.0, 1.0, steps)
    for texture in range(model.ntex):
        if int(model.tex_type[texture]) != mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            continue
        texels = _texels(model, texture)
        side = texels.shape[1]
        if texels.shape[0] != 6 * side:
            break
        # faces: right, left, up, down, front, back; a direction at 45 degrees is on an edge
        up, front = texels[2 * side : 3 * side], texels[4 * side : 5 * side]
        colours = []
        for z in heights:
            level = math.sqrt(1.0 - z * z)
            low = z <= level
            share = 0.5 * (1.0 - (z / level if low else level / z))
            row = min(int(share * side), side - 1)
            colours.append(front[row, side // 2] if low else up[side - 1 - row, side // 2])
        return np.array(colours)
    return np.asarray(
        np.outer(1.0 - heights, [0.8, 0.87, 0.93]) + np.outer(heights, [0.30, 0.52, 0.82])
    )


def _soundings(model: Any, data: Any, start: Array, count: int) -> npt.NDArray[np.float32]:
    """Heights (count, count) of what stands still, seen from above the water [m]."""
    free = set(free_bodies(model))
    groups = np.array(
        [
            any(
                model.geom_group[g] == k and int(model.geom_bodyid[g]) not in free
                for g in range(model.ngeom)
            )
            for k in range(6)
        ],
        dtype=np.uint8,
    )
    hidden = [g for g in range(model.ngeom) if int(model.geom_bodyid[g]) in free]
    kept = model.geom_rgba[hidden].copy(), model.geom_matid[hidden].copy()
    heights = np.empty((count, count), np.float32)
    at, down, hit = np.zeros(3), np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    at[2] = 50.0
    model.geom_matid[hidden] = -1
    model.geom_rgba[hidden, 3] = 0.0  # rays pass what cannot be seen
    try:
        for i in range(count):
            for j in range(count):
                at[0], at[1] = start[0] + i * _STEP, start[1] + j * _STEP
                length = mujoco.mj_ray(model, data, at, down, groups, 1, -1, hit)
                heights[i, j] = 50.0 - length if length >= 0.0 else _DEEP
    finally:
        model.geom_rgba[hidden], model.geom_matid[hidden] = kept
    return np.maximum(heights, _DEEP)
