"""What is written, and by which OpenGL."""

import os
import subprocess
import sys

import imageio_ffmpeg
import numpy as np
import pytest
from flights import SMALL, flight, small
from PIL import Image

from mjskip.draw import render, video
from mjskip.errors import MjskipError, RenderError


def test_a_video_is_h264_with_every_frame(tmp_path):
    seen = []
    path = render.render_video(
        small(),
        flight(),
        tmp_path / "throw.mp4",
        size=SMALL,
        fps=25,
        linger=0.2,
        progress=lambda done, total: seen.append((done, total)),
    )
    count, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count == 15  # 0 to 0.399 s at 25 Hz, and 5 of the rings after it
    assert seen == [(k, 15) for k in range(1, 16)]
    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    reader.close()
    assert meta["codec"] == "h264"
    assert meta["size"] == SMALL
    assert meta["pix_fmt"].startswith("yuv420p")
    assert list(tmp_path.iterdir()) == [path]


def test_frames_are_numbered_pngs(tmp_path):
    paths = render.render_frames(
        small(), flight(), tmp_path, shot=render.Shot(size=SMALL, fps=5, linger=0.0)
    )
    assert [path.name for path in paths] == ["frame_0000.png", "frame_0001.png"]
    assert sorted(tmp_path.iterdir()) == paths
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


@pytest.mark.parametrize(("suffix", "magic"), [(".webp", b"RIFF"), (".gif", b"GIF89a")])
def test_pictures_that_move_by_themselves_are_written(tmp_path, suffix, magic):
    path = tmp_path / f"throw{suffix}"
    render.render_video(small(), flight(), path, size=SMALL, fps=10, linger=0.0)
    with Image.open(path) as moving:
        assert moving.n_frames == 4
        assert moving.size == SMALL
    assert path.read_bytes().startswith(magic)


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
    with pytest.raises(
        RenderError, match=r"^\S+throw.mp4 cannot be written, the video encoder failed: .+$"
    ):
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
    with pytest.raises(ValueError, match=r"use \.mp4, \.mkv, \.mov, \.webp, \.gif"):
        render.render_video(small(), flight(), tmp_path / "throw.txt")


# OpenGL


def test_the_renderer_has_a_name():
    assert render.gl_renderer()


def test_software_renderers_are_known_by_their_names():
    assert render.is_software("llvmpipe (LLVM 19.1.7, 256 bits)")
    assert not render.is_software("NVIDIA H200/PCIe/SSE2")


def without_choice():
    """The environment, but for the user's choice of OpenGL."""
    return {key: value for key, value in os.environ.items() if key != "MUJOCO_GL"}


def test_without_an_egl_library_the_packages_are_named():
    # in a process of its own: MuJoCo picks its OpenGL once, as MUJOCO_GL says when it is imported
    code = (
        "import sys; sys.modules['mujoco.egl'] = None\n"  # as if it could not be imported
        "from mjskip.draw.render import gl_renderer\n"
        "from mjskip.errors import RenderError\n"
        "try: gl_renderer()\n"
        "except RenderError as error: sys.exit(0 if 'libegl1 libgl1-mesa-dri' in str(error) else str(error))\n"
        "sys.exit('no error')"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120, env=without_choice())


def test_importing_touches_no_opengl():
    code = (
        "import sys, mjskip.draw.render;"
        "loaded = [n for n in sys.modules if n.startswith(('OpenGL', 'mujoco.egl', 'mediapy'))];"
        "sys.exit(str(loaded) if loaded else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120, env=without_choice())
