"""Films: where the camera looks, what is drawn over, strips and duels."""

from dataclasses import replace

import imageio_ffmpeg
import mediapy
import numpy as np
import pytest
from flights import SMALL, flight, small

from mjskip.draw import render
from mjskip.draw.eye import PinholeCamera
from mjskip.draw.film import compose, duel_of, render_duel, render_strip, strip_times
from mjskip.draw.overlay import Overlay, caption, numbers_at
from mjskip.draw.render import Shot, followed, shot_times
from mjskip.throws.recording import Limits
from mjskip.throws.scene import load_scene
from mjskip.throws.simulate import simulate_all


@pytest.fixture(scope="module")
def throw():
    (one,) = simulate_all(small(), limits=Limits(duration=2.0)).values()
    return one


# Time and the camera


def test_a_film_has_the_frames_of_the_throw_and_of_the_rings_after_it():
    # 0.399 s three times slower and half a second of rings: floor((1.197 + 0.5) 20) + 1
    times = shot_times(flight(), Shot(fps=20, slow=3.0, linger=0.5))
    assert len(times) == 34
    np.testing.assert_allclose(np.diff(times), 1.0 / 60.0, rtol=1e-9)


def test_the_camera_stays_with_the_last_rings_when_a_stone_ploughs_on(throw):
    assert throw.end == "planing"
    last = throw.contacts[-1].entry
    times = np.linspace(0.0, throw.time[-1] + 1.0, 200)
    path = followed(throw, times)
    # the path is smoothed over a tenth of a second
    np.testing.assert_allclose(path[times > last.time + 0.5], [last.position] * (times > last.time + 0.5).sum(), atol=0.02)  # fmt: skip
    speed = np.diff(path[:, 0]) / np.diff(times)
    assert np.abs(np.diff(speed)).max() < 2.0  # m/s from frame to frame: no jerk
    in_flight = np.searchsorted(times, 0.5 * last.time)
    assert (
        abs(path[in_flight, 0] - np.interp(times[in_flight], throw.time, throw.position[:, 0]))
        < 0.5
    )


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"slow": 0.5}, "slow is 0.5"),
        ({"linger": -1.0}, "linger is -1.0"),
        ({"look": "oil"}, "use one of shaded, plain"),
        ({"size": (33, 20)}, "even whole numbers"),
    ],
)
def test_a_shot_that_cannot_be_taken_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Shot(**wrong)


# What is drawn over


EYE = PinholeCamera(
    position=np.array([-3.5, -1.5, 0.3]),
    forward=np.array([0.0, 1.0, 0.0]),
    up=np.array([0.0, 0.0, 1.0]),
    half_height=0.5,
    aspect=4 / 3,
)


def painted(time, **options):
    image = np.zeros((120, 160, 3), np.uint8)
    trajectory = flight()
    trajectory.position[:, 2] = 0.2
    Overlay(trajectory, marks=False, **options).draw(image, time, EYE)
    return image


def test_the_trail_is_where_the_stone_was_and_fades():
    image = painted(0.3)
    columns = np.flatnonzero(image.any(axis=(0, 2)))
    trajectory = flight()
    trajectory.position[:, 2] = 0.2
    place, _ = EYE.project(trajectory.position[[0, 300]])
    expected = 0.5 * (place[:, 0] + 1.0) * 160
    assert columns.min() == pytest.approx(expected[0], abs=6.0)  # faint at its end
    assert columns.max() == pytest.approx(expected[1], abs=2.0)
    brightness = image.sum(axis=2).max(axis=0)[columns]
    assert brightness[-3] > 2.0 * brightness[3]
    assert not painted(0.0).any()
    assert not painted(0.3, trail=False).any()


def test_touches_are_marked_from_then_on(throw):
    first = throw.contacts[0].entry
    eye = PinholeCamera(
        position=np.array([*first.position[:2], 2.0]), forward=np.array([0.0, 0.0, -1.0]),
        up=np.array([0.0, 1.0, 0.0]), half_height=0.5, aspect=1.0,
    )  # fmt: skip
    for time, seen in ((first.time - 0.01, False), (first.time + 0.01, True)):
        image = np.zeros((100, 100, 3), np.uint8)
        Overlay(throw, trail=False).draw(image, time, eye)
        assert image.any() == seen


def test_the_caption_counts_the_skips_so_far(throw):
    assert numbers_at(throw, 0.0).startswith("12.0 m/s  ·  15 rev/s  ·  0 skips")
    assert numbers_at(throw, throw.contacts[0].exit.time + 1e-3).endswith("1 skip")
    # the stone is gone: no speed is told any more
    assert numbers_at(throw, 99.0) == f"{throw.skips} skips, {throw.end}"


def test_a_caption_stays_in_its_corner():
    image = np.zeros((120, 160, 3), np.uint8)
    caption(image, "3 skips")
    rows = np.flatnonzero(image.any(axis=(1, 2)))
    assert rows.min() > 95
    assert image.max() > 200
    caption(image, "a line that is much longer than the picture is wide, and then some more")


# Pictures of several


def test_a_strip_holds_its_moments_in_even_rows(tmp_path, throw):
    path = render_strip(small(), throw, tmp_path / "strip.png", moments=6, shot=Shot(size=SMALL))
    assert mediapy.read_image(path).shape == (2 * 120 + 4, 3 * 160 + 2 * 4, 3)
    assert compose([np.zeros((4, 6, 3), np.uint8)] * 4).shape == (4, 4 * 6 + 3 * 4, 3)
    with pytest.raises(ValueError, match=r"use \.png"):
        render_strip(small(), throw, tmp_path / "strip.jpg")
    with pytest.raises(ValueError, match="from 1 to 100"):
        render_strip(small(), throw, tmp_path / "strip.png", moments=0)


def test_every_panel_of_a_strip_has_the_stone_in_it(throw):
    for camera in ("side", "top", "chase"):
        shot = Shot(
            camera=camera, size=SMALL, look="plain", trail=False, marks=False, caption=False
        )
        times = strip_times(throw, 5)
        assert times[-1] <= throw.time[-1]
        away = replace(throw, position=throw.position + np.array([0.0, 0.0, 50.0]))
        ours, theirs = (
            list(render.frames(small(), one, shot, times=times, follow=throw))
            for one in (throw, away)
        )
        for with_it, without in zip(ours, theirs, strict=True):
            assert (np.abs(with_it.astype(int) - without).max(axis=2) > 15).sum() > 5


def test_a_duel_shows_both_throws_at_the_same_moment(tmp_path):
    scene = small("duel")
    sides = duel_of(scene, simulate_all(scene, limits=Limits(duration=0.4)))
    path = render_duel(sides, tmp_path / "duel.mp4", shot=Shot(size=SMALL, fps=10, linger=0.0))
    count, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count == 5  # 0 to 0.4 s at 10 Hz, of the longer throw
    reader = imageio_ffmpeg.read_frames(str(path))
    assert next(reader)["size"] == (320, 120)
    reader.close()
    with pytest.raises(ValueError, match="two stones"):
        duel_of(small(), {"stone": flight()})


def test_memory_does_not_grow_with_the_film():
    images = render.frames(small(), flight(), Shot(size=SMALL, fps=240, slow=1000))
    first, second = next(images), next(images)  # of a hundred thousand: made as they are asked for
    images.close()
    assert first.shape == second.shape == (120, 160, 3)


@pytest.mark.parametrize("camera", ["side", "top", "chase", "underwater"])
@pytest.mark.parametrize("name", ["lake", "duel", "clanet_disc"])
def test_every_camera_shows_the_stone(name, camera):
    scene = small(name) if name != "clanet_disc" else load_scene(name)
    flights = simulate_all(scene, limits=Limits(duration=0.12))
    shot = Shot(camera=camera, size=(320, 240), caption=False, trail=False, marks=False)
    (image,) = render.frames(scene, flights, shot, times=np.array([0.1]))
    away = {key: _moved(one) for key, one in flights.items()}
    (without,) = render.frames(scene, away, shot, times=np.array([0.1]))
    assert (np.abs(image.astype(int) - without).max(axis=2) > 20).sum() > 25


def _moved(trajectory):
    """The same throw far below, so that the camera rides along and the stone is not seen."""
    below = trajectory.position - [0.0, 0.0, 900.0]
    return replace(trajectory, position=below)
