"""A robot throws: an arm in MJCF, its control signal and its release in the scene's settings."""

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from mjskip import Limits, Stone, load_scene, simulate
from mjskip.errors import SceneError
from mjskip.throws.arm import Arm
from mjskip.throws.simulate import simulate_all

MODELS = Path(__file__).parent.parent / "models"
THROWER = MODELS / "thrower.xml"


@pytest.fixture(scope="module")
def scene():
    return load_scene("thrower")


@pytest.fixture(scope="module")
def flight(scene):
    return simulate(scene)


def variant(tmp_path, *changes):
    """The scene with other text; assets where it looks for them."""
    text = THROWER.read_text().replace("assets/", f"{MODELS}/assets/")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    file = tmp_path / "thrower.xml"
    file.write_text(text)
    return file


def test_the_arm_throws_the_papers_pebble(scene):
    assert scene.held == {"stone"}
    assert len(scene.stone.faces) == 44
    # compiled meshes have single precision
    assert scene.stone.mass == pytest.approx(Stone.pebble().mass, rel=1e-6)
    assert 2 <= scene.model.nu <= 3
    assert scene.plugged["stone"] == scene.water


def test_the_thrown_stone_skips(flight):
    assert flight.skips >= 2
    throw = flight.attributes["throw"]
    assert throw["speed"] > 8.0
    assert math.degrees(throw["attack"]) == pytest.approx(20.0, abs=2.0)
    assert math.degrees(throw["descent"]) == pytest.approx(6.0, abs=1.0)
    assert throw["spin"] > 2.0 * math.pi * 10.0


def test_the_hand_holds_the_stone_until_it_lets_go(scene):
    model, data = scene.model, mujoco.MjData(scene.model)
    hand, stone = model.body("hand").id, model.body("stone").id
    release = scene.arm.release_times["grip"]
    while data.time < release - 1e-9:
        scene.arm.act(model, data)
        mujoco.mj_step(model, data)
        # the weld gives way under the stone's weight in the turn: some micrometres
        assert np.linalg.norm(data.xipos[stone] - data.xpos[hand]) < 5e-5
    assert data.eq_active[0]
    # the elbow and the shoulder make the speed, the wrist the spin
    assert np.linalg.norm(data.qvel[3:6]) > 8.0
    for _ in range(100):
        scene.arm.act(model, data)
        mujoco.mj_step(model, data)
    assert not data.eq_active[0]
    assert np.linalg.norm(data.xipos[stone] - data.xpos[hand]) > 0.05


def test_a_released_stone_falls_freely(scene, flight):
    release = scene.arm.release_times["grip"]
    first = flight.contacts[0].entry.time
    air = (flight.time > release + 1e-3) & (flight.time < first - 1e-3)
    gained = flight.P[air][-1] - flight.P[air][0]
    pull = flight.mass * np.array([0.0, 0.0, -9.81])
    pushed = np.trapezoid(pull + flight.air_force[air], flight.time[air], axis=0)
    # the trapezoidal rule at steps of 0.5 ms over forces that turn with the wobble
    np.testing.assert_allclose(gained, pushed, atol=1e-6)


def test_a_weaker_signal_throws_more_slowly(tmp_path, flight):
    slow = simulate(
        variant(tmp_path, ('data="0 0  .3 8.5  .5 0"', 'data="0 0  .3 5  .5 0"')),
        limits=Limits(duration=0.6),
    )
    assert slow.attributes["throw"]["speed"] < 0.7 * flight.attributes["throw"]["speed"]


def test_the_sensor_of_the_scene_feels_the_touch(scene):
    model, data = scene.model, mujoco.MjData(scene.model)
    wetted = []
    while data.time < 0.5:
        scene.arm.act(model, data)
        mujoco.mj_step(model, data)
        wetted.append(data.sensor("water").data[6])
    assert wetted[0] == 0.0
    assert max(wetted) > 1e-3


def test_controls_are_linear_between_their_times_and_held_outside(scene):
    arm = Arm(controls={"wrist": (0.1, 0.0, 0.2, 10.0)}, release_times={})
    data = mujoco.MjData(scene.model)
    seen = []
    for now in (0.0, 0.15, 0.9):
        data.time = now
        arm.act(scene.model, data)
        seen.append(data.actuator("wrist").ctrl[0])
    np.testing.assert_allclose(seen, [0.0, 5.0, 10.0], atol=1e-6)


@pytest.mark.parametrize("signal", [(), (1.0,), (0.0, 1.0, 2.0), (1.0, 0.0, 1.0, 2.0)])
def test_a_signal_is_pairs_in_the_order_of_time(signal):
    with pytest.raises(ValueError, match="a time and a value in turn, times increasing"):
        Arm(controls={"wrist": signal}, release_times={})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("mjskip.control.elbow", "mjskip.control.knee"), "unknown setting 'mjskip.control.knee'"),
        (("mjskip.release.grip", "mjskip.release.it"), "mjskip.release.grip"),
        (('data=".3"', 'data=".3 .4"'), "mjskip.release.grip has 2 values: give 1"),
        (("0 0  .3 80  .6 0", "0 0  .3"), "control.wrist is 0 0 0.3"),
        (('value="lee2010"', 'value="newton"'), "law is 'newton'"),
        (
            ('<numeric name="mjskip.damping" data="0.2"/>', '<numeric name="mjskip.density" data="1"/>'),
            "mjskip.density has no effect on bodies that carry plugin",
        ),
    ],
)  # fmt: skip
def test_a_wrong_setting_is_named(tmp_path, change, says):
    with pytest.raises(SceneError, match=says):
        load_scene(variant(tmp_path, change))


def test_what_an_arm_throws_takes_no_other_throw(scene):
    with pytest.raises(ValueError, match="thrown by the arm"):
        scene.rethrow(speed=3.0)
    with pytest.raises(ValueError, match="the reference engine knows no arm"):
        simulate(scene, engine="reference")


def test_a_scene_with_the_plugin_equals_one_with_settings(tmp_path):
    text = (MODELS / "lake.xml").read_text().replace("assets/", f"{MODELS}/assets/")
    plain = simulate("lake")
    for setting in ("density", "air_density"):
        text = text.replace(f'<numeric name="mjskip.{setting}"', f'<numeric name="{setting}"')
    text = text.replace('<text name="mjskip.gate"', '<text name="gate"')
    text = text.replace(
        "<custom>",
        '<extension><plugin plugin="mjskip.water"><instance name="w"/></plugin></extension><custom>',
        1,
    ).replace("<freejoint/>", '<freejoint/><plugin instance="w"/>', 1)
    file = tmp_path / "lake.xml"
    file.write_text(text)
    plugged = simulate(file)
    assert plugged.skips == plain.skips
    # rounding grows in every touch
    np.testing.assert_allclose(plugged.position[:400], plain.position[:400], atol=1e-10)


def test_the_water_of_a_plugin_is_changed_in_its_config(scene):
    with pytest.raises(ValueError, match="comes from the plugin"):
        simulate(replace(scene, water=replace(scene.water, density=500.0)))


def test_both_engines_give_each_stone_the_water_of_its_plugin(tmp_path):
    text = (MODELS / "duel.xml").read_text().replace("assets/", f"{MODELS}/assets/")
    for setting in ("density", "air_density", "gate"):
        text = text.replace(f'"mjskip.{setting}"', f'"{setting}"')
    text = text.replace(
        "<custom>",
        '<extension><plugin plugin="mjskip.water"><instance name="a"/><instance name="b">'
        '<config key="density" value="500"/></instance></plugin></extension><custom>',
        1,
    )
    for name in "ab":
        text = text.replace("<freejoint/>\n", f'<freejoint/><plugin instance="{name}"/>', 1)
    file = tmp_path / "duel.xml"
    file.write_text(text)
    runs = [
        simulate_all(load_scene(file), engine=engine, limits=Limits(duration=0.3))
        for engine in ("mujoco", "reference")
    ]
    for name, density in (("spinning", 1000.0), ("still", 500.0)):
        first, second = (run[name] for run in runs)
        assert first.attributes["water"]["density"] == density
        assert first.wetted_area.max() > 0.0
        # both are RK4 at the same step; MuJoCo turns a free joint by another rule
        np.testing.assert_allclose(first.position, second.position, atol=1e-5)
