"""Pictures of a throw."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from flights import SMALL, flight, small

from mjskip.coupling.plugin import register_plugin
from mjskip.draw import render, stage
from mjskip.draw.skin import Grid
from mjskip.errors import MjskipWarning, SceneError
from mjskip.throws.scene import shipped_scenes
from mjskip.throws.simulate import simulate_all


def picture(
    time=0.0,
    *,
    surface=None,
    camera="side",
    trajectory=None,
    scene=None,
    flights=None,
    look="shaded",
):
    scene = scene or small()
    grid = Grid.around(step=0.02)
    flights = flights or {"stone": trajectory or flight()}
    drawn = stage.Stage(scene, flights, camera=camera, size=SMALL, grid=grid, look=look)
    drawn.open()
    try:
        return drawn.draw(time, surface or scene.field()).astype(int)
    finally:
        drawn.close()


@pytest.mark.parametrize("look", stage.LOOKS)
def test_rings_show(look):
    water = small().field()
    still = picture(surface=water, look=look)
    water.displace(-3.9, 0.1, height=0.02, radius=0.05)
    water.advance(0.1)
    # a tenth of 255, in a small picture: a ring anyone can see
    assert np.abs(picture(surface=water, look=look) - still).max() > 25


@pytest.mark.parametrize("look", stage.LOOKS)
def test_the_stone_shows(look):
    away = flight()
    away.position[:, 2] += 50.0
    seen = np.abs(picture(look=look) - picture(trajectory=away, look=look)).max(axis=2) > 30
    assert seen.sum() > 10  # pixels: at 640 x 480 sixteen times as many


@pytest.mark.parametrize("name", shipped_scenes())
def test_cameras_are_level_and_above_the_water_unless_their_name_says_otherwise(name):
    register_plugin()  # of some
    model = mujoco.MjModel.from_xml_path(str(shipped_scenes()[name]))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for k in range(model.ncam):
        right, up, _ = data.cam_xmat[k].reshape(3, 3).T
        assert abs(right[2]) < 1e-3, model.camera(k).name  # a 20th of a degree
        assert up[2] > 0.0
        assert (data.cam_xpos[k][2] > 0.1) == ("underwater" not in model.camera(k).name)


def test_a_camera_that_follows_stays_level():
    diving = flight()
    diving.position[:, 2] -= 3.0
    horizon = picture()[:20]  # the far bank does not move with the stone
    np.testing.assert_array_equal(picture(trajectory=diving)[:20], horizon)


def test_a_stone_that_nobody_throws_is_not_drawn():
    gone = flight()
    gone.position[:, 2] += 50.0
    alone = picture(scene=small("duel"), flights={"spinning": flight()}, camera="top")
    both = {"spinning": flight(), "still": gone}
    np.testing.assert_array_equal(picture(scene=small("duel"), flights=both, camera="top"), alone)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pose_between_two_rows_is_between_them(sign):
    trajectory = flight()
    trajectory.q[101] *= sign  # q and -q are the same attitude
    position, attitude = stage.pose_at(trajectory, 0.5 * sum(trajectory.time[100:102]))
    np.testing.assert_allclose(position, trajectory.position[100:102].mean(axis=0), rtol=1e-12)
    half_turn = 60.0 * 0.1005
    np.testing.assert_allclose(
        attitude, [np.cos(half_turn), 0.0, 0.0, np.sin(half_turn)], atol=1e-12
    )


def test_a_stone_is_placed_by_its_centre_of_mass(tmp_path):
    lopsided = tmp_path / "lopsided.xml"
    lopsided.write_text(
        """<mujoco><worldbody>
          <body name="stone" pos="0 0 1"><freejoint/><geom size=".1" pos=".3 0 0"/></body>
          <camera name="side" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/>
        </worldbody></mujoco>"""
    )
    spinning = flight()
    spinning.position[:] = [0.0, 0.0, 0.5]
    scene = replace(small(), path=lopsided)
    drawn = stage.Stage(
        scene, {"stone": spinning}, camera="side", size=SMALL, grid=Grid.around(step=0.02)
    )
    drawn.open()
    try:
        for time in (0.0, 0.02, 0.05):  # turned by 0, 2.4 and 6 radians
            drawn.draw(time, scene.field())
            # interpolated attitudes are normalised: rounding only
            np.testing.assert_allclose(drawn.data.xipos[1], [0.0, 0.0, 0.5], atol=1e-12)
    finally:
        drawn.close()


def test_a_pose_beyond_the_ends_is_held():
    trajectory = flight()
    np.testing.assert_array_equal(stage.pose_at(trajectory, 99.0)[0], trajectory.position[-1])
    np.testing.assert_array_equal(stage.pose_at(trajectory, -1.0)[0], trajectory.position[0])


def test_real_throws_of_two_stones_are_drawn_together():
    duel = small("duel")
    flights = simulate_all(duel)
    shot = render.Shot(camera="top", size=SMALL, fps=10, linger=0.0)
    pictures = list(render.frames(duel, flights, shot))
    assert len(pictures) == len(render.frame_times(flights, fps=10))
    assert all(one.shape == (120, 160, 3) for one in pictures)
    first, later = pictures[0].astype(int), pictures[2].astype(int)
    assert np.abs(first - later).max() > 40  # of 255: the wake of the first touch at 0.1 s


def test_without_shaders_the_plain_look_remains_with_one_line(monkeypatch):
    monkeypatch.setattr(stage, "shaders_work", lambda: False)
    with pytest.warns(MjskipWarning, match=r"GLSL 3\.30: drawn with the plain look"):
        seen = picture()
    np.testing.assert_array_equal(seen, picture(look="plain"))


def test_an_unknown_camera_lists_those_there_are():
    with pytest.raises(
        SceneError, match="no camera 'bird': use one of side, top, chase, underwater"
    ):
        picture(camera="bird")


def test_an_unknown_stone_lists_those_there_are():
    with pytest.raises(SceneError, match="no free body 'brick': it has stone"):
        picture(flights={"brick": flight()})
