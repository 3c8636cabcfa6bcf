"""Checks of arguments: ValueError with one line that names the argument, what came, and what to give instead."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array

T = TypeVar("T")

MAX_SHOWN = 60
"""Characters of a value that are shown."""

SMALL = 2**26
"""Bytes that are taken without a look at how much memory is free."""


def fault(name: str, value: object, remedy: str) -> ValueError:
    """The error to raise: "speed is 'fast': give a number"."""
    text = " ".join(repr(value).split())
    if len(text) > MAX_SHOWN:
        text = f"{text[:MAX_SHOWN]}..."
    return ValueError(f"{name} is {text}: {remedy}")


def as_number(value: Any) -> float | None:
    """The value as a float; None if it is text, a switch, an array or anything else but a number."""
    if isinstance(value, str | bytes | bool | np.bool_) or np.ndim(value) != 0:
        return None
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return None


def check_type(name: str, value: object, kind: type[T], remedy: str = "") -> T:
    """The value, which must be of this class."""
    if not isinstance(value, kind):
        raise fault(name, value, remedy or f"give a mjskip.{kind.__name__}")
    return value


def check_number(
    name: str,
    value: object,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
) -> float:
    """The value as a float, which must be finite and between these limits (included)."""
    number = as_number(value)
    if number is None or not (math.isfinite(number) and low <= number <= high):
        raise fault(name, value, f"give {_range('a finite number', low, high, unit)}")
    return number


def check_positive(**named: object) -> None:
    """Every named value must be a finite number greater than 0."""
    for name, value in named.items():
        number = as_number(value)
        if number is None or not (math.isfinite(number) and number > 0.0):
            raise fault(name, value, "give a finite number greater than 0")


def check_count(name: str, value: object, *, low: int = 1, high: float = math.inf) -> int:
    """The value as an int, which must be a whole number between these limits (included)."""
    number = as_number(value)
    if number is None or not (number % 1.0 == 0.0 and low <= number <= high):
        raise fault(name, value, f"give {_range('a whole number', low, high)}")
    return int(number)


def check_switch(name: str, value: object) -> bool:
    """The value, which must be True or False."""
    if not isinstance(value, bool | np.bool_):
        raise fault(name, value, "give True or False")
    return bool(value)


def check_choice(name: str, value: T, allowed: Collection[T]) -> T:
    """The value, which must be one of those allowed."""
    if not isinstance(value, str) or value not in allowed:
        raise fault(name, value, f"use one of {', '.join(map(str, allowed))}")
    return value


def check_array(name: str, value: object, *shape: int | None, remedy: str = "") -> Array:
    """The value as an array of finite real numbers; of this shape, if one is given, None being any length."""
    array = _as_array(value)
    fits = array is not None and (
        not shape
        or (
            array.ndim == len(shape)
            and all(want in (None, n) for want, n in zip(shape, array.shape, strict=True))
        )
    )
    if array is None or not fits:
        sides = ", ".join("n" if n is None else str(n) for n in shape)
        text = f"give finite numbers, ({sides})" if shape else "give finite numbers"
        raise fault(name, value, remedy or text)
    return array


def check_vector(name: str, value: object, size: int) -> Array:
    """The value as an array (size,) of finite numbers."""
    return check_array(name, value, size, remedy=f"give {size} finite numbers")


def check_triangles(vertices: object, faces: object) -> tuple[Array, npt.NDArray[np.int32]]:
    """Vertices (n, 3) [m], and triangles (m, 3) as indices of them."""
    points = check_array("vertices", vertices, None, 3)
    index = _as_array(faces)
    if (
        index is None
        or index.ndim != 2
        or index.shape[1] != 3
        or not len(index)
        or (index % 1.0 != 0.0).any()
        or not (index.min() >= 0 and index.max() < len(points))
    ):
        raise fault("faces", faces, "give triangles (m, 3) as indices of the vertices")
    return points, np.asarray(index, dtype=np.int32)


def _as_array(value: object) -> Array | None:
    """Finite real numbers as an array, or None."""
    try:
        found = np.asarray(value)
        if found.dtype.kind in "biuf" or (found.dtype == object and found.size):
            found = found.astype(np.float64)
            return found if np.isfinite(found).all() else None
    except (TypeError, ValueError, OverflowError):
        pass
    return None


def check_mapping(name: str, value: object, remedy: str) -> Mapping[str, Any]:
    """The value, which must map names to something."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise fault(name, value, remedy)
    return value


def check_names(name: str, value: object) -> tuple[str, ...]:
    """The value as a tuple of names; a single text is one name and not its letters."""
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, Collection) or not all(isinstance(n, str) for n in names):
        raise fault(name, value, "give names, such as ['stone']")
    return tuple(names)


def check_path(name: str, value: object) -> Path:
    """The value as a path."""
    if not isinstance(value, str | os.PathLike) or not os.fspath(value):
        raise fault(name, value, "give a path")
    return Path(os.fsdecode(value))


def check_memory(what: str, size: float, remedy: str) -> None:
    """What is about to be made must fit into the memory that is free.

    Args:
        what: it is, with its extent.
        size: it takes [bytes].
        remedy: what to ask for instead.
    """
    if size < SMALL:
        return
    free = free_memory()
    if not size <= 0.9 * free:
        raise ValueError(
            f"{what} needs {size / 1e9:.3g} GB and {free / 1e9:.3g} GB are free: {remedy}"
        )


def free_memory() -> int:
    """Bytes this process may still take: the machine's, the container's or its own limit's, whichever is least."""
    free = 1 << 62
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                free = 1024 * int(line.split()[1])
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
        if limit != "max":
            free = min(free, max(0, int(limit) - used))
    except (OSError, ValueError):
        if free == 1 << 62 and hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
            free = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        most, _ = resource.getrlimit(resource.RLIMIT_AS)
        if most != resource.RLIM_INFINITY:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            free = min(free, max(0, most - pages * resource.getpagesize()))
    return free


def _range(kind: str, low: float, high: float, unit: str = "") -> str:
    unit = f" {unit}" if unit else ""
    if math.isinf(low) and math.isinf(high):
        return f"{kind}{f' of{unit}' if unit else ''}"
    if math.isinf(high):
        return f"{kind} of at least {low:g}{unit}"
    if math.isinf(low):
        return f"{kind} of at most {high:g}{unit}"
    return f"{kind} between {low:g} and {high:g}{unit}"
