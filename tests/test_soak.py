"""A minute of what the long scripts do for long: threads do not mix, strangers do not disturb, memory does not grow."""

import contextlib
import importlib.util
import logging
import sys
import warnings
from pathlib import Path

import pytest

from mjskip import load_scene

SCRIPTS = Path(__file__).parents[1] / "scripts"


def script(name):
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_threads_with_moving_water_plugin_and_batch_find_what_each_finds_alone():
    found = script("soak_threads").soak(4.0)
    assert found["wrong"] == []
    assert sum(found["rounds"].values()) >= 4


@pytest.fixture
def soak(monkeypatch):
    """The script of the playground, with strangers dropped soon."""
    pytest.importorskip("viser")
    module = script("soak_play")
    monkeypatch.setattr(module.access, "FIRST_MESSAGE", 1.0)
    monkeypatch.setattr(logging.getLogger("websockets.server"), "level", logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is on its way to a page that has gone is lost
        yield module


def test_pages_that_throw_again_and_again_leave_nothing_behind(soak):
    with (
        soak.watched() as errors,
        contextlib.closing(soak.Playground(load_scene("lake"), port=0)) as play,
    ):
        found = soak.throw_on(play, 12.0, 3)
    assert found["all_tabs_gone"]
    assert found["throws"] >= 6
    assert found["frames"] > 10
    assert found["growth"] < 0.25  # of seconds; the script's minutes say less
    assert errors == []


def test_a_page_plays_on_among_hostile_connections(soak):
    with (
        soak.watched() as errors,
        contextlib.closing(soak.Playground(load_scene("lake"), port=0)) as play,
    ):
        found = soak.attack(play, 2 * len(soak.HOSTILE), peace=3.0)
    assert found["serious"] == []
    assert found["plays_on"]
    assert found["others_gone"]
    assert found["all_tabs_gone"]
    assert found["frames_a_second_meanwhile"] > 1.0
    assert errors == []
    assert not any("other_origin: ended" in name for name in found["outcomes"])
