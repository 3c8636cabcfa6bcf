"""What the water gets back of what the stone took."""

import numpy as np
import pytest
from flights import flight

from mjskip.throws.wake import Wake
from mjskip.waves import HeightField


class Ledger:
    """A water that only writes down what it is given."""

    spacing = 0.02

    def __init__(self):
        self.given = 0.0
        self.time = 0.0
        self.advances = 0
        self._load = 0.0

    def press(self, x, y, *, force, radius, density):
        self._load += force

    def advance(self, duration):
        self.given += self._load * duration
        self._load = 0.0
        self.time += duration
        self.advances += 1


@pytest.mark.parametrize("seed", range(5))
def test_over_any_interval_the_water_gets_back_the_impulse_the_stone_took(seed):
    trajectory = flight(seed=seed)
    held = np.append(np.diff(trajectory.time), 0.0)
    taken = np.concatenate([[0.0], np.cumsum(trajectory.force[:, 2] * held)[:-1]])
    ledger = Ledger()
    wake = Wake(ledger, [trajectory], density=1000.0)
    for until in np.sort(np.random.default_rng(seed).uniform(0.0, 0.45, 37)):
        wake.advance(until)
        expected = np.interp(until, trajectory.time, taken)
        # sums of a thousand rounded products of order 1e-2 N s
        assert ledger.given == pytest.approx(expected, abs=1e-13)
        assert ledger.time == pytest.approx(until, abs=1e-12)


def test_the_wakes_of_two_stones_add():
    both, ledgers = Ledger(), (Ledger(), Ledger())
    flights = flight(seed=1), flight(seed=2, timestep=7e-4)
    Wake(both, flights, density=1000.0).advance(0.5)
    for ledger, one in zip(ledgers, flights, strict=True):
        Wake(ledger, [one], density=1000.0).advance(0.5)
    assert both.given == pytest.approx(sum(one.given for one in ledgers), rel=1e-12)


def test_untouched_water_advances_in_one_go():
    ledger = Ledger()
    Wake(ledger, [flight()], density=1000.0).advance(0.04)
    assert ledger.advances == 1
    assert ledger.given == 0.0


def test_a_wake_makes_no_water():
    field = HeightField((160, 100), 0.02, centre=(-3.5, 0.0))
    Wake(field, [flight()], density=1000.0).advance(0.4)
    assert np.abs(field.elevation).max() > 1e-4  # there is a wake
    # single precision: 16000 cells of 4e-4 m^2, each off by about 1e-9 m in 40 steps
    assert abs(field.volume()) < 1e-7
