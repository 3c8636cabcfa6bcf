"""Options that several commands share, and what is made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from typing import Any, TypeVar

import click

from mjskip.coupling.moving_water import SURFACES
from mjskip.hydro.laws import LAWS
from mjskip.hydro.water import GATES
from mjskip.throws.recording import Limits
from mjskip.throws.scene import Scene, load_scene
from mjskip.throws.throw import PARAMETERS

F = TypeVar("F", bound=Callable[..., Any])


def throw_options(function: F) -> F:
    """The scene, the stone, its throw and its water: together, what `chosen_scene` takes."""
    return _together(
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
            "--gate", type=click.Choice(GATES), help="Which wet faces are loaded.  [default: the scene's]"
        ),
        click.option(
            "--buoyancy/--no-buoyancy", default=None,
            help="The water bears: hydrostatic pressure.  [default: the scene's]",
        ),
        click.option(
            "--skin-friction/--no-skin-friction", default=None,
            help="The water rubs: ITTC 1957.  [default: the scene's]",
        ),
        click.option(
            "--quadrature/--no-quadrature", default=None,
            help="Loads integrated over faces, not taken at centroids.  [default: the scene's]",
        ),
    )(function)  # fmt: skip


def limit_options(function: F) -> F:
    """When a run is over: together, what `chosen_limits` takes."""
    return _together(
        click.option(
            "--duration", type=float, default=Limits.duration, show_default=True, metavar="S",
            help="Longest simulated time.",
        ),
        click.option(
            "--max-contact", type=float, default=Limits.max_contact, show_default=True, metavar="S",
            help="Longest touch; a longer one ends the run. Give --duration for what floats.",
        ),
    )(function)  # fmt: skip


timestep_option = click.option(
    "--timestep", type=float, metavar="S", help="Time step.  [default: the scene's]"
)

surface_option = click.option(
    "--surface", type=click.Choice(SURFACES), default="still", show_default=True,
    help="What stones feel: the undisturbed level, or the scene's lake as they move it; deep by the plugin only.",
)  # fmt: skip


sea_option = click.option(
    "--sea", metavar="TEXT",
    help='Waves and current about what radiates, as "hs=0.3 tp=3 direction=30".  [default: the scene\'s]',
)  # fmt: skip


def _together(*decorators: Callable[[F], F]) -> Callable[[F], F]:
    """One decorator of several, in the order of the help."""
    return lambda function: reduce(lambda made, each: each(made), reversed(decorators), function)


def chosen_scene(
    scene: str,
    body: str | None,
    law: str | None,
    gate: str | None,
    buoyancy: bool | None,
    skin_friction: bool | None,
    quadrature: bool | None,
    sea: str | None = None,
    **throw: float | None,
) -> Scene:
    """The scene with what was asked for at the command line."""
    loaded = load_scene(scene, body=body, sea=sea)
    given = {n: PARAMETERS[n].to_si(value) for n, value in throw.items() if value is not None}
    loaded = loaded.rethrow(**given)
    water: dict[str, Any] = {
        "law": law, "gate": gate, "buoyancy": buoyancy, "skin_friction": skin_friction,
        "quadrature": quadrature,
    }  # fmt: skip
    water = {key: value for key, value in water.items() if value is not None}
    return replace(loaded, water=replace(loaded.water, **water)) if water else loaded


def chosen_limits(duration: float, max_contact: float) -> Limits:
    """The limits that were asked for at the command line."""
    return Limits(duration=duration, max_contact=max_contact)


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
