"""Options that several commands share, and what is made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import click

from mjskip.hydro.laws import LAWS
from mjskip.hydro.water import GATES
from mjskip.throws.scene import Scene, load_scene
from mjskip.throws.throw import PARAMETERS

F = TypeVar("F", bound=Callable[..., Any])


def throw_options(function: F) -> F:
    """The scene, the stone, its throw and its water: together, what `chosen_scene` takes."""
    decorators = [
        click.argument("scene", default="lake"),
        click.option("--body", metavar="NAME", help="Stone to follow.  [default: the first]"),
        *(
            click.option(
                f"--{name}", type=float, metavar=parameter.shown_unit.upper(),
                help=f"{parameter.text}  [default: the scene's]",
            )
            for name, parameter in PARAMETERS.items()
        ),
        click.option(
            "--law", type=click.Choice(list(LAWS)), help="Force law.  [default: the scene's]"
        ),
        click.option(
            "--gate",
            type=click.Choice(GATES),
            help="Which wet faces are loaded.  [default: the scene's]",
        ),
        click.option("--buoyancy", is_flag=True, help="The water bears: hydrostatic pressure."),
        click.option("--skin-friction", is_flag=True, help="The water rubs: ITTC 1957."),
    ]  # fmt: skip
    for decorator in reversed(decorators):
        function = decorator(function)
    return function


def chosen_scene(
    scene: str,
    body: str | None,
    law: str | None,
    gate: str | None,
    buoyancy: bool,
    skin_friction: bool,
    **throw: float | None,
) -> Scene:
    """The scene with what was asked for at the command line."""
    loaded = load_scene(scene, body=body)
    given = {n: PARAMETERS[n].to_si(value) for n, value in throw.items() if value is not None}
    loaded = loaded.rethrow(**given)
    water: dict[str, Any] = {
        key: value for key, value in (("law", law), ("gate", gate)) if value is not None
    }
    water |= {"buoyancy": True} if buoyancy else {}
    water |= {"skin_friction": True} if skin_friction else {}
    return replace(loaded, water=replace(loaded.water, **water)) if water else loaded


class Size(click.ParamType[tuple[int, int]]):
    """Picture size as WIDTHxHEIGHT."""

    name = "WIDTHxHEIGHT"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[int, int]:
        """Two whole numbers from text such as 640x480."""
        if isinstance(value, tuple):
            return value
        width, cross, height = str(value).lower().partition("x")
        if not (cross and width.isdigit() and height.isdigit()):
            self.fail(
                f"{value!r} is no size: give WIDTHxHEIGHT in pixels, such as 640x480", param, ctx
            )
        return int(width), int(height)
