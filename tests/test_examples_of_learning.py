"""Examples of learning and of gradients do what they say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def run(name, *arguments, **options):
    command = [sys.executable, str(ROOT / "examples" / name), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, **options).stdout


@pytest.mark.slow
def test_the_arm_learns_to_skip_keeps_a_checkpoint_and_goes_on_from_it(tmp_path):
    said = run("learn_to_skip.py", "--minutes", "0.3", "--folder", str(tmp_path), "--no-film")
    assert re.search(r"1 skips first in episode \d+, after \d+ s", said)
    rows = (tmp_path / "episodes.csv").read_text().splitlines()
    assert max(int(row.split(",")[3]) for row in rows[1:]) >= 2
    assert (tmp_path / "curve.png").stat().st_size > 1000
    run("learn_to_skip.py", "--minutes", "0.35", "--folder", str(tmp_path), "--resume", "--no-film")
    more = (tmp_path / "episodes.csv").read_text().splitlines()
    assert more[: len(rows)] == rows
    assert len(more) > len(rows)


@pytest.mark.slow
def test_a_recorded_fall_tells_the_mass_within_one_percent():
    said = run("identify_stone.py")
    error = float(re.search(r"mass .*: ([+-][\d.]+)%", said).group(1))
    assert abs(error) < 1.0


@pytest.mark.slow
def test_derivatives_through_a_touch_are_those_of_finite_differences():
    said = run("touch_sensitivity.py")
    assert float(re.search(r"greatest derivative: (\S+)", said).group(1)) < 1e-6
