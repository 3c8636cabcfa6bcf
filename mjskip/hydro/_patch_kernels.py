"""A patch of moving surface around a body: bilinear between its points, still water outside."""

from typing import Any

import numba

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, bits
from mjskip.hydro._block import (
    PATCH_NX,
    PATCH_NY,
    PATCH_POINTS,
    PATCH_RATE,
    PATCH_X,
    PATCH_Y,
    SURFACE,
)


@kernel
def patch_of(block: Any) -> Any:
    """The patch of surface around a body; empty if the water is still."""
    address = bits(block[SURFACE])
    if address == 0:
        return numba.carray(as_doubles(address), 0)
    head = numba.carray(as_doubles(address), PATCH_POINTS)
    size = PATCH_POINTS + 2 * int(head[PATCH_NX]) * int(head[PATCH_NY])
    return numba.carray(as_doubles(address), size)


@kernel
def surface_at(patch: Any, state: Any, x: float, y: float, z: float, speed: int) -> float:
    """Elevation (speed 0) or vertical speed (1) of the surface at a point of the body, body axes."""
    nx, ny = int(patch[PATCH_NX]), int(patch[PATCH_NY])
    east = (state[0] + state[3] * x + state[4] * y + state[5] * z - patch[PATCH_X]) * patch[
        PATCH_RATE
    ]
    north = (state[1] + state[6] * x + state[7] * y + state[8] * z - patch[PATCH_Y]) * patch[
        PATCH_RATE
    ]
    if not (0.0 <= east < nx - 1 and 0.0 <= north < ny - 1):
        return 0.0
    i, j = int(east), int(north)
    east -= i
    north -= j
    k = PATCH_POINTS + speed * nx * ny + i * ny + j
    found: float = (1.0 - east) * ((1.0 - north) * patch[k] + north * patch[k + 1]) + east * (
        (1.0 - north) * patch[k + ny] + north * patch[k + ny + 1]
    )
    return found
