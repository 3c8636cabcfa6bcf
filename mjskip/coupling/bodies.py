"""Bodies of a compiled MuJoCo model as stones: their geoms as one closed triangle mesh."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt
import trimesh

from mjskip.errors import MeshError, SceneError
from mjskip.hydro.stone import Stone, closed_mesh
from mjskip.rigid.attitude import matrices

Array = npt.NDArray[np.float64]

ROUND_SECTIONS = 64
"""Segments around a tessellated cylinder or capsule."""


def body_stone(model: mujoco.MjModel, body: int, *, geoms: Sequence[str] | None = None) -> Stone:
    """The stone that a body is: MuJoCo's mass and inertia, and the surface of its geoms.

    Args:
        model: compiled model.
        body: its id.
        geoms: names of the geoms that water touches; all of the body's if None.

    Raises:
        SceneError: the body has no geom, or one that is no solid.
        MeshError: a mesh geom is not closed.
    """
    first, count = model.body_geomadr[body], model.body_geomnum[body]
    chosen = [
        g for g in range(first, first + count) if geoms is None or model.geom(g).name in geoms
    ]
    name = body_name(model, body)
    if not chosen:
        has = (
            ", ".join(model.geom(g).name or f"geom {g}" for g in range(first, first + count))
            or "none"
        )
        raise SceneError(
            f"body {name!r} has no geom for water to act on: choose from its geoms ({has})"
        )
    if not model.body_mass[body] > 0.0:
        raise SceneError(f"body {name!r} has no mass: give its geoms a density or a mass")
    vertices: list[Array] = []
    faces: list[npt.NDArray[np.int32]] = []
    for geom in chosen:
        mesh = geom_solid(model, geom)
        turn = matrices(model.geom_quat[geom])
        faces.append(np.asarray(mesh.faces, dtype=np.int32) + sum(map(len, vertices)))
        vertices.append(np.asarray(mesh.vertices) @ turn.T + model.geom_pos[geom])
    axes = matrices(model.body_iquat[body])
    return Stone.of_parts(
        vertices=np.vstack(vertices),
        faces=np.vstack(faces),
        mass=float(model.body_mass[body]),
        centre=np.array(model.body_ipos[body]),
        inertia=axes @ np.diag(model.body_inertia[body]) @ axes.T,
    )


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body, or its number if it has none."""
    return model.body(body).name or f"body {body}"


def free_bodies(model: mujoco.MjModel) -> list[int]:
    """Ids of the bodies with a free joint."""
    free = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
    return [int(body) for body in model.jnt_bodyid[free]]


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


def geom_solid(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh:
    """A geom's surface in its own frame. Round primitives keep their volume: meshes inscribed in them
    are scaled up a little (the sphere's by 0.3%)."""
    kind = mujoco.mjtGeom(model.geom_type[geom])
    size = model.geom_size[geom]
    label = f"geom {model.geom(geom).name or geom!r} of body {body_name(model, model.geom_bodyid[geom])!r}"
    match kind:
        case mujoco.mjtGeom.mjGEOM_MESH:
            return _mesh_geom(model, geom, label)
        case mujoco.mjtGeom.mjGEOM_BOX:
            return trimesh.creation.box(extents=2.0 * size)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return _keep_volume(
                trimesh.creation.icosphere(3), np.full(3, size[0]), 4.0 / 3.0 * np.pi
            )
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return _keep_volume(trimesh.creation.icosphere(3), size, 4.0 / 3.0 * np.pi)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            prism = trimesh.creation.cylinder(1.0, height=2.0, sections=ROUND_SECTIONS)
            grow = np.sqrt(2.0 * np.pi / prism.volume)
            prism.apply_scale([grow * size[0], grow * size[0], size[1]])
            return prism
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            mesh = trimesh.creation.capsule(
                radius=size[0], height=2.0 * size[1], count=[ROUND_SECTIONS, ROUND_SECTIONS // 2]
            )
            mesh.apply_translation(-mesh.bounds.mean(axis=0))
            volume = np.pi * size[0] ** 2 * (2.0 * size[1] + 4.0 / 3.0 * size[0])
            return _keep_volume(mesh, np.ones(3), volume)
        case _:
            raise SceneError(
                f"{label} is a {kind.name.removeprefix('mjGEOM_').lower()}: water acts on meshes, boxes, "
                "spheres, ellipsoids, cylinders and capsules; name the other geoms with geoms="
            )


def _keep_volume(unit: trimesh.Trimesh, size: Array, volume: float) -> trimesh.Trimesh:
    unit.apply_scale((volume / unit.volume) ** (1.0 / 3.0) * size)
    return unit


def _mesh_geom(model: mujoco.MjModel, geom: int, label: str) -> trimesh.Trimesh:
    data = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[data], model.mesh_vertnum[data]
    vertices = np.array(model.mesh_vert[first : first + count], dtype=np.float64)
    first, count = model.mesh_faceadr[data], model.mesh_facenum[data]
    try:
        return closed_mesh(
            trimesh.Trimesh(vertices, model.mesh_face[first : first + count], process=False)
        )
    except MeshError as error:
        raise MeshError(f"{label}: {error}") from error
