"""A scene is MJCF with settings; every setting that is wrong is refused by name, with what is allowed."""

import math

import mujoco
import numpy as np
import pytest

from mjskip import HeightField, Stone, Throw, Water, load_scene
from mjskip.errors import MjskipWarning, SceneError
from mjskip.throws.scene import is_afloat, shipped_scenes

BODY = '<body name="stone" pos="0 0 1"><freejoint/><geom type="box" size=".05 .05 .01"/></body>'


@pytest.fixture
def scene(tmp_path):
    """Writes a scene with these settings and bodies, and returns its path."""

    def write(custom="", bodies=BODY, asset=""):
        path = tmp_path / "scene.xml"
        path.write_text(
            f"<mujoco><asset>{asset}</asset><custom>{custom}</custom>"
            f"<worldbody>{bodies}</worldbody></mujoco>"
        )
        return path

    return write


def numeric(name, *values):
    return f'<numeric name="mjskip.{name}" data="{" ".join(map(str, values))}"/>'


def text(name, value):
    return f'<text name="mjskip.{name}" data="{value}"/>'


# --- what a scene says -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["lake", "duel", "clanet_disc"])
def test_shipped_scenes_load_by_name_and_by_path(name):
    by_name = load_scene(name)
    by_path = load_scene(shipped_scenes()[name])
    assert by_name.path == by_path.path
    assert by_name.throws == by_path.throws
    assert by_name.water == by_path.water


def test_the_default_scene_is_the_lake():
    assert load_scene().path.stem == "lake"


def test_a_scene_without_settings_has_those_of_the_package(scene):
    found = load_scene(scene())
    assert found.water == Water()
    assert found.throw == Throw()
    assert found.grid == {}
    assert found.body == "stone"


def test_settings_reach_water_throw_and_field(scene):
    found = load_scene(
        scene(
            numeric("density", 1025)
            + numeric("air_density", 0.5)
            + text("gate", "local")
            + text("law", "bocquet2003")
            + numeric("speed", 7)
            + numeric("spin", 50)
            + numeric("wobble", -3)
            + numeric("shape", 60, 40)
            + numeric("spacing", 0.05)
            + numeric("centre", 1, 2)
            + text("stencil", "five_point")
            + text("boundary", "reflect")
        )
    )
    assert found.water == Water(density=1025, air_density=0.5, gate="local", law="bocquet2003")
    assert found.throw == Throw(speed=7, spin=50, wobble=-3)
    field = found.field()
    assert isinstance(field, HeightField)
    assert field.elevation.shape == (60, 40)
    assert found.grid["centre"] == (1.0, 2.0)


def test_a_body_may_have_a_throw_of_its_own(scene):
    second = BODY.replace('"stone"', '"other"').replace("0 0 1", "0 2 1")
    found = load_scene(
        scene(numeric("spin", 90) + numeric("spin.other", 5), bodies=BODY + second), body="other"
    )
    assert found.throws["stone"].spin == 90
    assert found.throws["other"].spin == 5
    assert found.throw.spin == 5


def test_a_rethrow_keeps_what_the_scene_gives_to_the_others_alone():
    duel = load_scene("duel")
    again = duel.rethrow(speed=5.0, spin=1.0)
    assert again.throws["spinning"].speed == again.throws["still"].speed == 5.0
    assert again.throws["spinning"].spin == 1.0
    assert again.throws["still"].spin == 0.0
    assert duel.throws["spinning"].speed != 5.0
    with pytest.raises(ValueError, match="speed is -1"):
        duel.rethrow(speed=-1.0)


def test_stones_of_a_scene_are_what_mujoco_made_of_them(scene):
    found = load_scene(scene())
    assert found.stone.mass == pytest.approx(0.1 * 0.1 * 0.02 * 1000)
    np.testing.assert_allclose(found.stone.disc_normal, [0, 0, 1])
    assert found.stone.disc_area == pytest.approx(0.01)


def test_the_stone_of_the_clanet_scene_is_the_disc_of_the_oracle(clanet_scene, clanet):
    assert clanet_scene.stone.mass == pytest.approx(clanet.mass, rel=1e-6)  # single precision mesh
    assert isinstance(clanet_scene.stone, Stone)
    assert clanet_scene.water.air_density == 0.0
    throw = clanet_scene.throw
    assert math.degrees(throw.attack) == pytest.approx(20, abs=0.01)
    # it touches at 3.5 m/s and 20 degrees after falling from the hand
    down = math.sqrt((throw.speed * math.sin(throw.descent)) ** 2 + 2 * 9.81 * throw.height)
    ahead = throw.speed * math.cos(throw.descent)
    assert math.hypot(down, ahead) == pytest.approx(3.5, rel=1e-4)
    assert math.degrees(math.atan2(down, ahead)) == pytest.approx(20, abs=0.01)


# --- refusals --------------------------------------------------------------------------------------

BAD_SETTINGS = [
    (
        numeric("spinn", 1),
        r"unknown setting 'mjskip.spinn'; known are mjskip\.added_mass, mjskip\.afloat, .*",
    ),
    (
        '<numeric name="mjskip_speed" data="3"/>',
        r"'mjskip_speed' would be ignored: begin it with 'mjskip\.'",
    ),
    ('<numeric name="MJSkip.speed" data="3"/>', r"'MJSkip\.speed' would be ignored"),
    (numeric("spin.nobody", 1), r"unknown setting 'mjskip.spin.nobody'.*\(bodies: stone\)"),
    (numeric("density.stone", 1), r"unknown setting 'mjskip.density.stone'"),
    (numeric("density", -1), "density is -1.0: give a finite number of at least 0"),
    (numeric("speed", -3), "speed is -3 m/s: give a number between 0 and 1000 m/s"),
    (numeric("attack", 2), "attack is 114.592 degrees: give a number between -90 and 90 degrees"),
    (numeric("height", -0.1), "height is -0.1 m"),
    (numeric("speed.stone", 1e9), r"speed is 1e\+09 m/s"),
    (numeric("speed", 1, 2), "mjskip.speed has 2 values: give 1"),
    (numeric("shape", 100), "mjskip.shape has 1 values: give 2"),
    (numeric("shape", 10.5, 20), "mjskip.shape is .*give two whole numbers"),
    (numeric("centre", 1, 2, 3), "mjskip.centre has 3 values: give 2"),
    (numeric("gate", 1), "mjskip.gate is a <numeric>: give it as a <text>"),
    (text("speed", "fast"), "mjskip.speed is a <text>: give it as a <numeric>"),
    (text("gate", "open"), "gate is 'open': use one of centre, local"),
    (text("law", "newton"), "law is 'newton': use one of lee2010, "),
    (text("stencil", "seven_point"), "stencil"),
    (text("boundary", "leak"), "boundary"),
    (numeric("spacing", 0), "spacing"),
    (numeric("damping", -1), "damping"),
    (numeric("wave_speed", -1), "wave_speed"),
    (numeric("shape", 1, 1), "shape"),
]


@pytest.mark.parametrize(("custom", "message"), BAD_SETTINGS)
def test_a_setting_that_is_wrong_is_refused_in_one_line(scene, custom, message):
    path = scene(custom)
    with pytest.raises(SceneError, match=message) as refused:
        load_scene(path)
    assert "\n" not in str(refused.value)
    assert str(path) in str(refused.value)


def test_settings_of_others_are_none_of_our_business(scene):
    load_scene(scene('<numeric name="filament.x" data="1"/><text name="mine" data="yes"/>'))


def test_a_scene_that_is_missing_is_refused_with_those_that_are_shipped(tmp_path):
    with pytest.raises(SceneError, match=r"no scene 'pond': .*boat, .*clanet_disc, .*duel, lake"):
        load_scene("pond")
    with pytest.raises(SceneError, match="is a folder: give an MJCF file"):
        load_scene(tmp_path)


@pytest.mark.parametrize(
    "content", ["not xml at all", "<mujoco><worldbody>", "<mujoco><nonsense/></mujoco>", ""]
)
def test_a_file_that_is_no_scene_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "bad.xml"
    path.write_text(content)
    with pytest.raises(SceneError, match=r"bad\.xml does not compile as MJCF: ") as refused:
        load_scene(path)
    assert "\n" not in str(refused.value)


def test_a_scene_without_a_free_body_is_refused(scene):
    with pytest.raises(SceneError, match="has no free body: give the stone a <freejoint/>"):
        load_scene(scene(bodies='<geom type="plane" size="1 1 1"/>'))


def test_a_body_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(SceneError, match="has no free body 'pebble': it has spinning, still"):
        load_scene("duel", body="pebble")


def test_an_open_mesh_is_said_when_the_scene_is_loaded_and_is_its_convex_hull(scene):
    asset = (
        '<mesh name="tent" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1" face="0 2 1 0 1 3 0 3 2"'
        ' inertia="shell"/>'
    )
    bodies = '<body name="s"><freejoint/><geom name="t" type="mesh" mesh="tent" mass="1"/></body>'
    with pytest.warns(MjskipWarning, match="geom 't' of body 's' is open"):
        loaded = load_scene(scene(bodies=bodies, asset=asset))
    assert loaded.stone.volume == pytest.approx(0.1**3 / 6.0)


@pytest.mark.parametrize("name", ["lake", "duel", "clanet_disc"])
def test_plain_mujoco_loads_and_steps_the_first_scenes(name):
    model = mujoco.MjModel.from_xml_path(str(shipped_scenes()[name]))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()


BUOYANT = """<mujoco><extension><plugin plugin="mjskip.water"><instance name="w">
  <config key="preset" value="floating"/></instance></plugin></extension>
  <custom>{}</custom>
  <worldbody><camera name="mine" pos="0 -2 1"/><body name="raft" pos="0 0 .05"><freejoint/>
  <geom type="box" size=".3 .2 .05" density="400"/><plugin instance="w"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("said", "afloat"),
    [
        ("", True),
        ('<numeric name="mjskip.afloat" data="0"/>', False),
        ('<numeric name="mjskip.speed" data="5"/>', False),
    ],
)
def test_what_water_bears_floats_unless_a_throw_is_asked_for(tmp_path, said, afloat):
    path = tmp_path / "raft.xml"
    path.write_text(BUOYANT.format(said))
    assert load_scene(path).afloat is afloat
    assert is_afloat(path) is afloat
