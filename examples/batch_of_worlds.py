"""Many worlds on a thread pool: a raft dropped from 64 heights, by MuJoCo's own batches.

python examples/batch_of_worlds.py
"""

import mujoco
import numpy as np
from mujoco import batch

import mjskip

XML = """
<mujoco>
  <option timestep=".004" integrator="implicitfast"/>
  <extension>
    <plugin plugin="mjskip.water">
      <instance name="pond">
        <config key="buoyancy" value="true"/>
        <config key="skin_friction" value="true"/>
        <config key="gate" value="local"/>
      </instance>
    </plugin>
  </extension>
  <worldbody>
    <body name="raft"><freejoint/><plugin instance="pond"/><geom type="box" size=".4 .3 .05" density="400"/></body>
  </worldbody>
</mujoco>"""


def main():
    """Step all worlds together and print how deep each went."""
    mjskip.register_plugin()
    model = mujoco.MjModel.from_xml_string(XML)
    worlds = batch.Batch(model, 64, nthread=2)
    heights = np.linspace(0.0, 0.6, 64)
    qpos = worlds.bind("qpos")
    qpos[:, 2] = heights
    deepest = np.full(64, np.inf)
    for _ in range(400):
        worlds.step()
        deepest = np.minimum(deepest, qpos[:, 2])
    for k in range(0, 64, 16):
        print(
            f"from {heights[k]:.2f} m: down to {1e3 * deepest[k]:.0f} mm, now at {1e3 * qpos[k, 2]:.0f} mm"
        )
    assert deepest[-1] < deepest[8] < 0.01  # where it rests


if __name__ == "__main__":
    main()
