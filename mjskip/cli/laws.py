"""`mjskip laws`: which force law for what, and where each comes from."""

from __future__ import annotations

import click

from mjskip.hydro.laws import LAWS, advice_table


@click.command()
def laws() -> None:
    """Which force law for what body, with the error to expect; and every law with its source."""
    click.echo(advice_table())
    click.echo()
    width = max(map(len, LAWS))
    for name, law in LAWS.items():
        click.echo(f"{name:<{width}}  {law.source}")
