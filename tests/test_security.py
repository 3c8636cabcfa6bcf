"""SECURITY.md says what the code does."""

import inspect
import re
from pathlib import Path

import pytest

from mjskip.cli.sweep import sweep
from mjskip.waves import field

TEXT = (Path(__file__).parents[1] / "SECURITY.md").read_text(encoding="utf-8")


def test_the_limits_of_the_playground_are_those_of_the_code():
    pytest.importorskip("viser")
    from mjskip.play import access, server

    (size,) = re.findall(r"at most (\d+) kB, then closed", TEXT)
    (rate,) = re.findall(r"at most (\d+) a second, then closed", TEXT)
    (tabs, connections) = re.findall(r"(\d+) that throw, (\d+) connections", TEXT)[0]
    assert int(size) * 1024 == access.LARGEST_FRAME
    assert int(rate) == access.MAX_MESSAGES
    assert (int(tabs), int(connections)) == (server.MAX_TABS, access.MAX_CONNECTIONS)
    assert set(re.findall(r"dropped after (\d+) s", TEXT)) == {f"{access.FIRST_MESSAGE:g}"}


def test_options_and_promises_that_it_names_exist():
    options = {name for parameter in sweep.params for name in parameter.opts}
    assert set(re.findall(r"`mjskip sweep (--\w+)", TEXT)) <= options
    assert "allow_pickle=False" in inspect.getsource(field)
