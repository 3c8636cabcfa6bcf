"""A wind sea to start from: many sinusoids with random directions and phases."""

import math

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.checks import check_count, check_number, check_positive


def wind_waves(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    wave_speed: float,
    height: float,
    wavelength: float,
    direction: float = 0.0,
    spread: float = 0.5,
    seed: int = 0,
    waves: int = 48,
    periodic: bool = False,
) -> tuple[Array, Array]:
    """Elevation and vertical speed of travelling waves, for `HeightField.set`.

    z = sum a cos(k . x - c |k| t + phase) at t = 0: each runs at c, as the surface's own equation
    has it, which knows no dispersion (water does). Same seed, same sea.

    Args:
        x, y: (nx,) and (ny,) positions of the cells [m].
        wave_speed: c of the field [m/s].
        height: significant height, four times the standard deviation of the elevation [m].
        wavelength: mean one [m]; single ones lie within a third of it.
        direction: the waves run to, from x counter-clockwise [rad].
        spread: standard deviation of the single directions [rad].
        seed: of the random numbers.
        waves: how many.
        periodic: move each wave number to the nearest that fits a periodic field of these cells.

    Returns:
        Elevation (nx, ny) [m] and vertical speed (nx, ny) [m/s].

    Raises:
        ValueError: a number is out of range.
    """
    height = check_number("height", height, low=0.0, unit="m")
    direction = check_number("direction", direction, unit="rad")
    spread = check_number("spread", spread, low=0.0, unit="rad")
    check_positive(wave_speed=wave_speed, wavelength=wavelength)
    waves = check_count("waves", waves)
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    rng = np.random.default_rng(seed)
    headings = direction + spread * rng.standard_normal(waves)
    numbers = 2.0 * math.pi / wavelength * rng.uniform(0.75, 1.5, waves)
    phases = rng.uniform(0.0, 2.0 * math.pi, waves)
    k = numbers[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    if periodic:
        unit = 2.0 * math.pi / np.array([len(p) * (p[1] - p[0]) for p in (x, y)])
        k = np.round(k / unit) * unit
    # sqrt(2) S is the amplitude of one wave of standard deviation S = height / 4.
    amplitude = math.sqrt(2.0 / waves) * 0.25 * height
    elevation = np.zeros((len(x), len(y)))
    speed = np.zeros_like(elevation)
    for (kx, ky), phase in zip(k, phases, strict=True):
        # cos(a + b) by parts: two outer products instead of a cosine per cell.
        wave = amplitude * np.outer(np.exp(1j * (kx * x + phase)), np.exp(1j * ky * y))
        elevation += wave.real
        speed += wave_speed * math.hypot(kx, ky) * wave.imag
    return elevation, speed
