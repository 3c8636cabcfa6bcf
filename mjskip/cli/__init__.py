"""The command line: degrees and revolutions per second here, SI and radians everywhere else."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

import click

from mjskip.errors import DivergedError, MjskipError, MjskipWarning

COMMANDS = {
    "run": "Run a scene, a boat or a robot that floats or a stone that is thrown; draw a video.",
    "compare": "The same throw by MuJoCo and by the pure integrator, over a ladder of time steps.",
    "sweep": "Throws over a grid of parameters: most skips, where they skip, how surely.",
    "optimize": "The best throw within a thrower's limits, for a hand that scatters.",
    "plot": "A page of curves about saved throws (extra: plot).",
    "play": "A page in the browser where you throw (extra: play).",
    "view": "MuJoCo's own viewer with the water, live.",
    "hydro": "Added mass, damping, natural periods and responses of what floats in a model.",
    "inspect": "What is wet in a model and why, how it floats, and what that costs.",
    "laws": "Which force law for what body, and the error to expect.",
    "info": "Versions, OpenGL renderer, ffmpeg, threads, shipped scenes.",
}
"""Each is a module of this package with a click command of the same name."""

SHORT_OF_MEMORY = 2**28
"""Bytes below which a failure of a library is put down to too little memory."""


class _Group(click.Group):
    """Imports a command's module when it is asked for: help stays quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(import_module(f"mjskip.cli.{cmd_name}"), cmd_name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mjskip")
def cli() -> None:
    """A water surface for MuJoCo: boats, robots, and stones that skip."""


def main(
    arguments: list[str] | None = None, *, interrupted: Callable[[], bool] = lambda: False
) -> None:
    """Run a command and exit: 0 well, 1 the run diverged, 2 bad input, 130 interrupted.

    `interrupted` says whether an interrupt has come: libraries that call back into Python turn a
    KeyboardInterrupt into errors of their own, which are then not the user's.
    """
    warnings.simplefilter("always", MjskipWarning)
    warnings.showwarning = _show_warning
    try:
        code = cli.main(arguments, prog_name="mjskip", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        code = 0
    except Exception as error:
        code = _fail("interrupted", 130) if interrupted() else _code_of(error)
    except KeyboardInterrupt:
        code = _fail("interrupted", 130)
    sys.exit(code or 0)


def _code_of(error: Exception) -> int:
    """The exit status of an error, told in one line; a defect of ours is raised again."""
    if isinstance(error, click.UsageError):
        command = error.ctx.command_path if error.ctx else "mjskip"
        return _fail(f"{error.format_message()} See {command} --help.", 2)
    if isinstance(error, click.Abort):
        return _fail("interrupted", 130)
    if isinstance(error, DivergedError):
        return _fail(str(error), 1)
    if isinstance(error, MjskipError | ValueError):
        return _fail(" ".join(str(error).split()), 2)
    if isinstance(error, BrokenPipeError):  # whoever read our output has gone
        sys.stdout = None
        return 141
    if isinstance(error, OSError):
        where = f" ({error.filename})" if error.filename else ""
        return _fail(
            f"{error.strerror or error}{where}: the system refuses a file or a resource", 2
        )
    from mjskip.checks import free_memory  # not for --help

    text = " ".join(str(error).split())
    unloaded = isinstance(error, ImportError) and "shared object" in text
    # short of memory libraries fail in ways of their own: threads, OpenGL and MuJoCo's compiler by RuntimeError
    exhausted = isinstance(error, RuntimeError) and free_memory() < SHORT_OF_MEMORY
    if isinstance(error, MemoryError) or unloaded or exhausted:
        kind = "a library cannot be loaded" if unloaded else "out of memory"
        return _fail(f"{kind}{f' ({text})' if text else ''}: ask for less, or free memory", 2)
    raise error


def _fail(message: str, code: int) -> int:
    click.echo(f"mjskip: {message}", err=True)
    return code


def _show_warning(message: Any, category: Any, *_rest: Any, **_named: Any) -> None:
    kind = "warning" if issubclass(category, MjskipWarning) else category.__name__
    click.echo(f"mjskip: {kind}: {message}", err=True)
