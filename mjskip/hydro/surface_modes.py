"""The free surface of open water as plane waves on a contour of complex wavenumbers.

    elevation(x)       zeta = Re sum_n w_n c_n exp(i k_n . x)
    surface potential  phi  = Im sum_n w_n (g / omega_n) c_n exp(i k_n . x)
    omega^2 = g k tanh(k H)

The sum is the inverse Fourier transform in polar coordinates: Gauss-Legendre in the square root of k, equal
angles. Integrands are analytic in k, so the path of integration may leave the real axis (Cauchy). Below
it waves that travel outwards decay in time, and the finite sum does not return them, as a periodic basin would:
the sum is the open sea, exactly as far as the quadrature is. It holds within a *reach* of the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Complex, Integers

SLOPE = 0.7
"""Descent of the contour at k = 0, in the plane of the square root of k."""
GROWTH = 4.0
"""Greatest growth of a plane wave across the diameter of the reach, as the exponent."""
SPARE_ANGLES = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceModes:
    """Plane waves by rings of one wavenumber each.

    Attributes:
        wavenumbers: of the rings (rings,), complex [1/m].
        weights: of one wave of a ring, with the ring's share of the area of the wavenumber plane (rings,).
        angles: number of directions in each ring (rings,).
        depth: of the water [m]; infinite by default.
        gravity: [m/s^2].
        reach: radius within which the sum holds [m].
        cutoff: largest wavenumber, where the contour ends [1/m].
    """

    wavenumbers: Complex
    weights: Complex
    angles: Integers
    depth: float
    gravity: float
    reach: float
    cutoff: float

    @cached_property
    def size(self) -> int:
        """Number of plane waves."""
        return int(self.angles.sum())

    @cached_property
    def first(self) -> Integers:
        """Index of the first wave of every ring, and the number of waves at the end (rings + 1,)."""
        return np.concatenate([[0], np.cumsum(self.angles)])

    @cached_property
    def ring(self) -> Integers:
        """Ring of every wave (size,)."""
        return np.repeat(np.arange(len(self.angles)), self.angles)

    @cached_property
    def direction(self) -> Array:
        """Angle of every wave from the x axis (size,) [rad]."""
        return np.concatenate([ring_directions(n) for n in self.angles])

    @cached_property
    def frequencies(self) -> Complex:
        """omega of the rings (rings,), complex [rad/s]."""
        return np.asarray(frequency(self.wavenumbers, depth=self.depth, gravity=self.gravity))

    def elevation(self, amplitudes: Complex, points: npt.ArrayLike) -> Array:
        """Elevation at points (n, 2) within the reach [m]."""
        xy = np.asarray(points, dtype=np.float64)
        k = self.wavenumbers[self.ring]
        ahead = np.cos(self.direction) * xy[:, :1] + np.sin(self.direction) * xy[:, 1:2]
        return np.asarray((np.exp(1j * k * ahead) @ (self.weights[self.ring] * amplitudes)).real)

    def grid_elevation(self, amplitudes: Complex, x: Array, y: Array) -> Array:
        """Elevation at the points of a grid with axes x (nx,) and y (ny,) [m], within the reach: (nx, ny) [m]."""
        k = self.wavenumbers[self.ring]
        along = np.exp(1j * np.outer(x, k * np.cos(self.direction)))
        across = np.exp(1j * np.outer(k * np.sin(self.direction), y))
        return np.asarray(((along * (self.weights[self.ring] * amplitudes)) @ across).real)


def ring_directions(count: int) -> Array:
    """Equal angles from the x axis (count,) [rad]."""
    return 2.0 * np.pi * np.arange(count) / count


def frequency(wavenumber: Any, *, depth: float, gravity: float) -> Any:
    """omega = sqrt(g k tanh(k H)) [rad/s], of real or complex wavenumbers."""
    k = np.asarray(wavenumber)
    deep = gravity * k
    return np.sqrt(deep * np.tanh(k * depth)) if math.isfinite(depth) else np.sqrt(deep)


def wavenumber(omega: Any, *, depth: float, gravity: float) -> Array:
    """The real k >= 0 with omega^2 = g k tanh(k H), by Newton's iteration [1/m]."""
    deep = np.asarray(omega, dtype=np.float64) ** 2 / gravity
    if not math.isfinite(depth):
        return deep
    x = deep * depth
    y = np.maximum(np.where(x > 1.0, x, np.sqrt(x)), 1e-300)
    for _ in range(12):
        t = np.tanh(y)
        y = y - (y * t - x) / (t + y * (1.0 - t * t))
    return np.asarray(y / depth)


def surface_modes(
    *, shortest: float, reach: float, depth: float = math.inf, gravity: float = 9.81
) -> SurfaceModes:
    """Modes for bodies whose points lie within `reach` of the origin.

    Args:
        shortest: wavelength of the shortest waves kept [m].
        reach: radius of the circle that holds every wetted point [m].
        depth: of the water [m].
        gravity: [m/s^2].
    """
    cutoff = 2.0 * math.pi / shortest
    extent = 2.0 * cutoff * reach
    rings = math.ceil(12.0 + 0.6 * extent)
    nodes, parts = np.polynomial.legendre.leggauss(rings)
    v, parts = 0.5 * (nodes + 1.0), 0.5 * parts
    # sqrt(k) = v - i e(v): e rises with SLOPE, then 2 v e stays below GROWTH / extent, and ends at 0
    bend = 2.0 * SLOPE * extent / GROWTH
    e = SLOPE * v * (1.0 - v) / (1.0 + bend * v * v)
    de = (SLOPE * (1.0 - 2.0 * v) - 2.0 * bend * v * e) / (1.0 + bend * v * v)
    root = v - 1j * e
    k = cutoff * root**2
    angles = 2 * np.ceil(np.abs(k) * reach).astype(np.int64) + SPARE_ANGLES
    dk = 2.0 * cutoff * root * (1.0 - 1j * de) * parts
    return SurfaceModes(
        wavenumbers=np.asarray(k, dtype=np.complex128),
        weights=k * dk / (2.0 * math.pi * angles),
        angles=angles,
        depth=depth,
        gravity=gravity,
        reach=reach,
        cutoff=cutoff,
    )
