"""Sweeps: what is varied, failed throws as rows, and a store that goes on where it stopped."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner

import mjskip.sweeps.store as store_module
import mjskip.sweeps.sweep as sweep_module
from mjskip import Limits, Stone, Throw, Water, integrate, simulate
from mjskip.cli import cli, main
from mjskip.errors import DivergedError, MjskipError, MjskipWarning
from mjskip.sweeps.design import Design, latin_hypercube, normal, span
from mjskip.sweeps.job import RESULTS, WORDS, scaled
from mjskip.sweeps.plot import plot_sweep
from mjskip.sweeps.store import open_sweep
from mjskip.sweeps.sweep import chunk_shape, sweep
from mjskip.throws.scene import load_scene

PEBBLE = Stone.pebble()
SHORT = Limits(duration=0.4)
GRID = {
    "vary": {"attack": span(0.2, 0.5, 4), "spin": [0.0, 60.0, 120.0]},
    "scatter": normal({"speed": (0.0, 0.3)}, count=2, seed=4),
    "throw": Throw(height=0.05),
    "limits": SHORT,
}


def contents(store):
    """Every file of a store, by name."""
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in sorted(store.rglob("*"))
        if path.is_file()
    }


def test_a_point_of_a_sweep_is_the_throw_alone():
    found = sweep(PEBBLE, **GRID, air="fixed", timestep=5e-4)
    assert dict(found.sizes) == {"attack": 4, "spin": 3, "member": 2}
    place = {"attack": 2, "spin": 1, "member": 1}
    throw = Throw(
        attack=float(found.attack[2]),
        spin=60.0,
        speed=12.0 + float(found.speed_scatter[1]),
        height=0.05,
    )
    alone = integrate(PEBBLE, throw, limits=SHORT, timestep=5e-4)
    here = found.isel(place)
    assert here.skips == alone.skips
    assert here.end == alone.end
    assert here.status == "ok"
    assert here.distance == alone.position[-1, 0] - alone.position[0, 0]
    assert here.exit_speed == alone.contacts[0].exit.speed


def test_the_engines_agree_over_a_sweep():
    """RK4 both: they differ in how a step is laid through the touch, and by single precision meshes."""
    options = GRID | {"vary": {"attack": [0.3, 0.4]}, "timestep": 1e-4}
    ours, theirs = (sweep(PEBBLE, engine=e, **options) for e in ("reference", "mujoco"))
    np.testing.assert_array_equal(ours.skips, theirs.skips)
    # the height of release is that of the single precision mesh: some 1e-9 m; the rest is 1e-4 s steps
    np.testing.assert_allclose(ours.exit_speed, theirs.exit_speed, atol=1e-3)
    np.testing.assert_allclose(ours.first_entry, theirs.first_entry, atol=1e-6)


def test_mujoco_sweeps_a_scene_with_its_own_throw_and_water():
    found = sweep("lake", {"attack": [0.3, 0.4]}, engine="mujoco", limits=SHORT)
    scene = load_scene("lake").rethrow(attack=0.4)
    alone = simulate(scene, limits=SHORT)
    assert found.distance[1] == alone.position[-1, 0] - alone.position[0, 0]


def test_waters_and_laws_are_dimensions():
    found = sweep(PEBBLE, {"law": ["lee2010", "rosellini2005"], "water_density": [800.0, 1000.0]})
    direct = integrate(
        PEBBLE, Throw(), water=Water(density=800.0, law="rosellini2005"), timestep=5e-4
    )
    assert found.sel(law="rosellini2005", water_density=800.0).skips == direct.skips


def test_switches_of_the_water_are_on_and_off():
    """A stone of cork dives less deep where the water bears it."""
    found = sweep(
        PEBBLE, {"buoyancy": [True, False], "stone_density": [240.0]}, throw=Throw(speed=1.0),
        limits=Limits(duration=0.5),
    )  # fmt: skip
    assert list(found.buoyancy.values) == ["on", "off"]
    borne, not_borne = found.depth.values.ravel()
    assert borne < 0.8 * not_borne


def test_a_throw_that_cannot_be_is_a_row_with_a_reason():
    found = sweep(PEBBLE, {"speed": [5.0, -1.0], "radius": [0.04, -0.04]}, limits=SHORT)
    np.testing.assert_array_equal(found.status, [["ok", "refused"], ["refused", "refused"]])
    assert "speed is -1 m/s" in str(found.reason[1, 0].values)
    assert "radius" in str(found.reason[0, 1].values)
    assert np.isnan(found.skips[1, 0])
    assert found.reason[0, 0] == ""


def test_a_throw_that_diverges_is_a_row_with_its_time():
    limits = Limits(duration=0.5, sink_depth=1e300)
    with pytest.warns(MjskipWarning, match="too large at 1000 m/s"):
        found = sweep(
            PEBBLE, {"height": [1000.0, 0.0]}, throw=Throw(speed=1000, descent=1.2), timestep=0.002,
            integrator="euler", limits=limits,
        )  # fmt: skip
    assert list(found.status.values) == ["ok", "diverged"]
    assert "t = " in str(found.reason[1].values)
    assert np.isnan(found.skips[1])


def test_a_throw_that_diverges_in_mujoco_is_a_row_with_its_time(monkeypatch):
    """The engine limits the drag of a step, so that hardly anything diverges in it."""

    def explode(scene, **_):
        raise DivergedError("not finite at t = 0.1 s: use a smaller time step", time=0.1)

    monkeypatch.setattr("mjskip.sweeps.job.simulate", explode)
    found = sweep(PEBBLE, {"height": [0.1]}, engine="mujoco", limits=SHORT)
    assert list(found.status.values) == ["diverged"]
    assert list(found.end.values) == ["diverged"]
    assert "t = 0.1 s" in str(found.reason[0].values)


def test_every_result_has_a_unit_or_a_meaning_and_the_file_says_what_made_it():
    found = sweep(PEBBLE, {"attack": [0.3]}, limits=SHORT)
    assert set(found.data_vars) == {*RESULTS, *WORDS}
    for name in RESULTS:
        assert found[name].attrs["units"]
    assert found.attack.attrs["units"] == "rad"
    made = json.loads(found.attrs["request"])
    assert made["version"]
    assert made["limits"]["duration"] == 0.4
    assert made["stone"]["triangles"] == 44


@pytest.mark.parametrize("change", ["radius", "thickness"])
def test_a_stretched_disc_is_the_disc_of_those_dimensions(change):
    first = {"radius": 0.03, "thickness": 0.004}
    then = first | {change: 0.007 if change == "thickness" else 0.05}
    ours = scaled(Stone.disc(**first), **{change: then[change]})
    theirs = Stone.disc(**then)
    assert ours.mass == pytest.approx(theirs.mass, rel=1e-12)  # rounding
    np.testing.assert_allclose(ours.inertia, theirs.inertia, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(ours.vertices, theirs.vertices, atol=1e-15)


def test_a_heavier_stone_keeps_its_shape():
    heavy = scaled(PEBBLE, stone_density=5200.0)  # pebbles are of granite, 2600
    assert heavy.mass == pytest.approx(2 * PEBBLE.mass, rel=1e-12)
    np.testing.assert_allclose(heavy.inertia, 2 * PEBBLE.inertia, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(
        scaled(PEBBLE, mass=heavy.mass).inertia, heavy.inertia, rtol=1e-12, atol=1e-18
    )


def test_a_latin_hypercube_has_one_point_in_every_slice_of_every_parameter():
    points = latin_hypercube({"attack": (0.1, 0.5), "speed": (5.0, 15.0)}, count=20, seed=1)
    for name, (low, high) in {"attack": (0.1, 0.5), "speed": (5.0, 15.0)}.items():
        slices = np.floor(20 * (points[name] - low) / (high - low))
        assert sorted(slices) == list(range(20))
    again = latin_hypercube({"attack": (0.1, 0.5), "speed": (5.0, 15.0)}, count=20, seed=1)
    np.testing.assert_array_equal(points["speed"], again["speed"])
    other = latin_hypercube({"attack": (0.1, 0.5), "speed": (5.0, 15.0)}, count=20, seed=2)
    assert (points["speed"] != other["speed"]).all()


def test_normal_scatter_has_the_mean_and_spread_asked_for():
    points = normal({"attack": (0.3, 0.02)}, count=500, seed=3)["attack"]
    # stratified: far nearer than the 0.02 / sqrt(500) of independent draws
    assert points.mean() == pytest.approx(0.3, abs=2e-4)
    assert points.std() == pytest.approx(0.02, rel=0.02)


def test_samples_lie_along_one_dimension():
    points = latin_hypercube({"attack": (0.2, 0.5), "speed": (5.0, 12.0)}, count=6, seed=1)
    found = sweep(PEBBLE, {"gate": ["centre", "local"]}, samples=points, limits=SHORT)
    assert dict(found.sizes) == {"gate": 2, "sample": 6}
    np.testing.assert_array_equal(found.speed, points["speed"])


@pytest.mark.parametrize(
    ("design", "says"),
    [
        ({"axes": {"atack": [1]}}, "no parameter 'atack'"),
        ({"axes": {"attack": []}}, "at least one"),
        ({"axes": {"buoyancy": ["perhaps"]}}, "one of on, off"),
        ({"axes": {"attack": [0.1, 0.1]}}, "twice"),
        ({"axes": {"attack": [np.nan]}}, "finite"),
        ({"axes": {"attack": [0.1]}, "samples": {"attack": [0.1]}}, "both an axis and a sample"),
        ({"samples": {"law": ["lee2010"]}}, "words"),
        ({"samples": {"attack": [0.1], "speed": [1.0, 2.0]}}, "different lengths"),
        ({"axes": {"mass": [0.1], "stone_density": [1.0]}}, "vary one"),
    ],
)
def test_a_design_that_cannot_be_is_refused(design, says):
    with pytest.raises(ValueError, match=says):
        Design(**design)


def test_chunks_are_whole_in_the_last_dimensions():
    assert chunk_shape((100, 10, 4), 256) == (6, 10, 4)
    assert chunk_shape((100, 10, 4), 20) == (1, 5, 4)
    assert chunk_shape((3,), 256) == (3,)


def test_a_store_holds_what_memory_would(tmp_path):
    kept = sweep(PEBBLE, **GRID)
    written = sweep(PEBBLE, **GRID, path=tmp_path / "a.zarr", chunk=4)
    xr.testing.assert_identical(kept, written)
    xr.testing.assert_identical(open_sweep(tmp_path / "a.zarr"), written)


def test_a_store_is_gone_on_with_and_finished_chunks_are_not_done_again(tmp_path, monkeypatch):
    whole, parts = tmp_path / "whole.zarr", tmp_path / "parts.zarr"
    sweep(PEBBLE, **GRID, path=whole, chunk=4)
    did = []
    real = sweep_module.run_chunk

    def until_the_third(job, index, **options):
        if len(did) == 2:
            raise KeyboardInterrupt
        did.append(index)
        return real(job, index, **options)

    monkeypatch.setattr(sweep_module, "run_chunk", until_the_third)
    with pytest.raises(KeyboardInterrupt):
        sweep(PEBBLE, **GRID, path=parts, chunk=4)
    unfinished = open_sweep(parts)
    assert (unfinished.status == "").sum() == 24 - 6  # chunks of 4, 2, 4, 2, ...
    seen = []
    monkeypatch.setattr(
        sweep_module,
        "run_chunk",
        lambda job, index, **options: (seen.append(index), real(job, index, **options))[1],
    )
    sweep(PEBBLE, **GRID, path=parts, chunk=4, threads=2)
    assert len(seen) == 8 - 2
    assert not set(map(str, seen)) & set(map(str, did))
    assert contents(parts) == contents(whole)


def test_a_killed_sweep_goes_on_to_the_same_bytes(tmp_path):
    """SIGKILL, in the middle of whatever it is doing."""
    script = f"""
import sys, time
sys.path.insert(0, {os.path.dirname(__file__)!r})
import mjskip.sweeps.sweep as s
from test_sweep import GRID, PEBBLE
real = s.run_chunk
s.run_chunk = lambda *a, **k: (time.sleep(0.2), real(*a, **k))[1]
s.sweep(PEBBLE, **GRID, path=sys.argv[1], chunk=2, progress=lambda d, n: print(d, flush=True))
"""
    store = tmp_path / "killed.zarr"
    with subprocess.Popen(
        [sys.executable, "-c", script, str(store)], stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout:
            if int(line) >= 4:
                break
        time.sleep(0.1)
        process.send_signal(signal.SIGKILL)
    before = {n: b for n, b in contents(store).items() if "/c/" in n and ".partial" not in n}
    assert 0 < (open_sweep(store).status != "").sum() < 24
    (store / "status" / "c" / "9.ab12.partial").write_bytes(b"half")  # as Zarr leaves it
    sweep(PEBBLE, **GRID, path=store, chunk=2)
    sweep(PEBBLE, **GRID, path=tmp_path / "whole.zarr", chunk=2)
    after = contents(store)
    assert after == contents(tmp_path / "whole.zarr")
    assert before.items() <= after.items()


def test_two_processes_do_not_write_to_one_store(tmp_path):
    store = tmp_path / "a.zarr"
    options = GRID | {"vary": {"attack": [0.3]}}
    sweep(PEBBLE, **options, path=store)
    script = f"""
import sys
sys.path.insert(0, {os.path.dirname(__file__)!r})
from test_sweep import GRID, PEBBLE
from mjskip.sweeps.sweep import sweep
sweep(PEBBLE, **GRID | {{"vary": {{"attack": [0.3]}}}}, path={str(store)!r})
"""
    lock = store_module._locked(store)
    other = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert "is being written by another process: wait for it" in other.stderr
    lock.close()
    sweep(PEBBLE, **options, path=store)
    sweep(PEBBLE, **options, path=store)  # one after the other


@pytest.mark.parametrize("damage", [b"", b"{", b'{"zarr_format": 3}', bytes(range(256))])
def test_a_damaged_store_is_refused_in_one_line(tmp_path, damage):
    store = tmp_path / "a.zarr"
    options = GRID | {"vary": {"attack": [0.3]}}
    sweep(PEBBLE, **options, path=store)
    for name in ("status/c/0/0", "status/zarr.json", "zarr.json"):
        (store / name).write_bytes(damage)
        for what in (lambda: open_sweep(store), lambda: sweep(PEBBLE, **options, path=store)):
            with pytest.raises(MjskipError, match=r"a\.zarr cannot be read as a sweep") as refused:
                what()
            assert "\n" not in str(refused.value)


@pytest.mark.parametrize("read_only", [False, True])
def test_a_sweep_to_a_disk_that_is_full_or_read_only_ends_in_one_line(tmp_path, read_only):
    command = ["mount", "-t", "tmpfs", "-o", "size=100k", "tmpfs", str(tmp_path)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no file system may be mounted here")
    try:
        if read_only:
            subprocess.run(["mount", "-o", "remount,ro", str(tmp_path)], check=True)
        else:
            (tmp_path / "fill").write_bytes(b"0" * 60_000)
        with pytest.raises(MjskipError, match="cannot be written") as refused:
            sweep(PEBBLE, **GRID, path=tmp_path / "a.zarr", chunk=2)
        assert "\n" not in str(refused.value)
        assert not list(tmp_path.rglob("*.part*"))
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


def test_a_store_of_another_request_is_refused_with_the_difference(tmp_path):
    store = tmp_path / "a.zarr"
    options = GRID | {"vary": {"attack": [0.3]}}
    sweep(PEBBLE, **options, path=store)
    for change, says in (
        ({"timestep": 4e-4}, "timestep was 0.0005, now 0.0004"),
        ({"throw": Throw(height=0.06)}, "throw.height was 0.05, now 0.06"),
        ({"vary": {"attack": [0.31]}}, "design.axes.attack was 1 from 0.3"),
        ({"chunk": 1}, "chunk was"),
    ):
        with pytest.raises(MjskipError, match=says):
            sweep(PEBBLE, **options | change, path=store)
    with pytest.raises(MjskipError, match=r"stone\.mass was"):
        sweep(Stone.pebble(radius=0.05), **options, path=store)


def test_what_is_no_store_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(MjskipError, match="is no sweep"):
        sweep(PEBBLE, **GRID, path=tmp_path)
    with pytest.raises(MjskipError, match="is no sweep"):
        open_sweep(tmp_path / "nothing.zarr")
    with pytest.raises(MjskipError, match="does not exist"):
        sweep(PEBBLE, **GRID, path=tmp_path / "no" / "a.zarr")
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_without_zarr_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(MjskipError, match=r"pip install 'mjskip\[sweep\]'"):
        sweep(PEBBLE, **GRID, path=tmp_path / "a.zarr")


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="engine is 'bullet'"):
        sweep(PEBBLE, {"attack": [0.3]}, engine="bullet")
    with pytest.raises(ValueError, match="integrator of the reference engine is"):
        sweep(PEBBLE, {"attack": [0.3]}, integrator="adaptive")
    with pytest.raises(ValueError, match="chunk is 0"):
        sweep(PEBBLE, {"attack": [0.3]}, chunk=0)


@pytest.fixture(scope="module")
def small():
    """A sweep with two dimensions of numbers, one of words, and an ensemble."""
    return sweep(
        PEBBLE, {"attack": span(0.1, 0.6, 6), "law": ["lee2010", "rosellini2005"], "spin": [0, 60]},
        scatter=normal({"speed": (0, 0.3)}, count=3, seed=1), limits=SHORT,
        throw=Throw(height=0.05, speed=8.0),
    )  # fmt: skip


def test_plots_show_what_the_dimensions_suggest(small, tmp_path):
    pytest.importorskip("matplotlib")
    samples = sweep(
        PEBBLE,
        samples=latin_hypercube({"attack": (0.1, 0.6), "speed": (5, 12)}, count=9, seed=1),
        limits=SHORT,
    )
    for name, data, size in (
        ("map per law", small, 2),
        ("line per law", small.isel(spin=1), 1),
        ("line", small.isel(spin=1, law=0, member=[0]), 1),
        ("cloud", samples, 1),
    ):
        path = tmp_path / f"{name}.png"
        plot_sweep(data, path, dpi=50)
        width = int.from_bytes(path.read_bytes()[16:20], "big")  # of the PNG's header
        assert width == pytest.approx(50 * (1.2 + 4.6 * size), abs=2)
        assert path.stat().st_size > 3000


def test_what_cannot_be_drawn_is_said(small, tmp_path):
    with pytest.raises(ValueError, match="no result 'joy'"):
        plot_sweep(small, tmp_path / "a.png", result="joy")
    with pytest.raises(MjskipError, match="nothing varies in numbers"):
        plot_sweep(small.isel(attack=0, spin=0), tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


def test_the_command_takes_degrees_writes_a_store_and_goes_on_with_it(tmp_path):
    store = tmp_path / "a.zarr"
    command = (
        f"sweep lake --vary attack=10:30:3 --vary law=lee2010,rosellini2005 --scatter spin=0.5 --members 2 "
        f"--height 0.05 --duration 0.4 --timestep 5e-4 --save {store} --plot {tmp_path / 'a.png'}"
    )
    first = CliRunner().invoke(cli, command.split(), catch_exceptions=False)
    assert first.exit_code == 0
    assert "12 throws in" in first.stdout
    assert "12 ok" in first.stdout
    before = contents(store)
    assert CliRunner().invoke(cli, command.split(), catch_exceptions=False).exit_code == 0
    assert contents(store) == before
    data = open_sweep(store)
    np.testing.assert_allclose(np.degrees(data.attack), [10, 20, 30])
    assert abs(data.spin_scatter).max() < 4 * np.pi  # rev/s became rad/s
    assert (tmp_path / "a.png").stat().st_size > 3000
    again = f"plot {store} -o {tmp_path / 'b.png'} --result distance"
    assert CliRunner().invoke(cli, again.split(), catch_exceptions=False).exit_code == 0
    assert (tmp_path / "b.png").stat().st_size > 3000
    assert CliRunner().invoke(cli, ["plot", str(store), str(store)]).exit_code == 2


@pytest.mark.parametrize(
    ("option", "says"),
    [
        ("--vary=attack=1:2", "neither"),
        ("--vary=attack=1:2:x", "whole number"),
        ("--vary=atack=1:2:3", "choose from"),
        ("--latin=speed=5", "two numbers"),
        ("--vary=speed=five", "speed"),
        ("--plot=nowhere/a.png", "create it"),
        ("--plot=a.xyz", "no picture"),
    ],
)
def test_options_that_cannot_be_read_are_refused(option, says, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["sweep", "lake", option])
    assert says in capsys.readouterr().err
