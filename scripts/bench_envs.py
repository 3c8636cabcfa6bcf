"""What an environment costs beside the engine steps in it, and many at once beside one after the other.

    python scripts/bench_envs.py [--json FILE]

Prints for every environment `env.step` over the `mj_step` calls in it, and for 64 of them in one
`mujoco.batch.Batch`, on one thread and on two, how many times as many steps a second as a `SyncVectorEnv`.
Measurements are taken in turn. One thread: medians of processor time, which other processes hardly disturb. Two
threads: the shortest of the times on the clock, which they do; it means nothing unless two cores are idle. Half a
minute.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import gymnasium
import mujoco
import numpy as np

import mjskip.envs  # noqa: F401  registers the environments

NAMES = ("Thrower", "Float", "Wade")
MANY = 64


def seconds(function, count: int) -> tuple[float, float]:
    """Processor time of this thread and time on the clock, of `count` calls."""
    begun = time.thread_time(), time.perf_counter()
    for _ in range(count):
        function()
    return time.thread_time() - begun[0], time.perf_counter() - begun[1]


def single(name: str, rounds: int = 40, count: int = 10) -> float:
    """env.step over the mj_step calls in it, from the same states."""
    env = gymnasium.make(f"mjskip/{name}-v0").unwrapped
    env.reset(seed=0)
    model, data, skip = env.model, env.data, env.frame_skip
    action = np.zeros(env.action_space.shape, np.float32)
    action[-1:] = -1.0 if name == "Thrower" else 0.0
    spec = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, spec))
    ratios = []
    for _ in range(rounds):
        mujoco.mj_getState(model, data, state, spec)
        bare, _ = seconds(lambda: mujoco.mj_step(model, data, skip), count)
        mujoco.mj_setState(model, data, state, spec)
        ratios.append(seconds(lambda: env.step(action), count)[0] / bare)
        if data.time > 3.0:
            env.reset(seed=0)
    return statistics.median(ratios)


def many(name: str, rounds: int = 15) -> dict[int, float]:
    """Times as many steps a second as one after the other, by number of threads."""
    made = {
        0: gymnasium.make_vec(f"mjskip/{name}-v0", num_envs=MANY, vectorization_mode="sync")
    } | {
        threads: gymnasium.make_vec(
            f"mjskip/{name}-v0",
            num_envs=MANY,
            vectorization_mode="vector_entry_point",
            num_threads=threads,
        )
        for threads in (1, 2)
    }
    action = np.zeros(made[0].action_space.shape, np.float32)
    action[:, -1] = -1.0 if name == "Thrower" else 0.0
    taken: dict[int, list[tuple[float, float]]] = {key: [] for key in made}
    for _ in range(rounds):
        for key, env in made.items():
            env.reset(seed=0)
            taken[key].append(seconds(lambda env=env: env.step(action), 10))
    for env in made.values():
        env.close()
    alone = statistics.median(a[0] / b[0] for a, b in zip(taken[0], taken[1], strict=True))
    return {1: alone, 2: min(a[1] for a in taken[0]) / min(b[1] for b in taken[2])}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    figures = {}
    arguments = parser.parse_args()
    print(f"{'':10} env.step / mj_steps   {MANY} in a batch: 1 thread   2 threads")
    for name in NAMES:
        ratio, times = single(name), many(name)
        figures[name] = {"step_over_engine": ratio, "vector": times}
        print(f"{name:10} {ratio:19.2f}   {times[1]:22.2f}   {times[2]:9.2f}", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
