"""Bodies of a model that float, as `mjskip.hydro.response` takes them."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from mjskip._typing import Array
from mjskip.coupling.bodies import body_name, free_bodies
from mjskip.coupling.sea import finer
from mjskip.coupling.selection import wet_body
from mjskip.coupling.wet import HullOptions, hull_of, inertia_of
from mjskip.errors import SceneError
from mjskip.hydro.hydrostatics import SinksError, float_at_rest
from mjskip.hydro.panels import WettedHull, wetted_hull
from mjskip.hydro.response import FloatingBody

PANELS = 160
"""Panels of all hulls together for curves over frequency, at least: and finer towards sharp edges."""


def floating_bodies(
    model: mujoco.MjModel, *, density: float = 1000.0, options: HullOptions | None = None
) -> list[FloatingBody]:
    """The free bodies of a model that float, at rest in still water, where the model has them.

    One body is in its own level frame; several are in the model's. Mass and inertia are those of the body's whole tree,
    its joints as they are in `qpos0`; the hull is the body's own.

    Raises:
        SceneError: none floats.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    found, reasons = [], []
    for body in free_bodies(model):
        wet = wet_body(model, body, None)
        inertia = inertia_of(model, body, wet.members)
        name = body_name(model, body)
        built = hull_of(model, wet, finer(options or HullOptions()), inertia) if wet.geoms else None
        if built is None or built.hull is None:
            reasons.append(f"{name!r} has no geom that water acts on")
            continue
        turn = data.xmat[body].reshape(3, 3)
        centre = data.xpos[body] + turn @ inertia.centre
        mass = float(model.body_subtreemass[body])
        try:
            rest = float_at_rest(built.hull.triangles, mass=mass, density=density, rotation=turn)
        except SinksError as error:
            reasons.append(f"{name!r}: {error}")
            continue
        tensor = turn.T @ _tree_inertia(model, data, body, centre) @ turn
        found.append((name, built.hull.triangles, mass, tensor, rest, centre))
    if not found:
        raise SceneError(
            f"nothing floats in this model: {'; '.join(reasons) or 'it has no free body'}"
        )
    return [_placed(*one, count=len(found)) for one in found]


def _tree_inertia(model: mujoco.MjModel, data: Any, root: int, centre: Array) -> Array:
    """Inertia of a tree about a point, world axes (3, 3)."""
    total = np.zeros((3, 3))
    for body in range(root, model.nbody):
        if model.body_rootid[body] != root:
            continue
        axes, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - centre
        total += axes @ np.diag(model.body_inertia[body]) @ axes.T
        total += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total


def _placed(
    name: str,
    triangles: Array,
    mass: float,
    tensor: Array,
    rest: Any,
    centre: Array,
    *,
    count: int,
) -> FloatingBody:
    """A body as it floats; alone in its own level frame."""
    turn = np.asarray(rest.rotation)
    place = np.zeros(2) if count == 1 else centre[:2]
    if count == 1:
        yaw = math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ turn
    height = rest.centre_of_mass
    own = wetted_hull(
        triangles @ turn.T + [0.0, 0.0, height],
        height=height,
        panels=max(PANELS // count, 80),
        graded=True,
    )
    return FloatingBody(
        name=name,
        hull=WettedHull(
            triangles=own.triangles + np.array([*place, 0.0]), height=height, centre=place
        ),
        mass=mass,
        inertia=turn @ tensor @ turn.T,
    )
