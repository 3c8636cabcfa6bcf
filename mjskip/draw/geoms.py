"""What a model says about light and about its geoms, in the arrays that drawing water needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags
from mjskip.draw.passes import MAX_BODIES

Indices = npt.NDArray[np.intp]

CLEAR_OF_WATER = 0.3
"""[m]: a camera so high is above the water, and a geom so deep is under it."""

_SUN = (-0.579, -0.644, -0.5)  # the way its light goes where the model has no directional light
_DRAWN = 3  # geom groups below this are drawn unless an option says otherwise


@dataclass(frozen=True, kw_only=True, eq=False)
class StaticGeoms:
    """What stands still.

    Attributes:
        sunk: geoms wholly under water, by id.
        boxes: about geoms that reach out of it, (n, 4): least and greatest x, least and greatest y [m].
        low: least x, y and z of all geoms that are not wholly under water (n, 3) [m].
        high: greatest (n, 3) [m].
    """

    sunk: frozenset[int]
    boxes: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, model: Any) -> StaticGeoms:
        """Of a model, in its first pose."""
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        low, high = outlines(model, data, np.arange(model.ngeom))
        still = ~_moves(model)[model.geom_bodyid] & (model.geom_group < _DRAWN)
        below = still & (high[:, 2] < -CLEAR_OF_WATER)
        still &= ~below
        pierce = still & (low[:, 2] < 0.05)
        return cls(
            sunk=frozenset(np.flatnonzero(below).tolist()),
            boxes=np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)[pierce],
            low=low[still],
            high=high[still],
        )


def outlines(model: Any, data: Any, geoms: Indices) -> tuple[Array, Array]:
    """Least and greatest x, y and z (n, 3) of geoms [m]; planes have no end."""
    axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
    middle = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", axes, model.geom_aabb[geoms, :3])
    half = np.einsum("nij,nj->ni", np.abs(axes), model.geom_aabb[geoms, 3:])
    endless = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_PLANE
    half[endless] = 1e4
    half[endless & (np.abs(axes[:, 2, 2]) > 1.0 - 1e-6), 2] = 0.0
    return middle - half, middle + half


def _moves(model: Any) -> Flags:
    """Which bodies can move against the world, in the order of their ids."""
    return np.asarray((model.body_weldid != 0) | (model.body_mocapid >= 0))


def moving_geoms(model: Any) -> Indices:
    """Geoms of bodies that move."""
    moving = _moves(model)[model.geom_bodyid] & (model.geom_rbound > 0.0)
    return np.flatnonzero(moving & (model.geom_group < _DRAWN))


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """Geoms that move, each as an ellipsoid about as large: the largest, if there are too many."""

    model: Any
    geoms: Indices
    colours: Array

    @classmethod
    def of(cls, model: Any, geoms: Indices) -> Ellipsoids:
        """Of these geoms of a model."""
        if len(geoms) > MAX_BODIES:
            geoms = geoms[np.argsort(-model.geom_rbound[geoms], kind="stable")[:MAX_BODIES]]
        colours = np.array([_colour(model, int(geom)) for geom in geoms]).reshape(-1, 3)
        return cls(model, geoms, colours)

    def rows(self, data: Any) -> Array:
        """As (n, 16): centre, reach; rows of the matrix that makes it a unit sphere, and colour."""
        model, geoms = self.model, self.geoms
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        half = np.maximum(model.geom_aabb[geoms, 3:], 1e-3)
        rows = np.empty((len(geoms), 4, 4))
        rows[:, 0, :3] = data.geom_xpos[geoms]
        rows[:, 0, :3] += np.einsum("nij,nj->ni", axes, model.geom_aabb[geoms, :3])
        rows[:, 0, 3] = model.geom_rbound[geoms]
        rows[:, 1:, :3] = (axes / half[:, None, :]).transpose(0, 2, 1)
        rows[:, 1:, 3] = self.colours
        # what is far above the water or deep below is neither mirrored nor seen
        near = np.abs(rows[:, 0, 2]) - rows[:, 0, 3] < 10.0
        return rows[near].reshape(-1, 16)


def sun_of(model: Any) -> tuple[Array, Array]:
    """Towards the brightest directional light, and its colour; ahead on the left if there is none."""
    best, way, colour = 0.0, np.array(_SUN), np.array([1.0, 0.95, 0.84])
    for light in range(model.nlight):
        if model.light_type[light] != mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
            continue
        strength = float(np.sum(model.light_diffuse[light]))
        if strength > best and model.light_dir[light][2] < -0.05:
            best, way = strength, np.array(model.light_dir[light], np.float64)
            colour = model.light_diffuse[light] / max(model.light_diffuse[light])
    return -way / np.linalg.norm(way), colour


def _colour(model: Any, geom: int) -> Array:
    """Of a geom, the mean of its texture."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return np.asarray(model.geom_rgba[geom][:3], np.float64)
    colour = np.asarray(model.mat_rgba[material][:3], np.float64)
    texture = int(model.mat_texid[material][int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    if texture < 0:
        return colour
    channels, first = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    count = int(model.tex_height[texture]) * int(model.tex_width[texture]) * channels
    texels = model.tex_data[first : first + count].reshape(-1, channels)
    return np.asarray(colour * texels[:: max(1, len(texels) // 1000), :3].mean(axis=0) / 255.0)
