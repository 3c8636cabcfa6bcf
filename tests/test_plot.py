"""A page about throws, and the balance of energy on it."""

import sys

import numpy as np
import pytest
from click.testing import CliRunner
from flights import flight

from mjskip.cli.plot import plot
from mjskip.draw.plot import energy_budget, plot_runs, tilts
from mjskip.errors import MjskipError
from mjskip.throws.simulate import simulate
from mjskip.throws.throw import Throw


@pytest.fixture(scope="module")
def runs():
    return {"spin": simulate("lake"), "none": simulate("lake", Throw(spin=0.0))}


def test_the_energy_that_a_stone_loses_is_given_to_water_and_air(runs):
    for run in runs.values():
        total = energy_budget(run).total
        # the trapezium rule over steps of 0.5 ms, with kinks where triangles get wet: a percent
        np.testing.assert_allclose(total, total[0], rtol=0.01)


def test_the_budget_begins_with_the_energy_of_the_throw(runs):
    budget = energy_budget(runs["spin"])
    assert budget.water[0] == budget.air[0] == 0.0
    start = budget.motion[0] + budget.turning[0] + budget.potential[0]
    assert start == pytest.approx(runs["spin"].energy[0], rel=1e-12)
    assert (np.diff(budget.water) > -1e-3).all()  # the drag law takes; only buoyancy gives back


def test_attack_and_bank_agree_with_those_at_the_touches(runs):
    run = runs["spin"]
    attack, bank = tilts(run)
    for contact in run.contacts:
        # a touch is between two rows 0.5 ms apart; the stone nutates by a degree in that
        at = contact.entry.time
        assert np.interp(at, run.time, attack) == pytest.approx(contact.entry.attack, abs=0.02)
        assert np.interp(at, run.time, bank) == pytest.approx(contact.entry.bank, abs=0.02)


@pytest.mark.parametrize(
    ("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")]
)
def test_a_page_is_written_in_each_format(runs, tmp_path, suffix, magic):
    path = plot_runs(runs, tmp_path / f"throw{suffix}")
    assert path.read_bytes().startswith(magic)
    assert list(tmp_path.iterdir()) == [path]


def test_one_run_without_a_recorded_throw_is_drawn_too(tmp_path):
    assert plot_runs({"made by hand": flight()}, tmp_path / "throw.png").stat().st_size > 10_000


def test_saved_runs_are_drawn_from_the_command_line(runs, tmp_path):
    files = []
    for name, run in runs.items():
        run.save(tmp_path / f"{name}.nc")
        files.append(str(tmp_path / f"{name}.nc"))
    result = CliRunner().invoke(plot, [*files, "-o", str(tmp_path / "both.svg")])
    assert result.exit_code == 0, result.output
    text = (tmp_path / "both.svg").read_text()
    assert "given to water" in text or "path" in text


def test_what_cannot_be_plotted_is_refused(runs, tmp_path):
    with pytest.raises(ValueError, match=r"use \.png, \.svg, \.pdf"):
        plot_runs(runs, tmp_path / "throw.bmp")
    with pytest.raises(ValueError, match="at least one"):
        plot_runs({}, tmp_path / "throw.png")


def test_without_matplotlib_the_extra_is_named(runs, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MjskipError, match=r"pip install 'mjskip\[plot\]'"):
        plot_runs(runs, tmp_path / "throw.png")
