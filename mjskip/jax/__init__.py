"""The force of still water as a function that JAX can compile, map and differentiate.

import jax
jax.config.update("jax_enable_x64", True)
import mjskip.jax

load = mjskip.jax.wrench(stone, water)
jax.jacfwd(lambda v: load(mjskip.jax.State(x, q, v, omega)).force)(velocity)
"""

from mjskip.jax.forces import Load as Load
from mjskip.jax.forces import rotation as rotation
from mjskip.jax.forces import wrench as wrench
from mjskip.jax.motion import State as State
from mjskip.jax.motion import free_flight as free_flight
from mjskip.jax.motion import step as step

__all__ = ["Load", "State", "free_flight", "rotation", "step", "wrench"]
