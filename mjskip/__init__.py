"""Stone skipping on MuJoCo: a water surface for rigid bodies, after Lee & Baek (2010).

SI units and radians; right-handed, z up, still water at z = 0. Importing loads nothing else: what `__all__`
names is imported when it is first asked for. It compiles nothing, opens no GL and installs no callback.
Where Gymnasium is imported already, the names of the environments are registered with it.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mjskip import errors as errors
    from mjskip.coupling.attach import Coupling as Coupling
    from mjskip.coupling.attach import attach as attach
    from mjskip.coupling.flotation import float_at_rest as float_at_rest
    from mjskip.coupling.plugin import register_plugin as register_plugin
    from mjskip.coupling.water_surface import WaterSurface as WaterSurface
    from mjskip.coupling.water_surface import add_water as add_water
    from mjskip.draw.appearance import WaterAppearance as WaterAppearance
    from mjskip.draw.render import render_video as render_video
    from mjskip.draw.renderer import Renderer as Renderer
    from mjskip.hydro.hull import Hull as Hull
    from mjskip.hydro.laws import LAWS as LAWS
    from mjskip.hydro.seas import Sea as Sea
    from mjskip.hydro.stone import Stone as Stone
    from mjskip.hydro.water import Water as Water
    from mjskip.hydro.wrench import wrench as wrench
    from mjskip.sweeps.models import sweep_model as sweep_model
    from mjskip.sweeps.optimize import optimize as optimize
    from mjskip.sweeps.sweep import sweep as sweep
    from mjskip.throws.recording import Limits as Limits
    from mjskip.throws.reference import integrate as integrate
    from mjskip.throws.scene import Scene as Scene
    from mjskip.throws.scene import load_scene as load_scene
    from mjskip.throws.simulate import simulate as simulate
    from mjskip.throws.simulate import simulate_all as simulate_all
    from mjskip.throws.throw import Throw as Throw
    from mjskip.throws.trajectory import Contact as Contact
    from mjskip.throws.trajectory import Trajectory as Trajectory
    from mjskip.waves import HeightField as HeightField

    __version__: str

__all__ = [
    "LAWS", "Contact", "Coupling", "HeightField", "Hull", "Limits", "Renderer", "Scene", "Sea", "Stone", "Throw",
    "Trajectory", "Water", "WaterAppearance", "WaterSurface", "add_water", "attach", "errors", "float_at_rest", "integrate", "load_scene",
    "optimize", "register_plugin", "render_video",
    "simulate", "simulate_all", "sweep", "sweep_model", "wrench",
]  # fmt: skip

_WHERE = {
    "coupling.attach": ["Coupling", "attach"],
    "coupling.flotation": ["float_at_rest"],
    "coupling.plugin": ["register_plugin"],
    "coupling.water_surface": ["WaterSurface", "add_water"],
    "draw.appearance": ["WaterAppearance"],
    "draw.render": ["render_video"],
    "draw.renderer": ["Renderer"],
    "hydro.hull": ["Hull"],
    "hydro.laws": ["LAWS"],
    "hydro.seas": ["Sea"],
    "hydro.stone": ["Stone"],
    "hydro.water": ["Water"],
    "hydro.wrench": ["wrench"],
    "sweeps.models": ["sweep_model"],
    "sweeps.optimize": ["optimize"],
    "sweeps.sweep": ["sweep"],
    "throws.recording": ["Limits"],
    "throws.reference": ["integrate"],
    "throws.scene": ["Scene", "Sea", "load_scene"],
    "throws.simulate": ["simulate", "simulate_all"],
    "throws.throw": ["Throw"],
    "throws.trajectory": ["Contact", "Trajectory"],
    "waves": ["HeightField"],
}
"""Where the public names live, by module of this package."""

if (
    "gymnasium" in sys.modules
):  # its users expect environments registered by the import of their package
    import_module("mjskip.envs")

if not TYPE_CHECKING:  # a type checker would take any name for an attribute

    def __getattr__(name: str) -> object:
        """A public name on first use (PEP 562)."""
        if name == "__version__":
            from importlib.metadata import version

            return globals().setdefault(name, version("mjskip"))
        if name == "errors":
            return import_module("mjskip.errors")
        for module, names in _WHERE.items():
            if name in names:
                found = getattr(import_module(f"mjskip.{module}"), name)
                return globals().setdefault(name, found)
        raise AttributeError(
            f"module 'mjskip' has no attribute {name!r}: it has {', '.join(__all__)}"
        )


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__, "__version__"])
