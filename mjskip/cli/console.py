"""What commands print with: two consoles, tables without frames, and what shows that long work goes on.

All of that goes to stderr, and only where somebody looks: nothing on a pipe or in a file.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.status import Status
from rich.table import Table
from rich.text import Text

from mjskip._typing import Progress as Report

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)

OFTEN = 0.1
"""Time between two pictures of a bar [s]."""

COMPILED = 90
"""Functions that the first run on a machine compiles, about."""


@contextmanager
def preparing(text: str = "preparing") -> Iterator[Status]:
    """A line on stderr while something goes on, and while code is compiled for the first time."""
    status = err.status(text)
    try:
        status.start()
    except RuntimeError:  # no thread to be had: then without
        status.stop()
    with _compiling(status.update):
        try:
            yield status
        finally:
            status.stop()


@contextmanager
def _compiling(show: Callable[[str], None]) -> Iterator[None]:
    """Show how many functions are compiled, for how long, and for how long still."""
    from mjskip._compile.cache import watchers

    begun = time.monotonic()
    compiled = 0

    def watch() -> None:
        nonlocal begun, compiled
        if compiled == 0:
            begun = time.monotonic()
        compiled += 1
        took = time.monotonic() - begun
        left = took / compiled * max(COMPILED - compiled, 1)
        show(
            f"compiling for the first run on this machine: {compiled} of about {max(COMPILED, compiled)} "
            f"functions, {took:.0f} s, about {left:.0f} s left"
        )

    watchers.append(watch)
    try:
        yield
    finally:
        watchers.remove(watch)


def plain_table(*headings: str, left: tuple[str, ...] = ()) -> Table:
    """A table without frames; columns are numbers, on the right, but for those named in `left`."""
    table = Table(header_style="cyan", box=None, pad_edge=False, padding=(0, 1))
    for heading in headings:
        justify: Any = "left" if heading in left else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    return table


@contextmanager
def progress_bar(label: str, unit: str) -> Iterator[Report]:
    """A progress bar on stderr: call what is yielded with what is done and to do.

    It is drawn by those calls and by no thread, so that it cannot fail where threads are refused.
    """
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit), _Rate(),
        TextColumn("left"), TimeRemainingColumn(), console=err, transient=True, auto_refresh=False,
        disable=not err.is_terminal,
    ) as progress:  # fmt: skip
        task = progress.add_task(label, total=None)
        progress.refresh()
        begun, drawn = False, 0.0

        def update(done: int, total: int) -> None:
            nonlocal begun, drawn
            if not begun:  # what a store held already was not done now
                progress.reset(task, total=total, completed=done)
                begun = True
            now = time.monotonic()
            if now - drawn >= OFTEN or done == total:
                drawn = now
                progress.update(task, description=label, completed=done, total=total, refresh=True)

        def compiling(text: str) -> None:
            progress.update(task, description=text, refresh=True)

        with _compiling(compiling):
            yield update


class _Rate(ProgressColumn):
    """What is done in a second."""

    def render(self, task: Task) -> Text:
        """The rate of a task as text."""
        if not task.speed:
            return Text("")
        return Text(f"{task.speed:.0f}/s" if task.speed >= 10.0 else f"{task.speed:.2g}/s")
