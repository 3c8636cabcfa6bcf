"""Many throws at once: the same numbers as one by one, and the air in long steps."""

import math

import numpy as np
import pytest
import trimesh

from mjskip import Limits, Stone, Throw, Water, integrate
from mjskip.rigid._rigid_kernels import derivative
from mjskip.rigid.attitude import matrices
from mjskip.sweeps import _batch_kernels as kernels
from mjskip.sweeps import batch
from mjskip.sweeps.batch import Outcomes, throw_all
from mjskip.throws.reference import start_of
from mjskip.throws.trajectory import ENDS

GRAVITY = 9.81

PEBBLE = Stone.pebble()


def random_throws(count, seed=0, **fixed):
    """Throws from flat and fast to steep and slow, some of them wobbling."""
    rng = np.random.default_rng(seed)
    ranges = {
        "speed": (3, 12),
        "spin": (5, 100),
        "attack": (5, 40),
        "descent": (3, 40),
        "bank": (-10, 10),
        "wobble": (-1, 1),
        "height": (0, 0.1),
    }
    return [
        Throw.from_degrees(**{k: rng.uniform(*v) for k, v in ranges.items()} | fixed)
        for _ in range(count)
    ]


def columns(outcomes):
    """Everything in an outcome as one table (n, m)."""
    assert isinstance(outcomes, Outcomes)
    numbers = {**vars(outcomes), "end": [list(ENDS).index(end) for end in outcomes.end]}
    return np.column_stack(list(numbers.values()))


@pytest.mark.parametrize("method", ["rk4", "midpoint", "euler"])
def test_a_batch_does_what_integrate_does_to_the_last_bit(method):
    throws = random_throws(12, seed=3)
    water = Water(gate="local")  # explicit Euler stays finite
    done = throw_all(
        PEBBLE, throws, water=water, integrator=method, timestep=3e-4, air="fixed", threads=1
    )
    for k, throw in enumerate(throws):
        single = integrate(PEBBLE, throw, water=water, integrator=method, timestep=3e-4)
        touch = single.contacts[0]
        assert single.skips == done.skips[k]
        assert len(single.contacts) == done.touches[k]
        assert single.end == done.end[k]
        assert len(single.time) - 1 == done.steps[k]
        assert single.time[-1] == done.time[k]
        assert single.position[-1, 0] - single.position[0, 0] == done.distance[k]
        assert single.position[-1, 1] - single.position[0, 1] == done.drift[k]
        assert max(c.depth for c in single.contacts) == done.depth[k]
        assert touch.entry.time == done.first_entry[k]
        if touch.exit is None:
            assert np.isnan(done.first_exit[k])
        else:
            assert touch.exit.time == done.first_exit[k]
            assert touch.exit.velocity == tuple(done.exit_velocity[k])
    assert len(set(done.end)) > 1  # the throws were not all alike
    assert done.skips.max() > 0


def test_a_frozen_stone_in_a_batch_is_the_frozen_stone_alone(clanet, frozen_touch):
    throw = Throw.from_degrees(speed=3.5, spin=0, attack=20, descent=20, height=0)
    done = throw_all(
        clanet, [throw], water=Water(air_density=0), timestep=1e-4, limits=Limits(duration=0.12),
        frozen_attitude=True, air="fixed",
    )  # fmt: skip
    assert done.first_exit[0] == frozen_touch.contacts[0].exit.time
    assert tuple(done.exit_velocity[0]) == frozen_touch.contacts[0].exit.velocity


@pytest.mark.parametrize("air", ["fixed", "adaptive"])
def test_256_throws_over_two_threads_are_the_throws_one_by_one(air):
    throws = random_throws(256, seed=1)
    limits = Limits(duration=0.3)
    together = throw_all(PEBBLE, throws, air=air, limits=limits, threads=2)
    alone = [throw_all(PEBBLE, [t], air=air, limits=limits, threads=1) for t in throws]
    np.testing.assert_array_equal(columns(together), np.vstack([columns(a) for a in alone]))


def irregular():
    """A stone with three different moments of inertia, its disc off its centre of mass."""
    points = np.random.default_rng(2).normal(size=(20, 3)) * [0.05, 0.03, 0.01]
    return Stone.from_mesh(trimesh.convex.convex_hull(points))


@pytest.mark.parametrize(("stone", "spin"), [(PEBBLE, 60.0), (irregular(), 3.0)])
def test_long_steps_in_the_air_follow_the_yardstick(stone, spin):
    """A second of flight with spin, wobble and drag, against DOP853 at a tolerance of 1e-12."""
    throws = random_throws(4, seed=5, height=30.0, wobble=2.0, spin=spin)
    limits = Limits(duration=1.0)
    done = throw_all(stone, throws, air="adaptive", limits=limits)
    assert done.steps.max() < 1000  # half of the ordinary ones
    for k, throw in enumerate(throws):
        yardstick = integrate(stone, throw, integrator="adaptive", rtol=1e-12, limits=limits)
        way = yardstick.position[-1] - yardstick.position[0]
        # at most a thousand steps that each err by 1e-8 of 12 m/s, for half a second on average
        assert done.distance[k] == pytest.approx(way[0], abs=6e-5)
        assert done.drift[k] == pytest.approx(way[1], abs=6e-5)
        assert done.end[k] == "out of time"
        assert done.time[k] == pytest.approx(1.0, rel=1e-12)


def test_a_clean_throw_flies_in_a_few_steps_at_any_spin():
    throws = random_throws(4, seed=7, height=30.0, wobble=0.0, bank=0.0, spin=500.0)
    done = throw_all(PEBBLE, throws, limits=Limits(duration=1.0))
    assert done.steps.max() < 60  # 2000 ordinary ones


def test_the_touch_after_a_flight_comes_when_fine_steps_say():
    """Attitude counts too: a wobbling stone meets the water with whatever is lowest then."""
    throws = random_throws(4, seed=6, height=2.0, wobble=3.0)
    limits = Limits(duration=0.8)
    done = throw_all(PEBBLE, throws, air="adaptive", limits=limits, timestep=5e-4)
    fine = throw_all(PEBBLE, throws, air="fixed", limits=limits, timestep=2e-5)
    # position to some 1e-6 m (the test above) at 6 m/s
    np.testing.assert_allclose(done.first_entry, fine.first_entry, rtol=0, atol=2e-6)


def test_a_vacuum_flight_takes_hardly_a_step_and_ends_on_the_parabola():
    throw = Throw.from_degrees(speed=10, spin=0, attack=15, descent=-30, height=1.0)
    done = throw_all(
        PEBBLE, [throw], water=Water(air_density=0), limits=Limits(duration=1.2), timestep=1e-3
    )
    climb = 10 * math.sin(math.radians(30))
    lands = (climb + math.sqrt(climb**2 + 2 * GRAVITY * 1.0)) / GRAVITY
    # located to a clearance of 1e-9 m at 6.7 m/s
    assert done.first_entry[0] == pytest.approx(lands, abs=2e-9)
    before_the_touch = done.steps[0] - (1.2 - lands) / 1e-3
    assert before_the_touch < 12  # 1182 steps of 1 ms


def test_a_finer_step_and_the_fixed_one_meet():
    """Both ways of taking the air converge to the same first bounce."""
    throws = random_throws(6, seed=8, wobble=0, descent=8, attack=20, spin=60)
    limits = Limits(duration=0.5)
    fine = {
        a: throw_all(PEBBLE, throws, air=a, timestep=1e-5, limits=limits)
        for a in ("fixed", "adaptive")
    }
    left = ~np.isnan(fine["fixed"].first_exit)
    assert left.sum() >= 3
    # force has a kink wherever a facet meets the water: a hundredth of a millisecond of some m/s^2
    np.testing.assert_allclose(
        fine["adaptive"].exit_velocity[left], fine["fixed"].exit_velocity[left], atol=5e-5
    )


def test_a_throw_that_diverges_is_a_row_and_harms_no_other():
    good = Throw()
    bad = Throw(speed=1000.0, height=0.0, descent=1.2)
    limits = Limits(duration=0.5, sink_depth=1e300)  # it may go on until it overflows
    options = {"integrator": "euler", "timestep": 0.02, "limits": limits, "threads": 1}
    with np.errstate(all="raise"):
        mixed = throw_all(PEBBLE, [good, bad, good], **options)
    alone = throw_all(PEBBLE, [good], **options)
    assert mixed.end[1] == "diverged"
    assert math.isfinite(mixed.time[1])
    np.testing.assert_array_equal(columns(mixed)[[0, 2]], np.repeat(columns(alone), 2, axis=0))


def test_every_throw_may_have_its_own_stone_and_water():
    stones = [PEBBLE, Stone.disc(0.05, 0.008)]
    waters = [Water(), Water(law="rosellini2005")]
    throws = [Throw(), Throw()]
    both = throw_all(stones, throws, water=waters)
    for k in range(2):
        one = throw_all(stones[k], throws[:1], water=waters[k])
        np.testing.assert_array_equal(columns(both)[k], columns(one)[0])


def test_no_throws_give_no_outcomes():
    assert len(throw_all(PEBBLE, []).skips) == 0


def test_bad_arguments_are_refused_with_what_is_allowed():
    with pytest.raises(ValueError, match="rk4"):
        throw_all(PEBBLE, [Throw()], integrator="rk5")
    with pytest.raises(ValueError, match="adaptive"):
        throw_all(PEBBLE, [Throw()], air="thin")
    with pytest.raises(ValueError, match="timestep"):
        throw_all(PEBBLE, [Throw()], timestep=0.0)
    with pytest.raises(ValueError, match="2 of stone for 1 throws"):
        throw_all([PEBBLE, PEBBLE], [Throw()])


def row_of(stone, throw):
    """A stone's row for the kernels, and x, q, P, L, state and slopes as it leaves the hand."""
    table = batch._Table([stone], [Water(air_density=0)], np.array([0.0, 0.0, -GRAVITY]), False)
    y = start_of(stone, throw.state(stone))
    state, load, slopes = np.empty(18), np.empty(12), np.empty((kernels.STAGES, y.size))
    derivative(table.bodies[0], y, state, load, slopes[0])
    return table, y, state, slopes


@pytest.mark.parametrize(("attack", "wobble"), [(10, 1.5), (25, 0.8), (5, 0.0), (-15, -2.0)])
def test_a_wobbling_stone_reaches_as_far_below_its_centre_as_is_said_and_no_farther(attack, wobble):
    """The axis is on a cone about L, which is tilted itself: the rim is lowest where both add up."""
    stone = Stone.disc(0.05, 0.01, segments=360)
    throw = Throw.from_degrees(attack=attack, bank=0, spin=6, wobble=wobble)
    table, y, state, _ = row_of(stone, throw)
    said = kernels.reach_below(table.bodies[0], y, state)
    turned, seen = y.copy(), []
    for time in np.linspace(0.0, 1.0, 4001):
        kernels.free_rotation(table.bodies[0], y, state, time, turned)
        seen.append(-(stone.vertices @ matrices(turned[3:7])[2]).min())
    assert max(seen) <= said
    assert max(seen) == pytest.approx(said, rel=1e-3)  # the rim has 360 corners


def test_a_long_step_stays_above_the_floor_however_long_it_may_be():
    """Without air the error of a step is nothing: only the floor ends it."""
    throw = Throw.from_degrees(speed=5, descent=30, height=1.0)
    table, y, state, slopes = row_of(PEBBLE, throw)
    rules = np.zeros(kernels.RULES)
    rules[kernels.TIMESTEP], rules[kernels.AIR_TOLERANCE] = 1e-4, 1e-8
    work, out = np.empty((kernels.WORK, 18)), np.empty(y.size)
    work[kernels.HERE] = state
    floor = y[2] - 0.5
    length = kernels.air_step(table.bodies[0], rules, y, slopes, 2.0, floor, work, out)
    lands = (math.sqrt(2.5**2 + 2 * GRAVITY * 0.5) - 2.5) / GRAVITY
    assert 0.25 * lands < length < lands
    assert floor < out[2] < y[2]
