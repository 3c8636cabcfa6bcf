"""What commands print with: two consoles, tables without frames, and one progress bar."""

from __future__ import annotations

from collections.abc import Iterator
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


def preparing() -> Status:
    """What is shown while code is compiled and scenes are loaded."""
    return err.status("preparing: the first run on a machine compiles for some seconds")


def plain_table(*headings: str, left: tuple[str, ...] = ()) -> Table:
    """A table without frames; columns are numbers, on the right, but for those named in `left`."""
    table = Table(header_style="cyan", box=None, pad_edge=False, padding=(0, 1))
    for heading in headings:
        justify: Any = "left" if heading in left else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    return table


@contextmanager
def progress_bar(label: str, unit: str) -> Iterator[Report]:
    """A progress bar on stderr: call what is yielded with what is done and to do."""
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit), _Rate(),
        TextColumn("left"), TimeRemainingColumn(), console=err, transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task(label, total=None)
        begun = False

        def update(done: int, total: int) -> None:
            nonlocal begun
            if not begun:  # what a store held already was not done now
                progress.reset(task, total=total, completed=done)
                begun = True
            progress.update(task, completed=done, total=total)

        yield update


class _Rate(ProgressColumn):
    """What is done in a second."""

    def render(self, task: Task) -> Text:
        """The rate of a task as text."""
        return Text(f"{task.speed:.0f}/s" if task.speed else "")
