"""Memory for grids of water, and the checks on what they are asked to be."""

import math
import os
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Name = TypeVar("Name", bound=str)

PAGE = 4096
"""Bytes: a processor takes two places that differ by whole pages for one until it has looked closely."""

LARGEST = float(np.finfo(np.float32).max)

APART = 1024
"""Bytes into a page at which the second of two grids starts, so that a store does not hold up loads."""


def aligned_zeros(rows: int, columns: int, *, after: int = 0) -> npt.NDArray[np.float32]:
    """(rows, columns) float32 zeros that start on a cache line, `after` bytes into a page."""
    raw = np.zeros(4 * rows * columns + PAGE, np.uint8)
    start = (after - raw.ctypes.data) % PAGE
    return raw[start : start + 4 * rows * columns].view(np.float32).reshape(rows, columns)


def positions(n: int, centre: float, spacing: float) -> npt.NDArray[np.float64]:
    """(n,) places `spacing` apart about their centre [m]."""
    return np.asarray(centre + (np.arange(n) - (n - 1) / 2) * spacing, np.float64)


def free_memory() -> int:
    """Bytes this process may still take: the machine's or the container's, whichever is less."""
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
    return free


def refuse_if_too_large(shape: tuple[int, int], size: int) -> None:
    """Raise ValueError if `size` bytes are more than nine tenths of what is free."""
    free = free_memory()
    if size > 0.9 * free:
        raise ValueError(
            f"shape is {shape[0]} x {shape[1]}: that grid needs {size / 1e9:.3g} GB and "
            f"{free / 1e9:.3g} GB are free; use fewer cells, a larger spacing, or a Lake"
        )


def checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Two whole numbers of at least 3."""
    try:
        nx, ny = (int(n) for n in shape)
        if (nx, ny) == tuple(shape) and min(nx, ny) >= 3:
            return nx, ny
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(
        f"shape is {shape!r}: give two whole numbers of at least 3, (cells x, cells y)"
    )


def checked_number(name: str, value: float, unit: str, *, positive: bool = False) -> float:
    """A finite number of at least 0, or above 0."""
    if not (math.isfinite(value) and (value > 0.0 if positive else value >= 0.0)):
        allowed = "above 0" if positive else "of at least 0"
        raise ValueError(f"{name} is {value!r}: give a finite number {allowed} [{unit}]")
    return float(value)


def checked_finite(unit: str, **values: float) -> None:
    """Finite numbers of either sign."""
    for name, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"{name} is {value!r}: give a finite number [{unit}]")


def checked_height(height: float) -> None:
    """A finite number of metres that the surface can store."""
    if not abs(height) <= LARGEST:
        raise ValueError(f"height is {height!r}: give a number that single precision holds [m]")


def checked_load(
    x: float,
    y: float,
    *,
    force: float,
    radius: float,
    density: float,
    gravity: float,
    spacing: float,
) -> float:
    """Volume of the head of a load that can be pressed on water [cells x m]."""
    checked_finite("m", x=x, y=y)
    checked_finite("N", force=force)
    checked_number("radius", radius, "m", positive=True)
    checked_number("density", density, "kg/m^3", positive=True)
    checked_number("gravity", gravity, "m/s^2", positive=True)
    volume = force / (density * gravity * spacing**2)
    if not abs(volume) <= LARGEST:
        raise ValueError(
            f"force is {force!r} N on water of {density!r} kg/m^3: that is more than single precision holds"
        )
    return volume


def checked_name(what: str, name: Name, allowed: tuple[Name, ...]) -> Name:
    """One of the names there are."""
    if name not in allowed:
        raise ValueError(f"{what} is {name!r}: use one of {', '.join(allowed)}")
    return name
