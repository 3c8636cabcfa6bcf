"""Bodies and geoms of a compiled MuJoCo model: names, trees, and geoms as closed surfaces.

A model is a `mujoco.MjModel`, or a `ModelView` of one that compiled code was handed.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mjskip._typing import Array
from mjskip.checks import as_number, fault
from mjskip.errors import MeshError, SceneError
from mjskip.hydro import primitives
from mjskip.rigid.attitude import matrices

FINE = 64
"""Segments around a round geom where the shape counts more than the time: land."""

GEOMS = mujoco.mjtGeom
SOLIDS = {
    int(kind)
    for kind in (
        GEOMS.mjGEOM_MESH,
        GEOMS.mjGEOM_BOX,
        GEOMS.mjGEOM_SPHERE,
        GEOMS.mjGEOM_ELLIPSOID,
        GEOMS.mjGEOM_CYLINDER,
        GEOMS.mjGEOM_CAPSULE,
    )
}
"""Kinds that displace water; planes, height fields and signed distance fields are none."""


def body_name(model: Any, body: int) -> str:
    """Name of a body, or its number if it has none."""
    return str(model.body(body).name) or f"body {body}"


def geom_name(model: Any, geom: int) -> str:
    """Name of a geom, or its number if it has none."""
    return str(model.geom(geom).name) or f"geom {geom}"


def free_bodies(model: Any) -> list[int]:
    """Ids of the bodies with a free joint."""
    free = np.asarray(model.jnt_type) == int(mujoco.mjtJoint.mjJNT_FREE)
    return [int(body) for body in np.asarray(model.jnt_bodyid)[free]]


def find_body(model: mujoco.MjModel, name: str) -> int:
    """Id of the body of this name.

    Raises:
        SceneError: there is none; the text lists the free bodies there are.
    """
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if body <= 0:
        has = ", ".join(body_name(model, b) for b in free_bodies(model)) or "none"
        raise SceneError(f"no body named {name!r}: the free bodies of this scene are: {has}")
    return int(body)


def body_id(model: mujoco.MjModel, body: str | int) -> int:
    """Id of a body that is given by its name or by its id.

    Raises:
        ValueError: it is neither.
        SceneError: there is no such body that can move.
    """
    if isinstance(body, str):
        return find_body(model, body)
    number = as_number(body)
    if number is None or number != number // 1.0:
        raise fault("body", body, "give the name or the id of a body")
    if not 0 < number < model.nbody:
        raise SceneError(f"no body {body!r}: ids of bodies go from 1 to {model.nbody - 1}")
    return int(number)


def posed(model: mujoco.MjModel, data: mujoco.MjData | None) -> mujoco.MjData:
    """New data of a model in the pose of some, or in `qpos0`, with the places of bodies worked out."""
    own = mujoco.MjData(model)
    if data is not None:
        own.qpos[:] = data.qpos
    mujoco.mj_kinematics(model, own)
    mujoco.mj_comPos(model, own)
    return own


def body_geoms(model: Any, body: int) -> range:
    """Ids of a body's geoms."""
    first = int(model.body_geomadr[body])
    return range(first, first + int(model.body_geomnum[body])) if first >= 0 else range(0)


def kind_name(model: Any, geom: int) -> str:
    """What MJCF calls a geom's type."""
    return str(GEOMS(int(model.geom_type[geom])).name).removeprefix("mjGEOM_").lower()


def pose_in(model: Any, body: int, above: int) -> tuple[Array, Array]:
    """Position (3,) and rotation (3, 3) of a body in one above it that it is welded to."""
    position, rotation = np.zeros(3), np.eye(3)
    while body != above:
        turn = matrices(np.asarray(model.body_quat[body], np.float64))
        position = np.asarray(model.body_pos[body], np.float64) + turn @ position
        rotation = turn @ rotation
        body = int(model.body_parentid[body])
    return position, rotation


def geom_solid(
    model: Any,
    geom: int,
    *,
    resolution: int = primitives.RESOLUTION,
    strict: bool = False,
    deck: bool = False,
) -> Any:
    """A geom's closed surface in its own frame, with the geom's volume.

    Args:
        model: compiled model.
        geom: its id.
        resolution: segments around a circle.
        strict: refuse an open mesh; otherwise its convex hull is taken, with a warning.
        deck: close an open mesh across its edges, where that closes it.

    Raises:
        SceneError: the geom is no solid.
        MeshError: a mesh has no volume, or it is open (strict).
    """
    kind = GEOMS(int(model.geom_type[geom]))
    size = np.asarray(model.geom_size[geom], np.float64)
    match kind:
        case GEOMS.mjGEOM_MESH:
            return mesh_solid(model, geom, strict=strict, deck=deck)
        case GEOMS.mjGEOM_BOX:
            return primitives.box(size)
        case GEOMS.mjGEOM_SPHERE:
            return primitives.ellipsoid([size[0]] * 3, resolution)
        case GEOMS.mjGEOM_ELLIPSOID:
            return primitives.ellipsoid(size, resolution)
        case GEOMS.mjGEOM_CYLINDER:
            return primitives.cylinder(size[0], size[1], resolution)
        case GEOMS.mjGEOM_CAPSULE:
            return primitives.capsule(size[0], size[1], resolution)
        case _:
            raise SceneError(f"{label(model, geom)} is a {kind_name(model, geom)}: {NOT_SOLID}")


NOT_SOLID = (
    "water acts on meshes, boxes, spheres, ellipsoids, cylinders and capsules; name the other geoms "
    "with geoms="
)


def label(model: Any, geom: int) -> str:
    """How a message names a geom."""
    name = str(model.geom(geom).name)
    body = body_name(model, int(model.geom_bodyid[geom]))
    return f"geom {name or int(geom)!r} of body {body!r}"


def mesh_of(model: Any, geom: int) -> Any:
    """The mesh of a mesh geom as it was compiled, geom frame."""
    import trimesh

    data = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[data]), int(model.mesh_vertnum[data])
    vertices = np.array(model.mesh_vert[first : first + count], dtype=np.float64)
    first, count = int(model.mesh_faceadr[data]), int(model.mesh_facenum[data])
    return trimesh.Trimesh(vertices, model.mesh_face[first : first + count], process=False)


def mesh_solid(model: Any, geom: int, *, strict: bool, deck: bool = False) -> Any:
    """The closed surface of a mesh geom; triangles that face inwards are turned."""
    from mjskip.hydro.solids import capped, closed_mesh

    mesh = mesh_of(model, geom)
    if deck:
        mesh = capped(mesh)
    try:
        try:
            return closed_mesh(mesh)
        except MeshError:
            return closed_mesh(mesh, fix_normals=True, strict=strict, what=label(model, geom))
    except MeshError as error:
        raise MeshError(f"{label(model, geom)}: {error}") from error
