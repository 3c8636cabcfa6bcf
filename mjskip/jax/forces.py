"""Force and torque of still water and of air on one hull, as a pure function in double precision.

The same formulas as `mjskip.hydro`, over all triangles at once; branches are chosen by `where`, and what is not chosen is
kept finite, so that derivatives are finite too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjskip.checks import check_number, check_type
from mjskip.hydro.hull import Hull
from mjskip.hydro.laws import LAWS, ForceLaw
from mjskip.hydro.packing import pack, planes_of
from mjskip.hydro.water import Water
from mjskip.jax.faces import Motion, grouped, over, plane_load, root, triangle_load

Vector = jax.Array


class Load(NamedTuple):
    """What water and air do to a body, world frame.

    Attributes:
        force: of the water (3,) [N].
        torque: of the water about the centre of mass (3,) [N m].
        air_force: of the air (3,) [N].
        air_torque: of the air about the centre of mass (3,) [N m].
    """

    force: Vector
    torque: Vector
    air_force: Vector
    air_torque: Vector


class _Faces(NamedTuple):
    """Triangles about the centre of mass: corners (m, 3, 3), normals (m, 3), areas (m,)."""

    corners: Vector
    normals: Vector
    areas: Vector


def wrench(hull: Hull, water: Water | None = None, *, gravity: float = 9.81) -> Callable[..., Load]:
    """What still water (z = 0) and air do to a body, as a function of its motion.

    Args:
        hull: the body.
        water: the fluid; `Water()` if omitted.
        gravity: for buoyancy [m/s^2].

    Returns:
        A pure function of a `State` (and, if its derivative is wanted, of `density=` of the water [kg/m^3]) that gives a
        `Load`; for `jax.jit`, `jax.vmap`, `jax.grad` and the like.

    Raises:
        ValueError: JAX would work in single precision, or the water is one that is not known here: it is still, and has
            no added mass.
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError(
            'JAX works in single precision: call jax.config.update("jax_enable_x64", True) first'
        )
    check_type("hull", hull, Hull, "give a mjskip.Stone or another Hull")
    fluid = Water() if water is None else check_type("water", water, Water)
    gravity = check_number("gravity", gravity)
    law = LAWS[fluid.law]
    if fluid.radiation or fluid.added_mass:
        raise ValueError(
            "radiation is True: for JAX water is still"
            if fluid.radiation
            else f"added_mass is {fluid.added_mass:g}: for JAX leave it out"
        )
    planes = grouped(planes_of(pack(hull, fluid))) if law.forward else []
    local = fluid.gate == "local"
    areas = np.linalg.norm(hull.area_vectors, axis=1)
    faces = _Faces(
        jnp.asarray(hull.triangles),
        jnp.asarray(hull.area_vectors / areas[:, None]),
        jnp.asarray(areas),
    )
    length = 2.0 * float(np.sqrt(hull.disc_area / np.pi))
    disc_normal, disc_centre = jnp.asarray(hull.disc_normal), jnp.asarray(hull.disc_centre)

    def load(state: Any, *, density: Any = fluid.density) -> Load:
        turn = rotation(state.q)
        velocity, omega, up = turn.T @ state.velocity, turn.T @ state.omega, turn[2]
        z = state.position[2]

        # air, on the disc
        vn = jnp.dot(velocity + jnp.cross(omega, disc_centre), disc_normal)
        air = -fluid.air_density * hull.disc_area * vn * jnp.abs(vn) * disc_normal

        # water, on the mesh
        heights = z + faces.corners @ up
        share, centre, height, moment = _immersed(faces.corners, heights)
        wet = share * faces.areas
        motion = Motion(z, up, velocity, omega)
        if law.forward:
            parts = [plane_load(group, law, local, motion) for group in planes]
            force, torque = (sum(column) for column in zip(*parts, strict=True))
        elif fluid.quadrature:
            force, torque = triangle_load(faces.corners, faces.normals, law, local, motion)
        else:
            forces = _law_force(faces, law, local, wet, centre, velocity, omega)
            force, torque = forces.sum(axis=0), jnp.cross(centre, forces).sum(axis=0)
        if fluid.buoyancy:
            weight = gravity * faces.areas[:, None]
            force += (weight * height[:, None] * faces.normals).sum(axis=0)
            torque += (weight * jnp.cross(moment, faces.normals)).sum(axis=0)
        if fluid.skin_friction:
            rub = _skin_force(faces, wet, centre, velocity, omega, length / fluid.viscosity)
            force += rub.sum(axis=0)
            torque += jnp.cross(centre, rub).sum(axis=0)
        return Load(
            turn @ (density * force),
            turn @ (density * torque),
            turn @ air,
            turn @ jnp.cross(disc_centre, air),
        )

    return load


def rotation(q: Any) -> Vector:
    """Matrix (3, 3), body to world, without unit.

    Args:
        q: quaternion (4,), w-x-y-z, of any length but zero.
    """
    w, x, y, z = q / jnp.linalg.norm(q)
    return jnp.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _law_force(
    faces: _Faces, law: ForceLaw, local: bool, wet: Vector, centre: Vector,
    velocity: Vector, omega: Vector,
) -> Vector:  # fmt: skip
    """Forces (m, 3) for a density of 1.

    F = -S [ (a (V.n)^2 + b U (V.n) + c U^2) n + d U^2 t ]
    """
    vn_centre = faces.normals @ velocity
    along = velocity - vn_centre[:, None] * faces.normals
    vn = vn_centre + jnp.einsum("mi,mi->m", jnp.cross(omega, centre), faces.normals)
    speed2 = jnp.dot(velocity, velocity)
    pressure = law.normal_squared * vn**2
    if law.speed_normal:
        pressure += law.speed_normal * root(speed2) * vn
    pressure += law.speed_squared * speed2
    force = -pressure[:, None] * faces.normals
    if law.friction:
        length = root(jnp.einsum("mi,mi->m", along, along))
        force -= law.friction * speed2 * over(along, length)
    loaded = (vn > 0.0) if local else (vn_centre >= 0.0)
    return jnp.where(loaded, wet, 0.0)[:, None] * force


def _skin_force(
    faces: _Faces, wet: Vector, centre: Vector, velocity: Vector, omega: Vector, rate: float
) -> Vector:
    """Forces (m, 3) of friction for a density of 1: -1/2 C_f |V_t| V_t S (ITTC 1957)."""
    slip = velocity + jnp.cross(omega, centre)
    slip -= jnp.einsum("mi,mi->m", slip, faces.normals)[:, None] * faces.normals
    speed = root(jnp.einsum("mi,mi->m", slip, slip))
    coefficient = 0.075 / (jnp.log10(jnp.maximum(speed * rate, 1e3)) - 2.0) ** 2
    return -0.5 * (coefficient * speed * wet)[:, None] * slip


def _immersed(corners: Vector, heights: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Of triangles (m, 3, 3) with corners at these heights (m, 3) above the surface, the immersed part.

    Returns:
        Share of the area (m,), its centroid (m, 3), and the integrals of h (m,) and of r h (m, 3) over it for a triangle
        of unit area.
    """
    wet = heights < 0.0
    below = wet.sum(axis=1)
    one = below == 1
    # turn every triangle so that its odd corner, the only wet or the only dry one, comes first
    odd = jnp.argmax(wet == one[:, None], axis=1)
    order = (odd[:, None] + jnp.arange(3)) % 3
    a, b, c = jnp.moveaxis(jnp.take_along_axis(corners, order[:, :, None], axis=1), 1, 0)
    ha, hb, hc = jnp.take_along_axis(heights, order, axis=1).T
    cut = (below == 1) | (below == 2)
    u = jnp.where(cut, hc, 0.0) / jnp.where(cut, hc - ha, 1.0)  # from c to a
    w = jnp.where(cut, hb, 0.0) / jnp.where(cut, hb - ha, 1.0)  # from b to a
    p, q = c + u[:, None] * (a - c), b + w[:, None] * (a - b)
    zero = jnp.zeros_like(ha)
    whole = _linear(a, ha, b, hb, c, hc, zero + 1.0)
    tip = _linear(a, ha, q, zero, p, zero, (1.0 - u) * (1.0 - w))
    first = _linear(b, hb, c, hc, p, zero, u)
    second = _linear(b, hb, p, zero, q, zero, (1.0 - u) * w)

    def chosen(k: int) -> Vector:
        deep = [below == 3, below == 2, below == 1]
        values = [whole[k], first[k] + second[k], tip[k]]
        if values[0].ndim == 2:
            deep = [d[:, None] for d in deep]
        return jnp.select(deep, values, 0.0)

    share, first_moment, height, moment = (chosen(k) for k in range(4))
    return share, over(first_moment, share), height, moment


def _linear(
    a: Vector, ha: Vector, b: Vector, hb: Vector, c: Vector, hc: Vector, area: Vector
) -> tuple[Vector, Vector, Vector, Vector]:
    """Of triangles of these areas: area, integral of r, of h and of r h."""
    total = ha + hb + hc
    corners = a + b + c
    weighted = a * ha[:, None] + b * hb[:, None] + c * hc[:, None]
    return (
        area,
        (area / 3.0)[:, None] * corners,
        area / 3.0 * total,
        (area / 12.0)[:, None] * (corners * total[:, None] + weighted),
    )
