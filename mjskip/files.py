"""Writing files so that a reader never meets half of one."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mjskip.errors import MjskipError


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path beside `path` to write to, renamed to it when all went well, removed otherwise.

    Raises:
        MjskipError: the folder does not exist or cannot be written to.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise MjskipError(f"folder {target.parent} does not exist: create it, or name another file")
    if target.is_dir():
        raise MjskipError(f"{target} is a folder: name a file")
    if not os.access(target.parent, os.W_OK):
        raise MjskipError(f"folder {target.parent} cannot be written to: name another one")
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
