"""The best throw: where it is known, for hands that stray, and within limits."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

from mjskip import Limits, Stone, Throw, Water
from mjskip.cli import cli
from mjskip.sweeps.optimize import GOOD_FRACTION, optimize

PEBBLE = Stone.pebble()
QUICK = {"population": 12, "generations": 8, "members": 4, "limits": Limits(duration=0.6)}
BOX = {"speed": (6.0, 10.0), "attack": (0.1, 0.6), "descent": (0.05, 0.3)}


def test_without_air_and_water_the_longest_way_is_the_longest_parabola():
    """Water without weight and 2 s of flight: the farthest is flattest and fastest."""
    best = optimize(
        PEBBLE, {"speed": (5.0, 10.0), "descent": (-1.2, 0.0)}, goal="distance", scatter={},
        throw=Throw(height=0.0, attack=0.0, spin=0.0), water=Water(density=0.0, air_density=0.0),
        limits=Limits(duration=2.0, sink_depth=1e-3, max_contact=1e-3), timestep=1e-3,
        population=20, generations=60, members=1,
    )  # fmt: skip
    # thrown from the ground it comes down after 2 v sin / g: the way is v^2 sin(2 angle) / g, best at 45;
    # sinking a thousandth of its radius lower makes no difference here, stopping at 2 s neither
    assert best.throw.speed == pytest.approx(10.0, rel=1e-2)
    assert best.throw.descent == pytest.approx(-math.pi / 4, abs=0.03)
    assert best.mean == pytest.approx(100 / 9.81, rel=1e-2)
    assert best.deviation == 0.0


def test_the_best_throw_is_within_the_limits_and_better_than_their_middle():
    best = optimize(PEBBLE, BOX, **QUICK)
    for name, (low, high) in BOX.items():
        assert low <= getattr(best.throw, name) <= high
    middle = {name: (e[0] + e[1]) / 2 for name, e in BOX.items()}
    held = {n: (v - 1e-6, v + 1e-6) for n, v in middle.items()}
    assert best.mean > optimize(PEBBLE, held, **QUICK | {"generations": 1}).mean
    assert best.throw.spin == Throw().spin  # what has no limits stays


def test_the_same_seed_finds_the_same_throw_with_any_number_of_threads():
    one, two = (optimize(PEBBLE, BOX, **QUICK, threads=n) for n in (1, 2))
    assert one.throw == two.throw
    assert one.mean == two.mean
    assert optimize(PEBBLE, BOX, **QUICK, seed=5).throw != one.throw


def test_the_neighbourhood_holds_the_best_throw_and_says_how_far_one_may_stray():
    best = optimize(PEBBLE, BOX, **QUICK)
    for name, around in best.neighbourhood.items():
        aim = getattr(best.throw, name)
        at = np.flatnonzero(np.isclose(around.values, aim, rtol=1e-12))
        assert len(at) == 1
        assert around.mean[at[0]] == best.mean  # the same ensemble
        assert around.good[0] <= aim <= around.good[1]
        inside = (around.values >= around.good[0]) & (around.values <= around.good[1])
        assert (around.mean[inside] >= GOOD_FRACTION * best.mean).all()
        assert around.values[[0, -1]] == pytest.approx(BOX[name])


def test_a_hand_that_strays_is_told_less_than_a_perfect_one():
    """Five skips exactly as aimed are fewer on average: that is what the ensemble is for."""
    perfect = optimize(PEBBLE, BOX, **QUICK, scatter={})
    assert perfect.mean == perfect.aimed == perfect.searched
    wild = {"speed": 1.0, "attack": 0.15, "descent": 0.1}
    strays = optimize(PEBBLE, BOX, **QUICK, scatter=wild)
    assert strays.mean < perfect.mean
    assert strays.deviation > 0.0
    assert strays.tenth <= strays.mean


@pytest.mark.parametrize(
    ("limits", "options", "says"),
    [
        ({}, {}, r"ranges is \{\}: say what the thrower can do"),
        ({"radius": (0.1, 0.2)}, {}, "a parameter of ranges is .radius."),
        ({"speed": (9.0, 5.0)}, {}, "lower end first"),
        ({"speed": (-9.0, 5.0)}, {}, "speed is -9"),
        ({"speed": (5.0, 9.0)}, {"goal": "glory"}, "goal is 'glory'"),
        ({"speed": (5.0, 9.0)}, {"members": 0}, "members is 0"),
        ({"speed": (5.0, 9.0)}, {"scatter": {"mass": 1.0}}, "a parameter of scatter is .mass."),
    ],
)
def test_limits_that_cannot_be_are_refused(limits, options, says):
    with pytest.raises(ValueError, match=says):
        optimize(PEBBLE, limits, **options)


def test_the_command_speaks_degrees_and_reports_si():
    command = (
        "optimize lake --limit attack=10:30 --limit spin=5:15 --generations 2 --population 6 "
        "--members 2 --duration 0.5 --json"
    )
    found = CliRunner().invoke(cli, command.split(), catch_exceptions=False)
    assert found.exit_code == 0
    best = json.loads(found.stdout)
    assert math.radians(10) <= best["throw"]["attack"] <= math.radians(30)
    assert 10 * math.pi <= best["throw"]["spin"] <= 30 * math.pi
    assert set(best["neighbourhood"]) == {"attack", "spin"}
    text = CliRunner().invoke(cli, command.removesuffix(" --json").split(), catch_exceptions=False)
    assert "skips on average" in text.stdout
    assert "°" in text.stdout
