"""Forces to see."""

import inspect
from dataclasses import fields

import mujoco
import numpy as np
import pytest
from flights import SMALL, small

from mjskip.draw import render
from mjskip.draw.forces import ARROW_LENGTH, BUOYANCY, WATER, add_loads, draw_loads, loads_at
from mjskip.throws.simulate import simulate_all


@pytest.fixture(scope="module")
def throw():
    (one,) = simulate_all(small()).values()
    return one


@pytest.fixture(scope="module")
def touch(throw):
    """The moment of the greatest force."""
    return float(throw.time[np.argmax(np.linalg.norm(throw.force, axis=1))])


def test_the_longest_arrow_is_that_of_the_greatest_force_and_points_along_it(throw, touch):
    loads = loads_at(throw, small().stone, touch)
    start, tip, colour = loads.arrows[0]
    assert colour == WATER
    assert np.linalg.norm(tip - start) == pytest.approx(ARROW_LENGTH, rel=1e-9)
    force = throw.force[np.argmax(np.linalg.norm(throw.force, axis=1))]
    np.testing.assert_allclose(
        (tip - start) / ARROW_LENGTH, force / np.linalg.norm(force), atol=1e-9
    )


def test_faces_are_wetted_below_the_surface_only_and_their_area_is_the_recorded_one(throw, touch):
    loads = loads_at(throw, small().stone, touch)
    assert loads.faces[..., 2].max() < 1e-9
    a, b, c = np.moveaxis(loads.faces, 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    row = np.searchsorted(throw.time, touch)
    assert area == pytest.approx(throw.wetted_area[row], rel=1e-6)
    assert loads.buoyancy[2] < 0.0
    assert loads_at(throw, small().stone, 0.0).buoyancy is None


def test_forces_show_and_are_left_out_unless_asked_for(throw, touch):
    pictures = [
        next(render.frames(small(), throw, render.Shot(size=SMALL, spray=False, caption=False, **more), times=np.array([touch]))).astype(int)
        for more in ({}, {"forces": True})
    ]  # fmt: skip
    changed = np.abs(pictures[1] - pictures[0]).max(axis=2) > 30
    assert changed.sum() > 15


def test_a_body_behind_the_camera_draws_nothing(throw, touch):
    from mjskip.draw.eye import PinholeCamera

    away = PinholeCamera(
        position=np.array([0.0, -50.0, 1.0]), forward=np.array([0.0, -1.0, 0.0]),
        up=np.array([0.0, 0.0, 1.0]), half_height=0.4, aspect=4 / 3,
    )  # fmt: skip
    image = np.zeros((60, 80, 3), np.uint8)
    draw_loads(image, loads_at(throw, small().stone, touch), away)
    assert not image.any()


def test_a_viewers_scene_gets_them_as_geoms(throw, touch):
    scene = mujoco.MjvScene(small().model, maxgeom=2)
    loads = loads_at(throw, small().stone, touch)
    add_loads(scene, loads)
    assert scene.ngeom == 2  # the arrow of the water and the centre of buoyancy; the air's is a dot
    assert scene.geoms[0].type == mujoco.mjtGeom.mjGEOM_ARROW
    np.testing.assert_allclose(scene.geoms[1].rgba[:3], np.array(BUOYANCY) / 255.0, atol=1e-6)
    add_loads(scene, loads)  # and no more than it has room for
    assert scene.ngeom == 2


def test_every_option_of_a_shot_is_one_of_render_video_and_reaches_the_film(
    throw, tmp_path, monkeypatch
):
    names = {field.name for field in fields(render.Shot)}
    assert names <= set(inspect.signature(render.render_video).parameters)
    seen = []

    def frames(scene, trajectory, shot):
        seen.append(shot)
        raise InterruptedError

    monkeypatch.setattr(render, "frames", frames)
    other = {
        "camera": "top", "size": (64, 48), "fps": 7.0, "slow": 3.0, "look": "plain", "linger": 0.0,
        "trail": False, "marks": False, "caption": False, "spray": False, "forces": True,
    }  # fmt: skip
    assert set(other) == names
    with pytest.raises(InterruptedError):
        render.render_video(small(), throw, tmp_path / "a.mp4", **other)
    assert seen == [render.Shot(**other)]
