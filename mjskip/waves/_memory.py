"""Memory for grids of water: where it begins, and how much of it is free."""

import os
from pathlib import Path

import numpy as np

from mjskip._typing import SingleArray

PAGE = 4096
"""Bytes: a processor takes two places that differ by whole pages for one until it has looked closely."""

SECOND_OFFSET = 1024
"""Bytes into a page at which the second of two grids starts, so that a store does not hold up loads."""


def aligned_zeros(rows: int, columns: int, *, after: int = 0) -> SingleArray:
    """(rows, columns) float32 zeros that start on a cache line, `after` bytes into a page."""
    raw = np.zeros(4 * rows * columns + PAGE, np.uint8)
    start = (after - raw.ctypes.data) % PAGE
    return raw[start : start + 4 * rows * columns].view(np.float32).reshape(rows, columns)


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
