# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A boat in swell
#
# A barge floats in waves of different length. Long waves lift it as they lift the water; near its natural period it heaves
# more; short waves hardly move it. We measure that in MuJoCo, and compare with what linear theory says of the same hull.
# (Needs `mjskip[plot]`.)

# %%
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np
import xarray

import mjskip

XML = """
<mujoco model="barge">
  <option timestep="0.005" integrator="implicitfast"/>
  <visual><headlight ambient=".5 .5 .5"/></visual>
  <asset><texture name="sky" type="skybox" builtin="gradient" rgb1=".6 .75 .9" rgb2=".2 .35 .6" width="256" height="256"/></asset>
  <worldbody>
    <light pos="0 0 5" dir=".3 .2 -1" directional="true" castshadow="false"/>
    <camera name="shore" pos="0 -3.2 1.1" xyaxes="1 0 0 0 .3 .95"/>
    <body name="barge">
      <freejoint/>
      <geom type="box" size=".5 .25 .1" mass="50" rgba=".7 .3 .2 1"/>
      <geom type="box" size=".1 .1 .1" pos="-.3 0 .2" mass="1" rgba=".9 .9 .85 1"/>
    </body>
  </worldbody>
</mujoco>"""
Path("barge.xml").write_text(XML)
model = mujoco.MjModel.from_xml_string(XML)
water = mjskip.Water.floating(radiation=True)

# %% [markdown]
# ## How it floats
#
# `float_at_rest` finds draft, trim and heel, and the metacentric height.

# %%
mjskip.float_at_rest(model, water=water)

# %% [markdown]
# ## What linear theory says
#
# `mjskip hydro` writes added mass, damping and the motion per metre of wave over frequency, with Capytaine's names.

# %%
command = [
    sys.executable,
    "-m",
    "mjskip",
    "hydro",
    "barge.xml",
    "--omega",
    "2:9:15",
    "--save",
    "barge.nc",
]
print(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
theory = xarray.open_dataset("barge.nc")
heave = theory["rao"].sel(radiating_dof="Heave").isel(wave_direction=0)
heave = np.hypot(heave.sel(complex="re"), heave.sel(complex="im"))

# %% [markdown]
# ## What MuJoCo says
#
# Each swell in turn, small, as the theory asks: ten periods to get used to it, then six, to which a sine is fitted.


# %%
def heave_per_metre(omega: float, height: float = 0.005) -> float:
    """Amplitude of heave over that of the wave, in a regular swell of angular frequency omega [rad/s]."""
    period = 2 * np.pi / omega
    data = mujoco.MjData(model)
    with mjskip.attach(
        model, data, water=water, sea=mjskip.Sea.regular(height=height, period=period)
    ):
        mujoco.mj_step(model, data, round(10 * period / model.opt.timestep))
        times, heights = [], []
        for _ in range(round(6 * period / model.opt.timestep)):
            mujoco.mj_step(model, data)
            times.append(data.time)
            heights.append(data.xipos[1, 2])
    phase = omega * np.array(times)
    waves = np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=1)
    cosine, sine, _ = np.linalg.lstsq(waves, np.array(heights), rcond=None)[0]
    return np.hypot(cosine, sine) / (height / 2)


measured = {omega: heave_per_metre(omega) for omega in (2.5, 4.0, 5.0, 6.0, 7.5)}

# %%
plt.plot(theory.omega, heave, label="linear theory")
plt.plot(list(measured), list(measured.values()), "o", label="in MuJoCo")
plt.xlabel("angular frequency of the swell (rad/s)")
plt.ylabel("heave over wave amplitude")
plt.legend()
plt.show()
expected = np.interp(list(measured), theory.omega, heave)
for (omega, value), theirs in zip(measured.items(), expected, strict=True):
    print(f"{omega:4.1f} rad/s: {value:.2f} in MuJoCo, {theirs:.2f} by theory")
    assert abs(value - theirs) < 0.05

# %% [markdown]
# ## See it
#
# `mjskip.Renderer` draws the water that the boat feels, in your own loop.

# %%
data = mujoco.MjData(model)
sea = mjskip.Sea.irregular(hs=0.15, tp=1.6, seed=1)
coupling = mjskip.attach(model, data, water=water, sea=sea)
pictures = []
with coupling, mjskip.Renderer(model, 360, 640, water=coupling) as renderer:
    for _ in range(3):
        mujoco.mj_step(model, data, 80)
        renderer.update_scene(data, "shore")
        pictures.append(renderer.render().copy())
figure, axes = plt.subplots(1, 3, figsize=(15, 3))
for axis, picture in zip(axes, pictures, strict=True):
    axis.imshow(picture)
    axis.axis("off")
plt.show()
