"""The command line as a stranger meets it: what it prints, writes and refuses."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mjskip.cli import main

ROOT = Path(__file__).parents[1]


def run(capsys, *arguments):
    """Exit code, stdout and stderr of a command."""
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


def test_the_default_throw_skips_at_least_twice(capsys):
    code, out, _ = run(capsys, "run", "--json")
    assert code == 0
    found = json.loads(out)  # and nothing else on stdout
    assert found["skips"] >= 2
    assert found["skips"] == sum(c["airtime"] >= 0.01 for c in found["contacts"])
    assert found["energy_end"] < found["energy_start"]
    assert found["sim_seconds"] == pytest.approx(found["steps"] * found["timestep"])
    assert found["real_time_factor"] == pytest.approx(found["sim_seconds"] / found["wall_seconds"])
    assert {"end", "mass", "triangles", "version"} <= found.keys()
    entry = found["contacts"][0]["entry"]
    assert entry.keys() == {"time", "position", "velocity", "attack_deg", "bank_deg", "spin_rev_s"}
    assert {"entry", "exit", "depth", "impulse", "airtime"} == found["contacts"][0].keys()


def test_the_engines_agree_on_every_skip(capsys):
    results = [
        json.loads(run(capsys, "run", "--json", "--engine", e)[1]) for e in ("mujoco", "reference")
    ]
    assert results[0]["skips"] == results[1]["skips"]
    for a, b in zip(*(r["contacts"] for r in results), strict=True):
        assert a["entry"]["time"] == pytest.approx(b["entry"]["time"], abs=1e-3)


def test_a_person_reads_a_table(capsys):
    code, out, _ = run(capsys, "run", "duel")
    assert code == 0
    assert re.search(r"spinning .*\n(.*\n)+?\d+ skips?, then", out)
    assert re.search(r"still .*0 rev/s", out)


def test_options_reach_the_throw_in_si_units(capsys):
    options = (
        "--speed",
        "3.5",
        "--spin",
        "70",
        "--attack",
        "20",
        "--descent",
        "20",
        "--height",
        "0",
    )
    _, out, _ = run(capsys, "run", "clanet_disc", "--json", *options)
    entry = json.loads(out)["contacts"][0]["entry"]
    assert entry["attack_deg"] == pytest.approx(20.0, abs=0.1)
    assert entry["spin_rev_s"] == pytest.approx(70.0, abs=0.1)
    assert entry["velocity"] == pytest.approx([3.2889, 0.0, -1.1971], abs=0.01)


def test_a_law_changes_the_throw(capsys):
    depths = {
        law: json.loads(run(capsys, "run", "--json", "--law", law)[1])["contacts"][0]["depth"]
        for law in ("lee2010", "nagahiro2005")
    }
    assert depths["nagahiro2005"] > depths["lee2010"]  # a weaker force stops the stone deeper


def test_compare_prints_agreement_and_order(capsys):
    code, out, _ = run(
        capsys, "compare", "clanet_disc", "--json", "--timestep", "4e-4", "--timestep", "2e-4",
    )  # fmt: skip
    found = json.loads(out)
    assert code == 0
    assert {row["integrator"] for row in found["rows"]} >= {"Euler", "implicitfast", "RK4", "rk4"}
    close = [row["touch_position"] for row in found["mujoco_rk4_against_pure_rk4"]]
    assert close[1] < close[0] < 1e-5
    code, out, _ = run(capsys, "compare", "clanet_disc", "--timestep", "4e-4", "--timestep", "2e-4")
    assert code == 0
    assert "Observed order" in out


def test_info_names_versions_and_renderer(capsys):
    code, out, _ = run(capsys, "info")
    assert code == 0
    for word in ("mujoco", "OpenGL", "ffmpeg", "threads", "lake"):
        assert word in out


def test_a_saved_run_loads_again(capsys, tmp_path):
    from mjskip import Trajectory

    file = tmp_path / "run.nc"
    code, out, _ = run(capsys, "run", "--json", "--save", str(file))
    assert code == 0
    assert Trajectory.load(file).skips == json.loads(out)["skips"]


BAD = {
    "nan": (("run", "--speed", "nan"), "speed is nan.*between 0 and 1000"),
    "negative": (("run", "--speed", "-3"), "speed is -3"),
    "absurd": (("run", "--spin", "1e9"), "spin is 1e.09 rev/s"),
    "no netcdf": (("run", "--save", "x.txt"), "--save is 'x.txt': NetCDF files end in .nc"),
    "word": (("run", "--speed", "fast"), "'fast' is not a valid float"),
    "tilt": (("run", "--attack", "95"), "attack is 95 degrees"),
    "tilts": (("run", "--attack", "60", "--bank", "60"), "cannot both hold"),
    "missing scene": (("run", "nosuch.xml"), "no scene 'nosuch.xml'.*lake"),
    "not xml": (("run", str(ROOT / "pyproject.toml")), "does not compile as MJCF"),
    "no body": (("run", "--body", "rock"), "no free body 'rock': it has stone"),
    "size": (("run", "--size", "640"), "WIDTHxHEIGHT"),
    "odd size": (("run", "--size", "641x480"), "even"),
    "video folder": (("run", "--video", "/nowhere/a.mp4"), "/nowhere"),
    "frames folder": (("run", "--frames", "/nowhere"), "/nowhere"),
    "save folder": (("run", "--save", "/nowhere/a.nc"), "/nowhere"),
    "integrator": (("run", "--integrator", "rk5"), "Euler, implicitfast"),
    "time step": (("run", "--timestep", "-1"), "timestep is -1"),
    "endless": (("run", "--duration", "1e9"), "at most 1e.07 are allowed"),
    "camera": (("run", "--camera", "moon", "--video", "a.mp4"), "side"),
    "camera without a picture": (
        ("run", "--camera", "side"),
        "--camera is about pictures: give --vi",
    ),
    "no trail without a picture": (("run", "--no-trail"), "--trail is about pictures"),
    "law in a sweep": (("sweep", "--vary", "law=foo"), "law is 'foo': use one of lee2010"),
    "gate in a sweep": (("sweep", "--vary", "gate=local,front"), "gate is 'front'"),
    "sweep too large": (("sweep", "--vary", "speed=1:2:100000000"), "between 1 and 1e"),
    "product too large": (
        ("sweep", "--vary", "speed=1:2:10000", "--vary", "spin=1:9:10000"),
        "has 100000000 throws",
    ),
    "picture": (("run", "--picture", "p.png"), "give --strip"),
    "waves of a law along the face": (
        ("run", "--surface", "waves", "--law", "bocquet2003"),
        "use one of lee2010",
    ),
    "deep water under a throw": (("run", "--surface", "deep"), "add_water"),
    "command": (("throw",), "No such command"),
    "ladder": (("compare", "--timestep", "3e-4", "--timestep", "2e-4"), "no multiple"),
    "never touches": (("compare", "--height", "900"), "does not touch the water"),
}


@pytest.mark.parametrize(("arguments", "says"), BAD.values(), ids=BAD.keys())
def test_bad_input_gets_one_clear_line_and_code_2(capsys, arguments, says):
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert out == ""
    (line,) = [line for line in err.splitlines() if line.startswith("mjskip: ")]
    assert re.search(says, line), line


def test_a_scene_without_cameras_runs_when_nothing_is_drawn(capsys, tmp_path):
    scene = tmp_path / "ball.xml"
    scene.write_text(
        "<mujoco><worldbody><body name='ball' pos='0 0 .3'><freejoint/>"
        "<geom size='.04' density='800'/></body></worldbody></mujoco>"
    )
    assert run(capsys, "run", str(scene))[0] == 0
    code, _, err = run(
        capsys, "run", str(scene), "--strip", "2", "--picture", str(tmp_path / "p.png")
    )
    assert code == 2
    assert "camera" in err


def test_a_coarse_time_step_is_doubted_with_both_numbers(capsys):
    code, _, err = run(capsys, "run", "--json", "--timestep", "0.002")
    assert code == 0
    assert re.search(r"warning: time step 0\.002 s is too large .* at most 0\.00\d+ s", err)


def test_help_is_quick_and_whole():
    found = subprocess.run(
        [sys.executable, "-m", "mjskip", "--help"], capture_output=True, text=True, check=True
    )
    for command in ("run", "compare", "info"):
        assert command in found.stdout
