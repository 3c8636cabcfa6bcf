"""Does two-way water stay sound? Ten simulated minutes of random throws of three stones into one lake.

    python scripts/soak.py [minutes]

Prints, every half minute: mean level of the lake inside its walls (loads move water and make none), the
greatest elevation, what the waves gained of what the stones lost, memory. Ten minutes take five to ten.
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from mjskip import Throw, Water
from mjskip.hydro.stone import Stone
from mjskip.throws.reference import Integrator
from mjskip.waves.lake import Lake
from mjskip.waves.twoway import MovingSurface

TIMESTEP = 1e-3
STONES = {
    "pebble": Stone.pebble(),
    "disc": Stone.disc(0.05, 0.01, segments=24, density=2500.0),
    "light": Stone.disc(0.06, 0.02, segments=24, density=700.0),
}
WATER = Water(buoyancy=True, skin_friction=True, gate="local")


def soak(seconds: float, *, every: float = 30.0, seed: int = 1) -> Iterator[dict[str, Any]]:
    """Throw three stones, each anew when it has sunk or after four seconds, and report now and then."""
    rng = np.random.default_rng(seed)
    lake = Lake((192, 192), damping=0.5, sleep_amplitude=0.0)
    balance = dict.fromkeys(("lost", "gained", "taken", "given", "loads", "limited"), 0.0)
    flying: dict[str, Integrator] = {}
    states: dict[str, Any] = {}
    age = dict.fromkeys(STONES, 0)
    surface: MovingSurface | None = None

    def count() -> None:
        if surface is not None:
            surface.settle()
            for name in balance:
                balance[name] += getattr(surface.balance, name)

    steps, report = round(seconds / TIMESTEP), round(every / TIMESTEP)
    for step in range(1, steps + 1):
        gone = [
            n
            for n in STONES
            if n not in flying or states[n][0, 2] < -0.3 or age[n] * TIMESTEP > 4.0
        ]
        if gone:
            count()
            for name in gone:
                throw = Throw.from_degrees(
                    speed=rng.uniform(1, 9), spin=rng.uniform(0, 60), attack=rng.uniform(0, 40),
                    descent=rng.uniform(0, 80), height=rng.uniform(0, 0.5),
                )  # fmt: skip
                start = throw.state(
                    STONES[name], x=rng.uniform(-1.8, 0.5), y=rng.uniform(-1.5, 1.5)
                )
                flying[name] = Integrator(STONES[name], start, water=WATER, timestep=TIMESTEP)
                states[name], age[name] = flying[name].start(), 0
            blocks = {name: stone.block for name, stone in flying.items()}
            surface = MovingSurface(lake, blocks, own_dent=bool(rng.integers(2)))
        assert surface is not None
        surface.look(states)
        surface.advance(TIMESTEP)
        for name, stone in flying.items():
            states[name] = stone.advance(1)
            age[name] += 1
        if step % report == 0 or step == steps:
            count()
            surface.balance = type(surface.balance)()
            yield {
                "time": step * TIMESTEP,
                "mean_level": lake.volume() / (192 * lake.spacing) ** 2,
                "highest": lake.highest,
                "finite": all(np.isfinite(s).all() for s in states.values()),
                "water_bytes": lake.memory,
                "process_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
                **balance,
            }


def main() -> None:
    """Print the reports."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    for row in soak(60.0 * minutes):
        print("  ".join(f"{k} {v:.6g}" for k, v in row.items()), flush=True)


if __name__ == "__main__":
    main()
