"""Writing files and folders so that a reader never meets half of one, and one line where that fails."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mjskip._typing import PathLike
from mjskip.checks import check_path
from mjskip.errors import MjskipError


def check_target(path: PathLike) -> Path:
    """The path, if a file or folder can be made there.

    Raises:
        MjskipError: its folder does not exist or cannot be written to.
    """
    target = check_path("path", path)
    check_folder(target.parent)
    return target


def check_folder(folder: PathLike) -> Path:
    """The folder, if it exists and files can be made in it.

    Raises:
        MjskipError: it does not exist or cannot be written to.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise MjskipError(f"folder {folder} does not exist: create it, or name another")
    if not os.access(folder, os.W_OK):
        raise MjskipError(f"folder {folder} cannot be written to: name another")
    return folder


@contextmanager
def whole_file(path: PathLike) -> Iterator[Path]:
    """A path beside `path` to write a file or a folder to; renamed to it when all went well, removed otherwise.

    What processes that are no longer there left beside the same target is removed first.

    Raises:
        MjskipError: the folder does not exist or cannot be written to, the disk is full, a size limit is
            reached, or the memory does not suffice. What was at `path` before is still there.
    """
    target = check_target(path)
    if target.is_dir():
        raise MjskipError(f"{target} is a folder: name a file")
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        with writing(target):
            _remove_leftovers(target)
            yield part
            os.replace(part, target)
    finally:
        with suppress(OSError):
            _remove(part)


@contextmanager
def writing(target: PathLike) -> Iterator[None]:
    """Turn what a disk or the memory refuses while `target` is written into one line.

    Raises:
        MjskipError: names the target and the reason.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split()) or type(error).__name__
        raise MjskipError(
            f"{target} cannot be written ({reason}): make room, or name a place that can be written to"
        ) from error
    except MemoryError as error:
        raise MjskipError(
            f"{target} cannot be written (out of memory): ask for less, or free memory"
        ) from error


def _remove_leftovers(target: Path) -> None:
    """Remove parts of the same target that processes left which have ended since."""
    name = re.compile(
        rf"\.{re.escape(target.stem)}\.(\d+)\.part{re.escape(target.suffix)}", re.DOTALL
    )
    for entry in os.scandir(target.parent):
        found = name.fullmatch(entry.name)
        if found and not _is_running(int(found[1])):
            with suppress(OSError):
                _remove(Path(entry.path))


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # somebody else's process
        return True
    return True


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def reading(path: PathLike, *, what: str, writer: str) -> Iterator[None]:
    """Turn everything that a missing, damaged or foreign file does to its reader into one line.

    Args:
        path: the file.
        what: it should hold, such as "a trajectory".
        writer: what writes such files, such as "Trajectory.save".

    Raises:
        MjskipError: names the file, the reason, and what to give instead.
    """
    file = check_path("path", path)
    try:
        if not file.exists():
            raise FileNotFoundError("there is no such file")
        yield
    except MjskipError:
        raise
    except Exception as error:  # HDF5, zip and JSON readers raise anything
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MjskipError(
            f"{path} cannot be read as {what} ({reason}): give one that {writer} wrote"
        ) from error
