"""mjskip view: MuJoCo's own viewer."""

from __future__ import annotations

import math
from typing import Any

import click

from mjskip.cli.console import preparing
from mjskip.cli.options import chosen_scene, surface_option, throw_options
from mjskip.draw.view import view as show


@click.command()
@throw_options
@surface_option
@click.option("--slow", type=float, default=1.0, show_default=True, help="Times slower.")
@click.option("--seconds", type=float, metavar="S", help="Close by itself after this time.")
def view(surface: Any, slow: float, seconds: float | None, **throw: Any) -> None:
    """Throw the stones of SCENE in MuJoCo's viewer: live forces, live water; Enter throws again."""
    with preparing() as status:
        seen = show(
            chosen_scene(**throw),
            surface=surface,
            slow=slow,
            seconds=math.inf if seconds is None else seconds,
            ready=status.stop,
        )
    click.echo(
        f"mjskip view: {seen.frames} frames, {seen.simulated:.2f} s simulated, "
        f"{seen.throws} throw{'' if seen.throws == 1 else 's'}"
    )
    if seen.late > 0.1 * slow * seen.simulated:
        click.echo(
            f"mjskip view: this machine is too slow: the clock went {seen.late:.1f} s ahead",
            err=True,
        )
