"""The two stones that figures 5, 7 and 8 may have been made with, and throws around a nominal one."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from mjskip import Limits, Stone, Throw, integrate

SPREAD = {  # standard deviations of an ensemble: a steady hand
    "speed": 0.02,  # of the nominal one
    "spin": 0.02,  # of the nominal one
    "attack": math.radians(1.5),
    "descent": math.radians(0.5),
    "bank": math.radians(1.5),
    "height": 0.005,
}

COLOURS = {"flat": "#1f5fa8", "round": "#d9822b"}


def stone(kind: str) -> Stone:
    """A flat hand-sized stone (97 g, R 5 cm, 5 mm, 11-gon) or a round pebble (5 g, R 1 cm, 12 mm)."""
    if kind == "flat":
        return Stone.disc(0.05, 0.005, segments=11, mass=0.097)
    return Stone.lens(0.01, 0.012, segments=16, rings=4)


def nominal(kind: str, speed: float, spin: float) -> Throw:
    """Released at 0.1 m, descent 5°, attack 30° (flat) or 20° (round) [m/s, rad/s]."""
    attack = math.radians(30.0 if kind == "flat" else 20.0)
    return Throw(speed=speed, spin=spin, attack=attack, descent=math.radians(5.0), height=0.1)


def scattered(throw: Throw, seed: int) -> Throw:
    """The throw as a steady hand repeats it; the spin's sign and a spin of none are kept."""
    draw = np.random.default_rng(seed).standard_normal(len(SPREAD))
    values = asdict(throw)
    for (name, width), number in zip(SPREAD.items(), draw, strict=True):
        if name in ("speed", "spin"):
            values[name] *= 1.0 + width * number
        else:
            values[name] += width * number
    return Throw(**values)


def fly(
    kind: str,
    throw: Throw,
    *,
    timestep: float = 2e-4,
    duration: float = 6.0,
    longest: float = 0.3,
    **options: Any,
) -> Any:
    """Its trajectory, in air; a touch longer than `longest` ends it [s]."""
    limits = Limits(duration=duration, max_contact=longest, sink_depth=3.0)
    return integrate(stone(kind), throw, timestep=timestep, limits=limits, **options)
