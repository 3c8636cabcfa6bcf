"""MuJoCo's own viewer: it opens where there is a display, draws, ends by itself, and says why it cannot."""

import contextlib
import math
import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from mjskip.cli import main
from mjskip.draw.skin import Grid, add_water
from mjskip.draw.view import _Show, check_display, view
from mjskip.errors import RenderError
from mjskip.throws.engines import MujocoEngine
from mjskip.throws.scene import load_scene

PATIENCE = 120.0  # [s]: only a hang takes longer
REQUIRED = os.environ.get("MJSKIP_REQUIRE_BROWSER")


@contextlib.contextmanager
def display(folder):
    """A display that nobody sees; its picture lies in a file of the folder."""
    reader, writer = os.pipe()
    command = [
        "Xvfb",
        "-displayfd",
        str(writer),
        "-screen",
        "0",
        "640x480x24",
        "-fbdir",
        str(folder),
    ]
    with subprocess.Popen(command, pass_fds=(writer,), stderr=subprocess.DEVNULL) as server:
        os.close(writer)
        try:
            with os.fdopen(reader) as numbers:
                yield f":{numbers.readline().strip()}", folder / "Xvfb_screen0"
        finally:
            server.terminate()


def pixels(file):
    """What the display shows (height, width, 3), from its XWD file."""
    content = file.read_bytes()
    header = np.frombuffer(content[:100], ">u4").astype(int)
    size, width, height, row, colours = header[[0, 4, 5, 12, 19]]
    flat = np.frombuffer(content, np.uint8, count=row * height, offset=size + 12 * colours)
    return flat.reshape(height, row // 4, 4)[:, :width, 2::-1].copy()


@pytest.mark.skipif(
    shutil.which("Xvfb") is None and not REQUIRED, reason="no Xvfb here (Debian: apt install xvfb)"
)
@pytest.mark.parametrize("surface", ["still", "waves"])
def test_the_viewer_draws_frames_that_change_and_ends_with_0(tmp_path, surface):
    command = [
        sys.executable, "-m", "mjskip", "view", "--seconds", "6", "--slow", "5", "--surface", surface,
    ]  # fmt: skip
    with display(tmp_path) as (name, file):
        environment = os.environ | {"DISPLAY": name, "LIBGL_ALWAYS_SOFTWARE": "1"}
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            seen = []
            try:
                deadline = time.monotonic() + PATIENCE
                while process.poll() is None and time.monotonic() < deadline:
                    seen.append(pixels(file))
                    time.sleep(0.2)
                out, err = process.communicate(timeout=PATIENCE)
            finally:
                process.kill()
    assert process.returncode == 0, err
    drawn = [picture for picture in seen if len(np.unique(picture.reshape(-1, 3), axis=0)) > 500]
    changes = [np.mean(np.abs(a.astype(int) - b)) for a, b in pairwise(drawn)]
    # the stone flies over the lake under a camera that follows it: most looks differ
    assert sum(change > 0.05 for change in changes) >= 3, changes
    frames, simulated = re.search(r"(\d+) frames, ([\d.]+) s simulated", out).groups()
    assert int(frames) >= 5
    assert 0.0 < float(simulated) <= 6.0 / 5.0 + 0.1


def test_no_display_is_one_clear_line_and_code_2(monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(SystemExit) as ended:
        main(["view"])
    assert ended.value.code == 2
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("mjskip: ")]
    assert "DISPLAY is not set" in line
    assert "mjskip run --video" in line


def test_a_display_that_does_not_answer_is_an_error_and_not_a_hang(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":9876")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(RenderError, match="':9876' does not answer"):
        check_display()


BAD = {
    "slow": ({"slow": 0.5}, "slow is 0.5"),
    "seconds": ({"seconds": 0.0}, "seconds is 0.0"),
    "no time": ({"seconds": math.nan}, "seconds is nan"),
    "surface": ({"surface": "lava"}, "surface is 'lava'"),
}


@pytest.mark.parametrize(("options", "says"), BAD.values(), ids=BAD.keys())
def test_bad_options_are_refused(lake, options, says):
    with pytest.raises(ValueError, match=says):
        view(lake, **options)


@contextlib.contextmanager
def show_of(name, surface="still"):
    """What the viewer is given, without a viewer."""
    from dataclasses import replace

    import mujoco

    scene, grid = load_scene(name), Grid.around(step=0.03)
    spec = mujoco.MjSpec.from_file(str(scene.path))
    add_water(spec, grid)
    scene = replace(scene, model=spec.compile())
    timestep = float(scene.model.opt.timestep)
    with MujocoEngine(scene, None, timestep, frozen_attitude=False) as engine:
        yield _Show(scene, engine, surface, grid)


@pytest.mark.parametrize("surface", ["still", "waves"])
def test_the_stone_in_the_viewer_flies_as_in_a_run_and_the_water_moves(lake, surface):
    from mjskip import simulate

    flight = simulate(lake, surface=surface)
    touch = flight.contacts[0]
    steps = int((touch.exit.time + 0.1) / flight.attributes["timestep"])
    with show_of("lake", surface) as show:
        for _ in range(steps // 50):  # frames
            show.advance(50)
        show.draw()
        done = steps // 50 * 50
        stone = show.engine.data.body("stone").xipos
        # the same engine, steps and water: only frames of rows and single steps differ
        np.testing.assert_allclose(stone, flight.position[done], atol=1e-9)
        heights = show._bound.skinvert.reshape(-1, 3)[:, 2]
        assert np.abs(heights).max() > 1e-3
        show.throw_again()
        show.draw()
        assert np.abs(show._bound.skinvert.reshape(-1, 3)[:, 2]).max() == 0.0
        np.testing.assert_allclose(
            show.engine.data.body("stone").xipos, flight.position[0], atol=1e-9
        )


def test_the_water_of_the_viewer_gets_what_the_stone_took(lake):
    from mjskip import simulate

    flight = simulate(lake)
    touch = flight.contacts[0]
    given = []
    with show_of("lake") as show:
        field, loads = show.run.field, []
        press, advance = field.press, field.advance
        field.press = lambda x, y, **load: (loads.append(load["force"]), press(x, y, **load))

        def advanced(duration):
            given.append(sum(loads) * duration)
            loads.clear()
            return advance(duration)

        field.advance = advanced
        until = touch.exit.time + 0.05
        for _ in range(int(until / show.timestep) // 20):
            show.advance(20)
            show.draw()
    # the impulse of the touch, worked out by the run from the same forces at the same steps; the sums
    # begin a step apart
    assert sum(given) == pytest.approx(touch.impulse[2], rel=0.01)


def test_the_viewers_water_is_the_sea_that_acts_on_what_floats():
    scene = load_scene("boat_in_swell")
    grid = Grid.around(step=0.05)
    spec = mujoco.MjSpec.from_file(str(scene.path))
    add_water(spec, grid)
    scene = replace(scene, model=spec.compile())
    timestep = float(scene.model.opt.timestep)
    with MujocoEngine(scene, None, timestep, frozen_attitude=False) as engine:
        show = _Show(scene, engine, "still", grid)
        show.advance(100)
        show.draw()
        vertices = show._bound.skinvert
        away = np.linalg.norm(vertices[:, :2] - [0.0, 2.0], axis=1)
        x, y, z = vertices[np.argmin(away)]
        felt = engine.surface().elevation(engine.data, [[x, y]])[0]
    assert abs(felt) > 3e-3
    assert z == pytest.approx(felt, abs=2e-3)
