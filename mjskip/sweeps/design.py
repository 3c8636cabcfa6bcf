"""What a sweep varies: ranges, lists and samples of parameters, and the scatter of a throwing hand."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_choice, check_count, check_mapping, check_number, fault
from mjskip.hydro.laws import LAWS
from mjskip.hydro.water import GATES, SWITCHES
from mjskip.throws import throw

THROW = {name: parameter.unit for name, parameter in throw.PARAMETERS.items()}
STONE = {"radius": "m", "thickness": "m", "mass": "kg", "stone_density": "kg m-3"}
WATER = {"water_density": "kg m-3", "air_density": "kg m-3", "viscosity": "m2 s-1"}
NAMED = {"gate": GATES, "law": tuple(LAWS), **dict.fromkeys(SWITCHES, ("on", "off"))}
PARAMETERS: dict[str, str] = {**THROW, **STONE, **WATER, **dict.fromkeys(NAMED, "")}
"""Everything that can be varied, with its SI unit; the named ones take words, switches on and off."""

MAX_THROWS = 10**7
"""Throws of a sweep: their results fill a gigabyte."""

SAMPLE, MEMBER = "sample", "member"


def span(low: float, high: float, count: int) -> Array:
    """`count` evenly spaced values from low to high, both included."""
    low, high = check_number("the lower end of a range", low), check_number("its upper end", high)
    return np.linspace(
        low, high, check_count("the number of values of a range", count, high=MAX_THROWS)
    )


def latin_hypercube(
    ranges: Mapping[str, tuple[float, float]], *, count: int, seed: int
) -> dict[str, Array]:
    """`count` points that fill a box evenly in every coordinate.

    Args:
        ranges: (low, high) by parameter.
        count: of points.
        seed: of the random numbers.

    Returns:
        An array (count,) by parameter, for `samples` of a sweep.
    """
    _check_spread(ranges, count)
    for name, (low, high) in ranges.items():
        if not low < high:
            raise ValueError(f"{name} from {low!r} to {high!r}: give the lower end first")
    from scipy.stats import qmc  # half a second of imports that few need

    points = qmc.LatinHypercube(len(ranges), rng=np.random.default_rng(seed)).random(count)
    return {
        name: low + (high - low) * points[:, k]
        for k, (name, (low, high)) in enumerate(ranges.items())
    }


def normal(
    spreads: Mapping[str, tuple[float, float]], *, count: int, seed: int
) -> dict[str, Array]:
    """`count` normally distributed points, stratified in every coordinate.

    Args:
        spreads: (mean, standard deviation) by parameter; mean 0 for `scatter` of a sweep.
        count: of points.
        seed: of the random numbers.
    """
    _check_spread(spreads, count)
    for name, (_, deviation) in spreads.items():
        if deviation < 0.0:
            raise ValueError(f"the standard deviation of {name} is {deviation!r}: give at least 0")
    size = len(spreads)
    from scipy.stats import qmc

    cube = qmc.LatinHypercube(size, rng=np.random.default_rng(seed))
    bell = qmc.MultivariateNormalQMC(np.zeros(size), np.eye(size), engine=cube, inv_transform=True)
    points = bell.random(count)
    return {
        name: mean + deviation * points[:, k]
        for k, (name, (mean, deviation)) in enumerate(spreads.items())
    }


@dataclass(frozen=True, kw_only=True)
class Design:
    """The throws of a sweep as a grid: a dimension for every axis, one for samples, one for members.

    Attributes:
        axes: values by parameter; each parameter is a dimension, in this order.
        samples: values by parameter, all of one length, along the dimension "sample".
        scatter: additions by parameter, all of one length, along the dimension "member", the same at
            every point: an ensemble of throws around each.
        parameters: what can be varied, with its SI unit: those of throws, or of a model.
        named: those that take words, and the words.

    Raises:
        ValueError: a parameter is unknown, has no values, or is given twice.
    """

    axes: Mapping[str, Sequence[Any] | Array] = field(default_factory=dict)
    samples: Mapping[str, Array] = field(default_factory=dict)
    scatter: Mapping[str, Array] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=lambda: PARAMETERS)
    named: Mapping[str, Sequence[str]] = field(default_factory=lambda: NAMED)

    def __post_init__(self) -> None:
        for part in ("axes", "samples", "scatter"):
            given = check_mapping(part, getattr(self, part), "give values by parameter")
            given = {name: self._values(part, name, values) for name, values in given.items()}
            object.__setattr__(self, part, given)
        twice = sorted(set(self.axes) & set(self.samples))
        if twice:
            raise ValueError(f"{', '.join(twice)} is both an axis and a sample: give it once")
        if {"mass", "stone_density"} <= {*self.axes, *self.samples}:
            raise ValueError("both mass and stone_density are varied: vary one of them")
        for part in ("samples", "scatter"):
            lengths = {name: len(v) for name, v in getattr(self, part).items()}
            if len(set(lengths.values())) > 1:
                raise ValueError(f"{part} have different lengths ({lengths}): give them one length")
        if self.size > MAX_THROWS:
            raise ValueError(f"the sweep has {self.size} throws: at most {MAX_THROWS} are allowed")

    @property
    def sizes(self) -> dict[str, int]:
        """Length of every dimension, in order."""
        sizes = {name: len(values) for name, values in self.axes.items()}
        if self.samples:
            sizes[SAMPLE] = len(next(iter(self.samples.values())))
        if self.scatter:
            sizes[MEMBER] = len(next(iter(self.scatter.values())))
        return sizes or {SAMPLE: 1}

    @property
    def size(self) -> int:
        """How many throws it is."""
        return math.prod(self.sizes.values())

    @property
    def varied(self) -> list[str]:
        """Names of the parameters that differ between throws."""
        return list(dict.fromkeys([*self.axes, *self.samples, *self.scatter]))

    def point(self, index: Mapping[str, int], base: Mapping[str, Any]) -> dict[str, Any]:
        """The varied parameters of one throw, by name; scatter is added to `base` if nothing else is."""
        found = {name: values[index[name]] for name, values in self.axes.items()}
        found |= {name: values[index[SAMPLE]] for name, values in self.samples.items()}
        for name, values in self.scatter.items():
            found[name] = found.get(name, base[name]) + values[index[MEMBER]]
        return {k: str(v) if k in self.named else float(v) for k, v in found.items()}

    def coordinates(self) -> dict[str, tuple[str, Any, dict[str, str]]]:
        """For an xarray Dataset: (dimension, values, attributes) by name."""
        found: dict[str, tuple[str, Any, dict[str, str]]] = {}
        for name, values in self.axes.items():
            found[name] = (name, values, self._attributes(name))
        for name, values in self.samples.items():
            found[name] = (SAMPLE, values, self._attributes(name))
        for name, values in self.scatter.items():
            text = {"long_name": f"added to {name} for this member of the ensemble"}
            found[f"{name}_scatter"] = (MEMBER, values, self._attributes(name) | text)
        return found

    def summary(self) -> dict[str, Any]:
        """What identifies the design, for provenance: short, yet different for different values."""
        return {
            part: {name: _digest(values) for name, values in getattr(self, part).items()}
            for part in ("axes", "samples", "scatter")
        } | {"dimensions": self.sizes}

    def _values(self, part: str, name: str, values: Any) -> Any:
        if name not in self.parameters:
            raise ValueError(f"no parameter {name!r}: choose from {', '.join(self.parameters)}")
        words = name in self.named
        if words and part != "axes":
            raise ValueError(f"{name} takes words: it can be an axis, not one of {part}")
        if words:
            values = (
                values
                if isinstance(values, Collection) and not isinstance(values, str)
                else [values]
            )
            values = [
                ("off", "on")[value] if isinstance(value, bool) else value for value in values
            ]
            values = [check_choice(name, value, self.named[name]) for value in values]
        try:
            found = np.array(values, dtype=str if words else np.float64)
        except (TypeError, ValueError):
            raise fault(name, values, "give a row of numbers") from None
        if found.ndim != 1 or len(found) == 0:
            raise ValueError(
                f"{name} has values of shape {found.shape}: give at least one, in a row"
            )
        if not words and not np.isfinite(found).all():
            raise ValueError(f"{name} has values that are not finite")
        if part == "axes" and len(np.unique(found)) != len(found):
            raise ValueError(f"{name} has a value twice: give each once")
        return found

    def _attributes(self, name: str) -> dict[str, str]:
        return {"units": self.parameters[name]} if self.parameters[name] else {}


def _check_spread(given: Mapping[str, tuple[float, float]], count: int) -> None:
    check_count("count", count, high=MAX_THROWS)
    if not given:
        raise ValueError(f"{count} points of no parameters: give at least one")
    for name, pair in given.items():
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
            raise fault(name, pair, "give two numbers")
        for number in pair:
            check_number(name, number)


def _digest(values: Any) -> str:
    if values.dtype.kind == "U":
        return ", ".join(values)
    mark = hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()[:16]
    return f"{len(values)} from {values.min():.6g} to {values.max():.6g} (sha256 {mark})"
