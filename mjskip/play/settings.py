"""What the controls of the page say, in the units of the command line, and how it is written in links."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any
from urllib.parse import parse_qsl, urlencode

from mjskip.hydro.laws import LAWS
from mjskip.throws.scene import Scene
from mjskip.throws.simulate import SURFACES
from mjskip.throws.throw import PARAMETERS, Throw

STONES = ("scene", "pebble", "disc", "lens")
"""The scene's own stone, or one of granite turned to size."""

DIGITS = 4
"""Decimals that the page, its links and its commands show; a throw is of the numbers as shown."""

LONGEST_LINK = 2000
"""Characters of a link that are read."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """One throw as it is asked for on the page.

    Attributes:
        speed: [m/s].
        spin: [rev/s].
        attack: [degrees].
        descent: [degrees].
        bank: [degrees].
        height: of the lowest point above still water [m].
        stone: one of `STONES`.
        radius: of a stone that is not the scene's [cm].
        thickness: of the same [cm].
        law: force law, a key of `mjskip.hydro.laws.LAWS`.
        surface: "still" or "waves", see `mjskip.simulate`.

    Raises:
        ValueError: a value that the command line would refuse too.
    """

    speed: float
    spin: float
    attack: float
    descent: float
    bank: float
    height: float
    stone: str = "scene"
    radius: float = 4.5
    thickness: float = 1.5
    law: str = "lee2010"
    surface: str = "still"

    def __post_init__(self) -> None:
        for name in NUMBERS:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ValueError(f"{name} is {value!r}: give a number")
            object.__setattr__(self, name, round(float(value), DIGITS) if value else 0.0)
        _ = self.throw
        choices = (("stone", STONES), ("law", tuple(LAWS)), ("surface", SURFACES))
        for name, allowed in choices:
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}: use one of {', '.join(allowed)}"
                )
        for name, low, high in (("radius", 0.5, 50.0), ("thickness", 0.1, 20.0)):
            if not low <= getattr(self, name) <= high:
                raise ValueError(
                    f"{name} is {getattr(self, name):g} cm: give a number between {low:g} and "
                    f"{high:g} cm"
                )
        if self.stone == "lens" and self.thickness >= 2.0 * self.radius:
            raise ValueError(
                f"thickness is {self.thickness:g} cm: a lens is thinner than its diameter, "
                f"{2.0 * self.radius:g} cm"
            )

    @property
    def throw(self) -> Throw:
        """The same in SI units and radians."""
        return Throw.from_degrees(**{name: getattr(self, name) for name in THROW})

    @classmethod
    def of_scene(cls, scene: Scene) -> Settings:
        """What a scene itself asks for."""
        shown: dict[str, Any] = {
            name: PARAMETERS[name].to_shown(getattr(scene.throw, name)) for name in THROW
        }
        return cls(**shown, law=scene.water.law)

    def changed(self, given: Mapping[str, Any]) -> Settings:
        """These settings with others instead; numbers may come as text.

        Raises:
            ValueError: an unknown setting, or a value out of range.
        """
        known = [field.name for field in fields(self)]
        values: dict[str, Any] = {}
        for name, value in given.items():
            if name not in known:
                raise ValueError(f"{name!r} is no setting of a throw: there are {', '.join(known)}")
            values[name] = _number(name, value) if name in NUMBERS else str(value)
        return replace(self, **values)

    def read_link(self, query: str) -> Settings:
        """These settings with what the part of a link behind its question mark says.

        Raises:
            ValueError: the link asks for what there is not.
        """
        query = query.removeprefix("?")
        if len(query) > LONGEST_LINK:
            raise ValueError(f"the link is longer than {LONGEST_LINK} characters")
        return self.changed(dict(parse_qsl(query, keep_blank_values=True)))

    def link(self) -> str:
        """The part of a link behind its question mark that `read_link` reads."""
        shown = asdict(self)
        if self.stone == "scene":
            del shown["radius"], shown["thickness"]
        for name in NUMBERS:
            if name in shown:
                shown[name] = shown_number(shown[name])
        return urlencode(shown)

    def command(self, scene: str, *, body: str | None = None) -> str:
        """The `mjskip run` that makes the same throw.

        Args:
            scene: name or file.
            body: for `--body`, if it is not the scene's first stone.
        """
        words = ["mjskip", "run", scene, *(("--body", body) if body else ())]
        for name in THROW:
            words += [f"--{name}", shown_number(getattr(self, name))]
        words += ["--law", self.law]
        if self.surface != "still":
            words += ["--surface", self.surface]
        return shlex.join(words)


THROW = tuple(name for name in PARAMETERS if name != "wobble")
NUMBERS = (*THROW, "radius", "thickness")


def shown_number(value: float) -> str:
    """As people write it: 12 and not 12.0, 0.05 and not 5e-02."""
    return f"{value:.{DIGITS}f}".rstrip("0").rstrip(".")


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {str(value)[:40]!r}: give a number") from None
