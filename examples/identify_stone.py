"""What does this stone weigh, and what is it thrown into? Both from a film of it, by gradients through the simulation.

    python examples/identify_stone.py [--seed 0]

A pebble falls flat from 2 m, spinning, and plunges. Its positions and velocities are recorded 200 times a second by
MuJoCo's independent engine and disturbed by noise of 1% of their root mean square. Known are the pebble's shape, how it
was let go, and the density of the air: the fall tells the mass (the air slows a light stone more), the plunge then tells
the density of the water. Neither comes out of the plunge alone, where only their ratio matters.

Gauss-Newton on both at once; the derivatives are `jax.jacfwd` of the whole flight. Needs `pip install "mjskip[jax]"`.
About half a minute.
"""

from __future__ import annotations

import argparse

import jax
import jax.numpy as jnp
import numpy as np

import mjskip
import mjskip.jax
from mjskip.jax import State

jax.config.update("jax_enable_x64", True)

MASS, DENSITY = 0.05, 1100.0
"""What is to be found [kg], [kg/m^3]: a pebble of pumice, and brine."""
GUESS = (0.07, 900.0)
TIMESTEP, STEPS, EVERY = 1e-3, 700, 5
NOISE = 0.01


def record() -> tuple[np.ndarray, np.ndarray, State]:
    """Positions and velocities (n, 3), without noise, and how the stone was let go."""
    stone = mjskip.Stone.from_mesh(_mesh(), mass=MASS)
    throw = mjskip.Throw.from_degrees(speed=1.0, spin=20, attack=0, descent=0, height=2.0)
    start = throw.state(stone)
    flight = mjskip.integrate(
        stone,
        throw,
        water=mjskip.Water(density=DENSITY),
        timestep=2e-4,
        limits=mjskip.Limits(duration=TIMESTEP * STEPS, sink_depth=1000.0, max_contact=10.0),
    )
    rows = np.arange(1, STEPS // EVERY + 1) * EVERY * 5
    return flight.position[rows], flight.velocity[rows], State(start.position, start.q, start.velocity, start.omega)  # fmt: skip


def _mesh() -> object:
    """The pebble's shape, which is known."""
    import trimesh

    pebble = mjskip.Stone.pebble()
    return trimesh.Trimesh(pebble.vertices, pebble.faces, process=False)


def main() -> None:
    """Record, disturb, identify."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    rng = np.random.default_rng(parser.parse_args().seed)
    x, v, start = record()
    scale = [np.sqrt(np.mean(x**2)), np.sqrt(np.mean(v**2))]
    seen = [a + NOISE * s * rng.normal(size=a.shape) for a, s in zip((x, v), scale, strict=True)]

    unit = mjskip.Stone.from_mesh(_mesh(), mass=1.0)
    load = mjskip.jax.wrench(unit)

    def residual(guess: jax.Array) -> jax.Array:
        """What is seen less what a guess of (mass, density) would show, in units of the noise."""
        mass, density = guess
        states = mjskip.jax.free_flight(
            start,
            lambda state: load(state, density=density),
            steps=STEPS,
            timestep=TIMESTEP,
            mass=mass,
            inertia=mass * unit.inertia,
        )
        shown = states.position[EVERY - 1 :: EVERY], states.velocity[EVERY - 1 :: EVERY]
        return jnp.concatenate(
            [((a - b) / (NOISE * s)).ravel() for a, b, s in zip(seen, shown, scale, strict=True)]
        )

    both = jax.jit(lambda guess: (residual(guess), jax.jacfwd(residual)(guess)))
    guess = np.array(GUESS)
    print(
        f"{'':6} mass [kg]  density [kg/m^3]  root mean square of what is left, in units of the noise"
    )
    for iteration in range(20):
        left, slope = map(np.asarray, both(jnp.asarray(guess)))
        print(f"{iteration:6d} {guess[0]:9.5f} {guess[1]:17.1f} {np.sqrt(np.mean(left**2)):12.3f}")
        step = -np.linalg.lstsq(slope, left, rcond=None)[0]
        limit = np.max(np.abs(step) / (0.3 * guess))  # at most 30% a step
        guess = guess + step / max(1.0, limit)
        if np.all(np.abs(step) < 1e-6 * guess):
            break
    doubt = np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))
    print(
        f"mass    {guess[0]:9.5f} +- {doubt[0]:.5f} kg     (is {MASS}: {100 * (guess[0] / MASS - 1):+.2f}%)"
    )
    print(f"density {guess[1]:9.1f} +- {doubt[1]:.1f} kg/m^3  (is {DENSITY}: {100 * (guess[1] / DENSITY - 1):+.2f}%)")  # fmt: skip


if __name__ == "__main__":
    main()
