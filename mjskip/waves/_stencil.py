"""How the wave equation is put on a grid: stencils, their stability limits, the absorbing layer."""

import math
from typing import Literal, get_args

import numpy as np

from mjskip._typing import SingleArray
from mjskip.checks import check_positive

Stencil = Literal["nine_point", "five_point", "paper_eq8"]
Boundary = Literal["reflect", "absorb", "periodic"]
STENCILS: tuple[Stencil, ...] = get_args(Stencil)
BOUNDARIES: tuple[Boundary, ...] = get_args(Boundary)

WEIGHTS: dict[Stencil, tuple[float, float]] = {
    "nine_point": (2.0 / 3.0, 1.0 / 6.0),
    "five_point": (1.0, 0.0),
    "paper_eq8": (2.0 / 3.0, 1.0 / 3.0),
}
"""Weights of the edge and the corner neighbours."""

COURANT_LIMITS: dict[Stencil, float] = {
    "nine_point": math.sqrt(3.0) / 2.0,
    "five_point": 1.0 / math.sqrt(2.0),
    "paper_eq8": math.sqrt(3.0) / 2.0,
}
"""Largest stable c t / d for any damping (von Neumann); no step is stable for `paper_eq8`."""

SAFE_FRACTION = 0.99
"""Steps chosen here stay this far below the limit, where rounding cannot make short waves grow."""

SMALLEST_STEP = 1e-10
"""Smallest step that is taken, in largest ones."""

MAX_STEPS = 1e10
"""Most steps that one call makes: a small grid would take days for them."""

SAME_STEP = 1e-9
"""Steps that differ by less, relatively, are one step written differently."""

NARROWEST_LOAD = 1.5
"""Radius of the narrowest load in cells: a narrower one excites waves the grid cannot carry."""

SPONGE_CELLS = 32
"""Width of the layer of growing friction outside an absorbing field."""

MARGIN = SPONGE_CELLS + 1
"""Stored cells outside an absorbing field on each side: the layer, and an open edge of one cell."""

SPONGE_STRENGTH = 0.35
"""Integral of the layer's friction over its width / c: amplitudes fall by e^-0.35, there and back.

The one-way condition at the outer edge takes nearly all; the layer takes what meets it at a grazing
angle. Much more friction would reflect long waves itself: measured with rings of 6 to 30 cm from
anywhere in the field, 0.35 keeps the reflected energy under 0.5%, 6 lets 2% of a broad ring back.
"""


def coefficients(rate: float, damping: float, timestep: float) -> tuple[float, float]:
    """q and s of a step, see `_wave_kernels`; rate = c / d and damping [1/s], timestep [s]."""
    m = 0.5 * damping * timestep
    return (1.0 - m) / (1.0 + m), (rate * timestep) ** 2 / (1.0 + m)


def same_step(one: float, other: float) -> bool:
    """Whether two steps [s] are one written differently."""
    return abs(other - one) <= SAME_STEP * other


def paper_limit(spacing: float, wave_speed: float, damping: float) -> float:
    """Largest step by equation (9), c < (d / 2t) sqrt(mu t + 2) [s]: too generous for mu > 0."""
    rate = (wave_speed / spacing) ** 2
    return (damping + math.sqrt(damping * damping + 32.0 * rate)) / (8.0 * rate)


def step_change_filter(old: float, new: float) -> float:
    """How much of the shortest waves' speed to take when the step changes: 0 to 1.

    A leapfrog whose step changes again and again is a swing whose length changes: waves that turn
    by half a period per cycle of steps grow, by up to 100% a cycle next to the limit. Taking
    (k / k_max)^4 of each wave's speed at a change of more than a twentieth stops that; a wave of
    12 cells loses a 400th at each such change, one of 24 cells a 6000th.
    """
    return min(1.0, 20.0 * abs(new - old) / max(new, old)) if old > 0.0 else 0.0


def is_ordinary_step(timestep: float, limit: float) -> bool:
    """Whether a step needs no closer look: `checked_step` would pass it."""
    return SMALLEST_STEP * limit <= timestep <= limit


def checked_step(timestep: float, limit: float, paper: float) -> None:
    """Refuse a step that is unstable, or too small for anything to move but rounding errors [s]."""
    check_positive(timestep=timestep)
    if timestep > limit:
        raise ValueError(unstable(timestep, limit, paper))
    if timestep < SMALLEST_STEP * limit:
        raise ValueError(
            f"the water's time step of {timestep:.6g} s is lost in rounding: use at least "
            f"{SMALLEST_STEP * limit:.3g} s; {limit:.6g} s is the largest"
        )


def steps_for(duration: float, limit: float) -> int:
    """Equal stable steps that make up a duration [s]; 0 if nothing could move in it."""
    steps = duration / (SAFE_FRACTION * limit)
    if steps > MAX_STEPS:
        raise ValueError(
            f"duration is {duration:g} s: that makes {steps:.3g} steps of at most {limit:.3g} s, and {MAX_STEPS:g} "
            "are allowed; use a shorter duration, a larger spacing or slower waves"
        )
    return math.ceil(steps) if steps > SMALLEST_STEP else 0


def unstable(timestep: float, limit: float, paper: float) -> str:
    """The line that refuses a time step."""
    return (
        f"the water's time step of {timestep:.6g} s is unstable: use at most {limit:.6g} s "
        f"(equation (9) would allow {paper:.6g} s), a larger spacing, or advance()"
    )


def reach_of(radius: float, spacing: float) -> float:
    """Cells from the centre of a round load to its rim.

    The profile (1 - (r / reach)^2)^2 with reach = sqrt(2) R has the second moment of a disc of R.
    """
    return math.sqrt(2.0) * max(radius / spacing, NARROWEST_LOAD)


def sponge(length: int, rate: float) -> SingleArray:
    """(length,) friction [1/s] that grows as depth^2 over the layers at both ends; `rate` is c / d [1/s]."""
    index = np.arange(length) - 1  # the outermost cells are the open edge
    depth = np.maximum(SPONGE_CELLS - index, index - (length - 3 - SPONGE_CELLS)) / SPONGE_CELLS
    depth[[0, -1]] = 0.0
    friction = 3.0 * SPONGE_STRENGTH / SPONGE_CELLS * rate * np.maximum(depth, 0.0) ** 2
    return friction.astype(np.float32)
