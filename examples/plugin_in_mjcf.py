"""Water that travels with the model: the engine plugin in MJCF, its sensor, and a rollout in threads.

python examples/plugin_in_mjcf.py
"""

import mujoco
import mujoco.rollout
import numpy as np

import mjskip

XML = """
<mujoco>
  <option timestep=".002" integrator="implicitfast"/>
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
    <body name="duck" pos="0 0 .1">
      <freejoint/>
      <plugin instance="pond"/>
      <geom type="ellipsoid" size=".1 .06 .05" density="300"/>
    </body>
  </worldbody>
  <sensor><plugin name="water" instance="pond"/></sensor>
</mujoco>"""


def main():
    """Let one duck float, then eight with different pushes, on two threads."""
    mjskip.register_plugin()  # before the model is compiled
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2500)
    force, wetted = data.sensor("water").data[:3], data.sensor("water").data[6]
    print(f"the water lifts with {force[2]:.2f} N; {1e4 * wetted:.0f} cm2 are wet")
    weight = model.body("duck").mass[0] * 9.81
    print(f"its weight is {weight:.2f} N: it still bobs")
    assert abs(force[2] - weight) < 0.2 * weight

    start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    starts = np.tile(start, (8, 1))
    starts[:, 1 + model.nq] = np.linspace(0.0, 2.0, 8)  # forward speed
    threads = [mujoco.MjData(model) for _ in range(2)]
    states, _ = mujoco.rollout.rollout(model, threads, initial_state=starts, nstep=500)
    print("after 1 s they are at", states[:, -1, 1].round(2), "m")


if __name__ == "__main__":
    main()
