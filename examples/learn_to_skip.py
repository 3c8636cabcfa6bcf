"""A robot learns to skip a stone: CMA-ES on the environment mjskip/Thrower-v0, on one core, without a neural network.

    python examples/learn_to_skip.py --minutes 4 --folder learned
    python examples/learn_to_skip.py --minutes 15 --folder learned --resume

What is learned are 13 numbers: velocities of shoulder, elbow and wrist at four moments, linear between them, and when
the grip lets go. The arm, the stone, the water and the limits of speed and torque are those of scene `thrower`. It
begins with an arm that stands still (`--seed` gives the random numbers), and counts what the environment rewards: 1 for
every skip, 0.1 for every metre.

Written to the folder after every generation: checkpoint.pickle and episodes.csv; at the end curve.png and best.mp4.
Needs `pip install "mjskip[rl,plot]" cma`.
"""

from __future__ import annotations

import argparse
import csv
import os
import pickle
import time
from dataclasses import dataclass, field
from pathlib import Path

import cma
import gymnasium
import numpy as np
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

import mjskip.envs  # noqa: F401  registers mjskip/Thrower-v0
from mjskip.draw.video import write_video

KNOTS = np.array([0.0, 0.15, 0.30, 0.45])
"""Moments at which the joints' velocities are given [s]."""
RELEASE, SPREAD = 0.30, 0.15
"""When the grip lets go if its number is 0, and how much later if it is 1 [s]."""
NUMBERS = 3 * len(KNOTS) + 1
SIGMA = 0.4
"""Standard deviation of the first generation, in shares of what the joints can do."""


def controls(numbers: np.ndarray, time: float) -> np.ndarray:
    """The action at a moment: three joints as shares of their greatest velocity, and the grip."""
    joints = [np.interp(time, KNOTS, knots) for knots in numbers[:-1].reshape(3, len(KNOTS))]
    release = np.clip(RELEASE + SPREAD * numbers[-1], 0.05, KNOTS[-1])
    return np.clip([*joints, 1.0 if time >= release else -1.0], -1.0, 1.0)


def throw(
    env: gymnasium.Env, numbers: np.ndarray, frames: list | None = None
) -> tuple[float, dict]:
    """One episode: the sum of its rewards and what the environment says at its end."""
    env.reset(seed=0)
    total, over, now = 0.0, False, 0.0
    interval = env.frame_skip * env.model.opt.timestep
    while not over and now < 5.0:
        _, reward, over, _, info = env.step(controls(numbers, now))
        total, now = total + reward, now + interval
        if frames is not None and round(now / interval) % 2 == 0:
            frames.append(env.render())
    return total, info


@dataclass
class Learning:
    """Everything that a checkpoint holds.

    Attributes:
        search: the state of CMA-ES.
        rows: of every episode its number, processor time [s], sum of rewards, skips, distance [m].
        best: the numbers of the best throw and its sum of rewards.
    """

    search: cma.CMAEvolutionStrategy
    rows: list[tuple[int, float, float, int, float]] = field(default_factory=list)
    best: tuple[np.ndarray, float] = (np.zeros(NUMBERS), -np.inf)

    def generation(self, env: gymnasium.Env, spent: float) -> None:
        """Throw every candidate once; `spent` is the processor time before [s]."""
        begun = time.process_time()
        candidates = self.search.ask()
        scores = []
        for numbers in candidates:
            total, info = throw(env, numbers)
            scores.append(total)
            clock = spent + time.process_time() - begun
            row = (len(self.rows) + 1, clock, total, info["skips"], info["distance"])
            self.rows.append(row)
            if total > self.best[1]:
                self.best = (numbers, total)
        self.search.tell(candidates, [-score for score in scores])

    def save(self, folder: Path) -> None:
        """Write the checkpoint and the table; whole or not at all."""
        part = folder / "checkpoint.part"
        part.write_bytes(pickle.dumps(self))
        os.replace(part, folder / "checkpoint.pickle")
        with (folder / "episodes.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["episode", "cpu_seconds", "reward", "skips", "distance"])
            writer.writerows(self.rows)

    def first(self, skips: int) -> str:
        """When so many skips were first seen."""
        for episode, clock, _, seen, _ in self.rows:
            if seen >= skips:
                return f"{skips} skips first in episode {episode}, after {clock:.0f} s"
        return f"{skips} skips were not seen"


def learn(folder: Path, *, minutes: float, seed: int, resume: bool) -> Learning:
    """Learn until so much processor time is spent, earlier runs into the same folder included."""
    checkpoint = folder / "checkpoint.pickle"
    if resume and checkpoint.exists():
        learning: Learning = pickle.loads(checkpoint.read_bytes())
    else:
        options = {"seed": seed + 1, "verbose": -9, "popsize": 16}
        learning = Learning(cma.CMAEvolutionStrategy(np.zeros(NUMBERS), SIGMA, options))
    env = gymnasium.make("mjskip/Thrower-v0").unwrapped
    throw(env, np.zeros(NUMBERS))  # compiles
    columns = [
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[best]}"), TimeRemainingColumn(),
    ]  # fmt: skip
    with Progress(*columns) as progress:
        spent = learning.rows[-1][1] if learning.rows else 0.0
        bar = progress.add_task("throws", total=60.0 * minutes, completed=spent, best="")
        while spent < 60.0 * minutes and not learning.search.stop():
            learning.generation(env, spent)
            learning.save(folder)
            spent = learning.rows[-1][1]
            most = max(row[3] for row in learning.rows)
            progress.update(
                bar, completed=spent, best=f"{len(learning.rows)} throws, at most {most} skips"
            )
    return learning


def draw_curve(learning: Learning, path: Path) -> None:
    """Skips over episodes: every episode, and the mean over 100."""
    from matplotlib.figure import Figure

    episodes, _, _, skips, _ = map(np.array, zip(*learning.rows, strict=True))
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(episodes, skips, ".", ms=3, alpha=0.3, label="every throw")
    width = min(100, len(skips))
    mean = np.convolve(skips, np.ones(width) / width, mode="valid")
    axes.plot(episodes[width - 1 :], mean, label=f"mean of {width}")
    axes.plot(episodes, np.maximum.accumulate(skips), "k--", lw=1, label="most so far")
    axes.set(xlabel="throws", ylabel="skips")
    axes.legend()
    figure.savefig(path, dpi=120)


def film(learning: Learning, path: Path) -> None:
    """The best throw, at half its speed."""
    size = (640, 480)
    env = gymnasium.make(
        "mjskip/Thrower-v0", render_mode="rgb_array", width=size[0], height=size[1]
    ).unwrapped
    frames: list[np.ndarray] = []
    throw(env, learning.best[0], frames)
    env.close()
    write_video(frames, path, size=size, fps=50.0, total=len(frames))


def main() -> None:
    """Learn, and show what was learned."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--minutes", type=float, default=15.0, help="of processor time (default 15)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("learned"))
    parser.add_argument("--resume", action="store_true", help="go on from the folder's checkpoint")
    parser.add_argument("--no-film", action="store_true")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    learning = learn(
        arguments.folder, minutes=arguments.minutes, seed=arguments.seed, resume=arguments.resume
    )
    most = max(row[3] for row in learning.rows)
    for skips in range(1, most + 1):
        print(learning.first(skips))
    clock = learning.rows[-1][1]
    print(
        f"{len(learning.rows)} throws in {clock:.0f} s of processor time; best reward {learning.best[1]:.2f}"
    )
    draw_curve(learning, arguments.folder / "curve.png")
    if not arguments.no_film:
        film(learning, arguments.folder / "best.mp4")
    print(f"written to {arguments.folder}")


if __name__ == "__main__":
    main()
