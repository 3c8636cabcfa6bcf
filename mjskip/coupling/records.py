"""Records of wet bodies for compiled code, and what must be said about a model before it is put into water."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.coupling import _record_kernels as kernels
from mjskip.coupling.bodies import body_geoms, body_name, label, mesh_of
from mjskip.coupling.wet import BuiltHull, Inertia
from mjskip.errors import MeshError
from mjskip.hydro.hull import Hull
from mjskip.hydro.laws import LAWS
from mjskip.hydro.water import Water

LIGHTER = 1e-3
"""Share of its weight by which a body must be lighter than water to be said to be."""

MASS_OFF = 0.02
"""Relative error of a mesh's mass from which there is a warning."""


def make_record(hull: Hull, water: Water, inertia: Inertia, block: Array) -> Array:
    """The record by which `_record_kernels` knows a wet body; the block must stay alive with it."""
    record = np.zeros(kernels.RECORD)
    record[kernels.BLOCK] = np.array([block.ctypes.data], np.int64).view(np.float64)[0]
    record[kernels.CENTRE : kernels.CENTRE + 3] = inertia.centre
    normals = hull.area_vectors / np.linalg.norm(hull.area_vectors, axis=1)[:, None]
    arms = np.cross(hull.triangles, normals[:, None, :])
    inverse: Array = np.eye(3)
    if inertia.mass > 0.0 and np.linalg.eigvalsh(inertia.tensor)[0] > 0.0:
        inverse = np.asarray(np.linalg.inv(inertia.tensor))
        record[kernels.INVERSE_MASS] = 1.0 / inertia.mass
        record[kernels.MEAN_INVERSE_INERTIA] = np.trace(inverse) / 3.0
        record[kernels.INVERSE_INERTIA : kernels.INVERSE_INERTIA + 9] = inverse.ravel()
    record[kernels.ARM_MOBILITY] = np.einsum("nki,ij,nkj->nk", arms, inverse, arms).max()
    law = LAWS[water.law]
    coefficient = law.normal_squared + law.speed_normal + law.speed_squared + law.friction
    coefficient += 0.25 * math.pi * law.cavity  # its slope where V.n is small
    turning = np.linalg.norm(hull.area_vectors, axis=1) @ np.linalg.norm(arms, axis=2).max(axis=1)
    record[kernels.MOVING_DRAG] = 0.5 * water.density * coefficient * hull.area
    record[kernels.TURNING_DRAG] = water.density * coefficient * turning
    record[kernels.AIR_DRAG] = water.air_density * hull.disc_area
    record[kernels.REACH] = hull.radius
    record[kernels.BEARING] = water.density if water.buoyancy else 0.0
    lifts = law.speed_squared != 0.0 or law.friction != 0.0
    record[kernels.DISSIPATES] = water.gate == "local" and not lifts
    record[kernels.NEEDED_STEP] = math.inf
    return record


def too_large_step(name: str, timestep: float, needed: float, when: float | None = None) -> str:
    """What to say about a time step that drag forbids."""
    at = "" if when is None else f" at t = {when:.4g} s"
    return (
        f"time step {timestep:g} s is too large for body {name!r}: the drag of one step{at} would have turned its "
        f"motion round, and was limited; use a time step of at most {_floor_two_digits(needed):g} s"
    )


def _floor_two_digits(value: float) -> float:
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / step * (1.0 + 1e-12)) * step:.3g}")


def physical_warnings(
    model: Any,
    water: Water,
    wet: Iterable[tuple[int, tuple[int, ...], BuiltHull]],
    *,
    medium: tuple[float, float] | None = None,
    gravity: Any = None,
) -> list[str]:
    """What is physically doubtful about a model in water, a sentence each.

    Args:
        model: compiled model.
        water: the fluid.
        wet: body, bodies welded together, and hull, of every wet body.
        medium: density and viscosity of MuJoCo's own medium; the model's if None.
        gravity: (3,) [m/s^2]; the model's if None.
    """
    found = gravity_warnings(model.opt.gravity if gravity is None else gravity)
    density, viscosity = medium or (float(model.opt.density), float(model.opt.viscosity))
    if density > 0.0 or viscosity > 0.0:
        found.append(
            f'MuJoCo\'s own medium (<option density="{density:g}" viscosity="{viscosity:g}"/>) acts on these bodies '
            f"beside water of {water.density:g} kg/m^3: set both to 0"
        )
    trees: dict[int, float] = {}
    for body, members, built in wet:
        root = int(model.body_rootid[body])
        trees[root] = trees.get(root, 0.0) + (built.hull.volume if built.hull else 0.0)
        found += _mass_warnings(model, members)
    for root, volume in trees.items():
        mass = float(np.asarray(model.body_mass)[np.asarray(model.body_rootid) == root].sum())
        if not water.buoyancy and mass < (1.0 - LIGHTER) * water.density * volume:
            found.append(
                f"body {body_name(model, root)!r} of {mass:.4g} kg displaces {water.density * volume:.4g} kg of water but "
                "sinks, because this water does not bear: use Water.floating(), or buoyancy=True"
            )
    return found


def gravity_warnings(gravity: Any) -> list[str]:
    """What to say if still water cannot lie level under this gravity (3,) [m/s^2]."""
    x, y, z = (float(g) for g in gravity)
    if math.hypot(x, y) <= 1e-9 * abs(z) and z <= 0.0:
        return []
    return [
        f"gravity is ({x:g}, {y:g}, {z:g}) m/s^2, and the water lies level at z = 0: only gravity along -z holds it "
        "there, and what floats is borne by the part along z alone; turn the model instead"
    ]


def _mass_warnings(model: Any, members: tuple[int, ...]) -> list[str]:
    """Bodies of one mesh whose mass MuJoCo has from a volume that is not the mesh's."""
    found = []
    for body in members:
        geoms = list(body_geoms(model, body))
        mass = float(model.body_mass[body])
        if len(geoms) != 1 or int(model.geom_dataid[geoms[0]]) < 0 or not mass > 0.0:
            continue
        mesh = mesh_of(model, geoms[0])
        wrong = _wrong_volume(
            np.asarray(mesh.vertices).tobytes(),
            np.asarray(mesh.faces).tobytes(),
            tuple(float(moment) / mass for moment in model.body_inertia[body]),
        )
        if wrong is not None:
            kind, volume, exact = wrong
            found.append(
                f"{label(model, geoms[0])} has the mass of its {kind} volume, {volume:.4g} m^3, but displaces "
                f'{exact:.4g} m^3: say inertia="exact" in its <mesh>'
            )
    return found


@lru_cache(maxsize=256)
def _wrong_volume(
    vertices: bytes, faces: bytes, moments: tuple[float, ...]
) -> tuple[str, float, float] | None:
    """Kind and size of the volume that gave a mesh its inertia, and its own, if these differ."""
    import trimesh

    from mjskip.hydro.solids import closed_mesh

    mesh = trimesh.Trimesh(
        np.frombuffer(vertices).reshape(-1, 3),
        np.frombuffer(faces, np.int64).reshape(-1, 3),
        process=False,
    )
    try:
        solid = closed_mesh(mesh)
    except MeshError:
        return None
    exact = float(solid.volume)
    for kind, (volume, own) in _mujoco_volumes(solid).items():
        taken = np.allclose(np.sort(moments), np.sort(own), rtol=1e-3)
        if taken and abs(volume / exact - 1.0) > MASS_OFF:
            return kind, volume, exact
    return None


def _mujoco_volumes(mesh: Any) -> dict[str, tuple[float, Array]]:
    """Volumes that MuJoCo takes for a mesh's mass, and the moments of inertia [m^2] that go with them."""
    hull = mesh.convex_hull
    found = {"convex": (float(hull.volume), _moments(np.asarray(hull.triangles), None))}
    triangles = np.asarray(mesh.triangles)
    areas = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    middle = areas @ triangles.mean(axis=1) / areas.sum()
    corners = triangles - middle
    volume = float(
        np.abs(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))).sum()
        / 6.0
    )
    found["legacy"] = (volume, _moments(triangles, middle))
    return found


def _moments(triangles: Array, middle: Array | None) -> Array:
    """Principal moments over mass of the tetrahedra over triangles; their volumes unsigned about a middle."""
    corners = triangles - (triangles.mean(axis=(0, 1)) if middle is None else middle)
    a, b, c = np.moveaxis(corners, 1, 0)
    parts = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
    if middle is not None:
        parts = np.abs(parts)
    centre = parts @ (a + b + c) / (4.0 * parts.sum())
    a, b, c, o = a - centre, b - centre, c - centre, -centre
    total = a + b + c + o
    second = sum(
        np.einsum("n,ni,nj->ij", parts, p, q)
        for p, q in ((a, a), (b, b), (c, c), (np.broadcast_to(o, a.shape),) * 2, (total, total))
    ) / (20.0 * parts.sum())
    return np.asarray(np.linalg.eigvalsh(np.trace(second) * np.eye(3) - second))
