"""MuJoCo and the pure integrator agree through a touch, and each converges at its own order."""

import math
import warnings

import numpy as np
import pytest

from mjskip import Limits, simulate
from mjskip.errors import MjskipWarning
from mjskip.throws.comparison import compare, observed_order

pytestmark = pytest.mark.filterwarnings("ignore:time step .* is too large")
"""A ladder begins with steps that are too large: they show the order."""

STEPS = (1e-3, 5e-4, 2e-4, 1e-4)


@pytest.fixture(scope="module")
def outcome(clanet_scene):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MjskipWarning)
        return compare(clanet_scene, timesteps=STEPS)


def rows_of(outcome, engine, integrator):
    return [r for r in outcome.rows if (r.engine, r.integrator) == (engine, integrator)]


def test_the_two_rk4_agree_through_the_whole_first_touch(outcome):
    """The foundation's promise: 1e-5 m and 1e-3 rad at 0.1 ms, and 1e-10 m in flight."""
    finest = outcome.agreement[-1]
    assert finest.timestep == 1e-4
    assert finest.touch_position < 1e-5
    assert finest.touch_attitude < 1e-3
    assert finest.flight_position < 1e-10
    # MuJoCo turns a stone exactly about a fixed axis, RK4 of dq/dt lags (omega h / 2)^5 / 60 a step:
    # 6e-11 at 65 rev/s, for the 180 steps of flight
    assert finest.flight_attitude < 2e-8


def test_the_difference_between_the_two_rk4_falls_with_the_step(outcome):
    position = [a.touch_position for a in outcome.agreement]
    attitude = [a.touch_attitude for a in outcome.agreement]
    assert len(position) == len(STEPS)
    assert position == sorted(position, reverse=True)
    assert attitude == sorted(attitude, reverse=True)


@pytest.mark.parametrize(("engine", "integrator"), [("mujoco", "RK4"), ("reference", "rk4")])
def test_both_rk4_are_fourth_order_in_smooth_flight(outcome, engine, integrator):
    (order,) = (o for o in outcome.orders if (o.engine, o.integrator) == (engine, integrator))
    assert order.smooth_flight >= 3.8


@pytest.mark.parametrize(
    ("engine", "integrator", "expected"),
    [
        ("mujoco", "Euler", 1),
        ("mujoco", "implicitfast", 1),
        ("reference", "euler", 1),
        ("reference", "midpoint", 2),
    ],
)
def test_the_others_have_the_order_of_their_kind(outcome, engine, integrator, expected):
    (order,) = (o for o in outcome.orders if (o.engine, o.integrator) == (engine, integrator))
    # three steps of 0.1 to 0.5 ms are not quite the limit of small steps
    assert order.smooth_flight == pytest.approx(expected, abs=0.25)


def test_kinks_leave_some_order_through_a_touch(outcome):
    """Where triangles meet the surface the force has kinks: order 4 is not to be had."""
    for order in outcome.orders:
        if order.integrator.lower() == "rk4":
            assert order.touch >= 1.0


def test_all_solvers_converge_to_the_yardstick(outcome):
    for engine, integrator in {(r.engine, r.integrator) for r in outcome.rows}:
        coarse, *_, fine = rows_of(outcome, engine, integrator)
        assert fine.touch_position < coarse.touch_position
    for engine, integrator in (("mujoco", "RK4"), ("reference", "rk4")):
        assert rows_of(outcome, engine, integrator)[-1].touch_position < 1e-5


def test_every_solver_has_a_row_for_every_step_with_its_cost(outcome):
    assert len(outcome.rows) == 6 * len(STEPS)
    assert all(0.0 < row.step_seconds < 1.0 for row in outcome.rows)
    assert 0.0 < outcome.touch_begins < outcome.touch_ends


def test_progress_is_told(clanet_scene):
    told = []
    compare(clanet_scene, timesteps=(1e-3,), progress=lambda *of: told.append(of))
    assert told == [(done, 6) for done in range(6)]


def test_an_order_is_the_slope_of_log_error_over_log_step():
    steps = (8e-3, 4e-3, 2e-3, 1e-3)
    assert observed_order(steps, [s**3 for s in steps]) == pytest.approx(3.0)
    # the coarsest saturates and is left out; so is what is below rounding
    assert observed_order(steps, [1e9, *(s**2 for s in steps[1:])]) == pytest.approx(2.0)
    assert observed_order(steps, [1e-4, 1e-5, 1e-15, 1e-15]) == pytest.approx(math.log2(10.0))
    assert observed_order(steps, [1e-4, 1e-15, 1e-15, 1e-15]) is None


def test_ladders_that_are_none_are_refused(clanet_scene):
    with pytest.raises(ValueError, match="no time steps"):
        compare(clanet_scene, timesteps=())
    with pytest.raises(ValueError, match=r"time step 0\.001 s is no multiple of the smallest"):
        compare(clanet_scene, timesteps=(1e-3, 3e-4))
    with pytest.raises(ValueError, match="timestep is -1"):
        compare(clanet_scene, timesteps=(-1,))


def test_a_throw_that_stays_dry_cannot_be_compared(clanet_scene):
    high = clanet_scene.rethrow(height=900.0)
    with pytest.raises(ValueError, match="does not touch the water within 2 s"):
        compare(high, timesteps=(1e-2,))


@pytest.mark.parametrize("engine", ["mujoco", "reference"])
def test_flight_in_vacuum_is_a_parabola_to_rounding(clanet_scene, engine):
    run = simulate(
        clanet_scene.rethrow(height=2.0), engine=engine, timestep=1e-4, limits=Limits(duration=0.3)
    )
    t = run.time[:, None]
    exact = run.position[0] + run.velocity[0] * t + 0.5 * np.array([0, 0, -9.81]) * t**2
    np.testing.assert_allclose(run.position, exact, atol=1e-11)
