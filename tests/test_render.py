"""Pictures: what the water gets back, how it is drawn, and what is written."""

import functools
import subprocess
import sys
from dataclasses import replace

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

from mjskip import _draw_kernels as kernels
from mjskip import render, video
from mjskip.errors import MjskipError, RenderError, SceneError
from mjskip.scene import load_scene
from mjskip.simulate import simulate_all
from mjskip.skin import Grid, WaterSkin, add_water
from mjskip.trajectory import Trajectory
from mjskip.wake import Wake
from mjskip.waves import HeightField

SMALL = (160, 120)


@functools.cache
def small(name="lake"):
    """A shipped scene with a field small enough for tests."""
    lake = {"shape": (120, 80), "spacing": 0.02, "boundary": "absorb", "centre": (-3.5, 0.0)}
    return replace(load_scene(name), grid=lake)


def flight(*, rows=400, timestep=1e-3, seed=0):
    """A stone that crosses the water at 2 m/s and touches it twice, with a ragged load."""
    random = np.random.default_rng(seed)
    time = np.arange(rows) * timestep
    x = np.column_stack([-4.0 + 2.0 * time, 0.05 * time, 0.1 - 0.1 * time])
    turn = 60.0 * time
    q = np.column_stack([np.cos(turn), 0.0 * turn, 0.0 * turn, np.sin(turn)])
    force = np.zeros((rows, 3))
    for first, last in ((50, 90), (230, 260)):
        force[first:last] = random.normal(5.0, 4.0, (last - first, 3))
    still = np.zeros((rows, 3))
    return Trajectory(
        time=time,
        x=x,
        q=q,
        P=still,
        L=still,
        velocity=still,
        omega=still,
        force=force,
        torque=still,
        air_force=still,
        water_load=force[:, 2],
        wetted_area=np.where(force[:, 2] != 0.0, 3e-3, 0.0),
        wetted_centre=x,
        clearance=x[:, 2],
        contacts=(),
        skips=0,
        end="out of time",
        mass=0.14,
    )


class Ledger:
    """A water that only writes down what it is given."""

    spacing = 0.02

    def __init__(self):
        self.given = 0.0
        self.time = 0.0
        self.advances = 0
        self._load = 0.0

    def press(self, x, y, *, force, radius, density):
        self._load += force

    def advance(self, duration):
        self.given += self._load * duration
        self._load = 0.0
        self.time += duration
        self.advances += 1


# What the water gets back


@pytest.mark.parametrize("seed", range(5))
def test_over_any_interval_the_water_gets_back_the_impulse_the_stone_took(seed):
    trajectory = flight(seed=seed)
    held = np.append(np.diff(trajectory.time), 0.0)
    taken = np.concatenate([[0.0], np.cumsum(trajectory.force[:, 2] * held)[:-1]])
    ledger = Ledger()
    wake = Wake(ledger, [trajectory], density=1000.0)
    for until in np.sort(np.random.default_rng(seed).uniform(0.0, 0.45, 37)):
        wake.advance(until)
        expected = np.interp(until, trajectory.time, taken)
        # sums of a thousand rounded products of order 1e-2 N s
        assert ledger.given == pytest.approx(expected, abs=1e-13)
        assert ledger.time == pytest.approx(until, abs=1e-12)


def test_the_wakes_of_two_stones_add():
    both, ledgers = Ledger(), (Ledger(), Ledger())
    flights = flight(seed=1), flight(seed=2, timestep=7e-4)
    Wake(both, flights, density=1000.0).advance(0.5)
    for ledger, one in zip(ledgers, flights, strict=True):
        Wake(ledger, [one], density=1000.0).advance(0.5)
    assert both.given == pytest.approx(sum(one.given for one in ledgers), rel=1e-12)


def test_untouched_water_advances_in_one_go():
    ledger = Ledger()
    Wake(ledger, [flight()], density=1000.0).advance(0.04)
    assert ledger.advances == 1
    assert ledger.given == 0.0


def test_a_wake_makes_no_water():
    field = HeightField((160, 100), 0.02, centre=(-3.5, 0.0))
    Wake(field, [flight()], density=1000.0).advance(0.4)
    assert np.abs(field.elevation).max() > 1e-4  # there is a wake
    # single precision: 16000 cells of 4e-4 m^2, each off by about 1e-9 m in 40 steps
    assert abs(field.volume()) < 1e-7


# How the water is drawn


def boxes(axis):
    return np.column_stack([axis[:-1], axis[1:]])


def means(elevation, spacing, x_boxes, y_boxes, *, function=kernels.box_means):
    ny = elevation.shape[1]
    out = [np.empty((len(x_boxes), len(y_boxes))) for _ in range(3)]
    function(elevation, spacing, x_boxes, y_boxes, np.empty(ny), np.empty(ny), *out)
    return out


def rough(shape=(40, 30)):
    return np.random.default_rng(1).normal(0.0, 1.0, shape).astype(np.float32)


def test_boxes_that_tile_the_field_hold_its_volume():
    elevation = rough()
    x, y = np.array([-3.0, 2.7, 11.0, 11.5, 44.0]), np.array([-1.0, 8.25, 30.5])
    height, _, _ = means(elevation, 0.1, boxes(x), boxes(y))
    volume = (height * np.outer(np.diff(x), np.diff(y))).sum()
    assert volume == pytest.approx(elevation.sum(dtype=np.float64), rel=1e-12)


def test_a_tilted_plane_is_drawn_with_its_own_slope():
    x, y = np.arange(40) * 0.1, np.arange(30) * 0.1
    elevation = (0.3 * x[:, None] - 0.2 * y[None, :]).astype(np.float32)
    edges = np.array([3.0, 4.5, 9.0, 20.0])
    _, x_slope, y_slope = means(elevation, 0.1, boxes(edges), boxes(edges))
    # single-precision heights of order 1 over 0.2 m
    np.testing.assert_allclose(x_slope, 0.3, atol=2e-6)
    np.testing.assert_allclose(y_slope, -0.2, atol=2e-6)


def test_waves_finer_than_the_drawn_mesh_fade():
    chequered = np.where(np.indices((64, 64)).sum(axis=0) % 2, 1.0, -1.0).astype(np.float32)
    edges = np.arange(4.0, 60.0, 7.5)
    height, x_slope, y_slope = means(chequered, 1.0, boxes(edges), boxes(edges))
    # at most half a cell of each row and column is left over: (0.5 / 7.5)^2
    assert np.abs(height).max() <= 0.25 / 7.5**2 + 1e-12
    assert max(np.abs(x_slope).max(), np.abs(y_slope).max()) < 0.1


def test_outside_the_field_the_water_is_still():
    outside = np.array([[-9.0, -2.0], [40.0, 41.0], [70.0, 90.0]])
    for values in means(rough(), 0.1, outside, np.array([[3.0, 5.0]])):
        assert (values == 0.0).all()


def test_the_kernel_agrees_with_its_slow_twin():
    edges = boxes(np.array([-4.0, 0.3, 2.2, 7.9, 25.0, 33.0, 48.0]))
    fast = means(rough(), 0.1, edges, edges)
    slow = means(rough(), 0.1, edges, edges, function=kernels.box_means.py_func)
    for one, other in zip(fast, slow, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_normals_are_upright_on_still_water_and_lean_downhill():
    shape = (2, 1)
    slope = np.array([[0.0], [0.5]])
    vertices, normals = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    kernels.fill_skin(
        np.array([0.0, 1.0]),
        np.zeros(1),
        np.zeros(shape),
        slope,
        np.zeros(shape),
        vertices,
        normals,
    )
    np.testing.assert_array_equal(normals[0], [0.0, 0.0, 1.0])
    # single precision
    np.testing.assert_allclose(normals[1], np.array([-0.5, 0.0, 1.0]) / np.sqrt(1.25), rtol=1e-6)


def test_the_grid_is_even_near_the_stone_and_reaches_the_horizon():
    grid = Grid.around(step=0.02)
    steps = np.diff(grid.x)
    middle = len(steps) // 2
    np.testing.assert_allclose(steps[middle - 10 : middle + 10], 0.02, rtol=1e-9)
    assert (steps > 0.0).all()
    assert steps[middle:] == pytest.approx(np.sort(steps[middle:]), rel=1e-9)
    assert grid.x[-1] == -grid.x[0] > 200.0
    assert len(grid.x) * len(grid.y) <= 125 * 125


@pytest.mark.parametrize("shape", [(124, 125), (11, 125), (401, 41)])
def test_a_grid_that_cannot_be_drawn_is_refused(shape):
    with pytest.raises(ValueError, match="two odd numbers"):
        Grid.around(step=0.02, shape=shape)


def test_vertices_near_the_stone_stay_in_their_places_as_the_grid_follows():
    grid = Grid.around(step=0.02)
    spec = mujoco.MjSpec()
    add_water(spec, grid)
    model = spec.compile()
    scene = mujoco.MjvScene(model, maxgeom=10)
    scene.skinvert[:] = 0.0
    skin = WaterSkin(model, grid)
    water = HeightField((50, 50), 0.02)
    places = []
    for focus in ((0.1, 0.0), (0.153, -0.031)):
        mujoco.mjv_updateScene(
            model,
            mujoco.MjData(model),
            mujoco.MjvOption(),
            mujoco.MjvPerturb(),
            mujoco.MjvCamera(),
            mujoco.mjtCatBit.mjCAT_ALL,
            scene,
        )
        skin.draw(scene, water, focus=focus)
        x = scene.skinvert.reshape(-1, 3)[:, 0]
        places.append(np.unique(np.round(x[np.abs(x - focus[0]) < 0.1], 5)))
    common = np.intersect1d(*places)
    assert len(common) >= 6  # vertices 0.02 m apart, in the 0.147 m that both show
    # single-precision coordinates
    np.testing.assert_allclose(common / 0.02, np.round(common / 0.02), atol=1e-3)


def test_a_bump_is_drawn_where_it_is():
    grid = Grid.around(step=0.02)
    spec = mujoco.MjSpec()
    add_water(spec, grid)
    model = spec.compile()
    scene = mujoco.MjvScene(model, maxgeom=10)
    mujoco.mjv_updateScene(
        model,
        mujoco.MjData(model),
        mujoco.MjvOption(),
        mujoco.MjvPerturb(),
        mujoco.MjvCamera(),
        mujoco.mjtCatBit.mjCAT_ALL,
        scene,
    )
    water = HeightField((80, 60), 0.02, centre=(2.0, -1.0))
    water.displace(2.2, -1.3, height=0.05, radius=0.06)
    WaterSkin(model, grid).draw(scene, water, focus=(2.1, -1.2))
    vertices = scene.skinvert.reshape(-1, 3)
    raised = vertices[vertices[:, 2] > 0.6 * vertices[:, 2].max()]
    # half a drawn step
    np.testing.assert_allclose(raised[:, :2].mean(axis=0), [2.2, -1.3], atol=0.01)
    assert 0.03 < vertices[:, 2].max() < 0.05  # averaging over a vertex's box lowers a crest


# The picture


def picture(time=0.0, *, surface=None, camera="side", trajectory=None, scene=None, flights=None):
    scene = scene or small()
    grid = Grid.around(step=0.02)
    flights = flights or {"stone": trajectory or flight()}
    stage = render.Stage(scene, flights, camera=camera, size=SMALL, grid=grid)
    stage.open()
    try:
        return stage.draw(time, surface or scene.field()).astype(int)
    finally:
        stage.close()


def test_rings_show():
    water = small().field()
    still = picture(surface=water)
    water.displace(-3.9, 0.1, height=0.02, radius=0.05)
    water.advance(0.1)
    assert np.abs(picture(surface=water) - still).max() > 40  # of 255: a ring anyone can see


def test_the_stone_shows():
    away = flight()
    away.x[:, 2] += 50.0
    assert (np.abs(picture() - picture(trajectory=away)).max(axis=2) > 30).sum() > 15


def test_a_camera_that_follows_stays_level():
    diving = flight()
    diving.x[:, 2] -= 3.0
    horizon = picture()[:20]  # the far bank does not move with the stone
    np.testing.assert_array_equal(picture(trajectory=diving)[:20], horizon)


def test_a_stone_that_nobody_throws_is_not_drawn():
    gone = flight()
    gone.x[:, 2] += 50.0
    alone = picture(scene=small("duel"), flights={"spinning": flight()}, camera="top")
    both = {"spinning": flight(), "still": gone}
    np.testing.assert_array_equal(picture(scene=small("duel"), flights=both, camera="top"), alone)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pose_between_two_rows_is_between_them(sign):
    trajectory = flight()
    trajectory.q[101] *= sign  # q and -q are the same attitude
    position, attitude = render.pose_at(trajectory, 0.5 * sum(trajectory.time[100:102]))
    np.testing.assert_allclose(position, trajectory.x[100:102].mean(axis=0), rtol=1e-12)
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
    spinning.x[:] = [0.0, 0.0, 0.5]
    scene = replace(small(), path=lopsided)
    stage = render.Stage(
        scene, {"stone": spinning}, camera="side", size=SMALL, grid=Grid.around(step=0.02)
    )
    stage.open()
    try:
        for time in (0.0, 0.02, 0.05):  # turned by 0, 2.4 and 6 radians
            stage.draw(time, scene.field())
            # interpolated attitudes are normalised: rounding only
            np.testing.assert_allclose(stage.data.xipos[1], [0.0, 0.0, 0.5], atol=1e-12)
    finally:
        stage.close()


def test_a_pose_beyond_the_ends_is_held():
    trajectory = flight()
    np.testing.assert_array_equal(render.pose_at(trajectory, 99.0)[0], trajectory.x[-1])
    np.testing.assert_array_equal(render.pose_at(trajectory, -1.0)[0], trajectory.x[0])


def test_real_throws_of_two_stones_are_drawn_together():
    duel = small("duel")
    flights = simulate_all(duel)
    pictures = list(render.frames(duel, flights, camera="top", size=SMALL, fps=10))
    assert len(pictures) == len(render.frame_times(flights, fps=10))
    assert all(one.shape == (120, 160, 3) for one in pictures)
    first, later = pictures[0].astype(int), pictures[2].astype(int)
    assert np.abs(first - later).max() > 40  # of 255: the wake of the first touch at 0.1 s


def test_an_unknown_camera_lists_those_there_are():
    with pytest.raises(SceneError, match="no camera 'bird': use one of side, top, chase"):
        picture(camera="bird")


def test_an_unknown_stone_lists_those_there_are():
    with pytest.raises(SceneError, match="no free body 'brick': it has stone"):
        picture(flights={"brick": flight()})


# What is written


def test_a_video_is_h264_with_every_frame(tmp_path):
    seen = []
    path = render.render_video(
        small(),
        flight(),
        tmp_path / "throw.mp4",
        size=SMALL,
        fps=25,
        progress=lambda done, total: seen.append((done, total)),
    )
    count, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count == 10  # 0 to 0.399 s at 25 Hz
    assert seen == [(k, 10) for k in range(1, 11)]
    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    reader.close()
    assert meta["codec"] == "h264"
    assert meta["size"] == SMALL
    assert meta["pix_fmt"].startswith("yuv420p")
    assert list(tmp_path.iterdir()) == [path]


def test_frames_are_numbered_pngs(tmp_path):
    paths = render.render_frames(small(), flight(), tmp_path, size=SMALL, fps=5)
    assert [path.name for path in paths] == ["frame_0000.png", "frame_0001.png"]
    assert sorted(tmp_path.iterdir()) == paths
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


@pytest.mark.parametrize("cause", [KeyboardInterrupt, ValueError])
def test_an_interrupted_video_leaves_nothing_and_spares_the_old_one(tmp_path, cause):
    old = tmp_path / "throw.mp4"
    old.write_bytes(b"old")

    def interrupt(done, total):
        if done == 3:
            raise cause("stop")

    with pytest.raises(cause, match="stop"):
        render.render_video(small(), flight(), old, size=SMALL, progress=interrupt)
    assert list(tmp_path.iterdir()) == [old]
    assert old.read_bytes() == b"old"


def test_an_encoder_that_fails_is_reported_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(video, "ffmpeg", lambda: "/bin/false")
    with pytest.raises(RenderError, match=r"^the video encoder failed: .+$"):
        render.render_video(small(), flight(), tmp_path / "throw.mp4", size=SMALL)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("size", [(641, 480), (640, 481), (0, 0), (-2, 64), (100000, 64)])
def test_sizes_that_cannot_be_encoded_are_refused(size, tmp_path):
    with pytest.raises(ValueError, match="even whole numbers from 16 to 4096"):
        render.render_video(small(), flight(), tmp_path / "throw.mp4", size=size)


def test_slow_motion_takes_more_pictures_of_the_same_time():
    slow = render.frame_times(flight(), fps=30, slow=4)
    np.testing.assert_allclose(slow[::4], render.frame_times(flight(), fps=30), rtol=1e-12)
    with pytest.raises(ValueError, match="from 1 to 1000"):
        render.frame_times(flight(), slow=0.0)


@pytest.mark.parametrize("fps", [0.0, -30.0, float("nan"), float("inf"), 1e6])
def test_rates_nobody_can_watch_are_refused(fps, tmp_path):
    with pytest.raises(ValueError, match="frames per second from 1 to 240"):
        render.render_video(small(), flight(), tmp_path / "throw.mp4", fps=fps)


def test_a_folder_that_does_not_exist_is_named(tmp_path):
    with pytest.raises((ValueError, MjskipError), match="nowhere"):
        render.render_video(small(), flight(), tmp_path / "nowhere" / "throw.mp4")
    with pytest.raises((ValueError, MjskipError), match="nowhere"):
        render.render_frames(small(), flight(), tmp_path / "nowhere")


def test_an_unknown_kind_of_video_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"use \.mp4, \.mkv, \.mov"):
        render.render_video(small(), flight(), tmp_path / "throw.txt")


# OpenGL


def test_the_renderer_has_a_name():
    assert render.gl_renderer()


def test_software_renderers_are_known_by_their_names():
    assert render.is_software("llvmpipe (LLVM 19.1.7, 256 bits)")
    assert not render.is_software("NVIDIA H200/PCIe/SSE2")


def test_without_an_egl_library_the_packages_are_named(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setitem(sys.modules, "mujoco.egl", None)  # as if it could not be imported
    with pytest.raises(RenderError, match="libegl1 libgl1-mesa-dri"):
        render.gl_renderer()


def test_importing_touches_no_opengl():
    code = (
        "import sys, mjskip.render;"
        "loaded = [n for n in sys.modules if n.startswith(('OpenGL', 'mujoco.egl', 'mediapy'))];"
        "sys.exit(str(loaded) if loaded else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
