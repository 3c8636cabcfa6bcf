"""Land in the water: where the geoms of a model's fixed bodies pierce the surface z = 0."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt
import trimesh

from mjskip.coupling.bodies import geom_solid

Array = npt.NDArray[np.float64]

SOLIDS = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("MESH", "BOX", "SPHERE", "ELLIPSOID", "CYLINDER", "CAPSULE")
}
"""Kinds that can be islands and piers; planes, such as a lake's bottom, are none."""

A_HAIR = 1e-9
"""The lines of cells are looked at this far aside [m], or one that meets a corner exactly may count it
in both of its sides or in neither, as they are rounded."""


def land_of(model: mujoco.MjModel, x: npt.ArrayLike, y: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Cells whose centre lies in the section of a fixed geom with the surface, for `HeightField(land=)`.

    Fixed are the geoms of the world and of bodies welded to it.

    Args:
        model: compiled model.
        x, y: (nx,) and (ny,) positions of the cells [m].

    Returns:
        (nx, ny), True on land.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    land = np.zeros((len(x), len(y)), np.bool_)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in range(model.ngeom):
        fixed = model.body_weldid[model.geom_bodyid[geom]] == 0
        if fixed and int(model.geom_type[geom]) in SOLIDS:
            solid = geom_solid(model, geom)
            turn = data.geom_xmat[geom].reshape(3, 3)
            world = np.asarray(solid.vertices) @ turn.T + data.geom_xpos[geom]
            land |= _covered(trimesh.Trimesh(world, solid.faces, process=False), x, y)
    return land


def _covered(mesh: trimesh.Trimesh, x: Array, y: Array) -> npt.NDArray[np.bool_]:
    """Points of a grid inside the section of a mesh with z = 0: an odd number of its sides lies to the east."""
    inside = np.zeros((len(x), len(y)), np.bool_)
    y = y + A_HAIR
    sides = trimesh.intersections.mesh_plane(mesh, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0])[:, :, :2]
    for (x0, y0), (x1, y1) in sides:
        spans = (y0 <= y) != (y1 <= y)
        at = x0 + (y[spans] - y0) / (y1 - y0) * (x1 - x0)
        inside[:, spans] ^= x[:, None] < at[None, :]
    return inside
