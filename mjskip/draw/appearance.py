"""What water looks like: clear or turbid, smooth or ruffled."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from mjskip._typing import Image
from mjskip.checks import check_array, check_number, fault

RIPPLE_SIDE = 2.56
"""Side of a tile of ripples [m]; `water.glsl` knows it too."""

RIPPLE_CELLS = 256

_SPANS = 0.08, 0.08, 4.0  # of slopes and of the Laplacian [1/m], from the least to the greatest
_SLOPE = 0.006  # root mean square of a slope of one sheet of ripples, along an axis


@dataclass(frozen=True, kw_only=True)
class WaterAppearance:
    """How water looks. None of it is felt by a body or found in a result.

    Attributes:
        absorption: of red, green and blue light [1/m]: exp(-absorption length) is left of what is
            seen through so much water.
        scattered: colour that deep water has, red, green and blue from 0 to 1.
        wind: how much of the drawn ripples there is: millimetres that make still water look like a
            lake; 0 for a lake like glass.

    Raises:
        ValueError: a value is out of range.
    """

    absorption: tuple[float, float, float] = (1.15, 0.45, 0.38)
    scattered: tuple[float, float, float] = (0.012, 0.13, 0.17)
    wind: float = 1.0

    def __post_init__(self) -> None:
        for name, highest in (("absorption", math.inf), ("scattered", 1.0)):
            limit = "at least 0" if highest == math.inf else "from 0 to 1"
            remedy = f"give red, green and blue, {limit}"
            value = check_array(name, getattr(self, name), 3, remedy=remedy)
            if not ((value >= 0.0) & (value <= highest)).all():
                raise fault(name, getattr(self, name), remedy)
        check_number("wind", self.wind, low=0.0, high=10.0)


@functools.cache
def ripples() -> Image:
    """A breath of wind: slopes along x and y and Laplacian, a tile (n, n, 4) that repeats; rows along y.

    Each is 127.5 at zero; the greatest and least are as `water.glsl` says. Bytes are drawn fastest.
    """
    n = RIPPLE_CELLS
    k = 2.0 * math.pi * np.fft.fftfreq(n, RIPPLE_SIDE / n)
    kx, ky = k[None, :], k[:, None]
    number = np.hypot(kx, ky)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (0.8 * kx + 0.6 * ky) / number
        shape = number**-2.2 * np.exp(-((number * 0.008) ** 2)) * (0.25 + along**2)
    shape[(number < 2.0 * math.pi / 0.8) | (number == 0.0)] = 0.0
    waves = shape * np.fft.fft2(np.random.default_rng(4).normal(size=(n, n)))
    parts = [np.fft.ifft2(part * waves).real for part in (1j * kx, 1j * ky, -(number**2))]
    strength = _SLOPE / math.sqrt(0.5 * (np.mean(parts[0] ** 2) + np.mean(parts[1] ** 2)))
    tile = np.full((n, n, 4), 255, np.uint8)
    for channel, (part, span) in enumerate(zip(parts, _SPANS, strict=True)):
        tile[..., channel] = np.clip(np.round(255.0 * (strength * part / span + 0.5)), 0, 255)
    return tile
