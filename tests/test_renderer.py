"""`mjskip.Renderer`: light at the water against closed forms, by pictures; and a stand-in for MuJoCo's own."""

import gc
import math
import threading
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mjskip
from mjskip.draw import renderer as module
from mjskip.draw.appearance import WaterAppearance
from mjskip.draw.gl import offscreen
from mjskip.draw.renderer import WATER_ID
from mjskip.draw.skin import Grid
from mjskip.draw.stage import Stage
from mjskip.draw.surface import patch_of
from mjskip.errors import RenderError

INDEX = 1.333
DEPTH = 0.5
CLEAR = WaterAppearance(absorption=(0.0, 0.0, 0.0), scattered=(0.0, 0.0, 0.0), wind=0.0)
WIDE, HIGH = 160, 120


def pool(*, bottom="0 0 0", sky="0 0 0", cameras="", geoms="", bodies=""):
    """Water over a level bottom, everything as bright as its colour says: no light but a sun that lights nothing."""
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <visual><headlight ambient="0 0 0" diffuse="0 0 0" specular="0 0 0"/>
        <quality offsamples="0" shadowsize="16"/><map znear=".01" zfar="50"/>
        <global offwidth="640" offheight="480"/></visual>
      <statistic extent="2" center="0 0 0"/>
      <asset><texture type="skybox" builtin="flat" rgb1="{sky}" rgb2="{sky}" width="16" height="96"/>
        <material name="bottom" rgba="{bottom} 1" emission="1" specular="0"/>
        <material name="white" rgba="1 1 1 1" emission="1" specular="0"/></asset>
      <worldbody><light type="directional" dir="0 0 -1" diffuse=".001 .001 .001" specular="0 0 0" castshadow="false"/>
        <geom type="plane" size="0 0 1" pos="0 0 {-DEPTH}" material="bottom"/>{geoms}{bodies}
        {cameras}</worldbody></mujoco>""")


def camera(name, position, pitch, fovy=40.0):
    """At (x, y, z), looking along y, up by a pitch [degrees]."""
    a = math.radians(pitch)
    place = " ".join(map(str, position))
    return f'<camera name="{name}" pos="{place}" xyaxes="1 0 0 0 {-math.sin(a)} {math.cos(a)}" fovy="{fovy}"/>'


def picture(model, name, *, linear=True, **options):
    """Colours (HIGH, WIDE, 3), 0 to 1."""
    options.setdefault("appearance", CLEAR)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjskip.Renderer(model, HIGH, WIDE, linear=linear, **options) as renderer:
        renderer.update_scene(data, name)
        return renderer.render() / 255.0


def angles(pitch, fovy=40.0):
    """Of the middle column's rays to the vertical (HIGH,) [rad], from the top row down."""
    rows = 1.0 - 2.0 * (np.arange(HIGH) + 0.5) / HIGH
    return math.pi / 2 + math.radians(pitch) + np.arctan(rows * math.tan(math.radians(0.5 * fovy)))


def fresnel(angle):
    """Share of unpolarised light that a surface mirrors, from air (angles to its normal [rad])."""
    inside = np.arcsin(np.sin(angle) / INDEX)
    s = np.sin(angle - inside) / np.sin(angle + inside)
    p = np.tan(angle - inside) / np.tan(angle + inside)
    return 0.5 * (s**2 + p**2)


# Laws of optics


@pytest.mark.parametrize("pitch", [-25.0, -45.0])
def test_a_level_pool_mirrors_the_share_that_fresnels_equations_say(pitch):
    model = pool(sky="1 1 1", cameras=camera("c", (0, 0, 1), pitch))
    seen = picture(model, "c")[:, WIDE // 2, 1]
    expected = fresnel(angles(pitch))
    # two percent, and half a step of a byte
    np.testing.assert_allclose(seen, expected, rtol=0.02, atol=0.6 / 255)


def seen_under_water(angle, height):
    """How far ahead the bottom is that is seen at an angle to the vertical (Snell) [m]."""
    return height * np.tan(angle) + DEPTH * np.tan(np.arcsin(np.sin(angle) / INDEX))


@pytest.mark.parametrize("pitch", [-50.0, -70.0])
def test_a_mark_on_the_bottom_is_seen_where_snells_law_lifts_it(pitch):
    height, ahead = 0.8, 0.8 * math.tan(math.pi / 2 + math.radians(pitch))
    ahead += DEPTH * math.tan(math.asin(math.cos(math.radians(pitch)) / INDEX))
    mark = f'<geom type="box" size="3 .03 .001" pos="0 {ahead} {-DEPTH}" material="white"/>'
    model = pool(geoms=mark, cameras=camera("c", (0, 0, height), pitch))
    column = picture(model, "c")[:, WIDE // 2, 1]
    assert column.max() > 0.5
    rows = np.sum(np.arange(HIGH) * column) / column.sum()
    angle = np.interp(rows, np.arange(HIGH), angles(pitch))
    # the place of the mark; without refraction it would be a fifth off
    assert seen_under_water(angle, height) == pytest.approx(ahead, rel=0.02)


def test_what_is_not_mirrored_is_let_through():
    model = pool(bottom="1 1 1", sky="1 1 1", cameras=camera("c", (0, 0, 1), -30.0))
    # R + T = 1 at every angle: a white room looks white; one step of a byte
    np.testing.assert_allclose(picture(model, "c"), 1.0, atol=1.01 / 255)


def test_a_tilted_plane_of_water_bends_a_ray_by_its_own_normal():
    slope, height = 0.25, 0.8
    x = np.linspace(-1.0, 1.0, 101)
    tilted = np.repeat(slope * x[None, :], 101, axis=0)  # rises along y
    mark = f'<geom type="box" size="3 .02 .001" pos="0 0 {-DEPTH}" material="white"/>'
    down = f'<camera name="c" pos="0 0 {height}" xyaxes="1 0 0 0 1 0" fovy="40"/>'
    column = picture(pool(geoms=mark, cameras=down), "c", water=tilted, spacing=0.02)[
        :, WIDE // 2, 1
    ]
    rows = np.sum(np.arange(HIGH) * column) / column.sum()
    across = (1.0 - 2.0 * (rows + 0.5) / HIGH) * math.tan(math.radians(20.0))
    # back from the mark: the ray from the eye at this angle through the plane z = slope y
    t = height / (1.0 + slope * across)
    point = np.array([across * t, height - t])
    normal = np.array([-slope, 1.0]) / math.hypot(1.0, slope)
    d = np.array([across, -1.0]) / math.hypot(1.0, across)
    cosine = -d @ normal
    k = cosine / INDEX - math.sqrt(1.0 - (1.0 - cosine**2) / INDEX**2)
    bent = d / INDEX + k * normal
    lands = point[0] + bent[0] / -bent[1] * (point[1] + DEPTH)
    # of what the tilt moves it by: depth tan(a - asin(sin(a) / n)), 3 cm
    a = math.atan(slope)
    shift = DEPTH * math.tan(a - math.asin(math.sin(a) / INDEX))
    assert abs(lands) < 0.1 * shift
    level = picture(pool(geoms=mark, cameras=down), "c")[:, WIDE // 2, 1]
    assert abs(rows - np.sum(np.arange(HIGH) * level) / level.sum()) > 2.0


def test_from_below_everything_is_mirrored_beyond_the_critical_angle():
    critical = math.degrees(math.asin(1.0 / INDEX))
    model = pool(bottom="1 1 1", cameras=camera("c", (0, 0, -0.25), 90.0 - critical, fovy=30.0))
    column = picture(model, "c")[:, WIDE // 2, 1]  # a white bottom under a black sky
    angle = math.pi - angles(90.0 - critical, 30.0)  # to the vertical, upwards
    beyond = angle > math.radians(critical + 1.0)
    within = angle < math.radians(critical - 6.0)
    assert beyond.sum() > 30
    assert within.sum() > 20
    np.testing.assert_allclose(column[beyond], 1.0, atol=2.0 / 255)
    outside = np.arcsin(INDEX * np.sin(angle[within]))
    np.testing.assert_allclose(column[within], fresnel(outside), rtol=0.02, atol=1.0 / 255)


def test_light_loses_what_beer_and_lambert_say_over_a_known_depth():
    absorption = (2.0, 1.0, 0.25)
    down = '<camera name="c" pos="0 0 1" xyaxes="1 0 0 0 1 0" fovy="10"/>'
    clear = WaterAppearance(absorption=absorption, scattered=(0.0, 0.0, 0.0), wind=0.0)
    seen = picture(pool(bottom="1 1 1", cameras=down), "c", appearance=clear)[HIGH // 2, WIDE // 2]
    through = 1.0 - ((INDEX - 1.0) / (INDEX + 1.0)) ** 2
    expected = through * np.exp(-DEPTH * np.array(absorption))
    np.testing.assert_allclose(seen, expected, rtol=0.02)


def test_deep_water_has_the_colour_that_it_scatters():
    murky = WaterAppearance(absorption=(90.0, 90.0, 90.0), scattered=(0.2, 0.4, 0.6), wind=0.0)
    down = '<camera name="c" pos="0 0 1" xyaxes="1 0 0 0 1 0" fovy="10"/>'
    seen = picture(pool(bottom="1 1 1", cameras=down), "c", appearance=murky)[HIGH // 2, WIDE // 2]
    through = 1.0 - ((INDEX - 1.0) / (INDEX + 1.0)) ** 2
    np.testing.assert_allclose(seen, through * np.array([0.2, 0.4, 0.6]), rtol=0.02)


def test_light_gathers_under_a_crest_and_spreads_under_a_trough():
    x = np.linspace(-1.0, 1.0, 201)
    waves = np.repeat(0.02 * np.cos(10.0 * x)[:, None], 201, axis=1)
    down = '<camera name="c" pos="0 0 1" xyaxes="1 0 0 0 1 0" fovy="30"/>'
    row = picture(pool(bottom=".5 .5 .5", cameras=down), "c", water=waves, spacing=0.01)[
        HIGH // 2, :, 1
    ]
    apparent = 1.0 + DEPTH / INDEX  # nearly straight down
    off = round(0.314 / apparent / math.tan(math.radians(15.0)) * HIGH / 2)
    middle, trough = row[WIDE // 2], row[WIDE // 2 + off]
    assert middle > 0.52
    assert trough < 0.46


def test_a_ball_over_the_water_is_mirrored_and_casts_its_shadow():
    ball = (
        '<body pos="0 1.5 .3"><freejoint/><geom size=".15" rgba="1 0 0 1" material="white"/></body>'
    )
    model = pool(bottom=".6 .6 .6", cameras=camera("c", (0, 0, 0.6), -15.0), bodies=ball)
    without = pool(bottom=".6 .6 .6", cameras=camera("c", (0, 0, 0.6), -15.0))
    change = picture(model, "c") - picture(without, "c")
    # as far below the plane of the water as the ball is above it: 0.9 m down at 1.5 m
    row = (
        0.5
        * HIGH
        * (1.0 - math.tan(math.radians(15.0) - math.atan2(0.9, 1.5)) / math.tan(math.radians(20.0)))
    )
    red, green, _ = change[round(row), WIDE // 2]
    assert red - green > 0.03
    # the sun is straight above: the shadow is on the bottom under the ball, lifted by refraction
    assert change[:, WIDE // 2, 1].min() < -0.05


def test_a_sunken_ball_is_seen_where_refraction_lifts_it():
    ball = f'<body pos="0 0 {-DEPTH + 0.1}"><freejoint/><geom size=".1" material="white"/></body>'
    model = pool(cameras=camera("c", (0, -0.9, 0.8), -45.0), bodies=ball)
    column = picture(model, "c")[:, WIDE // 2, 1]
    row = np.sum(np.arange(HIGH) * column) / column.sum()
    straight = 0.5 * HIGH * (
        1.0 - math.tan(math.radians(45.0) - math.atan2(0.8 + DEPTH - 0.1, 0.9)) / math.tan(math.radians(20.0))
    )  # fmt: skip
    assert column.max() > 0.5
    assert row < straight - 4.0  # rows go down: it seems to lie higher


def test_an_orthographic_camera_sees_a_pool_too():
    down = '<camera name="c" pos="0 0 1" xyaxes="1 0 0 0 1 0" projection="orthographic" fovy="1"/>'
    seen = picture(pool(bottom="1 1 1", cameras=down), "c")
    through = 1.0 - ((INDEX - 1.0) / (INDEX + 1.0)) ** 2
    np.testing.assert_allclose(seen, through, rtol=0.02)  # straight down everywhere


def test_colours_with_a_tone_curve_never_burn_out():
    model = pool(bottom="1 1 1", sky="1 1 1", cameras=camera("c", (0, 0, 1), -30.0))
    assert picture(model, "c", linear=False).max() < 0.95


# A stand-in for mujoco.Renderer


BOAT = """<mujoco><worldbody>
  <light type="directional" dir="-.6 -.6 -.5"/>
  <geom type="plane" size="0 0 1" pos="0 0 -1" rgba=".8 .7 .5 1"/>
  <body name="boat" pos="0 0 .05"><freejoint/>
    <geom type="box" size=".4 .15 .1" rgba=".7 .2 .1 1" density="500"/>
    <camera name="astern" pos="-1.6 0 .5" xyaxes="0 -1 0 .25 0 1"/></body>
  <camera name="shore" pos="0 -2 .7" xyaxes="1 0 0 0 .3 1"/></worldbody></mujoco>"""


def boat():
    model = mujoco.MjModel.from_xml_string(BOAT)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_ten_lines_of_a_users_own_draw_a_boat(tmp_path, monkeypatch):
    page = Path(__file__).parent.parent / "docs" / "drawing.md"
    (code,) = [
        part.split("```")[0]
        for part in page.read_text().split("```python\n")[1:]
        if "boat.xml" in part
    ]
    assert len(code.replace("\n\n", "\n").splitlines()) <= 10
    (tmp_path / "boat.xml").write_text(BOAT)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(page), "exec"), {})
    from PIL import Image

    seen = np.asarray(Image.open("boat.png")).astype(int)
    assert seen.shape == (480, 640, 3)
    assert ((seen[..., 0] > seen[..., 2] + 40).sum()) > 500  # the hull is red
    assert ((seen[..., 1] > seen[..., 0] + 20).sum()) > 5000  # the water is not


def test_it_takes_what_mujocos_renderer_takes_and_gives_what_it_gives():
    model, data = boat()
    with offscreen():
        theirs = mujoco.Renderer(model, 48, 64)
    with theirs, mjskip.Renderer(model, 48, 64) as ours:
        assert isinstance(ours, mujoco.Renderer)
        assert (ours.height, ours.width, ours.model) == (48, 64, model)
        for camera_given in (-1, 0, "astern", mujoco.MjvCamera()):
            for renderer in (theirs, ours):
                renderer.update_scene(data, camera_given, mujoco.MjvOption())
            assert ours.render().shape == theirs.render().shape == (48, 64, 3)
        out = np.empty((48, 64, 3), np.uint8)
        assert ours.render(out=out) is out
        floats = np.empty((48, 64, 3))
        np.testing.assert_array_equal(ours.render(out=floats), out)
        with pytest.raises(ValueError, match=r"out has shape \(3, 3\)"):
            ours.render(out=np.empty((3, 3)))
        with pytest.raises(ValueError, match="does not exist"):
            ours.update_scene(data, "bird")
    with pytest.raises(RuntimeError, match="after close"):
        ours.render()


def test_depth_is_that_of_the_nearer_of_water_and_geoms():
    model, data = boat()
    with mjskip.Renderer(model, 120, 160) as renderer:
        renderer.update_scene(data, "shore")
        renderer.enable_depth_rendering()
        depth = renderer.render()
        renderer.enable_segmentation_rendering()
        seen = renderer.render()
        renderer.disable_segmentation_rendering()
        assert renderer.render().shape == (120, 160, 3)
    camera_id = model.camera("shore").id
    axes = data.cam_xmat[camera_id].reshape(3, 3)
    half = math.tan(math.radians(22.5))
    rows, columns = np.mgrid[0:120, 0:160] + 0.5
    ray = (
        (2.0 * columns / 160 - 1.0)[..., None] * half * 4 / 3 * axes[:, 0]
        + (1.0 - 2.0 * rows / 120)[..., None] * half * axes[:, 1]
        - axes[:, 2]
    )
    water = (seen == WATER_ID).all(axis=-1)
    assert 5000 < water.sum() < 0.95 * water.size
    plane = -data.cam_xpos[camera_id][2] / ray[..., 2]
    np.testing.assert_allclose(depth[water], plane[water], rtol=1e-3)
    hull = (seen == (1, mujoco.mjtObj.mjOBJ_GEOM)).all(axis=-1)
    assert hull.sum() > 100
    assert (depth[hull] < 2.5).all()
    assert not (seen == (0, mujoco.mjtObj.mjOBJ_GEOM)).all(axis=-1).any()  # nothing of the bottom


def test_waves_reach_pictures_and_depths():
    model, data = boat()
    field = mjskip.HeightField((200, 200), 0.02, centre=(0.0, -0.5))
    with mjskip.Renderer(model, 120, 160, water=field) as renderer:
        renderer.update_scene(data, "shore")
        still = renderer.render().astype(int)
        field.displace(0.0, -0.8, height=0.05, radius=0.1)
        assert np.abs(renderer.render().astype(int) - still).max() > 25
        renderer.enable_depth_rendering()
        high = renderer.render()
        renderer.water = None
        level = renderer.render()
    drop = (level - high)[60:, 60:100]
    assert (
        0.03 < drop.max() < 0.2
    )  # a crest of 5 cm is met earlier, by up to its height over the ray's slope


@pytest.mark.parametrize(
    ("water", "options", "says"),
    [
        ("lava", {}, "water is a str: give a coupling"),
        (np.zeros(3), {"spacing": 0.1}, r"shape \(3,\)"),
        (np.zeros((4, 4)), {}, "spacing is None"),
    ],
)
def test_water_that_is_none_is_refused(water, options, says):
    with pytest.raises(ValueError, match=says):
        mjskip.Renderer(boat()[0], 48, 64, water=water, **options)


def test_any_water_of_the_package_is_drawn():
    model, data = boat()
    lake = mjskip.HeightField.endless(spacing=0.02)
    lake.press(0.3, 0.0, force=5.0, radius=0.1, density=1000.0)
    lake.advance(0.05)
    assert np.abs(patch_of(lake, focus=(0.3, 0.0)).elevation).max() > 1e-4

    class Recorded:
        def at(self, time):
            field = mjskip.HeightField((8, 8), 0.5)
            field.displace(0.0, 0.0, height=time, radius=0.5)
            return field

    assert patch_of(Recorded(), time=0.25).elevation.max() > 0.1

    with mjskip.attach(model, data, water=mjskip.Water.floating()) as coupling:
        assert np.abs(patch_of(coupling).elevation).max() == 0.0


@pytest.mark.parametrize(
    "wrong", [{"absorption": (1.0, -1.0, 0.0)}, {"scattered": (2.0, 0.0, 0.0)}, {"wind": -1.0}]
)
def test_water_that_cannot_look_so_is_refused(wrong):
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} is"):
        WaterAppearance(**wrong)


def test_a_sea_that_bodies_float_in_is_drawn_with_its_height():
    class Swell:
        surface = object()

        def grid_elevation(self, data, x, y):
            return 0.1 * np.sin(x - data)[:, None] + 0.0 * y

    patch = patch_of(Swell(), focus=(3.04, 0.0), data=0.5)
    x = patch.origin[0] + patch.spacing * np.arange(len(patch.elevation))
    inside = np.abs(x - 3.0) < 10.0
    row = patch.elevation[:, 160]
    np.testing.assert_allclose(row[inside], 0.1 * np.sin(x - 0.5)[inside], atol=1e-6)
    assert np.abs(row[[0, -1]]).max() == 0.0  # it fades: there is no step at its edge
    assert np.abs(np.diff(row)).max() < 0.012
    far = patch_of(Swell(), data=0.5, distance=40.0)
    assert far.spacing == pytest.approx(0.4)
    assert np.abs(patch_of(Swell()).elevation).max() == 0.0  # without data it is nobody's


def test_a_picture_larger_than_the_models_buffer_is_refused_with_the_remedy():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(
        ValueError, match=r'1920 x 1080 pixels.*<global offwidth="1920" offheight="1080"'
    ):
        mjskip.Renderer(model, 1080, 1920)


def test_what_is_no_model_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"^model is 'boat.xml': give what mujoco.MjModel"):
        mjskip.Renderer("boat.xml", 120, 160)


def test_moving_water_that_a_model_brings_is_drawn_without_being_named():
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><camera name="above" pos="0 0 1"/>
        <body name="ball" pos="0 0 .02"><freejoint/><geom type="sphere" size=".05"/></body></worldbody></mujoco>"""
    )
    mjskip.add_water(spec, mjskip.Water.floating(), surface="waves")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mjskip.WaterSurface(model, data).press(0.1, 0.0, impulse=0.02, radius=0.03)
    mujoco.mj_step(model, data, 100)
    level = mjskip.WaterSurface(model, data).level
    assert np.abs(level).max() > 1e-3
    with mjskip.Renderer(model, 120, 160) as renderer:
        renderer.update_scene(data, "above")
        np.testing.assert_array_equal(
            renderer._patch((0.0, 0.0)).elevation, level.astype(np.float32)
        )
        assert renderer.render().std() > 1.0
        decor = [g for g in renderer.scene.geoms[: renderer.scene.ngeom] if g.objtype == 0]
        assert len(decor) > 1000
        assert {(g.objid, g.segid, g.category) for g in decor} == {(-1, -1, 4)}
        # the plugin's own triangles are not drawn beneath the drawn water
        kinds = {int(geom.type) for geom in renderer.scene.geoms[: renderer.scene.ngeom]}
        assert int(mujoco.mjtGeom.mjGEOM_TRIANGLE) not in kinds


def test_a_translucent_geom_over_the_water_does_not_vanish():
    model = pool(
        cameras='<camera name="above" pos="0 0 1"/>',
        bodies='<body pos="0 0 .1"><freejoint/><geom size=".1" rgba="1 1 1 .4" material="white"/></body>',
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjskip.Renderer(model, HIGH, WIDE, linear=True) as renderer:
        renderer.update_scene(data, "above")
        alpha = float(renderer.scene.geoms[1].rgba[3])
        assert renderer.render()[HIGH // 2, WIDE // 2].min() > 200
        assert float(renderer.scene.geoms[1].rgba[3]) == alpha == pytest.approx(0.4)


def test_joints_move_in_films_of_what_floats():
    scene = mjskip.load_scene("quadruped_wading")
    run = mjskip.simulate(scene, limits=mjskip.Limits(duration=0.4))
    stage = Stage(
        scene,
        {scene.body: run},
        camera=scene.model.camera(0).name,
        size=(64, 48),
        grid=Grid.around(step=0.1),
    )
    stage._put_stones(0.3)
    np.testing.assert_allclose(stage.data.qpos, run.qpos[np.searchsorted(run.time, 0.3)], atol=1e-3)
    assert np.abs(stage.data.qpos[7:] - run.qpos[0, 7:]).max() > 0.05


def test_without_shaders_the_error_names_the_plain_look(monkeypatch):
    monkeypatch.setattr(module, "shaders_work", lambda: False)
    with pytest.raises(RenderError, match="look='plain'"):
        mjskip.Renderer(boat()[0], 48, 64)


def test_two_renderers_at_once_do_not_disturb_each_other():
    model, data = boat()
    shots = {}
    with mjskip.Renderer(model, 60, 80) as one, mjskip.Renderer(model, 120, 160) as other:
        for _ in range(2):
            for renderer, name in ((one, "shore"), (other, "astern")):
                renderer.update_scene(data, name)
                shots.setdefault(name, []).append(renderer.render())
    for first, second in shots.values():
        # MuJoCo's own first picture of a context is a step of a byte off, too
        assert np.abs(first.astype(int) - second).max() <= 1


def test_a_renderer_works_in_a_thread_and_beside_another_in_this_one():
    model, data = boat()
    found = {}

    def draw():
        with mjskip.Renderer(model, 60, 80) as renderer:
            renderer.update_scene(data, "shore")
            found["there"] = renderer.render()

    with mjskip.Renderer(model, 60, 80) as renderer:
        renderer.update_scene(data, "shore")
        here = renderer.render()
        thread = threading.Thread(target=draw)
        thread.start()
        thread.join()
        assert np.abs(renderer.render().astype(int) - here).max() <= 1  # of a byte, as above
    assert np.abs(found["there"].astype(int) - here).max() <= 1


def test_mujocos_own_pictures_are_as_before_beside_it():
    model, data = boat()
    with offscreen():
        theirs = mujoco.Renderer(model, 60, 80)
    with theirs:
        theirs.update_scene(data, "shore")
        before = theirs.render()
        with mjskip.Renderer(model, 60, 80) as ours:
            ours.update_scene(data, "shore")
            ours.render()
        np.testing.assert_array_equal(theirs.render(), before)


@pytest.mark.slow
def test_memory_is_flat_over_two_thousand_frames():
    model, data = boat()
    field = mjskip.HeightField((64, 64), 0.05)

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096

    out = np.empty((48, 64, 3), np.uint8)
    with mjskip.Renderer(model, 48, 64, water=field) as renderer:
        for frame in range(2001):
            renderer.update_scene(data, "shore")
            renderer.render(out=out)
            if frame == 200:
                gc.collect()
                early = resident()
    gc.collect()
    assert resident() - early < 8e6  # [B]: a leak of a picture a frame would be 16 MB
