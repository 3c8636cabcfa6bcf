"""mjskip info: what is installed here."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version

import click
import numba
from rich.console import Console
from rich.table import Table

from mjskip.draw.render import gl_renderer, is_software
from mjskip.draw.video import ffmpeg
from mjskip.errors import MjskipError
from mjskip.throws.scene import shipped_scenes


@click.command()
def info() -> None:
    """Versions, OpenGL renderer, ffmpeg, threads, shipped scenes."""
    table = Table(show_header=False, box=None)
    table.add_column(style="cyan")
    for package in ("mjskip", "mujoco", "numpy", "numba", "trimesh"):
        table.add_row(package, version(package))
    table.add_row("python", f"{platform.python_version()} on {platform.platform()}")
    table.add_row("threads", f"{numba.config.NUMBA_NUM_THREADS} (of {os.cpu_count()} processors)")
    table.add_row("OpenGL", _attempt(_renderer))
    table.add_row("ffmpeg", _attempt(ffmpeg))
    for number, (name, path) in enumerate(shipped_scenes().items()):
        table.add_row("" if number else "scenes", f"{name}  {path}")
    Console(highlight=False, soft_wrap=True).print(table)


def _renderer() -> str:
    name = gl_renderer()
    return f"{name} (software)" if is_software(name) else name


def _attempt(ask: object) -> str:
    try:
        return str(ask())  # type: ignore[operator]
    except MjskipError as error:
        return f"none: {error}"
