"""A law's load integrated over the wet part of faces, in double precision: what `mjskip.hydro._integral_kernels` and
`_strip_kernels` do, over all faces at once.

The normal speed over a plane face is v = V.n + (n x omega).r, and

    integral of (a v^2 + b U v + c U^2 + e U^2 pi v / (4 U + pi |v|)) {1, r} dA

has a closed form over a triangle. With `quadrature` it is taken over the wet part of every triangle. A law that acts
`forward` takes the wet part of a plane face as strips along the motion, each squeezed to its front part of length
(1 - 2 x / l) l with Rayleigh's x / l = 3/4 cos(theta) / (4 + pi sin(theta)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjskip._typing import Array
from mjskip.hydro._block import EDGES, OUTLINE
from mjskip.hydro.laws import ForceLaw

Vector = jax.Array

C = 4.0 / math.pi


class Motion(NamedTuple):
    """Of a body in its own axes: height of its centre of mass, vertical (3,), velocity (3,), angular velocity (3,)."""

    height: Vector
    up: Vector
    velocity: Vector
    omega: Vector


class Planes(NamedTuple):
    """Plane faces with the same number of edges.

    Attributes:
        normals: (p, 3).
        distances: from the centre of mass (p,).
        edges: ends of the edges of the outline (p, e, 2, 3).
        strips: how many lie beside each other along the motion at most: 1 if all outlines are convex.
    """

    normals: Vector
    distances: Vector
    edges: Vector
    strips: int


def grouped(planes: Sequence[Array]) -> list[Planes]:
    """Plane faces, as `mjskip.hydro.packing.planes_of` has them, by their number of edges."""
    groups: dict[int, list[Array]] = {}
    for plane in planes:
        groups.setdefault(int(plane[EDGES]), []).append(plane)
    found = []
    for count, rows in groups.items():
        table = np.array(rows)
        edges = table[:, OUTLINE:].reshape(-1, count, 2, 3)
        convex = all(_convex(n, e) for n, e in zip(table[:, :3], edges, strict=True))
        found.append(
            Planes(
                jnp.asarray(table[:, :3]),
                jnp.asarray(table[:, 3]),
                jnp.asarray(edges),
                1 if convex else (count + count // 2) // 2,
            )
        )
    return found


def _convex(normal: Array, edges: Array) -> bool:
    """Whether every corner lies on the inner side of every edge (e, 2, 3)."""
    along = edges[:, 1] - edges[:, 0]
    away = edges[None, :, 0] - edges[:, None, 0]
    side = np.cross(along[:, None], away) @ normal
    return bool((side > -1e-9 * np.abs(side).max()).all())


def plane_load(planes: Planes, law: ForceLaw, local: bool, motion: Motion) -> tuple[Vector, Vector]:
    """Force (3,) and torque (3,) of a law that acts forward, for a density of 1."""

    def one(normal: Vector, distance: Vector, edges: Vector) -> tuple[Vector, Vector]:
        points, weights = _strips(normal, distance, edges, planes.strips, motion)
        return _turned(law, local, motion, normal, points, weights)

    forces, torques = jax.vmap(one)(planes.normals, planes.distances, planes.edges)
    return forces.sum(axis=0), torques.sum(axis=0)


def triangle_load(
    corners: Vector, normals: Vector, law: ForceLaw, local: bool, motion: Motion
) -> tuple[Vector, Vector]:
    """Force (3,) and torque (3,) of a law over the wet part of triangles (m, 3, 3), for a density of 1."""

    def one(triangle: Vector, normal: Vector) -> tuple[Vector, Vector]:
        wet = _part_below(triangle, motion.height + triangle @ motion.up)
        return _turned(law, local, motion, normal, wet, jnp.ones(2))

    forces, torques = jax.vmap(one)(corners, normals)
    return forces.sum(axis=0), torques.sum(axis=0)


def _turned(
    law: ForceLaw, local: bool, motion: Motion, normal: Vector, points: Vector, weights: Vector
) -> tuple[Vector, Vector]:
    """Force and torque on the triangles (k, 3, 3) of a plane face: F = -load n, and friction along the motion."""
    velocity, speed = motion.velocity, root(jnp.dot(motion.velocity, motion.velocity))
    vn, slope = jnp.dot(velocity, normal), jnp.cross(normal, motion.omega)

    def gather(triangles: Vector, sign: float, factor: Vector) -> tuple[Vector, ...]:
        v = sign * (vn + triangles @ slope)
        return _integrals(law, speed, normal, triangles, v, factor)

    if local or law.cavity:
        flat = points.reshape(-1, 3, 3)
        parts = jax.vmap(_part_below)(flat, -(vn + flat @ slope)).reshape(-1, 3, 3)
        factor = jnp.repeat(weights.reshape(-1), 2)
        found = gather(parts, 1.0, factor)
        if not local:  # a cavity's load is odd in v
            parts = jax.vmap(_part_below)(flat, vn + flat @ slope).reshape(-1, 3, 3)
            more = gather(parts, -1.0, -factor)
            found = tuple(a + b for a, b in zip(found, more, strict=True))
    else:
        found = gather(points.reshape(-1, 3, 3), 1.0, weights.reshape(-1))
    load, moment, area, place = found
    force, torque = -load * normal, -jnp.cross(moment, normal)
    if law.friction:
        along = velocity - vn * normal
        length = root(jnp.dot(along, along))
        pull = -law.friction * jnp.dot(velocity, velocity) * over(along[None], length[None])[0]
        force, torque = force + area * pull, torque + jnp.cross(place, pull)
    if not local:
        loaded = vn >= 0.0
        force, torque = jnp.where(loaded, force, 0.0), jnp.where(loaded, torque, 0.0)
    return force, torque


def _integrals(
    law: ForceLaw, speed: Vector, normal: Vector, points: Vector, v: Vector, weights: Vector
) -> tuple[Vector, Vector, Vector, Vector]:
    """Load, load times r (3,), area and area times r (3,) over triangles (k, 3, 3) with normal speeds v (k, 3)."""
    a, b, c = points[:, 0], points[:, 1], points[:, 2]
    area = 0.5 * weights * jnp.abs(jnp.cross(b - a, c - a) @ normal)
    total = v.sum(axis=1, keepdims=True)
    squares = (v * v).sum(axis=1, keepdims=True)
    others, rest = total - v, squares - v * v
    square = v * v / 10.0 + v * others / 15.0 + rest / 30.0 + (others * others - rest) / 60.0
    p = law.normal_squared * square + law.speed_normal * speed * (total + v) / 12.0
    p += law.speed_squared * speed**2 / 3.0
    if law.cavity:
        moves = speed > 0.0
        q = jnp.where(moves, jnp.maximum(v, 0.0) / jnp.where(moves, speed, 1.0), 0.0)
        p += law.cavity * speed**2 * _cavity_shares(q)
    weighted = area[:, None] * p
    return (
        weighted.sum(),
        jnp.einsum("kc,kci->i", weighted, points),
        area.sum(),
        jnp.einsum("k,kci->i", area / 3.0, points),
    )


def _cavity_shares(q: Vector) -> Vector:
    """Integrals of pi q / (4 + pi q) times each barycentric coordinate (k, 3), over the area; q >= 0.

    See `mjskip.hydro._integral_kernels._cavity_shares`.
    """
    w = q + C
    order = jnp.argsort(w, axis=1)
    low, middle, high = jnp.take_along_axis(w, order, axis=1).T
    mean = w.mean(axis=1, keepdims=True)
    flat = high - low < 1e-7 * high
    level = (1.0 - C / mean) / 3.0 + C / mean**2 * (w - mean) / 12.0
    t = jnp.where(flat, 0.5, middle - low) / jnp.where(flat, 1.0, high - low)
    one, two = _levels(jnp.where(flat, 0.0, (middle - low) / low))
    three, four = _levels(jnp.where(flat, 0.0, (middle - high) / high))
    f, g = 2.0 * C * t / low, 2.0 * C * (1.0 - t) / high
    steep = 1.0 / 3.0 - jnp.stack(
        [
            f * (one - two + 0.5 * two * (1.0 - t)) + g * 0.5 * four * (1.0 - t),
            f * 0.5 * two + g * 0.5 * four,
            f * 0.5 * two * t + g * (three - four + 0.5 * four * t),
        ],
        axis=1,
    )
    steep = jnp.take_along_axis(steep, jnp.argsort(order, axis=1), axis=1)
    return jnp.where(flat[:, None], level, steep)


def _levels(x: Vector) -> tuple[Vector, Vector]:
    """Integrals of l / (1 + x l) and of l^2 / (1 + x l) from 0 to 1, x > -1."""
    small = jnp.abs(x) < 0.1  # the closed forms cancel: their series, to 1e-15
    near, far = jnp.where(small, x, 0.0), jnp.where(small, 1.0, x)
    one = two = jnp.zeros_like(x)
    for n in reversed(range(15)):
        one, two = 1.0 / (n + 2) - near * one, 1.0 / (n + 3) - near * two
    log = jnp.log1p(far)
    return (
        jnp.where(small, one, (far - log) / far**2),
        jnp.where(small, two, (0.5 * far**2 - far + log) / far**3),
    )


def _part_below(triangle: Vector, heights: Vector) -> Vector:
    """The part of a triangle (3, 3) on which h, linear over it, is negative: two triangles (2, 3, 3), of no area if dry."""
    wet = heights < 0.0
    below = wet.sum()
    odd = jnp.argmax(wet == (below == 1))
    order = (odd + jnp.arange(3)) % 3
    a, b, c = triangle[order]
    ha, hb, hc = heights[order]
    cut = (below == 1) | (below == 2)
    p = c + jnp.where(cut, hc, 0.0) / jnp.where(cut, hc - ha, 1.0) * (a - c)
    q = b + jnp.where(cut, hb, 0.0) / jnp.where(cut, hb - ha, 1.0) * (a - b)
    none = jnp.stack([a, a, a])
    choices = [
        jnp.stack([none, none]),
        jnp.stack([jnp.stack([a, q, p]), none]),
        jnp.stack([jnp.stack([b, c, p]), jnp.stack([b, p, q])]),
        jnp.stack([jnp.stack([a, b, c]), none]),
    ]
    return jnp.select([below == n for n in range(4)], choices)


def _strips(
    normal: Vector, distance: Vector, edges: Vector, most: int, motion: Motion
) -> tuple[Vector, Vector]:
    """Front parts of the wet strips of a plane face: triangles (k, 3, 3) and factors on their loads (k,)."""
    velocity = motion.velocity
    speed = root(jnp.dot(velocity, velocity))
    vn = jnp.dot(velocity, normal)
    # axes of the face: t along the motion, or any where there is none along it; s = n x t
    t = velocity - vn * normal
    along = root(jnp.dot(t, t))
    none = (along <= 1e-12 * speed) | (along == 0.0)
    shift = 0.75 * along / jnp.where(speed > 0.0, 4.0 * speed + math.pi * jnp.abs(vn), 1.0)
    front = 1.0 - 2.0 * shift
    any_axis = jnp.cross(normal, jnp.eye(3)[jnp.argmin(jnp.abs(normal))])
    t = jnp.where(
        none, any_axis / root(jnp.dot(any_axis, any_axis)), t / jnp.where(none, 1.0, along)
    )
    s = jnp.cross(normal, t)

    low, high, there = _outline(edges, motion, t, s)  # of every segment (2,): y and x
    levels = jnp.sort(jnp.where(there, jnp.stack([low[:, 0], high[:, 0]]), jnp.inf).ravel())
    bottom, top = levels[:-1], levels[1:]
    slab = jnp.isfinite(top) & (top > bottom)
    bottom, top = jnp.where(slab, bottom, 0.0), jnp.where(slab, top, 1.0)
    met = slab[:, None] & there & (low[:, 0] <= bottom[:, None]) & (high[:, 0] >= top[:, None])

    def places(y: Vector) -> Vector:
        rise = jnp.where(there, high[:, 0] - low[:, 0], 1.0)
        return low[:, 1] + (y[:, None] - low[:, 0]) / rise * (high[:, 1] - low[:, 1])

    # those that are met bound the strips in pairs, in the order of x
    order = jnp.argsort(jnp.where(met, places(0.5 * (bottom + top)), jnp.inf), axis=1)
    order = order[:, : 2 * most]
    pair = jnp.take_along_axis(met, order, axis=1).reshape(len(top), most, 2).all(axis=2)

    def ends(y: Vector) -> tuple[Vector, Vector]:
        x = jnp.take_along_axis(places(y), order, axis=1).reshape(len(y), most, 2)
        points = jnp.stack([x[..., 1] - front * (x[..., 1] - x[..., 0]), x[..., 1]])
        placed = points[..., None] * t + (y[:, None, None] * s + distance * normal)
        return placed[0], placed[1]

    a, b = ends(bottom)
    d, c = ends(top)
    triangles = jnp.stack([jnp.stack([a, b, c], axis=2), jnp.stack([a, c, d], axis=2)], axis=2)
    factors = jnp.broadcast_to(jnp.where(pair, 1.0 / front, 0.0)[..., None], triangles.shape[:3])
    triangles = jnp.where(pair[..., None, None, None], triangles, 0.0)
    return triangles.reshape(-1, 3, 3), factors.reshape(-1)


def _outline(edges: Vector, motion: Motion, t: Vector, s: Vector) -> tuple[Vector, Vector, Vector]:
    """Segments (n, 2), as y and x of their lower and upper ends, around the wet part of a face; whether each is there."""
    heights = motion.height + edges @ motion.up
    x, y = edges @ t, edges @ s
    wet = heights < 0.0
    cut = wet[:, 0] != wet[:, 1]
    part = jnp.where(cut, heights[:, 0], 0.0)
    part = part / jnp.where(cut, heights[:, 0] - heights[:, 1], 1.0)
    middle = jnp.stack(
        [y[:, 0] + part * (y[:, 1] - y[:, 0]), x[:, 0] + part * (x[:, 1] - x[:, 0])], axis=1
    )
    ends = jnp.stack([y, x], axis=2)
    ends = jnp.where((cut[:, None] & ~wet)[..., None], middle[:, None], ends)
    # along the waterline, across the slope of the face: crossings bound it in pairs
    place = middle[:, 1] * -jnp.dot(motion.up, s) + middle[:, 0] * jnp.dot(motion.up, t)
    order = jnp.argsort(jnp.where(cut, place, jnp.inf))
    pairs = len(order) // 2
    line = middle[order][: 2 * pairs].reshape(pairs, 2, 2)
    ends = jnp.concatenate([ends, line])
    there = jnp.concatenate(
        [wet.any(axis=1), cut[order][: 2 * pairs].reshape(pairs, 2).all(axis=1)]
    )
    up = (ends[:, 0, 0] < ends[:, 1, 0])[:, None]
    low, high = jnp.where(up, ends[:, 0], ends[:, 1]), jnp.where(up, ends[:, 1], ends[:, 0])
    return low, high, there & (ends[:, 0, 0] != ends[:, 1, 0])


def root(square: Any) -> Vector:
    """Square root whose derivative at 0 is 0 instead of infinite."""
    positive = square > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def over(vectors: Vector, length: Vector) -> Vector:
    """Vectors (m, 3) over lengths (m,); zero where the length is."""
    positive = length > 0.0
    safe = jnp.where(positive, length, 1.0)
    return jnp.where(positive[:, None], vectors / safe[:, None], 0.0)
