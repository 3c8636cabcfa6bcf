"""Land in the water: where the geoms of a model's fixed bodies pierce the surface z = 0."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Flags
from mjskip.coupling.bodies import FINE, SOLIDS, geom_solid

RAY_OFFSET = 1e-9
"""The lines of cells are looked at this far aside [m], or one that meets a corner exactly may count it
in both of its sides or in neither, as they are rounded."""


class ModelTerrain:
    """Where fixed geoms cut the surface z = 0: call it with the positions of cells, as `HeightField(terrain_mask=)` does.

    Fixed are the geoms of the world and of bodies welded to it.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Cut the geoms of a compiled model."""
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._sections = []
        for geom in range(model.ngeom):
            fixed = model.body_weldid[model.geom_bodyid[geom]] == 0
            if fixed and int(model.geom_type[geom]) in SOLIDS:
                solid = geom_solid(model, geom, resolution=FINE)
                turn = data.geom_xmat[geom].reshape(3, 3)
                world = np.asarray(solid.vertices) @ turn.T + data.geom_xpos[geom]
                self._sections.append(_section(world[solid.faces]))

    def __call__(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Flags:
        """Whether cells at x (nx,) and y (ny,) [m] are land: (nx, ny)."""
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        land = np.zeros((len(x), len(y)), np.bool_)
        for sides in self._sections:
            land |= _covered(sides, x, y)
        return land


def _section(triangles: Array) -> Array:
    """Sides (n, 2, 2) of the section of a surface (m, 3, 3) with z = 0."""
    import trimesh

    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles), process=False)
    sides = trimesh.intersections.mesh_plane(mesh, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0])
    return np.asarray(sides, np.float64).reshape(-1, 2, 3)[:, :, :2]


def _covered(sides: Array, x: Array, y: Array) -> Flags:
    """Points of a grid inside a section: an odd number of its sides lies to the east."""
    inside = np.zeros((len(x), len(y)), np.bool_)
    y = y + RAY_OFFSET
    for (x0, y0), (x1, y1) in sides:
        spans = (y0 <= y) != (y1 <= y)
        if spans.any():
            at = x0 + (y[spans] - y0) / (y1 - y0) * (x1 - x0)
            inside[:, spans] ^= x[:, None] < at[None, :]
    return inside
