"""What the water does to each body: forces, wetted area, centre of buoyancy, and where the model rests.

python examples/forces_per_body.py [MODEL.xml]
"""

import sys

import mujoco

import mjskip

XML = """
<mujoco><worldbody>
  <body name="hull" pos="0 0 .05"><freejoint/><geom type="box" size=".5 .2 .1" density="300"/>
    <body name="keel" pos="0 0 -.2"><geom type="box" size=".2 .01 .1" density="2000"/></body>
    <body name="mast" pos="0 0 .1"><joint axis="0 1 0" stiffness="5" damping=".5"/>
      <geom type="cylinder" fromto="0 0 0 0 0 .4" size=".01" density="500"/></body>
  </body>
</worldbody></mujoco>"""


def main(arguments):
    """Print forces at the start of a fall, and the pose at rest."""
    if arguments:
        model = mujoco.MjModel.from_xml_path(arguments[0])
    else:
        model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    with mjskip.attach(model, data, water=mjskip.Water.floating()) as coupling:
        mujoco.mj_step(model, data, 200)
        for name, wrench in coupling.wrenches(data).items():
            force = " ".join(f"{value:8.2f}" for value in wrench.force)
            print(f"{name:10} {force} N   wet {1e4 * wrench.wetted_area:7.1f} cm2")
        print(coupling.report(data))
    print(mjskip.float_at_rest(model))


if __name__ == "__main__":
    main(sys.argv[1:])
