"""Stone skipping on MuJoCo: a water surface for rigid bodies, after Lee & Baek (2010).

SI units and radians; right-handed, z up, still water at z = 0. Importing compiles nothing, opens no GL and
installs no callback.
"""

from importlib.metadata import version as _version

from mjskip.coupling.attach import attach as attach
from mjskip.coupling.plugin import register_plugin as register_plugin
from mjskip.draw.render import render_video as render_video
from mjskip.forces import wrench as wrench
from mjskip.recording import Limits as Limits
from mjskip.reference import integrate as integrate
from mjskip.scene import Scene as Scene
from mjskip.scene import load_scene as load_scene
from mjskip.simulate import simulate as simulate
from mjskip.stone import Stone as Stone
from mjskip.sweeps.optimize import optimize as optimize
from mjskip.sweeps.sweep import sweep as sweep
from mjskip.throw import Throw as Throw
from mjskip.trajectory import Contact as Contact
from mjskip.trajectory import Trajectory as Trajectory
from mjskip.water import Water as Water
from mjskip.waves import HeightField as HeightField
from mjskip.waves.lake import Lake as Lake

__version__ = _version("mjskip")
