"""Memory for grids of water: where it begins."""

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
