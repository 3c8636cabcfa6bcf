"""A free rigid body under a load, advanced by the classical Runge-Kutta method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from mjskip.jax.forces import Load, rotation


class State(NamedTuple):
    """A rigid body at one moment, world frame.

    Attributes:
        position: of the centre of mass (3,) [m].
        q: orientation (4,), w-x-y-z, body to world.
        velocity: of the centre of mass (3,) [m/s].
        omega: angular velocity (3,) [rad/s].
    """

    position: Any
    q: Any
    velocity: Any
    omega: Any


def step(
    state: State,
    load: Callable[[State], Load],
    *,
    timestep: Any,
    mass: Any,
    inertia: Any,
    gravity: float = 9.81,
) -> State:
    """The state a time step later: one step of the classical fourth-order Runge-Kutta method.

    m dv/dt = F - m g z,  d(I omega)/dt = tau,  dq/dt = 1/2 omega q

    Args:
        state: now.
        load: forces in a state, from `mjskip.jax.wrench`.
        timestep: [s].
        mass: [kg].
        inertia: about the centre of mass, body axes (3, 3) [kg m^2].
        gravity: downwards [m/s^2].
    """
    down = jnp.array([0.0, 0.0, -gravity])
    inverse = jnp.linalg.inv(jnp.asarray(inertia))

    def rate(now: State) -> State:
        found = load(now)
        turn = rotation(now.q)
        spin = turn.T @ now.omega
        torque = turn.T @ (found.torque + found.air_torque)
        turning = turn @ (inverse @ (torque - jnp.cross(spin, inertia @ spin)))
        w, v = now.q[0], now.q[1:]
        dq = 0.5 * jnp.concatenate(
            [-jnp.dot(now.omega, v)[None], w * now.omega + jnp.cross(now.omega, v)]
        )
        return State(now.velocity, dq, (found.force + found.air_force) / mass + down, turning)

    def moved(along: State, part: Any) -> State:
        return State(*(x + part * slope for x, slope in zip(state, along, strict=True)))

    k1 = rate(state)
    k2 = rate(moved(k1, 0.5 * timestep))
    k3 = rate(moved(k2, 0.5 * timestep))
    k4 = rate(moved(k3, timestep))
    mean = State(
        *((a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    )
    after = moved(mean, timestep)
    return after._replace(q=after.q / jnp.linalg.norm(after.q))


def free_flight(
    state: State,
    load: Callable[[State], Load],
    *,
    steps: int,
    timestep: Any,
    mass: Any,
    inertia: Any,
    gravity: float = 9.81,
) -> State:
    """States (steps, ...) after every step; arguments as for `step`."""

    def body(now: State, _: None) -> tuple[State, State]:
        after = step(
            now, load, timestep=timestep, mass=mass, inertia=inertia, gravity=gravity
        )  # fmt: skip
        return after, after

    start = State(*(jnp.asarray(value, jnp.float64) for value in state))
    _, states = jax.lax.scan(body, start, length=steps)
    return states
