"""Forces of water and air on a stone in a given pose and motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import F8P, address_of_cfunc
from mjskip.hydro import _block as layout
from mjskip.hydro import _wrench_kernels as kernels
from mjskip.hydro.columns import LOAD, load_columns
from mjskip.hydro.laws import LAWS
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.rigid.attitude import matrices
from mjskip.rigid.state import pack_states

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Wrench:
    """Forces on a stone, torques about its centre of mass, in the world frame.

    Attributes:
        force: of the water (3,) [N].
        torque: of the water (3,) [N m].
        air_force: of the air (3,) [N].
        air_torque: of the air (3,) [N m].
        wetted_area: immersed area of the surface, loaded or not [m^2].
        wetted_centre: centroid of that surface (3,) [m]; the centre of mass when dry.
        clearance: height of the lowest point above still water [m]; negative when wet.
    """

    force: Array
    torque: Array
    air_force: Array
    air_torque: Array
    wetted_area: float
    wetted_centre: Array
    clearance: float


def wrench(
    stone: Stone,
    water: Water | None = None,
    *,
    position: npt.ArrayLike,
    q: npt.ArrayLike = (1.0, 0.0, 0.0, 0.0),
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    omega: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Wrench:
    """Force and torque of still water (z = 0) and of air on a stone at one moment.

    Args:
        stone: the body.
        water: the fluid; `Water()` if omitted.
        position: of the centre of mass, world (3,) [m].
        q: orientation (4,), w-x-y-z, body to world; any length but zero.
        velocity: of the centre of mass, world (3,) [m/s].
        omega: angular velocity, world (3,) [rad/s].

    Returns:
        The wrench. Equations (1)-(4) of Lee & Baek (2010), or the law that `water` names.

    Raises:
        ValueError: an argument has the wrong shape or is not finite, or q is zero.
    """
    x, v, w = (
        _vector(n, a, 3)
        for n, a in (("position", position), ("velocity", velocity), ("omega", omega))
    )
    q = _vector("q", q, 4)
    if not np.linalg.norm(q) > 0.0:
        raise ValueError("q is zero: give a quaternion (w, x, y, z) of any length but zero")
    states = pack_states(x[None], matrices(q)[None], v[None], w[None])
    return wrench_of(pack(stone, water or Water()), states)


def wrench_of(block: Array, states: Array) -> Wrench:
    """The same for a packed stone and the first of its packed states."""
    row = load_columns(wrench_and_immersion(block, states[:1])[0])._asdict()
    row |= {"wetted_area": float(row["wetted_area"]), "clearance": float(row["clearance"])}
    return Wrench(**row)


def pack(stone: Stone, water: Water, *, gravity: float = 9.81) -> Array:
    """The block of doubles that the kernels know a stone in its water by; gravity [m/s^2] for buoyancy."""
    law = LAWS[water.law]
    header = np.zeros(layout.HEADER)
    header[layout.RADIUS] = stone.radius
    header[layout.LOCAL_GATE] = water.gate == "local"
    header[layout.NORMAL_SQUARED] = water.density * law.normal_squared
    header[layout.SPEED_NORMAL] = water.density * law.speed_normal
    header[layout.SPEED_SQUARED] = water.density * law.speed_squared
    header[layout.FRICTION] = water.density * law.friction
    header[layout.FORWARD] = law.forward
    header[layout.WEIGHT_DENSITY] = water.density * gravity if water.buoyancy else 0.0
    header[layout.SKIN_DENSITY] = water.density if water.skin_friction else 0.0
    header[layout.VISCOSITY] = water.viscosity
    header[layout.LENGTH] = 2.0 * np.sqrt(stone.disc_area / np.pi)
    header[layout.AIR_DENSITY] = water.air_density
    header[layout.DISC_AREA] = stone.disc_area
    header[layout.DISC_NORMAL : layout.DISC_NORMAL + 3] = stone.disc_normal
    header[layout.DISC_CENTRE : layout.DISC_CENTRE + 3] = stone.disc_centre
    return block_of(header, stone.triangles)


def block_of(header: Array, triangles: Array) -> Array:
    """A block with this header (of any block) and these triangles (n, 3, 3), counter-clockwise from outside."""
    triangles = triangles[_by_place(triangles.mean(axis=1))]
    a, b, c = np.moveaxis(triangles, 1, 0)
    vectors = 0.5 * np.cross(b - a, c - a)
    areas = np.linalg.norm(vectors, axis=1)
    volumes = np.linalg.det(triangles) / 6.0
    n = len(triangles)
    fill = (layout.WIDTH - n) % (2 * layout.WIDTH)
    header = header[: layout.HEADER].copy()
    header[layout.N_FACES], header[layout.STRIDE] = n, n + fill
    header[layout.VOLUME] = volumes.sum()
    centre = volumes @ triangles.sum(axis=1) / (4.0 * volumes.sum())
    header[layout.VOLUME_CENTRE : layout.VOLUME_CENTRE + 3] = centre
    normals, centroids = vectors / areas[:, None], triangles.mean(axis=1)
    columns = np.column_stack(
        [triangles.reshape(-1, 9), areas, normals, centroids, np.cross(centroids, normals)]
    )
    last = np.zeros((fill, layout.COLUMNS))
    last[:, : layout.AREA] = np.tile(triangles[-1, 0], 3)
    spheres = [
        _sphere(triangles[k : k + layout.GROUP].reshape(-1, 3)) for k in range(0, n, layout.GROUP)
    ]
    return np.concatenate([header, np.vstack([columns, last]).T.ravel(), *spheres])


def triangles_of(block: Array) -> Array:
    """The triangles (n, 3, 3) of a block, in its order."""
    columns = block[layout.HEADER :][: layout.AREA * int(block[layout.STRIDE])]
    return columns.reshape(layout.AREA, -1).T[: int(block[layout.N_FACES])].reshape(-1, 3, 3)


def _by_place(centroids: Array) -> npt.NDArray[np.intp]:
    """An order (n,) in which the faces of a group lie near each other: halved across the longest side."""
    done: list[npt.NDArray[np.intp]] = []
    waiting = [np.arange(len(centroids))]
    while waiting:
        faces = waiting.pop()
        groups = -(-len(faces) // layout.GROUP)
        if groups == 1:
            done.append(faces)
            continue
        axis = np.argmax(np.ptp(centroids[faces], axis=0))
        faces = faces[np.argsort(centroids[faces, axis], kind="stable")]
        half = groups // 2 * layout.GROUP
        waiting += [faces[half:], faces[:half]]
    return np.concatenate(done)


def _sphere(points: Array) -> Array:
    """Centre and radius (4,) of a sphere about points (n, 3), with a hair for rounding."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = np.linalg.norm(points - centre, axis=1).max()
    return np.array([*centre, (1.0 + 1e-9) * radius])


def wrench_and_immersion(block: Array, states: Array) -> Array:
    """Rows (n, 17) of every state (n, 18); see `mjskip.hydro.columns`."""
    out = np.empty((len(states), LOAD))
    kernels.wrench_and_immersion(wrench_address(), immersion_address(), block, states, out)
    return out


def wrench_address() -> int:
    """Address of the compiled kernel, void(block*, state*, out*): what both engines call."""
    return entry_address(kernels._entry)


def immersion_address() -> int:
    """The same for the five numbers that `wrench_and_immersion` adds to the wrench."""
    return entry_address(kernels._immersion_entry)


@cache
def entry_address(function: Callable[[Any, Any, Any], None]) -> int:
    """Address of a function compiled as void(double*, double*, double*)."""
    compiled = native(types.void(F8P, F8P, F8P))(function)
    _alive.append(compiled)
    return address_of_cfunc(compiled)


_alive: list[object] = []
"""Compiled C functions, kept for the life of the process: others hold their addresses."""


def _vector(name: str, value: npt.ArrayLike, size: int) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ValueError(f"{name} is {value!r}: give {size} finite numbers")
    return array
