"""Hydrostatics of what floats: displacement, centre of buoyancy, metacentric heights, equilibrium.

Integrals over the volume below still water (z = 0) are integrals over the wet surface, for a field that vanishes
on the waterplane: with outward normal n,

    V = int z n_z dS,   V x_B = int x z n_z dS,   V z_B = 1/2 int z^2 n_z dS,
    A = -int n_z dS,    I_xx = -int y^2 n_z dS    (waterplane)

Triangles are clipped at the surface exactly, and quadratic integrands are integrated exactly by the middles of sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.errors import MjskipError


@dataclass(frozen=True, kw_only=True)
class Hydrostatics:
    """A body in still water, as it lies.

    Attributes:
        displaced_volume: V [m^3].
        centre_of_buoyancy: B (3,), world [m]; the centre of mass if nothing is wet.
        wetted_area: [m^2].
        waterplane_area: A [m^2].
        centre_of_flotation: of the waterplane (2,), world [m].
        metacentric_height: GM for heel, about the axis of the heading [m]; infinite if nothing is wet.
        longitudinal_metacentric_height: GM for trim, about the horizontal axis across the heading [m].
    """

    displaced_volume: float
    centre_of_buoyancy: Array
    wetted_area: float
    waterplane_area: float
    centre_of_flotation: Array
    metacentric_height: float
    longitudinal_metacentric_height: float


def hydrostatics(
    triangles: npt.ArrayLike, *, centre_of_mass: npt.ArrayLike, heading: float = 0.0
) -> Hydrostatics:
    """Hydrostatics of closed surfaces in still water (z = 0).

    Args:
        triangles: (n, 3, 3), counter-clockwise seen from outside, world [m].
        centre_of_mass: (3,), world [m].
        heading: direction of the bow in the horizontal plane, from x to y [rad].

    GM = z_B + I / V - z_G, I the second moment of the waterplane about an axis through its centroid.
    """
    mass_centre = np.asarray(centre_of_mass, np.float64)
    found = _integrals(np.asarray(triangles, np.float64) - [*mass_centre[:2], 0.0])
    if not found.volume > 0.0:
        return Hydrostatics(
            displaced_volume=0.0,
            centre_of_buoyancy=mass_centre.copy(),
            wetted_area=found.wetted,
            waterplane_area=0.0,
            centre_of_flotation=mass_centre[:2].copy(),
            metacentric_height=math.inf,
            longitudinal_metacentric_height=math.inf,
        )
    c, s = math.cos(heading), math.sin(heading)
    ahead, aside = np.array([c, s]), np.array([-s, c])
    rise = found.buoyancy[2] - mass_centre[2]
    return Hydrostatics(
        displaced_volume=found.volume,
        centre_of_buoyancy=found.buoyancy + np.array([*mass_centre[:2], 0.0]),
        wetted_area=found.wetted,
        waterplane_area=found.waterplane,
        centre_of_flotation=found.flotation + mass_centre[:2],
        metacentric_height=float(rise + aside @ found.second @ aside / found.volume),
        longitudinal_metacentric_height=float(rise + ahead @ found.second @ ahead / found.volume),
    )


@dataclass(frozen=True)
class _Integrals:
    volume: float
    buoyancy: Array
    wetted: float
    waterplane: float
    flotation: Array
    second: Array
    """int x x^T over the waterplane about its centroid (2, 2) [m^4]."""


def _integrals(triangles: Array) -> _Integrals:
    wet = clipped(triangles)
    if not len(wet):
        nothing = np.zeros(2)
        return _Integrals(0.0, np.zeros(3), 0.0, 0.0, nothing, np.zeros((2, 2)))
    vectors = 0.5 * np.cross(wet[:, 1] - wet[:, 0], wet[:, 2] - wet[:, 0])
    middles = 0.5 * (wet + np.roll(wet, -1, axis=1))  # (n, 3, 3)
    weight = np.repeat(vectors[:, 2] / 3.0, 3)
    x, y, z = middles.reshape(-1, 3).T
    volume = float(weight @ z)
    first = np.array([weight @ (x * z), weight @ (y * z), 0.5 * (weight @ (z * z))])
    area = -float(weight.sum())
    flotation = -np.array([weight @ x, weight @ y]) / area if area > 0.0 else np.zeros(2)
    dx, dy = x - flotation[0], y - flotation[1]
    second = -np.array(
        [[weight @ (dx * dx), weight @ (dx * dy)], [weight @ (dx * dy), weight @ (dy * dy)]]
    )
    return _Integrals(
        volume,
        first / volume if volume > 0.0 else np.zeros(3),
        float(np.linalg.norm(vectors, axis=1).sum()),
        max(area, 0.0),
        flotation,
        second,
    )


def clipped(triangles: Array) -> Array:
    """The parts of triangles (n, 3, 3) below z = 0, as triangles (m, 3, 3)."""
    below = triangles[..., 2] < 0.0
    count = below.sum(axis=1)
    parts = [triangles[count == 3]]
    for wet in (1, 2):
        rows = np.flatnonzero(count == wet)
        if not len(rows):
            continue
        odd = np.argmax(below[rows] == (wet == 1), axis=1)  # the one wet or the one dry corner
        order = (odd[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(triangles[rows[:, None], order], 1, 0)
        p, q = _crossing(a, b), _crossing(a, c)
        if wet == 1:
            parts.append(np.stack([a, p, q], axis=1))
        else:
            parts += [np.stack([p, b, c], axis=1), np.stack([p, c, q], axis=1)]
    return np.concatenate(parts)


def _crossing(a: Array, b: Array) -> Array:
    """Where lines from a (n, 3) to b meet z = 0."""
    share = a[:, 2] / (a[:, 2] - b[:, 2])
    point = a + share[:, None] * (b - a)
    point[:, 2] = 0.0
    return np.asarray(point)


@dataclass(frozen=True, kw_only=True, repr=False)
class Flotation:
    """A body at rest in still water.

    Attributes:
        draft: depth of its lowest point [m].
        trim: angle by which its x axis points up: bow up is positive [rad].
        heel: angle by which its y axis points up from there: starboard down is positive [rad].
        rotation: body to world (3, 3).
        centre_of_mass: height of the centre of mass above the water [m].
        hydrostatics: as it floats, the centre of mass at x = y = 0.
    """

    draft: float
    trim: float
    heel: float
    rotation: Array
    centre_of_mass: float
    hydrostatics: Hydrostatics

    @property
    def stable(self) -> bool:
        """Whether it rights itself from any small heel or trim."""
        state = self.hydrostatics
        return min(state.metacentric_height, state.longitudinal_metacentric_height) > 0.0

    def __repr__(self) -> str:
        name = getattr(self, "body", "a body")
        angles = (f"{math.degrees(a) + 0.0:.2f}°" for a in (self.trim, self.heel))
        height = self.hydrostatics.metacentric_height
        return "<{} afloat: draft {:.4g} m, trim {}, heel {}, GM {:.4g} m>".format(
            name, self.draft, *angles, height
        )


class SinksError(MjskipError):
    """A body is heavier than the water it displaces when it is sunk."""


MAX_ROUNDS = 500
STEEPEST = 0.2
"""Greatest turn in one round of the search [rad]."""
NUDGE = 1e-3
"""Turn out of an unstable equilibrium [rad]."""


def float_at_rest(
    triangles: npt.ArrayLike,
    *,
    mass: float,
    centre_of_mass: npt.ArrayLike = (0.0, 0.0, 0.0),
    density: float = 1000.0,
    rotation: npt.ArrayLike | None = None,
) -> Flotation:
    """The equilibrium that a body comes to from an attitude: least potential energy nearby.

    At a given attitude the body is let down until it displaces its mass. The energy is then rho g V (z_G - z_B);
    its gradient is the moment of buoyancy about the centre of mass, its second derivative that of the
    metacentric formula, so that Newton's method finds where it is least.

    Args:
        triangles: (n, 3, 3) of a closed surface, body frame [m].
        mass: [kg].
        centre_of_mass: (3,), body frame [m].
        density: of the water [kg/m^3].
        rotation: attitude to begin from (3, 3), body to world; upright if None.

    Raises:
        SinksError: the body is too heavy to float.
        MjskipError: the search did not end.
    """
    body = np.asarray(triangles, np.float64) - np.asarray(centre_of_mass, np.float64)
    volume = mass / density
    whole = float(np.einsum("ni,ni->", body[:, 0], np.cross(body[:, 1], body[:, 2])) / 6.0)
    if volume >= whole:
        raise SinksError(
            f"it sinks: {mass:.6g} kg, and the water it displaces when it is sunk weighs {density * whole:.6g} kg"
        )
    turn = np.eye(3) if rotation is None else np.array(rotation, np.float64)
    size = float(np.ptp(body.reshape(-1, 3), axis=0).max())
    height, state = _floating_height(body @ turn.T, volume, None)
    nudged = 0
    for _ in range(MAX_ROUNDS):
        energy, moment, stiffness = _balance(state, height)
        values, axes = np.linalg.eigh(stiffness)
        still = np.linalg.norm(moment) < 1e-13 * volume * size
        scale = float(np.abs(values).max())
        if still and (values[0] > -1e-9 * scale or nudged > 3):
            break
        if still:  # balanced, but it would capsize
            step, nudged = NUDGE * axes[:, 0], nudged + 1
        else:
            step = axes @ ((axes.T @ moment) / np.maximum(np.abs(values), 1e-6 * scale))
            step *= min(1.0, STEEPEST / float(np.linalg.norm(step)))
        for _ in range(60):
            tried = _turned(step) @ turn
            up, after = _floating_height(body @ tried.T, volume, height)
            if still or _balance(after, up)[0] <= energy + 1e-15 * volume * size:
                break
            step = 0.5 * step
        else:
            break
        turn, height, state = tried, up, after
        if not still and np.linalg.norm(step) < 1e-14:
            break
    else:
        raise MjskipError(
            f"no equilibrium found in {MAX_ROUNDS} rounds: begin from another attitude, rotation="
        )
    return _flotation(body @ turn.T, turn, height)


def trim_and_heel(rotation: Array) -> tuple[float, float]:
    """Angles of a rotation body to world (3, 3), as `Flotation` has them [rad]."""
    up = rotation[2]
    return math.asin(max(-1.0, min(1.0, up[0]))), math.atan2(up[1], up[2])


def _flotation(turned: Array, turn: Array, height: float) -> Flotation:
    placed = turned + np.array([0.0, 0.0, height])
    return Flotation(
        draft=-float(placed[..., 2].min()),
        trim=trim_and_heel(turn)[0],
        heel=trim_and_heel(turn)[1],
        rotation=turn,
        centre_of_mass=height,
        hydrostatics=hydrostatics(
            placed,
            centre_of_mass=[0.0, 0.0, height],
            heading=math.atan2(turn[1, 0], turn[0, 0]),
        ),
    )


def _floating_height(turned: Array, volume: float, near: float | None) -> tuple[float, _Integrals]:
    """Height of the centre of mass at which a turned body displaces a volume: Newton between bounds."""
    low, high = -float(turned[..., 2].max()), -float(turned[..., 2].min())
    height = 0.5 * (low + high) if near is None or not low < near < high else near
    for _ in range(200):
        state = _integrals(turned + np.array([0.0, 0.0, height]))
        excess = state.volume - volume
        if abs(excess) <= 1e-14 * volume:
            break
        if excess > 0.0:
            low = height
        else:
            high = height
        ahead = height + excess / state.waterplane if state.waterplane > 0.0 else math.inf
        height = ahead if low < ahead < high else 0.5 * (low + high)
        if high - low <= 1e-15 * max(1.0, abs(high)):
            break
    return height, _integrals(turned + np.array([0.0, 0.0, height]))


def _balance(state: _Integrals, height: float) -> tuple[float, Array, Array]:
    """Energy, moment about the horizontal axes and stiffness (2, 2), all over rho g."""
    x, y, z = state.buoyancy
    lift = state.volume * (z - height)
    (xx, xy), (_, yy) = state.second
    stiffness = np.array([[yy + lift, -xy], [-xy, xx + lift]])
    return -lift, state.volume * np.array([y, -x]), stiffness


def _turned(step: Array) -> Array:
    """Rotation by a horizontal vector (2,) [rad]."""
    angle = float(np.linalg.norm(step))
    if angle == 0.0:
        return np.eye(3)
    x, y = step / angle
    cross: Any = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)
