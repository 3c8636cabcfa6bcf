"""Sea states: sums of regular waves that are known at any place and time, and a current.

    zeta = Re sum_i a_i exp(i theta_i),  theta_i = k_i . (x - U t) - omega_i t + epsilon_i
    omega_i^2 = g k_i tanh(k_i H),  u = U + Re sum_i a_i omega_i (k_i / k_i cosh, -i sinh)(k_i (z + H)) / sinh(k_i H)
    p = rho g Re sum_i a_i exp(i theta_i) cosh k_i (z + H) / cosh k_i H

Linear (Airy) waves on water that moves as a whole with the current U: frequencies and periods are those that
drift with the water sees. Above z = 0 the values of z = 0 hold.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Complex
from mjskip.checks import (
    as_number,
    check_array,
    check_count,
    check_number,
    check_positive,
    check_type,
    fault,
)
from mjskip.hydro.surface_modes import wavenumber

Spectrum = Literal["jonswap", "pierson-moskowitz"]
GAMMA = 3.3
"""Peak enhancement of the mean JONSWAP spectrum."""
LOWEST, HIGHEST = 0.5, 3.4
"""Frequencies of an irregular sea, over the peak's: some 99% of its energy lies between."""
COMPONENTS, MAX_COMPONENTS = 100, 1_000_000
TEXT_KEYS = {
    "height": "height of a regular wave, crest to trough [m]",
    "period": "of a regular wave [s]",
    "hs": "significant height of an irregular sea [m]",
    "tp": "its peak period [s]",
    "gamma": "its peak enhancement; 1 is Pierson and Moskowitz's",
    "direction": "where the waves run to [degrees from the x axis]",
    "spreading": "exponent s of cos^2s of half the angle; none: long crests",
    "seed": "of the phases",
    "components": "number of waves",
    "current": "speed of the water [m/s]",
    "current_direction": "where it flows to [degrees from the x axis]",
    "depth": "of the water [m]",
}
"""What `Sea.from_text` understands."""
SEA_UNITS = {
    "height": "m", "period": "s", "hs": "m", "tp": "s", "gamma": "1", "direction": "rad", "spreading": "1",
    "seed": "1", "components": "1", "current": "m s-1", "current_direction": "rad", "depth": "m",
}  # fmt: skip
"""SI units of the same keys, where seas are given as numbers: see `sea_text`."""
REGULAR = {"height", "period"}
IRREGULAR = {"hs", "tp", "gamma", "spreading", "seed", "components"}


def sea_text(changes: Mapping[str, float], before: str = "") -> str:
    """The text of a sea for `Sea.from_text`, with changes in SI units and radians.

    Args:
        changes: values by key of `SEA_UNITS`; one kind of waves takes the place of the other.
        before: the text that is changed.
    """
    given = dict(word.partition("=")[::2] for word in before.replace(",", " ").split())
    for own, other in ((REGULAR, IRREGULAR), (IRREGULAR, REGULAR)):
        if own & changes.keys():
            given = {key: value for key, value in given.items() if key not in other}
    for key, value in changes.items():
        shown = math.degrees(value) if SEA_UNITS[key] == "rad" else value
        given[key] = f"{shown:.0f}" if key in ("seed", "components") else repr(float(shown))
    return " ".join(f"{key}={value}" for key, value in given.items())


def sea_numbers(text: str) -> dict[str, float]:
    """The keys of a text of a sea, in SI units and radians.

    Raises:
        ValueError: it is no sea.
    """
    Sea.from_text(text)
    given = dict(word.partition("=")[::2] for word in text.replace(",", " ").split())
    return {
        key: math.radians(float(value)) if SEA_UNITS[key] == "rad" else float(value)
        for key, value in given.items()
    }


def spectrum(omega: npt.ArrayLike, *, hs: float, tp: float, gamma: float = GAMMA) -> Array:
    """One-sided JONSWAP spectrum of elevation at angular frequencies [m^2 s].

        S = A(gamma) 5/16 hs^2 wp^4 w^-5 exp(-5/4 (w/wp)^-4) gamma^exp(-(w - wp)^2 / (2 sigma^2 wp^2))

    sigma = 0.07 below the peak and 0.09 above, A = 1 - 0.287 ln(gamma) (DNV-RP-C205, 3.5.5). gamma = 1 is the
    Pierson-Moskowitz spectrum.
    """
    w, peak = np.asarray(omega, dtype=np.float64), 2.0 * math.pi / tp
    ratio = w / peak
    sigma = np.where(w <= peak, 0.07, 0.09)
    bump = gamma ** np.exp(-0.5 * ((ratio - 1.0) / sigma) ** 2)
    base = 5.0 / 16.0 * hs**2 / peak * ratio**-5.0 * np.exp(-1.25 * ratio**-4.0)
    return np.asarray((1.0 - 0.287 * math.log(gamma)) * base * bump)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sea:
    """Waves (n,) and a current.

    Attributes:
        amplitude: [m].
        omega: angular frequency seen from the moving water [rad/s].
        direction: where each wave runs to, from the x axis [rad].
        phase: at the origin at time 0 [rad].
        current: velocity of the water (2,) [m/s].
        depth: [m]; infinite by default.
        gravity: [m/s^2].
    """

    amplitude: Array = field(default_factory=lambda: np.zeros(0))
    omega: Array = field(default_factory=lambda: np.zeros(0))
    direction: Array = field(default_factory=lambda: np.zeros(0))
    phase: Array = field(default_factory=lambda: np.zeros(0))
    current: Array = field(default_factory=lambda: np.zeros(2))
    depth: float = math.inf
    gravity: float = 9.81

    def __post_init__(self) -> None:
        for name in ("amplitude", "omega", "direction", "phase"):
            value = check_array(
                name, getattr(self, name), None, remedy="give a row of finite numbers"
            )
            object.__setattr__(self, name, value)
        sizes = {len(getattr(self, name)) for name in ("amplitude", "omega", "direction", "phase")}
        if len(sizes) > 1:
            raise ValueError(
                f"amplitude, omega, direction and phase have {sorted(sizes)} values: give each wave all four"
            )
        current = check_array(
            "current", self.current, 2, remedy="give two speeds, along x and y [m/s]"
        )
        object.__setattr__(self, "current", current)
        if not (self.omega > 0.0).all():
            raise ValueError(f"omega is {self.omega!r}: give frequencies above 0 [rad/s]")
        depth = as_number(self.depth)
        if depth is None or not depth > 0.0:
            raise fault("depth", self.depth, "give a number above 0 [m]; inf is deep water")
        check_positive(gravity=self.gravity)

    @cached_property
    def wavenumber(self) -> Array:
        """k (n,) [1/m]."""
        return wavenumber(self.omega, depth=self.depth, gravity=self.gravity)

    @property
    def significant_height(self) -> float:
        """4 times the root mean square of the elevation [m]."""
        return float(4.0 * math.sqrt(0.5 * np.sum(self.amplitude**2)))

    @classmethod
    def regular(
        cls,
        *,
        height: float,
        period: float,
        direction: float = 0.0,
        phase: float = 0.0,
        current: npt.ArrayLike = (0.0, 0.0),
        depth: float = math.inf,
        gravity: float = 9.81,
    ) -> Sea:
        """One wave.

        Args:
            height: from trough to crest [m].
            period: [s].
            direction: where the wave runs to, from the x axis [rad].
            phase: at the origin at time 0 [rad].
            current: velocity of the water (2,) [m/s].
            depth: [m].
            gravity: [m/s^2].

        Raises:
            ValueError: an argument is no number, or out of range.
        """
        check_positive(period=period)
        height = check_number("height", height, low=0.0, unit="m")
        return cls(
            amplitude=np.array([0.5 * height]),
            omega=np.array([2.0 * math.pi / period]),
            direction=np.array([check_number("direction", direction, unit="rad")]),
            phase=np.array([check_number("phase", phase, unit="rad")]),
            current=current,  # type: ignore[arg-type]
            depth=depth,
            gravity=gravity,
        )

    @classmethod
    def irregular(
        cls,
        *,
        hs: float,
        tp: float,
        gamma: float = GAMMA,
        direction: float = 0.0,
        spreading: float | None = None,
        seed: int = 0,
        components: int = COMPONENTS,
        current: npt.ArrayLike = (0.0, 0.0),
        depth: float = math.inf,
        gravity: float = 9.81,
    ) -> Sea:
        """A JONSWAP sea, or Pierson and Moskowitz's with gamma 1.

        One wave from each of `components` bands of equal width, at a frequency drawn from the band, with a random
        phase; heights are those of the spectrum, so that `significant_height` is `hs`.

        Args:
            hs: significant height [m].
            tp: period of the spectrum's peak [s].
            gamma: peak enhancement, from 1.
            direction: mean direction the waves run to [rad].
            spreading: s of the distribution cos^2s((theta - direction) / 2) that each wave's direction is drawn
                from; None for long crests.
            seed: of the random numbers.
            components: number of waves.
            current: velocity of the water (2,) [m/s].
            depth: [m].
            gravity: [m/s^2].

        Raises:
            ValueError: an argument is no number, or out of range.
        """
        tp = check_number("tp", tp, low=1e-3, high=1e6, unit="s")
        hs = check_number("hs", hs, low=0.0, high=1e6, unit="m")
        gamma = check_number("gamma", gamma, low=1.0, high=20.0)
        direction = check_number("direction", direction, unit="rad")
        components = check_count("components", components, high=MAX_COMPONENTS)
        seed = check_count("seed", seed, low=0)
        if spreading is not None:
            spreading = check_number("spreading", spreading, low=0.0)
        random = np.random.default_rng(seed)
        edges = np.linspace(LOWEST, HIGHEST, components + 1) * 2.0 * math.pi / tp
        omega = edges[:-1] + np.diff(edges) * random.random(components)
        phase = 2.0 * math.pi * random.random(components)
        within = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(8) + 0.5) / 8.0
        energy = spectrum(within, hs=hs, tp=tp, gamma=gamma).mean(axis=1) * np.diff(edges)
        amplitude = np.sqrt(2.0 * energy)
        if hs > 0.0:
            amplitude *= hs / (4.0 * math.sqrt(float(energy.sum())))
        turns = np.zeros(components)
        if spreading is not None:
            angle = np.linspace(-math.pi, math.pi, 2001)
            weight = np.cumsum(np.cos(0.5 * angle) ** (2.0 * spreading))
            turns = np.interp(random.random(components), weight / weight[-1], angle)
        return cls(
            amplitude=amplitude,
            omega=omega,
            direction=direction + turns,
            phase=phase,
            current=current,  # type: ignore[arg-type]
            depth=depth,
            gravity=gravity,
        )

    @classmethod
    def from_text(cls, text: str, *, gravity: float = 9.81) -> Sea:
        """A sea from "hs=0.3 tp=3" or "height=0.2 period=2 direction=30"; degrees here, see TEXT_KEYS.

        Args:
            text: KEY=NUMBER words.
            gravity: [m/s^2].

        Raises:
            ValueError: a word is not key=number, a key is unknown, or too little is said.
        """
        check_type("sea", text, str, 'give a text such as "hs=0.3 tp=3"')
        given: dict[str, float] = {}
        for word in text.replace(",", " ").split():
            key, _, number = word.partition("=")
            if key not in TEXT_KEYS:
                raise ValueError(
                    f"sea {text!r} has {key!r}: use {', '.join(TEXT_KEYS)}, as in hs=0.3 tp=3"
                )
            try:
                given[key] = float(number)
            except ValueError:
                raise ValueError(f"sea {text!r} has {word!r}: give {key}=NUMBER") from None
        speed = given.get("current", 0.0)
        heading = math.radians(given.get("current_direction", 0.0))
        current = np.array([speed * math.cos(heading), speed * math.sin(heading)])
        depth = given.get("depth", math.inf)
        direction = math.radians(given.get("direction", 0.0))
        irregular, regular = {"hs", "tp"} & given.keys(), {"height", "period"} & given.keys()
        if irregular and regular:
            raise ValueError(f"sea {text!r} has both hs, tp and height, period: give one pair")
        if irregular == {"hs", "tp"}:
            return cls.irregular(
                hs=given["hs"],
                tp=given["tp"],
                gamma=given.get("gamma", GAMMA),
                direction=direction,
                spreading=given.get("spreading"),
                seed=given.get("seed", 0),  # type: ignore[arg-type]
                components=given.get("components", COMPONENTS),  # type: ignore[arg-type]
                current=current,
                depth=depth,
                gravity=gravity,
            )
        if regular == {"height", "period"}:
            return cls.regular(
                height=given["height"],
                period=given["period"],
                direction=direction,
                current=current,
                depth=depth,
                gravity=gravity,
            )
        if irregular or regular:
            raise ValueError(
                f"sea {text!r} says too little: give hs=METRES tp=SECONDS, or height=METRES period=SECONDS"
            )
        return cls(current=current, depth=depth, gravity=gravity)

    def _swings(self, points: Array, time: float) -> Complex:
        """a exp(i theta) at the horizontal places of points (m, 2 or 3): (m, n)."""
        place = points[:, :2] - self.current * check_number("time", time, unit="s")
        toward = np.stack([np.cos(self.direction), np.sin(self.direction)])
        angle = self.wavenumber * (place @ toward) - self.omega * time + self.phase
        return np.asarray(self.amplitude * np.exp(1j * angle))

    def _decay(self, height: Array) -> tuple[Array, Array]:
        """cosh k(z + H) / cosh kH and sinh k(z + H) / cosh kH at heights (m,) up to 0: (m, n) each."""
        k = self.wavenumber
        z = np.minimum(height, 0.0)[:, None]
        down = np.exp(k * z)
        if not math.isfinite(self.depth):
            return down, down
        bottom = 1.0 + np.exp(-2.0 * k * self.depth)
        below = np.exp(-2.0 * k * (np.maximum(z, -self.depth) + self.depth))
        return down * (1.0 + below) / bottom, down * (1.0 - below) / bottom

    def elevation(self, points: npt.ArrayLike, time: float) -> Array:
        """Height of the surface (m,) [m].

        Args:
            points: horizontal places (m, 2) [m].
            time: [s].
        """
        return np.asarray(self._swings(_points(points, 2), time).real.sum(axis=1))

    def grid_elevation(self, x: Array, y: Array, time: float) -> Array:
        """Height of the surface at the points of a grid with axes x (nx,) and y (ny,) [m] at a time [s]: (nx, ny) [m]."""
        kx, ky = self.wavenumber * np.cos(self.direction), self.wavenumber * np.sin(self.direction)
        east, north = x - self.current[0] * time, y - self.current[1] * time
        swing = self.amplitude * np.exp(1j * (self.phase - self.omega * time))
        along, across = np.exp(1j * np.outer(east, kx)), np.exp(1j * np.outer(ky, north))
        return np.asarray(((along * swing) @ across).real)

    def velocity(self, points: npt.ArrayLike, time: float) -> Array:
        """Velocity of the water, current included (m, 3) [m/s].

        Args:
            points: places (m, 3) [m].
            time: [s].
        """
        place = _points(points, 3)
        swings = self._swings(place, time)
        cosh, sinh = self._decay(place[:, 2])
        # a g k / omega cosh / cosh, and the vertical a quarter of a period later
        rate = self.gravity * self.wavenumber / self.omega
        along = (swings.real * cosh) * rate
        return np.stack(
            [
                self.current[0] + along @ np.cos(self.direction),
                self.current[1] + along @ np.sin(self.direction),
                (swings.imag * sinh) @ rate,
            ],
            axis=1,
        )

    def pressure(self, points: npt.ArrayLike, time: float, *, density: float = 1000.0) -> Array:
        """Dynamic pressure of the waves (m,) [Pa].

        Args:
            points: places (m, 3) [m].
            time: [s].
            density: of the water [kg/m^3].
        """
        check_positive(density=density)
        place = _points(points, 3)
        cosh, _ = self._decay(place[:, 2])
        weight = density * self.gravity
        return np.asarray(weight * (self._swings(place, time).real * cosh).sum(axis=1))


def _points(points: npt.ArrayLike, width: int) -> Array:
    place = np.atleast_2d(check_array("points", points))
    if place.ndim != 2 or place.shape[1] < width:
        raise ValueError(f"points have shape {place.shape}: give (n, {width}) coordinates [m]")
    return place
