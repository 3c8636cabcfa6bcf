"""Types and round heads of `Lake`."""

import math

import numpy as np
import numpy.typing as npt

from mjskip.waves._lake_kernels import fill_head

FloatArray = npt.NDArray[np.float64]
SurfaceArray = npt.NDArray[np.float32]
Head = tuple[SurfaceArray, int, int]
"""A pressure head [m] and the stored cell that its first element lies on."""


def round_head(
    centre: tuple[float, float], reach: float, volume: float, *, first: tuple[int, int] = (0, 0)
) -> Head:
    """A round head of this volume [cells x m] about a centre given in cells.

    Args:
        centre: in cells from the first one.
        reach: of the load, in cells.
        volume: sum of the head over its cells [m].
        first: stored row and column of the first cell.
    """
    x, y = centre
    i, j = math.ceil(x - reach), math.ceil(y - reach)
    head = np.empty((math.floor(x + reach) - i + 1, math.floor(y + reach) - j + 1), np.float32)
    fill_head(head, x - i, y - j, reach, volume)
    return head, first[0] + i, first[1] + j
