"""Does two-way water stay sound? Ten simulated minutes of random throws of three stones into one lake.

    python scripts/soak.py [minutes]

Prints, every half minute: mean level inside the walls (loads move water and make none), the greatest elevation, the
impulse that the water was given, memory.
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from mjskip import HeightField, Stone, Throw, Water
from mjskip.hydro.columns import FORCE
from mjskip.hydro.wrench import pack
from mjskip.throws.kick import KickedStones
from mjskip.waves.coupled import CoupledWater

TIMESTEP = 1e-3
STONES = {
    "pebble": Stone.pebble(),
    "disc": Stone.disc(0.05, 0.01, segments=24, density=2500.0),
    "light": Stone.disc(0.06, 0.02, segments=24, density=700.0),
}
WATER = Water(buoyancy=True, skin_friction=True)
GRAVITY = np.array([0.0, 0.0, -9.81])


def soak(seconds: float, *, every: float = 30.0, seed: int = 1) -> Iterator[dict[str, Any]]:
    """Throw three stones, each anew when it has sunk or after four seconds, and report now and then."""
    rng = np.random.default_rng(seed)
    field = HeightField((192, 192), damping=0.5)
    stones = list(STONES.values())

    def thrown(stone: Stone) -> Any:
        throw = Throw.from_degrees(
            speed=rng.uniform(1, 9), spin=rng.uniform(0, 60), attack=rng.uniform(0, 40),
            descent=rng.uniform(0, 80), height=rng.uniform(0, 0.5),
        )  # fmt: skip
        return throw.state(stone, x=rng.uniform(-1.8, 0.5), y=rng.uniform(-1.5, 1.5))

    def launched(starts: list[Any]) -> KickedStones:
        return KickedStones(stones, starts, timestep=TIMESTEP, gravity=GRAVITY)

    engine = launched([thrown(stone) for stone in stones])
    water = CoupledWater(
        field, [pack(stone, WATER) for stone in stones], timestep=TIMESTEP, stages=0
    )
    engine.couple(water)
    age, given, finite, done = np.zeros(len(stones)), 0.0, True, 0
    steps, report, block = round(seconds / TIMESTEP), round(every / TIMESTEP), 50
    while done < steps:
        path, loads, reactions = water.advance(engine, engine.states(), block)
        done, age = done + block, age + block * TIMESTEP
        given += TIMESTEP * float(reactions.sum())
        finite = finite and bool(np.isfinite(path).all() and np.isfinite(loads[..., FORCE]).all())
        for k in np.flatnonzero((path[-1, :, 2] < -0.3) | (age > 4.0)):
            engine.y[k] = launched([thrown(stone) for stone in stones]).y[k]
            age[k] = 0.0
        if done % report < block or done >= steps:
            water.catch_up()
            yield {
                "time": done * TIMESTEP,
                "mean_level": field.volume() / (192 * field.spacing) ** 2,
                "highest": field.highest,
                "given_impulse": given,
                "finite": finite,
                "water_bytes": field.memory,
                "process_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
            }


def main() -> None:
    """Print the reports."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    for row in soak(60.0 * minutes):
        print("  ".join(f"{k} {v:.6g}" for k, v in row.items()), flush=True)


if __name__ == "__main__":
    main()
