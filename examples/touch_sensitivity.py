"""How does the throw decide what a touch leaves? And how far ahead can one trust the answer?

    python examples/touch_sensitivity.py

First: derivatives of speed, path angle and attack after one touch with respect to speed, spin, attack and descent before
it, by `jax.jacfwd` through the touch, beside finite differences. Then the limit of it: distance over attack, from 5 to 37
degrees, has many peaks; how often the sign of the derivative tells whether a throw 2.5 degrees steeper flies farther.
Needs `pip install "mjskip[jax]"`. About a minute.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

import mjskip
import mjskip.jax
from mjskip.jax import State

jax.config.update("jax_enable_x64", True)

STONE = mjskip.Stone.pebble()
NAMES = ("speed [m/s]", "spin [rev/s]", "attack [deg]", "descent [deg]")
THROW = np.array([10.0, 15.0, 20.0, 10.0])
TIMESTEP, STEPS = 2e-4, 500
"""A tenth of a second: down from 2 cm, one touch, and out of it."""


def released(throw: jax.Array) -> State:
    """The state at release: as `mjskip.Throw`, but for JAX."""
    speed, spin, attack, descent = throw[0], 2.0 * jnp.pi * throw[1], *jnp.radians(throw[2:])
    half = -0.5 * attack  # nose up is a turn about -y
    q = jnp.array([jnp.cos(half), 0.0, jnp.sin(half), 0.0])
    normal = jnp.array([-jnp.sin(attack), 0.0, jnp.cos(attack)])
    turn = mjskip.jax.rotation(q)
    lowest = jnp.min(jnp.asarray(STONE.vertices) @ turn[2])
    return State(
        jnp.array([0.0, 0.0, 0.02 - lowest]),
        q,
        speed * jnp.array([jnp.cos(descent), 0.0, -jnp.sin(descent)]),
        spin * normal,
    )


def main() -> None:
    """Print both tables."""
    load = mjskip.jax.wrench(STONE)

    def after(throw: jax.Array) -> jax.Array:
        states = mjskip.jax.free_flight(
            released(throw), load, steps=STEPS, timestep=TIMESTEP, mass=STONE.mass, inertia=STONE.inertia
        )  # fmt: skip
        v, q = states.velocity[-1], states.q[-1]
        normal = mjskip.jax.rotation(q)[:, 2]
        ahead = jnp.array([v[0], v[1], 0.0]) / jnp.hypot(v[0], v[1])
        return jnp.array(
            [
                jnp.linalg.norm(v),
                jnp.degrees(jnp.arctan2(v[2], jnp.hypot(v[0], v[1]))),
                jnp.degrees(jnp.arcsin(-jnp.dot(normal, ahead))),
            ]
        )

    value, slope = jax.jit(after), jax.jit(jax.jacfwd(after))
    found = np.asarray(slope(THROW))
    differences = np.stack(
        [(value(THROW + h) - value(THROW - h)) / 2e-4 for h in 1e-4 * np.eye(4)], axis=1
    )
    print(f"a touch at {', '.join(f'{v:g} {n}' for v, n in zip(THROW, NAMES, strict=True))} leaves")
    print(
        " speed {:.3f} m/s, path {:.2f} degrees upwards, attack {:.2f} degrees".format(
            *value(THROW)
        )
    )
    print(f"{'derivative to':16} {'of speed':>10} {'of path':>10} {'of attack':>10}")
    for name, row in zip(NAMES, found.T, strict=True):
        print(f"{name:16} {row[0]:10.4f} {row[1]:10.4f} {row[2]:10.4f}")
    worst = np.abs(found - differences).max() / np.abs(found).max()
    print(f"greatest difference to finite differences, over the greatest derivative: {worst:.1e}")
    limits_of_gradients()


def limits_of_gradients() -> None:
    """Distance over attack: peaks, and what the sign of its derivative is worth."""
    fine = 0.05
    attacks = np.arange(5.0, 37.0 + fine / 2, fine)
    ends = []
    for attack in attacks:
        throw = mjskip.Throw.from_degrees(attack=attack)  # else the default throw
        flight = mjskip.integrate(STONE, throw, timestep=1e-3, limits=mjskip.Limits(duration=3.0))
        ends.append(flight.position[-1, 0])
    distance = np.array(ends)
    slope = np.sign(np.gradient(distance))
    peaks = int(np.sum((slope[:-1] > 0) & (slope[1:] < 0)))
    ahead = round(2.5 / fine)
    farther = np.sign(distance[ahead:] - distance[:-ahead])
    right = np.mean(slope[:-ahead] == farther)
    print(f"distance over {attacks[0]:g} to {attacks[-1]:g} degrees of attack: {peaks} peaks;")
    print(f" the sign of its derivative is right for 2.5 degrees ahead in {100 * right:.0f}%")


if __name__ == "__main__":
    main()
