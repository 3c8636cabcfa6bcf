"""Examples and notebooks run as they stand."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SLOW = {"learn_to_skip", "sweep_on_dask", "identify_stone", "touch_sensitivity"}
"""Those that take minutes or start a cluster."""


def scripts(folder):
    return [
        pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in SLOW else [])
        for path in sorted(folder.glob("*.py"))
        if path.stem != "learn_to_skip"
    ]


@pytest.mark.parametrize("path", scripts(EXAMPLES))
def test_an_example_runs(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize("path", scripts(EXAMPLES / "notebooks"))
def test_a_notebook_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    runpy.run_path(str(path), run_name="__main__")


def test_notebooks_are_kept_as_scripts_that_jupytext_reads():
    jupytext = pytest.importorskip("jupytext")
    for path in (EXAMPLES / "notebooks").glob("*.py"):
        cells = jupytext.read(path).cells
        assert cells[0].cell_type == "markdown"
        assert sum(cell.cell_type == "code" for cell in cells) >= 2
