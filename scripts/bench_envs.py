"""What an environment costs beside the engine steps in it, and many at once beside one after the other.

    python scripts/bench_envs.py [--json FILE]

Prints for every environment `env.step` over the `mj_step` calls in it, and for 64 of them in one
`mujoco.batch.Batch`, on one thread and on two, how many times as many steps a second as a `SyncVectorEnv`.
Measurements are taken in turn. One thread: medians of processor time, which other processes hardly disturb. Two
threads: the shortest of many times of one step on the clock, which they do disturb; it means nothing unless two cores are
idle for some of them. Half a minute. The last column is the engine's own share of a step of the batch: the
rest is all that the environments add.
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


def many(name: str, rounds: int = 8, steps: int = 12) -> dict[str, float]:
    """Times as many steps a second as one after the other, by number of threads; the engine's share on one."""
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
    simulation = made[1].unwrapped._episodes.simulation
    inner, engine = simulation.advance, []

    def advance(*arguments):
        begun = time.thread_time()
        said = inner(*arguments)
        engine.append(time.thread_time() - begun)
        return said

    simulation.advance = advance
    taken: dict[int, list[tuple[float, float]]] = {key: [] for key in made}
    for _ in range(rounds):
        for env in made.values():
            env.reset(seed=0)
        for _ in range(steps):
            for key, env in made.items():
                taken[key].append(seconds(lambda env=env: env.step(action), 1))
    for env in made.values():
        env.close()
    alone = statistics.median(a[0] / b[0] for a, b in zip(taken[0], taken[1], strict=True))
    share = statistics.median(part / b[0] for part, b in zip(engine, taken[1], strict=True))
    two = min(a[1] for a in taken[0]) / min(b[1] for b in taken[2])
    return {"1": alone, "2": two, "engine": share}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    figures = {}
    arguments = parser.parse_args()
    print(f"{'':10} env.step / mj_steps   {MANY} in a batch: 1 thread   2 threads   engine")
    for name in NAMES:
        ratio, times = single(name), many(name)
        figures[name] = {"step_over_engine": ratio, "vector": times}
        print(
            f"{name:10} {ratio:19.2f}   {times['1']:22.2f}   {times['2']:9.2f}   {times['engine']:6.2f}",
            flush=True,
        )
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
