# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Throw a stone, and see why spin matters
#
# A stone skips because it keeps its attitude, and it keeps its attitude because it spins. Run this notebook from a checkout
# (`pip install -e '.[plot]' jupyterlab`), or anywhere after `pip install 'mjskip[plot]'`.

# %%
import matplotlib.pyplot as plt
import numpy as np

import mjskip
from mjskip.sweeps.design import normal

# %% [markdown]
# The same throw with five spins. `attack` is the tilt of the stone's face to the water, `descent` the angle of its path.

# %%
spins = [0, 2, 5, 15, 40]  # rev/s
runs = {
    spin: mjskip.simulate(
        "lake", mjskip.Throw.from_degrees(speed=12, spin=spin, attack=20, descent=6)
    )
    for spin in spins
}
for spin, run in runs.items():
    print(f"{spin:3} rev/s: {run.skips} skips, {run.position[-1, 0]:.1f} m, then {run.end}")

# %%
figure, axes = plt.subplots(2, 1, figsize=(9, 5), sharex=True)
for spin, run in runs.items():
    axes[0].plot(run.position[:, 0], 100 * run.position[:, 2], label=f"{spin} rev/s")
    axes[1].plot(run.position[:, 0], np.linalg.norm(run.velocity, axis=1))
axes[0].axhline(0, color="0.6", linewidth=0.8)
axes[0].set(ylabel="height (cm)")
axes[0].legend()
axes[1].set(xlabel="distance (m)", ylabel="speed (m/s)")
plt.show()

# %% [markdown]
# Without spin the first touch turns the nose down, and the stone dives. One throw proves little, though: the last touches are
# chaotic. An ensemble of hands that stray a little:

# %%
data = mjskip.sweep(
    "lake",
    {"spin": 2 * np.pi * np.array([0.0, 2.0, 5.0, 15.0, 40.0])},
    scatter=normal({"speed": (0, 0.3), "attack": (0, 0.035)}, count=16, seed=0),
)
mean, spread = data.skips.mean("member"), data.skips.std("member")
plt.errorbar(data.spin / (2 * np.pi), mean, spread, marker="o", capsize=3)
plt.xlabel("spin (rev/s)")
plt.ylabel("skips")
plt.show()
assert float(mean[-1]) > float(mean[0])
