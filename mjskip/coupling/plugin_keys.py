"""What the keys of the plugin `mjskip.water` say about the bodies of a compiled model; see `mjskip.coupling.plugin`."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import mujoco

from mjskip.coupling import _plugin_kernels as kernels
from mjskip.coupling import _struct_layout as _layout
from mjskip.coupling._struct_layout import library
from mjskip.coupling.bodies import SOLIDS, kind_name
from mjskip.coupling.moving_water import MovingWater
from mjskip.coupling.selection import GeomRule, WetBody, geom_rule, wet_body
from mjskip.coupling.wet import BuiltHull, HullOptions, Inertia, hull_of, inertia_of
from mjskip.errors import SceneError
from mjskip.hydro.seas import Sea
from mjskip.hydro.water import Water
from mjskip.waves.coupling import check_law

NAME = "mjskip.water"
WATER_KEYS = tuple(field.name for field in fields(Water))
HULL_KEYS = tuple(field.name for field in fields(HullOptions))
SURFACE_KEYS = tuple(field.name for field in fields(MovingWater))
KEYS = (*WATER_KEYS, "preset", *HULL_KEYS, *SURFACE_KEYS, "geoms", "sea", "bodies")
"""In the order of MuJoCo's texts; compiled code looks at the last one."""
SWITCHES = {f.name for f in (*fields(Water), *fields(HullOptions)) if f.type in (bool, "bool")}
NUMBERS = {f.name for f in (*fields(Water), *fields(MovingWater)) if f.type in (float, "float")}
COUNTS = {f.name for f in fields(HullOptions) if f.type in (int, "int")}
PRESETS = ("floating",)


@dataclass(frozen=True, kw_only=True)
class PluginSettings:
    """What the keys of an instance say.

    Attributes:
        water: the fluid.
        options: how hulls are made.
        surface: whether and how it moves.
        geoms: the rule for geoms as `attach` takes it.
        below: whether what moves below the bodies that carry it is wet too.
        sea: waves that come, for bodies that radiate.
        sea_text: what the key said.
    """

    water: Water
    options: HullOptions
    surface: MovingWater
    geoms: str | list[str] | None
    below: bool
    sea: Sea
    sea_text: str


def plugin_settings(model: mujoco.MjModel, body: int) -> PluginSettings | None:
    """What the plugin's keys say about a body of a compiled model; None if it does not wet it."""
    slot, carrier = plugin_slot(), int(body)
    if slot < 0:
        return None
    while carrier > 0:
        instance = int(model.body_plugin[carrier])
        if instance >= 0 and model.plugin[instance] == slot:
            settings = instance_settings(_layout.ModelView(model._address), instance)
            same = model.body_weldid[carrier] == model.body_weldid[body]
            return settings if settings.below or same else None
        carrier = int(model.body_parentid[carrier])
    return None


def plugin_water(model: mujoco.MjModel, body: int) -> Water | None:
    """The water that the plugin puts on a body of a compiled model; None if it puts none there."""
    settings = plugin_settings(model, body)
    return None if settings is None else settings.water


def plugin_instances(model: mujoco.MjModel) -> list[int]:
    """Numbers of this plugin's instances in a compiled model."""
    slot = plugin_slot()
    return [n for n in range(model.nplugin) if slot >= 0 and model.plugin[n] == slot]


def instance_options(model: mujoco.MjModel, instance: int) -> tuple[MovingWater, Water, float]:
    """The surface and the fluid of an instance of a compiled model, and its gravity downwards [m/s^2]."""
    settings = instance_settings(_layout.ModelView(model._address), instance)
    return settings.surface, settings.water, float(-model.opt.gravity[2])


def plugin_bodies(
    model: mujoco.MjModel,
) -> list[tuple[WetBody, Inertia, BuiltHull, Water]]:
    """The bodies that the plugin wets in a compiled model, what they are to it, and their fluid."""
    view, slot, found = _layout.ModelView(model._address), plugin_slot(), []
    for instance in range(model.nplugin):
        if slot < 0 or model.plugin[instance] != slot:
            continue
        settings = instance_settings(view, instance)
        for body in wetted_bodies(view, instance, settings):
            wet = plugin_wet_body(view, body, settings)
            if wet.geoms:
                inertia = inertia_of(view, body, wet.members)
                found.append(
                    (wet, inertia, hull_of(view, wet, settings.options, inertia), settings.water)
                )
    return found


def plugin_slot() -> int:
    """Where MuJoCo has the plugin, -1 if it does not know it."""
    slot = ctypes.c_int(-1)
    library.mjp_getPlugin.restype = ctypes.c_void_p
    found = library.mjp_getPlugin(NAME.encode(), ctypes.byref(slot))
    return slot.value if found else -1


def plugin_wet_body(view: Any, body: int, settings: PluginSettings) -> WetBody:
    stop = [b for b in range(1, int(view.nbody)) if b != body and _has_plugin(view, b)]
    rule = _chosen(view, settings.geoms, body)
    return wet_body(view, body, rule, stop=stop)


def _has_plugin(view: Any, body: int) -> bool:
    instance = int(view.body_plugin[body])
    return instance >= 0 and int(view.plugin[instance]) == int(kernels.root[kernels.SLOT])


def _geom_rule(text: str) -> str | list[str] | None:
    """The key `geoms` as a rule: keywords, or names with spaces between them."""
    if not text or text in ("all", "collision") or text.split()[0] == "group":
        return text or None
    return text.split()


def _chosen(view: Any, rule: GeomRule, body: int) -> Any:
    """The rule for the geoms of a body; names count on every body of the model."""
    if not isinstance(rule, list):
        return geom_rule(view, rule, [body])
    there = {str(view.geom(g).name): g for g in range(int(view.ngeom))}
    for name in rule:
        if name not in there:
            has = ", ".join(n for n in there if n) or "none has a name"
            raise SceneError(f"geoms is {' '.join(rule)!r}: no geom {name!r}; there are {has}")
        if int(view.geom_type[there[name]]) not in SOLIDS:
            kind = kind_name(view, there[name])
            raise SceneError(f"geoms: {name!r} is a {kind}, which displaces no water")
    wanted = {there[name] for name in rule}
    return lambda geom: geom in wanted


def wetted_bodies(view: Any, instance: int, settings: PluginSettings) -> Iterator[int]:
    """The bodies that an instance wets, as compiled code finds them."""
    for body in range(1, int(view.nbody)):
        if int(view.body_plugin[body]) == instance:
            yield body
        elif settings.below and int(view.body_jntnum[body]) > 0:
            carrier = body
            while carrier > 0 and not _has_plugin(view, carrier):
                carrier = int(view.body_parentid[carrier])
            if carrier > 0 and int(view.body_plugin[carrier]) == instance:
                yield body


def instance_settings(view: _layout.ModelView, instance: int) -> PluginSettings:
    """What an instance's keys say; keys that are not there have their defaults.

    Raises:
        ValueError: a value is not allowed; names the instance, the key and the value.
    """
    settings = view.plugin_instance(instance)
    given = {key: text for key, text in zip(KEYS, settings.texts, strict=False) if text}
    who = f"plugin {NAME}" + (f", instance {settings.name!r}" if settings.name else "")
    try:
        for key, allowed in (("preset", PRESETS), ("bodies", ("tree", "this"))):
            if key in given and given[key] not in allowed:
                raise ValueError(f"{key} is {given[key]!r}: use one of {', '.join(allowed)}")
        own = {k: _value(k, t) for k, t in given.items() if k in WATER_KEYS}
        if "sea" in given and not own.get("radiation"):
            raise ValueError(
                f"sea is {given['sea']!r} and radiation is off: waves act on bodies that radiate; give "
                'preset="floating" and radiation="true"'
            )
        hull = {k: _value(k, t) for k, t in given.items() if k in HULL_KEYS}
        moving = MovingWater(**{k: _value(k, t) for k, t in given.items() if k in SURFACE_KEYS})
        water = Water.floating(**own) if "preset" in given else Water(**own)
        gravity = float(-view.gravity[2])
        if (moving.moves or water.radiation) and not gravity > 0.0:
            raise ValueError(
                f"gravity is {-gravity:g} m/s^2 along z: waves need water that is held down; give a negative number, or "
                "still water"
            )
        if moving.moves:
            check_law(water.law)
            if water.radiation:
                raise ValueError(
                    f"surface is {moving.surface!r} and radiation is on: bodies that radiate have a surface of their "
                    "own; give one of the two"
                )
        return PluginSettings(
            water=water,
            options=HullOptions(**hull),
            surface=moving,
            geoms=_geom_rule(given.get("geoms", "")),
            below=given.get("bodies", "tree") == "tree",
            sea=Sea.from_text(given.get("sea", ""), gravity=gravity if gravity > 0.0 else 9.81),
            sea_text=given.get("sea", ""),
        )
    except ValueError as error:
        raise ValueError(f"{who}: {error}") from error
    except ArithmeticError as error:
        text = " ".join(f"{key}={text}" for key, text in given.items())
        raise ValueError(f"{who}: a number is too large or too small ({text})") from error


def _value(key: str, text: str) -> Any:
    if key in SWITCHES:
        if text not in ("true", "false"):
            raise ValueError(f"{key} is {text!r}: give true or false")
        return text == "true"
    if key in COUNTS:
        if not text.isdigit():
            raise ValueError(f"{key} is {text!r}: give a whole number")
        return int(text)
    if key in NUMBERS:
        try:
            return float(text)
        except ValueError:
            raise ValueError(f"{key} is {text!r}: give a number") from None
    return text
