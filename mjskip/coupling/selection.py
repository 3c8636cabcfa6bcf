"""Which bodies and geoms of a model are wet.

Unless told otherwise: all moving bodies of every tree whose root has a free joint, each with the bodies that
are welded to it, and of them together the geoms that collide, or all if none does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from mjskip.coupling.bodies import (
    SOLIDS,
    body_geoms,
    body_id,
    body_name,
    free_bodies,
    geom_name,
    kind_name,
    label,
)
from mjskip.errors import SceneError

BodyRule = str | int | Sequence[str | int] | Callable[[Any, int], bool] | None
"""Bodies: "all", "group N" (with a geom of the group), a name, an id, several, or (model, id) -> bool."""

GeomRule = str | int | Sequence[str | int] | Callable[[Any, int], bool] | None
"""Geoms: "all", "collision", "group N", a name, an id, several, or (model, id) -> bool."""


@dataclass(frozen=True, kw_only=True)
class WetBody:
    """A rigid part of a model that water acts on.

    Attributes:
        body: id of the body that the force acts on.
        members: ids of it and of the bodies that are welded to it.
        geoms: ids of the geoms that are wet.
        left_out: why its other geoms are not, by id.
    """

    body: int
    members: tuple[int, ...]
    geoms: tuple[int, ...]
    left_out: Mapping[int, str]


@dataclass(frozen=True, kw_only=True)
class Selection:
    """What is wet in a model.

    Attributes:
        wet: the wet bodies, in the order of their ids or as they were named.
        dry: why the other moving bodies are dry, by id.
    """

    wet: tuple[WetBody, ...]
    dry: Mapping[int, str]


def select(model: mujoco.MjModel, bodies: BodyRule = None, geoms: GeomRule = None) -> Selection:
    """Choose the wet bodies and geoms of a model.

    Raises:
        SceneError: nothing is chosen, or something is named that is not there or cannot be wet.
        ValueError: a rule is of no kind that is known.
    """
    heads = _heads(model, bodies)
    rule = geom_rule(model, geoms, [m for head in heads for m in members_of(model, head)])
    wet: list[WetBody] = []
    dry: dict[int, str] = {}
    covered: set[int] = set()
    for head in heads:
        if head in covered:  # an ancestor that it is welded to was named too
            continue
        found = wet_body(model, head, rule)
        covered.update(found.members)
        if found.geoms:
            wet.append(found)
        else:
            dry[head] = _why_dry(model, found)
    if not wet:
        reasons = "; ".join(f"body {body_name(model, b)!r}: {why}" for b, why in dry.items())
        raise SceneError(f"this model has no geom for water to act on: {reasons}")
    moving = {int(b) for b in range(1, model.nbody) if _moves(model, b)}
    for body in sorted(moving - covered):
        dry[body] = "not chosen"
    return Selection(wet=tuple(wet), dry=dry)


def _why_dry(model: Any, found: WetBody) -> str:
    if not found.left_out:
        return "no geoms"
    return ", ".join(f"{geom_name(model, g)} {why}" for g, why in found.left_out.items())


def wet_body(
    model: Any, head: int, chosen: Callable[[int], bool] | None, *, stop: Iterable[int] = ()
) -> WetBody:
    """A body and what is welded to it, with the geoms that a rule chooses; see `geom_rule`."""
    members = members_of(model, head, stop=stop)
    solid: list[int] = []
    left_out: dict[int, str] = {}
    for geom in (geom for member in members for geom in body_geoms(model, member)):
        if int(model.geom_type[geom]) in SOLIDS:
            solid.append(geom)
        else:
            left_out[geom] = f"is a {kind_name(model, geom)}, no solid"
    if chosen is not None:
        taken = [geom for geom in solid if chosen(geom)]
        why = "not chosen"
    else:
        colliding = [geom for geom in solid if collides(model, geom)]
        taken = colliding or solid
        why = "does not collide, others of its body do"
    left_out |= {geom: why for geom in solid if geom not in taken}
    return WetBody(body=head, members=members, geoms=tuple(taken), left_out=left_out)


def collides(model: Any, geom: int) -> bool:
    """Whether a geom takes part in contacts."""
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def members_of(model: Any, head: int, *, stop: Iterable[int] = ()) -> tuple[int, ...]:
    """A body and those below it that are welded to it, without those that begin at `stop`."""
    found, barred = [int(head)], set(stop)
    inside = {int(head)}
    for body in range(int(head) + 1, int(model.nbody)):
        parent = int(model.body_parentid[body])
        welded = int(model.body_weldid[body]) == int(model.body_weldid[head])
        if parent in inside and welded and body not in barred:
            inside.add(body)
            found.append(body)
    return tuple(found)


def _moves(model: Any, body: int) -> bool:
    """Whether a body has a joint of its own."""
    return int(model.body_jntnum[body]) > 0


def can_move(model: Any, body: int) -> bool:
    """Whether a force moves a body: it, or one above it, has a joint; a mocap body has none."""
    while body > 0:
        if _moves(model, body):
            return True
        body = int(model.body_parentid[body])
    return False


def _heads(model: mujoco.MjModel, rule: BodyRule) -> list[int]:
    """The bodies that a rule names; those welded to them come with them."""
    moving = [body for body in range(1, model.nbody) if _moves(model, body)]
    if rule is None:
        roots = set(free_bodies(model))
        if not roots:
            raise SceneError(
                "this model has no free body: choose with bodies= which are wet, where "
                'bodies="all" takes every one that moves, or give one that floats a <freejoint/>'
                if moving
                else "this model has no free body, and nothing else moves: give one a <freejoint/>"
            )
        return [body for body in moving if int(model.body_rootid[body]) in roots]
    if isinstance(rule, str) and rule == "all":
        if not moving:
            raise SceneError("nothing moves in this model: give a body a <freejoint/>")
        return moving
    groups = _groups("bodies", rule)
    if groups is not None:
        found = [
            body
            for body in moving
            if any(
                int(model.geom_group[geom]) in groups
                for member in members_of(model, body)
                for geom in body_geoms(model, member)
            )
        ]
        return found or _nothing(f"no body that moves has a geom of group {sorted(groups)}")
    if callable(rule) and not isinstance(rule, type):
        found = [body for body in moving if rule(model, body)]
        return found or _nothing("bodies= chooses no body that moves")
    return [_body(model, item) for item in _items("bodies", rule)]


def _nothing(why: str) -> list[int]:
    raise SceneError(f"{why}: choose others")


def _body(model: mujoco.MjModel, item: str | int) -> int:
    body = body_id(model, item)
    if not can_move(model, body):
        raise SceneError(
            f"body {body_name(model, body)!r} is fixed to the world: water cannot move it; name a body with "
            "a joint at or above it"
        )
    return body


def geom_rule(model: Any, rule: GeomRule, bodies: Sequence[int]) -> Callable[[int], bool] | None:
    """A rule for geoms as a function of a geom's id; None for the colliding ones first."""
    if rule is None:
        return None
    if isinstance(rule, str) and rule == "all":
        return lambda geom: True
    if isinstance(rule, str) and rule == "collision":
        return lambda geom: collides(model, geom)
    groups = _groups("geoms", rule)
    if groups is not None:
        return lambda geom: int(model.geom_group[geom]) in groups
    if callable(rule) and not isinstance(rule, type):
        return lambda geom: bool(rule(model, geom))
    there = [geom for body in bodies for geom in body_geoms(model, body)]
    names = {str(model.geom(geom).name): geom for geom in there}
    chosen = set()
    for item in _items("geoms", rule):
        geom = names.get(item) if isinstance(item, str) and item else item
        if geom not in there:
            has = ", ".join(geom_name(model, g) for g in there) or "none"
            raise SceneError(f"no geom {item!r} on these bodies: their geoms are {has}")
        if int(model.geom_type[int(geom)]) not in SOLIDS:
            raise SceneError(
                f"{label(model, int(geom))} is a {kind_name(model, int(geom))}, which displaces no water: "
                "leave it out of geoms="
            )
        chosen.add(int(geom))
    return lambda geom: geom in chosen


def _groups(name: str, rule: Any) -> set[int] | None:
    """The groups that "group 3" or "group 0 2" names; None for other rules."""
    if not isinstance(rule, str) or rule.split()[:1] != ["group"]:
        return None
    numbers = rule.split()[1:]
    if not numbers or not all(n.isdigit() and int(n) < mujoco.mjNGROUP for n in numbers):
        raise ValueError(
            f'{name} is {rule!r}: give groups from 0 to {mujoco.mjNGROUP - 1}, as in "group 3"'
        )
    return {int(n) for n in numbers}


def _items(name: str, rule: Any) -> list[str | int]:
    """Names and ids of a rule that lists them; a text is one name."""
    if isinstance(rule, str) or _is_id(rule):
        return [rule]
    items = list(rule) if isinstance(rule, Iterable) else None
    if items is None or not all(isinstance(item, str) or _is_id(item) for item in items):
        raise ValueError(
            f'{name} is {rule!r}: give names or ids, "all", "group N", or a function of (model, id)'
        )
    if not items:
        raise ValueError(f"{name} is empty: leave it out, or give names or ids")
    return items


def _is_id(item: Any) -> bool:
    return isinstance(item, int | np.integer) and not isinstance(item, bool | np.bool_)
