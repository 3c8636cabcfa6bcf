"""Water, stone and sea of an episode: values, or ranges to draw them from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import mujoco
import numpy as np

from mjskip.checks import check_mapping, check_number, fault
from mjskip.coupling.plugin_keys import NAME
from mjskip.hydro.seas import SEA_UNITS, Sea, sea_numbers, sea_text
from mjskip.hydro.water import Water

Options = Mapping[str, Any]

STONE: dict[str, tuple[float, float, str]] = {
    "radius": (0.005, 0.5, "m"),
    "thickness": (0.001, 0.3, "m"),
    "density": (200.0, 20000.0, "kg/m^3"),
}
"""What can be said of a stone: the paper's pebble, scaled, of any density."""

FORM_DRAG = "birkhoff1944"
"""Law of a raft in a sea, unless another is given: the pressure of waves is that of potential flow, and without form drag
little but thrust would hold a drift."""

WAVES = 30.0
"""Waves of an irregular sea unless told otherwise: each costs time at every step."""

PEBBLE = {"radius": 0.045, "thickness": 0.015}
"""Size of the pebble in the shipped scenes [m]."""

WATER_NUMBERS = {field.name for field in fields(Water) if field.type in (float, "float")}


@dataclass(frozen=True)
class Choice:
    """What one episode has: pairs of key and value, in the order of the keys."""

    water: tuple[tuple[str, Any], ...] = ()
    stone: tuple[tuple[str, float], ...] = ()
    sea: tuple[tuple[str, float], ...] | None = None


class Variation:
    """What may differ from what a scene says.

    Args:
        water: fields of `Water`; a number may be a range (low, high). A `Water` gives all of them.
        stone: radius [m], thickness [m], density [kg/m^3]; each may be a range.
        sea: keys of `mjskip.hydro.seas.SEA_UNITS`, SI and radians; each may be a range. Or a text for `Sea.from_text`. None
            for still water; nothing in it for calm water in which bodies make waves.
        has: "stone" and "sea" if the environment has them.

    Raises:
        ValueError: an unknown key or a value that is not allowed.
    """

    def __init__(
        self,
        water: Water | Options | None,
        stone: Options | None,
        sea: Options | str | None,
        *,
        has: frozenset[str],
    ) -> None:
        if isinstance(water, Water):
            water = asdict(water)
        self._water = dict(check_mapping("water", water or {}, "give a mjskip.Water or its fields"))
        self._stone = dict(
            check_mapping("stone", stone or {}, f"give a mapping with {', '.join(STONE)}")
        )
        if self._stone and "stone" not in has:
            raise fault("stone", self._stone, "leave it out, this environment has no stone")
        if sea is not None and "sea" not in has:
            raise fault("sea", sea, "leave it out, this environment has no sea")
        if isinstance(sea, str):
            sea = sea_numbers(sea)
        self._sea = (
            None
            if sea is None
            else dict(check_mapping("sea", sea, 'give its keys, or a text as "hs=0.1 tp=2.5"'))
        )
        _check_keys("water", self._water, {field.name for field in fields(Water)})
        _check_keys("stone", self._stone, set(STONE))
        _check_keys("sea", self._sea or {}, set(SEA_UNITS))
        for key, value in (self._sea or {}).items():
            low = -math.inf if SEA_UNITS[key] in ("rad", "m s-1") else 0.0
            _check_range(f"sea {key}", value, low, math.inf, SEA_UNITS[key].strip("1"))
        for key, value in self._water.items():
            if key in WATER_NUMBERS:
                _check_range(f"water {key}", value, 0.0, math.inf, "")
        for key, value in self._stone.items():
            _check_range(f"stone {key}", value, *STONE[key])
        self.draw(np.random.default_rng(0))  # Water has its own say

    def draw(self, rng: np.random.Generator) -> Choice:
        """Values for one episode, uniform in their ranges."""
        water = {key: _drawn(self._water[key], rng) for key in sorted(self._water)}
        stone = {key: float(_drawn(self._stone[key], rng)) for key in sorted(self._stone)}
        Water(**water)
        if self._sea is None:
            return Choice(tuple(water.items()), tuple(stone.items()))
        sea = {key: float(_drawn(self._sea[key], rng)) for key in sorted(self._sea)}
        if "hs" in sea:
            sea.setdefault("components", WAVES)
        Sea.from_text(sea_text(sea))
        return Choice(tuple(water.items()), tuple(stone.items()), tuple(sea.items()))


def apply(choice: Choice, spec: mujoco.MjSpec) -> None:
    """Write a choice into a spec whose water is the plugin and whose stone is the mesh "pebble"."""
    for plugin in spec.plugins:
        if plugin.plugin_name == NAME:
            config = {key: _text(value) for key, value in choice.water}
            if choice.sea is not None:
                config |= {"radiation": "true", "sea": sea_text(dict(choice.sea))}
                config.setdefault("law", FORM_DRAG)
            plugin.config = {**plugin.config, **config}
    stone = dict(choice.stone)
    if stone.keys() & PEBBLE.keys():
        wide, high = (stone.get(key, size) / size for key, size in PEBBLE.items())
        spec.mesh("pebble").scale = [wide, wide, high]
    if "density" in stone:
        spec.geom("stone").density = stone["density"]


def check_options(options: Options | None, allowed: set[str]) -> Options:
    """The options of a reset, with known keys only."""
    options = check_mapping("options", options or {}, f"give a mapping with {_list(allowed)}")
    _check_keys("options", options, allowed)
    return options


def _check_keys(name: str, given: Options, allowed: set[str]) -> None:
    for key in given:
        if key not in allowed:
            raise ValueError(f"{name} has no {key!r}: use {_list(allowed)}")


def _list(names: set[str]) -> str:
    return ", ".join(sorted(names))


def _check_range(name: str, value: Any, low: float, high: float, unit: str) -> None:
    if isinstance(value, tuple | list):
        if len(value) != 2:
            raise fault(name, value, "give a number, or a range (low, high)")
        ends = [check_number(name, end, low=low, high=high, unit=unit) for end in value]
        if ends[0] > ends[1]:
            raise fault(name, value, "give a range with the lower end first")
    else:
        check_number(name, value, low=low, high=high, unit=unit)


def _drawn(value: Any, rng: np.random.Generator) -> Any:
    return float(rng.uniform(*value)) if isinstance(value, tuple | list) else value


def _text(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(float(value))
