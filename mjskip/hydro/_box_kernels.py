"""On which side of the surface a box about some faces lies, in body axes."""

from typing import Any

from mjskip._compile.jit import inlined
from mjskip.hydro._block import HEIGHT, UP


@inlined
def lowest_of(motion: Any, box: Any) -> float:
    """Height of the lowest corner of a box: its middle (3) and half its sides (3)."""
    return _middle_of(motion, box) - _reach_of(motion, box)


@inlined
def highest_of(motion: Any, box: Any) -> float:
    """Height of the highest corner of a box."""
    return _middle_of(motion, box) + _reach_of(motion, box)


@inlined
def _middle_of(motion: Any, box: Any) -> float:
    ux, uy, uz = motion[UP], motion[UP + 1], motion[UP + 2]
    found: float = motion[HEIGHT] + ux * box[0] + uy * box[1] + uz * box[2]
    return found


@inlined
def _reach_of(motion: Any, box: Any) -> float:
    ux, uy, uz = motion[UP], motion[UP + 1], motion[UP + 2]
    found: float = abs(ux) * box[3] + abs(uy) * box[4] + abs(uz) * box[5]
    return found
