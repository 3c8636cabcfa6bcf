"""A throw is followed by either engine until it is over, and its skips are counted by airtime."""

import warnings

import numpy as np
import pytest
from conftest import rotation

from mjskip import Limits, Stone, Throw, Water, load_scene, simulate
from mjskip.errors import DivergedError, MjskipWarning, SceneError
from mjskip.rigid.attitude import difference
from mjskip.rigid.state import pack_states
from mjskip.throws.engines import MujocoEngine
from mjskip.throws.recording import Recorder
from mjskip.throws.simulate import largest_timestep, simulate_all

DURATION = 0.12


@pytest.fixture(scope="module")
def default():
    """The default throw, by MuJoCo's RK4."""
    return simulate("lake")


@pytest.fixture(scope="module")
def both():
    """The duel's first touches by the two engines at the same step."""
    scene = load_scene("duel").rethrow(height=0.02)
    limits = Limits(duration=DURATION)
    return {
        engine: simulate_all(scene, engine=engine, timestep=1e-4, limits=limits)
        for engine in ("mujoco", "reference")
    }


def test_the_default_throw_skips_at_least_twice(default):
    assert default.skips >= 2
    assert default.end in ("sunk", "planing", "at rest")


def test_both_engines_throw_every_stone_of_a_scene_alike(both):
    for name in ("spinning", "still"):
        one, two = both["mujoco"][name], both["reference"][name]
        assert one.contacts
        assert two.contacts
        np.testing.assert_allclose(one.time, two.time, atol=1e-12)
        # RK4 both: they differ by how each writes attitude, through one touch
        np.testing.assert_allclose(one.position, two.position, atol=1e-6)
        assert difference(one.q, two.q).max() < 1e-4
        np.testing.assert_allclose(one.L, two.L, atol=1e-4 * np.abs(two.L).max())
        assert one.skips == two.skips


def test_stones_start_where_the_scene_has_them(both):
    for runs in both.values():
        np.testing.assert_allclose(runs["spinning"].position[0, :2], [-4, -0.3], atol=1e-9)
        np.testing.assert_allclose(runs["still"].position[0, :2], [-4, 0.3], atol=1e-9)
        assert runs["still"].clearance[0] == pytest.approx(0.02, abs=1e-7)  # single precision mesh


def test_spin_keeps_the_attitude_and_without_it_the_nose_moves(both):
    still, spinning = both["mujoco"]["still"], both["mujoco"]["spinning"]
    assert not still.omega[0].any()
    normals = {
        name: np.array([rotation(q)[:, 2] for q in run.q[:: len(run.q) - 1]])
        for name, run in (("still", still), ("spinning", spinning))
    }
    turned = {name: float(np.arccos(np.clip(n[0] @ n[1], -1, 1))) for name, n in normals.items()}
    assert turned["spinning"] < 0.3 * turned["still"]


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit", "RK4"])
def test_every_integrator_of_mujoco_flies_the_same_throw(lake, both, integrator):
    scene = lake.rethrow(height=0.02)
    run = simulate(scene, integrator=integrator, timestep=1e-4, limits=Limits(duration=DURATION))
    assert run.attributes["integrator"] == integrator
    expected = both["reference"]["spinning"]
    shift = np.array([0.0, 0.3, 0.0])
    # first-order integrators: millimetres at 0.1 ms
    np.testing.assert_allclose(run.position[-1], expected.position[-1] + shift, atol=5e-3)


def test_the_scene_itself_is_not_altered(lake):
    before = lake.model.opt.timestep, lake.model.opt.integrator, lake.model.body_inertia.copy()
    simulate(lake, integrator="Euler", timestep=4e-4, limits=Limits(duration=0.01))
    simulate(lake, frozen_attitude=True, limits=Limits(duration=0.01))
    assert (lake.model.opt.timestep, lake.model.opt.integrator) == before[:2]
    np.testing.assert_array_equal(lake.model.body_inertia, before[2])


def test_a_stone_is_thrown_by_its_centre_of_mass_wherever_its_frame_is(tmp_path):
    path = tmp_path / "hammer.xml"
    path.write_text(
        '<mujoco><option timestep="1e-4" integrator="RK4"/><worldbody><body name="hammer">'
        '<freejoint/><geom type="box" size=".05 .03 .01" pos=".1 .02 -.03"/>'
        '<geom type="sphere" size=".02" pos=".13 .02 -.02" density="4000"/></body></worldbody></mujoco>'
    )
    throw = Throw.from_degrees(speed=6, spin=5, wobble=2, attack=20, descent=10, height=0.01)
    limits = Limits(duration=0.05)
    one, two = (simulate(path, throw, engine=e, limits=limits) for e in ("mujoco", "reference"))
    for run in (one, two):
        assert run.clearance[0] == pytest.approx(0.01, abs=1e-12)
        np.testing.assert_allclose(np.linalg.norm(run.velocity[0]), 6.0)
        np.testing.assert_allclose(run.position[0, :2], 0.0, atol=1e-12)
    assert one.contacts
    np.testing.assert_allclose(one.position, two.position, atol=1e-6)  # RK4 both, through a touch
    assert difference(one.q, two.q).max() < 1e-4


def test_a_throw_replaces_the_one_of_the_scene(lake):
    throw = Throw.from_degrees(speed=5, spin=3, attack=10, descent=2, height=0.5)
    run = simulate(lake, throw, limits=Limits(duration=0.01))
    assert np.linalg.norm(run.velocity[0]) == pytest.approx(5.0)
    assert np.linalg.norm(run.omega[0]) == pytest.approx(6 * np.pi)
    assert run.attributes["throw"]["speed"] == 5.0


def test_a_frozen_attitude_is_frozen_in_mujoco_too(clanet_scene, frozen_touch):
    throw = Throw.from_degrees(speed=3.5, spin=0, attack=20, descent=20, height=0)
    run = simulate(
        clanet_scene, throw, timestep=1e-4, frozen_attitude=True, limits=Limits(duration=0.12)
    )
    assert float(difference(run.q[0], run.q[-1])) < 1e-9
    # the scene's mesh is in single precision
    np.testing.assert_allclose(
        run.contacts[0].exit.velocity, frozen_touch.contacts[0].exit.velocity, atol=1e-4
    )


# --- touches and skips ------------------------------------------------------------------------------


def motion_of(heights, step=1e-3):
    """(times, states) of a pebble held level whose lowest point follows `heights` [m]."""
    heights = np.asarray(heights, dtype=float)
    n = len(heights)
    times = step * np.arange(n)
    x = np.column_stack([10.0 * times, np.zeros(n), heights + 0.0075])
    velocity = np.column_stack([np.full(n, 10.0), np.zeros(n), np.gradient(heights, step)])
    return times, pack_states(x, np.tile(np.eye(3), (n, 1, 1)), velocity, np.zeros((n, 3)))


def contacts_of(heights, *, min_airtime=0.010):
    times, states = motion_of(heights)
    recorder = recording(min_airtime=min_airtime, max_contact=1.0)
    assert recorder.extend(times, states) is None
    return recorder.trajectory({}).contacts


def recording(**limits):
    return Recorder("pebble", Stone.pebble(), Water(), Limits(**limits), gravity=(0, 0, -9.81))


def hops(*spans):
    """Heights of 1 mm above (positive spans) and below (negative) the surface, in rows of 1 ms."""
    return np.concatenate([np.full(abs(span), np.sign(span) * 1e-3) for span in spans])


@pytest.mark.parametrize(("air", "touches"), [(8, 1), (9, 1), (11, 2), (40, 2)])
def test_hops_shorter_than_the_least_airtime_belong_to_the_touch_around_them(air, touches):
    contacts = contacts_of(hops(20, -15, air, -15, 30))
    assert len(contacts) == touches
    assert contacts[0].entry.time == pytest.approx(0.0195)
    if touches == 2:
        # between rows: from half a row after the last wet one to half a row before the next
        assert contacts[0].airtime == pytest.approx(1e-3 * air)


def test_chatter_counts_as_one_touch():
    contacts = contacts_of(hops(20, *([-2, 2] * 100), 50))
    assert len(contacts) == 1
    assert contacts[0].exit is not None


def test_the_moment_of_touching_lies_between_rows():
    contacts = contacts_of([3e-3, 1e-3, -3e-3, -3e-3, 1e-3, 1e-3] + [1e-3] * 20)
    assert contacts[0].entry.time == pytest.approx(1.25e-3)
    assert contacts[0].exit.time == pytest.approx(3.75e-3)
    assert contacts[0].entry.position[0] == pytest.approx(0.0125)
    assert contacts[0].depth == pytest.approx(3e-3)


def test_a_stone_that_never_leaves_has_no_exit():
    contacts = contacts_of(hops(5, -50))
    assert contacts[0].exit is None
    assert contacts[0].airtime == 0.0


def test_a_stone_that_starts_wet_touches_at_once():
    contacts = contacts_of(hops(-5, 50))
    assert contacts[0].entry.time == 0.0
    assert contacts[0].airtime == pytest.approx(0.0495, abs=1e-9)


def test_a_stone_that_stays_dry_touches_nothing():
    assert contacts_of(hops(50)) == ()


# --- how it ends ------------------------------------------------------------------------------------


def end_of(heights, **limits):
    times, states = motion_of(heights)
    log = recording(**limits)
    reason = log.extend(times, states)
    return reason, log.trajectory({})


def test_a_stone_four_radii_deep_has_sunk():
    reason, run = end_of(np.linspace(0.05, -0.5, 400))
    assert reason == run.end == "sunk"
    assert run.position[-1, 2] < -4 * Stone.pebble().radius < run.position[-2, 2]


def test_a_touch_that_lasts_is_planing():
    reason, run = end_of(hops(20, -700), max_contact=0.5)
    assert reason == run.end == "planing"
    assert run.time[-1] == pytest.approx(0.52, abs=2e-3)


def test_chatter_is_planing_too():
    reason, _ = end_of(hops(20, *([-2, 2] * 200)), max_contact=0.5)
    assert reason == "planing"


def test_hops_between_touches_are_not_planing():
    reason, _ = end_of(hops(20, *([-300, 20] * 3)), max_contact=0.5)
    assert reason is None


def test_time_runs_out():
    reason, run = end_of(hops(200), duration=0.1)
    assert reason == run.end == "out of time"
    assert run.time[-1] == pytest.approx(0.1)


def test_a_stone_that_stands_still_is_at_rest():
    times, states = motion_of(np.full(500, 0.2))
    states[:, 12:15] = 0.0
    log = recording(rest_time=0.2)
    assert log.extend(times, states) == "at rest"
    states[:, 17] = 5.0  # turning in place is no rest
    log = recording(rest_time=0.2)
    assert log.extend(times, states) is None


def test_nothing_is_recorded_after_the_end():
    times, states = motion_of(hops(200))
    log = recording(duration=0.05)
    log.extend(times, states)
    log.extend(times + times[-1], states)
    assert len(log.trajectory({}).time) == 51


@pytest.mark.parametrize("engine", ["mujoco", "reference"])
@pytest.mark.parametrize(
    ("throw", "limits", "end"),
    [
        ({"descent": 80, "speed": 5, "attack": 0}, {}, "sunk"),
        ({"height": 5}, {"duration": 0.1}, "out of time"),
        ({"speed": 30, "descent": 1, "attack": 12, "spin": 60}, {"max_contact": 0.004}, "planing"),
    ],
)
def test_throws_end_for_a_reason_in_either_engine(lake, engine, throw, limits, end):
    options = {"engine": engine, "timestep": 2e-4, "limits": Limits(**limits)}
    assert simulate(lake, Throw.from_degrees(**throw), **options).end == end


# --- doubts and refusals ----------------------------------------------------------------------------


def test_a_step_too_long_for_the_throw_is_doubted_with_both_numbers(lake):
    limit = largest_timestep(lake.stone, lake.throw.speed)
    assert limit == pytest.approx(0.5 * 0.015 / lake.throw.speed, rel=1e-6)
    with pytest.warns(
        MjskipWarning,
        match=rf"time step 0\.002 s is too large for 'stone'.*use at most {limit:.2g} s",
    ):
        simulate(lake, timestep=2e-3, limits=Limits(duration=0.01))


def test_a_step_at_the_limit_is_not_doubted(lake):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(
            lake,
            timestep=largest_timestep(lake.stone, lake.throw.speed),
            limits=Limits(duration=0.01),
        )
    assert largest_timestep(lake.stone, 0.0) == np.inf


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"engine": "bullet"}, "engine is 'bullet': use one of mujoco, reference"),
        ({"integrator": "rk4"}, "integrator is 'rk4': the mujoco engine has Euler, implicitfast"),
        (
            {"engine": "reference", "integrator": "RK4"},
            "integrator is 'RK4': the reference engine has euler, midpoint, rk4, adaptive",
        ),
        ({"timestep": 0.0}, r"timestep is 0\.0"),
        ({"timestep": float("nan")}, "timestep is nan"),
    ],
)
def test_options_that_are_none_are_refused(lake, options, message):
    with pytest.raises(ValueError, match=message):
        simulate(lake, **options)


@pytest.mark.filterwarnings("ignore:body 'brick' of 0.2 kg displaces")
@pytest.mark.parametrize("engine", ["mujoco", "reference"])
def test_a_run_that_diverges_says_which_body_and_when(tmp_path, monkeypatch, engine):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "heavy.xml"
    path.write_text(
        '<mujoco><custom><numeric name="mjskip.density" data="1e308"/></custom><worldbody>'
        '<body name="brick"><freejoint/><geom type="box" size=".05 .05 .01"/></body></worldbody></mujoco>'
    )
    throw = Throw.from_degrees(speed=10, descent=20, height=0.01)
    with pytest.raises(DivergedError, match="'brick'") as it:
        simulate(path, throw, engine=engine, timestep=1e-4)
    assert it.value.body == "brick"
    assert 0.0 < it.value.time < 0.1
    assert not list(tmp_path.glob("MUJOCO_LOG.TXT"))


def test_a_stone_on_another_body_is_refused(tmp_path):
    path = tmp_path / "nested.xml"
    path.write_text(
        '<mujoco><worldbody><body name="hand"><geom size=".1"/>'
        '<body name="stone"><joint/><geom size=".05"/></body></body></worldbody></mujoco>'
    )
    with pytest.raises(SceneError, match="no free body"):
        simulate(path)


def test_provenance_says_what_was_thrown(default):
    seen = default.attributes
    assert seen["scene"].endswith("lake.xml")
    assert seen["body"] == "stone"
    assert seen["engine"] == "mujoco"
    assert seen["integrator"] == "RK4"
    assert seen["water"]["gate"] == "centre"
    assert seen["limits"]["min_airtime"] == 0.010
    assert seen["wall_seconds"] > 0.0


def test_the_same_throw_is_the_same_to_the_last_bit(lake):
    runs = [simulate(lake, limits=Limits(duration=0.3)) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].position, runs[1].position)
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_a_state_that_is_lost_is_reported_with_the_time_before_mujoco_began_anew(lake):
    with MujocoEngine(lake, None, 5e-4, frozen_attitude=False) as engine:
        engine.advance(100)
        engine.check()
        engine.data.qvel[0] = np.nan
        engine.advance(30)
        assert engine.data.time < 0.02
        with pytest.raises(DivergedError, match=r"not finite soon after t = 0\.05 s") as error:
            engine.check()
    assert error.value.time == pytest.approx(0.05)
