"""mjskip play: the playground in the browser."""

from __future__ import annotations

import signal
import threading
import warnings
from typing import Any

import click

from mjskip.cli.console import preparing
from mjskip.throws.scene import load_scene


@click.command()
@click.argument("scene", default="lake")
@click.option("--body", metavar="NAME", help="Stone to throw.  [default: the first]")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Where to listen; 0.0.0.0 lets everybody in your networks throw.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=8080,
    show_default=True,
    help="0 takes any that is free.",
)
def play(scene: str, body: str | None, host: str, port: int) -> None:
    """A page where you throw the stone of SCENE; Ctrl-C ends it."""
    from mjskip.play.access import is_loopback
    from mjskip.play.server import Playground

    # a tab that closes while its stone flies: nobody misses the frame
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    ended = threading.Event()

    def end(*_: Any) -> None:
        ended.set()

    with preparing():
        playground = Playground(load_scene(scene, body=body), host=host, port=port)
    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        who = (
            "this machine only"
            if is_loopback(host)
            else "whoever has this address can use it: the token is its only protection, and nothing is encrypted"
        )
        click.echo(f"mjskip play: {playground.url} ({who}); Ctrl-C ends")
        ended.wait()
    finally:
        playground.close()
        for number, handler in before.items():
            signal.signal(number, handler)
    click.echo("mjskip play: ended")
