# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A robot learns to skip a stone
#
# An arm of three joints holds a stone over a lake. Nobody tells it how to throw. It throws, counts what the environment
# rewards (1 a skip, 0.1 a metre), and changes its movement: CMA-ES, an evolution strategy, on 13 numbers. This notebook gives it a
# minute or so; `examples/learn_to_skip.py` goes on from there. (Needs `mjskip[rl,plot]` and `cma`.)

# %%
import cma
import gymnasium
import matplotlib.pyplot as plt
import numpy as np

import mjskip.envs  # noqa: F401  registers mjskip/Thrower-v0

env = gymnasium.make("mjskip/Thrower-v0", render_mode="rgb_array").unwrapped
print(env.observation_space, env.action_space)

# %% [markdown]
# ## A movement is 13 numbers
#
# The velocities of shoulder, elbow and wrist at four moments, as shares of the greatest, with straight lines between; and
# when the grip lets go.

# %%
MOMENTS = np.array([0.0, 0.15, 0.30, 0.45])  # s


def action(numbers: np.ndarray, time: float) -> np.ndarray:
    """What the arm does at a moment."""
    joints = [np.interp(time, MOMENTS, knots) for knots in numbers[:12].reshape(3, 4)]
    lets_go = time >= np.clip(0.30 + 0.15 * numbers[12], 0.05, 0.45)
    return np.clip([*joints, 1.0 if lets_go else -1.0], -1, 1)


def throw(numbers: np.ndarray, *, film: bool = False) -> tuple[float, dict, list]:
    """One episode: its rewards added up, what the environment says at its end, and pictures."""
    env.reset(seed=0)
    total, time, over, pictures = 0.0, 0.0, False, []
    while not over and time < 5.0:
        _, reward, over, _, info = env.step(action(numbers, time))
        total += reward
        time += env.frame_skip * env.model.opt.timestep
        if film:
            pictures.append(env.render())
    return total, info, pictures


# %% [markdown]
# ## Learning
#
# Every generation throws 16 movements, and draws the next 16 nearer to the better half.

# %%
GENERATIONS = 12
search = cma.CMAEvolutionStrategy(np.zeros(13), 0.4, {"seed": 1, "popsize": 16, "verbose": -9})
skips, best, most = [], None, -np.inf
for _ in range(GENERATIONS):
    candidates = search.ask()
    rewards = []
    for numbers in candidates:
        reward, info, _ = throw(numbers)
        rewards.append(reward)
        skips.append(info["skips"])
        if reward > most:
            best, most = numbers, reward
    search.tell(candidates, [-reward for reward in rewards])
print(f"{len(skips)} throws; the best earned {most:.2f}, the most skips were {max(skips)}")

# %%
plt.plot(skips, ".", alpha=0.4, label="every throw")
plt.plot(np.maximum.accumulate(skips), "k--", label="most so far")
plt.xlabel("throws")
plt.ylabel("skips")
plt.legend()
plt.show()

# %% [markdown]
# ## What it learned

# %%
_, info, pictures = throw(best, film=True)
print(info)
shown = np.linspace(0, len(pictures) * 0.6, 4).astype(int)
figure, axes = plt.subplots(1, 4, figsize=(16, 3.2))
for axis, index in zip(axes, shown, strict=True):
    axis.imshow(pictures[index])
    axis.set_title(f"picture {index}")
    axis.axis("off")
plt.show()
env.close()
