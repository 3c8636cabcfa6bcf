"""Long work says how far it is and how long it will take, to whoever looks and to nobody else."""

import io
import re
import subprocess
import sys
import threading

import numpy as np
import pytest
from rich.console import Console

import mjskip
from mjskip import Limits, Stone
from mjskip.cli import console
from mjskip.hydro.panels import wetted_hull
from mjskip.hydro.response import FloatingBody, coefficients


@pytest.fixture
def terminal(monkeypatch):
    """What stderr shows on a terminal."""
    shown = Console(file=io.StringIO(), force_terminal=True, width=120, highlight=False)
    monkeypatch.setattr(console, "err", shown)
    monkeypatch.setattr(console, "OFTEN", 0.0)
    return lambda: re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.file.getvalue())


def test_a_bar_shows_what_is_done_the_rate_and_the_time_left(terminal):
    with console.progress_bar("sweep", "throws") as progress:
        for done in range(0, 101, 10):
            progress(done, 100)
    text = terminal()
    assert "sweep" in text
    assert "100/100 throws" in text
    assert "/s left 0:00:0" in text


def test_a_bar_needs_no_thread(terminal, monkeypatch):
    def refused(_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    with console.progress_bar("sweep", "throws") as progress:
        progress(1, 2)
    with console.preparing():
        pass
    assert "1/2 throws" in terminal()


def test_compiling_for_the_first_time_is_said_with_the_time_left(terminal, monkeypatch):
    from mjskip._compile import cache

    with console.progress_bar("run", "steps") as progress:
        for watcher in cache.watchers:
            watcher()
        assert "compiling for the first run on this machine: 1 of about" in terminal()
        assert "s left" in terminal()
        progress(3, 9)
    assert cache.watchers == []


def test_nothing_is_shown_on_a_pipe():
    done = subprocess.run(
        [sys.executable, "-m", "mjskip", "run", "--duration", "0.1"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr == ""
    assert "\x1b" not in done.stdout


@pytest.mark.parametrize("surface", ["still", "waves"])
def test_a_run_that_tells_its_progress_is_the_same_run_to_the_last_bit(surface):
    options = {"surface": surface, "limits": Limits(duration=0.3)}
    told = []
    one = mjskip.simulate("lake", **options)
    other = mjskip.simulate("lake", **options, progress=lambda *of: told.append(of))
    for name in ("time", "position", "q", "velocity", "omega"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    done = [d for d, _ in told]
    assert done == sorted(done)
    assert 1 <= done[0] <= 200
    assert {most for _, most in told} == {600}


def test_throws_of_the_mujoco_engine_are_told_one_by_one():
    told = []
    mjskip.sweep(
        Stone.pebble(), {"attack": [0.2, 0.3, 0.4]}, engine="mujoco", limits=Limits(duration=0.02),
        progress=lambda *of: told.append(of),
    )  # fmt: skip
    assert told == [(0, 3), (0, 3), (1, 3), (2, 3), (3, 3)]


def test_frequencies_are_told_one_by_one():
    import trimesh

    box = trimesh.creation.box((0.4, 0.4, 0.4))
    hull = wetted_hull(box.triangles, height=0.0, panels=20)
    body = FloatingBody(name="box", hull=hull, mass=32.0, inertia=np.eye(3))
    told = []
    coefficients([body], [2.0, 3.0, 4.0], progress=lambda *of: told.append(of))
    assert told == [(1, 3), (2, 3), (3, 3)]
