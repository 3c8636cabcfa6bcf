"""What plane waves do at panels, and panels' sources in plane waves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mjskip._typing import Array, Complex


class PlaneWaves(NamedTuple):
    """Plane waves of one wavenumber at panels (n) in several directions (m).

    Attributes:
        value: mean over a panel of the harmonic extension of exp(i k.x) (n, m).
        slope: mean of its normal derivative (n, m) [1/m].
        source: upward speed of the surface by unit strengths of the panels, as the transform
            -4 pi A exp(-i k.x) cosh k(z + H) / cosh kH (m, n) [m^2].
    """

    value: Complex
    slope: Complex
    source: Complex


def plane_waves(
    points: Array, normals: Array, areas: Array, *, k: complex, directions: Array, depth: float
) -> PlaneWaves:
    """Of one (complex) wavenumber; points (3, n, 3) have equal weights, see `WettedHull.points`."""
    east, north = k * np.cos(directions), k * np.sin(directions)
    value: Complex
    slope: Complex
    source: Complex
    value = slope = source = np.zeros((), complex)
    for place in points:
        z = place[:, 2:3]
        if math.isfinite(depth):
            # exp(kz) (1 + exp(-2k(z + H))) / (1 + exp(-2kH)), which cannot overflow
            bottom = 1.0 + np.exp(-2.0 * k * depth)
            below = np.exp(-2.0 * k * (z + depth))
            profile = np.exp(k * z) * (1.0 + below) / bottom
            rise = k * np.exp(k * z) * (1.0 - below) / bottom
        else:
            profile = np.exp(k * z)
            rise = k * profile
        ahead = 1j * (place[:, :1] * east + place[:, 1:2] * north)
        wave = np.exp(ahead)
        along = 1j * (normals[:, :1] * east + normals[:, 1:2] * north)
        value = value + wave * profile / len(points)
        slope = slope + wave * (rise * normals[:, 2:3] + profile * along) / len(points)
        source = source + profile / wave / len(points)
    return PlaneWaves(
        value, slope, np.asarray(-4.0 * math.pi * (source * areas[:, None]).T, complex)
    )
