"""Scenes and flights made by hand for tests of drawing."""

import functools
from dataclasses import replace

import numpy as np

from mjskip.throws.scene import load_scene
from mjskip.throws.trajectory import Trajectory

SMALL = (160, 120)


@functools.cache
def small(name="lake"):
    """A shipped scene with a field small enough for tests."""
    lake = {"shape": (120, 80), "spacing": 0.02, "boundary": "absorb", "centre": (-3.5, 0.0)}
    return replace(load_scene(name), grid=lake)


def flight(*, rows=400, timestep=1e-3, seed=0):
    """A stone that crosses the water at 2 m/s and touches it twice, with a ragged load."""
    random = np.random.default_rng(seed)
    time = np.arange(rows) * timestep
    x = np.column_stack([-4.0 + 2.0 * time, 0.05 * time, 0.1 - 0.1 * time])
    turn = 60.0 * time
    q = np.column_stack([np.cos(turn), 0.0 * turn, 0.0 * turn, np.sin(turn)])
    force = np.zeros((rows, 3))
    for first, last in ((50, 90), (230, 260)):
        force[first:last] = random.normal(5.0, 4.0, (last - first, 3))
    still = np.zeros((rows, 3))
    return Trajectory(
        time=time,
        position=x,
        q=q,
        P=still,
        L=still,
        velocity=still,
        omega=still,
        force=force,
        torque=still,
        air_force=still,
        water_load=force[:, 2],
        wetted_area=np.where(force[:, 2] != 0.0, 3e-3, 0.0),
        wetted_centre=x,
        clearance=x[:, 2],
        contacts=(),
        skips=0,
        end="out of time",
        mass=0.14,
    )
