"""Stone skipping on MuJoCo: a water surface for rigid bodies, after Lee & Baek (2010).

SI units and radians; right-handed, z up, still water at z = 0. Importing compiles nothing, opens no GL and
installs no callback.
"""

from importlib.metadata import version as _version

from mjskip.coupling.attach import attach as attach
from mjskip.coupling.plugin import register_plugin as register_plugin
from mjskip.draw.render import render_video as render_video
from mjskip.hydro.stone import Stone as Stone
from mjskip.hydro.water import Water as Water
from mjskip.hydro.wrench import wrench as wrench
from mjskip.sweeps.optimize import optimize as optimize
from mjskip.sweeps.sweep import sweep as sweep
from mjskip.throws.recording import Limits as Limits
from mjskip.throws.reference import integrate as integrate
from mjskip.throws.scene import Scene as Scene
from mjskip.throws.scene import load_scene as load_scene
from mjskip.throws.simulate import simulate as simulate
from mjskip.throws.throw import Throw as Throw
from mjskip.throws.trajectory import Contact as Contact
from mjskip.throws.trajectory import Trajectory as Trajectory
from mjskip.waves import HeightField as HeightField
from mjskip.waves.lake import Lake as Lake

__version__ = _version("mjskip")
