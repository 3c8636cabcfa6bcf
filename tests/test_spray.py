"""Spray: drawn only, and never more than the stone gave."""

import numpy as np
import pytest
from flights import SMALL, flight, small

from mjskip.draw import render
from mjskip.draw.spray import SPRAY_FRACTION, Spray, touches
from mjskip.throws.simulate import simulate_all


@pytest.fixture(scope="module")
def throw():
    (one,) = simulate_all(small()).values()
    return one


def test_spray_never_holds_more_momentum_or_energy_than_the_water_was_given(throw):
    spray = Spray(throw)
    assert len(spray.mass) > 1000
    speed = np.linalg.norm(
        spray._drops, axis=2
    )  # of the drops of each packet, which share its mass
    momentum = spray.mass * speed.mean(axis=1)
    energy = 0.5 * spray.mass * (speed**2).mean(axis=1)
    step = np.diff(throw.time, append=throw.time[-1])
    for first, last in touches(throw):
        for row in range(first + 1, last, 7):
            rows = slice(first, row + 1)
            given = np.linalg.norm(np.sum(throw.force[rows] * step[rows, None], axis=0))
            work = -np.sum(throw.force[rows] * throw.velocity[rows] * step[rows, None])
            thrown = (spray.birth >= throw.time[first]) & (spray.birth <= throw.time[row])
            assert momentum[thrown].sum() <= SPRAY_FRACTION * given * (1.0 + 1e-9)
            assert energy[thrown].sum() <= SPRAY_FRACTION * max(work, 0.0) * (1.0 + 1e-9)


def test_drops_fall_freely_and_are_gone_when_they_are_back(throw):
    spray = Spray(throw)
    spray._drops, spray._bubbles = spray.velocity[:, None], np.zeros((0, 4))
    packet = int(np.argmax(spray.velocity[:, 2]))
    for name in ("birth", "origin", "velocity", "mass", "_drops"):
        setattr(spray, name, getattr(spray, name)[packet : packet + 1])
    up = float(spray.velocity[0, 2])
    for age in (0.02, 0.05, 0.1):
        (row,) = spray.drops(spray.birth[0] + age)
        expected = spray.origin[0] + spray.velocity[0] * age - [0.0, 0.0, 0.5 * 9.81 * age**2]
        np.testing.assert_allclose(row[:3], expected, atol=1e-5)  # single precision
    assert len(spray.drops(spray.birth[0] + 2.0 * up / 9.81 + 0.01)) == 0


def test_spray_is_thrown_ahead_and_up_from_the_wet_edge(throw):
    spray = Spray(throw)
    assert (spray.velocity[:, 2] > 0.0).all()
    ahead = throw.velocity[touches(throw)[0][0], :2]
    assert np.sum(spray.mass * (spray.velocity[:, :2] @ ahead)) > 0.0
    # slower than the stone: no jet of these is faster
    assert np.linalg.norm(spray.velocity, axis=1).max() < np.linalg.norm(ahead)


def test_a_stone_that_touches_nothing_throws_nothing_up():
    dry = flight()
    dry.force[:] = 0.0
    dry.position[:, 2] = 1.0
    spray = Spray(dry)
    assert len(spray.drops(0.2)) == len(spray.sheet(0.2)) == 0


def test_bubbles_rise_where_a_stone_went_under():
    diving = flight()
    diving.force[:] = 0.0
    diving.position[:, 2] -= 0.3
    early, late = (Spray(diving).drops(time) for time in (0.2, 0.3))
    assert len(early) > 5
    assert (early[:, 2] < 0.0).all()
    assert late[:, 2].max() > early[:, 2].max()


def test_spray_shows_and_can_be_left_out(throw):
    first = throw.contacts[0]
    times = np.array([0.5 * (first.entry.time + first.exit.time) + 0.01])
    without, with_it = (
        next(render.frames(small(), throw, render.Shot(size=SMALL, spray=spray), times=times)).astype(int)
        for spray in (False, True)
    )  # fmt: skip
    changed = np.abs(with_it - without).max(axis=2) > 20
    assert 10 < changed.sum() < 0.2 * changed.size
    assert (with_it[changed].sum(axis=1) > without[changed].sum(axis=1)).mean() > 0.9  # brighter
