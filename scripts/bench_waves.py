"""How near is the water's step to what memory allows? Ratios of medians, measured in one run.

Prints JSON: a 500 x 500 step over a copy of the same grid and under a NumPy slice version of the
same stencil; one thread against two at 4096 x 4096; a row of touches over 100 m of endless water
against a field of 16384 x 16384 cells, whose step is taken as 16 times that at 4096. Half a
minute.
"""

import json
import os
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip.waves import HeightField


def median_seconds(call: Callable[[], object], *, repeats: int) -> float:
    """Median time of a call that repeats with nothing between: caches warm, code compiled."""
    call()
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def numpy_step(z: npt.NDArray[np.float32], prev: npt.NDArray[np.float32]) -> None:
    """The nine-point step with slices, into `prev`, as one would write it in NumPy."""
    q, s = np.float32(0.99), np.float32(0.5)
    edges = z[:-2, 1:-1] + z[2:, 1:-1] + z[1:-1, :-2] + z[1:-1, 2:]
    corners = z[:-2, :-2] + z[:-2, 2:] + z[2:, :-2] + z[2:, 2:]
    here = z[1:-1, 1:-1]
    bend = np.float32(2 / 3) * edges + np.float32(1 / 6) * corners - np.float32(10 / 3) * here
    prev[1:-1, 1:-1] = here + q * (here - prev[1:-1, 1:-1]) + s * bend
    prev[0], prev[-1] = prev[1], prev[-2]
    prev[:, 0], prev[:, -1] = prev[:, 1], prev[:, -2]


def waves(n: int, *, threads: int) -> HeightField:
    """n x n cells in motion."""
    water = HeightField((n, n), threads=threads)
    water.displace(0.0, 0.0, height=0.01, radius=0.25 * n * water.spacing)
    return water


def open_water() -> tuple[float, int, int]:
    """Touches over 100 m at 9 m/s: mean seconds per step, most bytes, most tiles."""
    water = HeightField.endless()
    water.press(-1.0, 0.0, force=10.0, radius=0.05)
    water.advance(0.01)  # compiled
    water.reset()
    steps, most, tiles = 0, 0, 0
    start = time.perf_counter()
    for place in np.arange(0.0, 100.0, 2.5).tolist():
        for _ in range(4):
            water.press(place, 0.0, force=10.0, radius=0.05)
            steps += water.advance(0.01)
        for _ in range(24):
            steps += water.advance(0.01)
        most, tiles = max(most, water.memory), max(tiles, water.active_tiles)
    return (time.perf_counter() - start) / steps, most, tiles


def bench() -> dict[str, Any]:
    """Measure; see the module's docstring."""
    small = waves(500, threads=1)
    step = 0.9 * small.max_timestep
    source = small.elevation.copy()
    target = source.copy()
    z, prev = np.pad(source, 1, mode="edge"), np.pad(source, 1, mode="edge")
    # In turns, and the best of each: another process on the machine disturbs some of them.
    rounds = [
        (
            median_seconds(lambda: small.step(step), repeats=300),
            median_seconds(lambda: np.copyto(target, source), repeats=300),
            median_seconds(lambda: numpy_step(z, prev), repeats=30),
        )
        for _ in range(6)
    ]
    ours, copy, numpy_slices = (min(times) for times in zip(*rounds, strict=True))

    whole = []
    for threads in (1, 2):
        water = waves(4096, threads=threads)
        whole.append(median_seconds(partial(water.advance, 16 * step), repeats=8) / 16)
        if threads == 1:
            one_by_one = median_seconds(partial(water.step, step), repeats=20)
        del water
    big = np.ones((4096, 4096), np.float32)  # zeros would all be one page
    big_target = big.copy()
    big_copy = median_seconds(lambda: np.copyto(big_target, big), repeats=30)
    whole_one, whole_two = whole  # several steps in one pass over memory
    open_step, open_bytes, open_tiles = open_water()
    return {
        "cores": os.cpu_count(),
        "step_500_us": 1e6 * ours,
        "memcpy_500_us": 1e6 * copy,
        "numpy_500_us": 1e6 * numpy_slices,
        "step_over_memcpy_500": ours / copy,
        "numpy_over_step_500": numpy_slices / ours,
        "step_4096_one_thread_ms": 1e3 * whole_one,
        "step_4096_two_threads_ms": 1e3 * whole_two,
        "two_threads_speedup_4096": whole_one / whole_two,
        "steps_in_one_pass_speedup_4096": one_by_one / whole_one,
        "step_over_memcpy_4096_one_thread": whole_one / big_copy,
        "endless_step_ms": 1e3 * open_step,
        "endless_megabytes": 1e-6 * open_bytes,
        "endless_tiles": open_tiles,
        "whole_16384_step_ms_extrapolated": 16e3 * one_by_one,  # a step at a time, as endless water
        "whole_over_endless_time": 16.0 * one_by_one / open_step,
        "whole_over_endless_memory": 2.0 * 4.0 * 16384**2 / open_bytes,
    }


if __name__ == "__main__":
    print(json.dumps(bench(), indent=2))
