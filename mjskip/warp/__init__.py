"""Still water for MuJoCo Warp: many worlds at once, on a graphics card or, for tests, on the processor.

import mujoco_warp
import mjskip.warp

bare = mjskip.warp.strip_plugin(model)     # only if the model carries plugin mjskip.water
m, d = mujoco_warp.put_model(bare), mujoco_warp.make_data(bare, nworld=1024)
water = mjskip.warp.attach(m, model)
mujoco_warp.step(m, d)
"""

from mjskip.warp.coupling import WarpWater as WarpWater
from mjskip.warp.coupling import attach as attach
from mjskip.warp.coupling import strip_plugin as strip_plugin

__all__ = ["WarpWater", "attach", "strip_plugin"]
