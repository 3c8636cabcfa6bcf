"""A trajectory is saved whole, with units and provenance, and loads again as it was."""

import dataclasses
import json

import numpy as np
import pytest
import xarray as xr

from mjskip import Limits, Stone, Throw, Trajectory, integrate, simulate
from mjskip.errors import MjskipError


@pytest.fixture(scope="module")
def run():
    """Two touches, the last without an exit."""
    throw = Throw.from_degrees(speed=9, spin=20, attack=20, descent=10, height=0.05)
    found = integrate(Stone.pebble(), throw, limits=Limits(duration=2.0))
    assert len(found.contacts) >= 2
    assert found.contacts[-1].exit is None
    return found


def assert_same(a, b):
    for field in dataclasses.fields(Trajectory):
        one, two = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, two, err_msg=field.name)
        else:
            assert one == two, field.name


def test_a_saved_trajectory_loads_as_it_was(run, tmp_path):
    path = tmp_path / "run.nc"
    run.save(path)
    assert_same(Trajectory.load(path), run)
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


def test_a_trajectory_without_contacts_is_saved_too(tmp_path):
    dry = integrate(Stone.pebble(), Throw(height=50.0), limits=Limits(duration=0.01))
    dry.save(tmp_path / "dry.nc")
    assert_same(Trajectory.load(tmp_path / "dry.nc"), dry)


def test_provenance_travels_with_the_file(tmp_path):
    found = simulate("lake", limits=Limits(duration=0.02))
    found.save(tmp_path / "lake.nc")
    loaded = Trajectory.load(tmp_path / "lake.nc")
    assert loaded.attributes == json.loads(json.dumps(found.attributes))
    for key in (
        "version",
        "scene",
        "body",
        "engine",
        "integrator",
        "timestep",
        "throw",
        "water",
        "limits",
    ):
        assert key in loaded.attributes


def test_every_variable_has_a_unit(run, tmp_path):
    run.save(tmp_path / "run.nc")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf", decode_times=False) as data:
        assert all("units" in data[name].attrs for name in [*data.data_vars, "time"])
        assert data["P"].attrs["units"] == "kg m s-1"
        assert data["force"].dims == ("time", "axis")
        assert data["contact_depth"].dims == ("contact",)
        assert data["axis"].values.tolist() == ["x", "y", "z"]
        assert data.attrs["end"] == run.end


def test_a_second_save_replaces_the_first(run, tmp_path):
    path = tmp_path / "run.nc"
    path.write_text("something else")
    run.save(path)
    assert_same(Trajectory.load(path), run)


def test_a_folder_that_is_not_there_is_refused(run, tmp_path):
    with pytest.raises(MjskipError, match=r"folder .*nowhere does not exist: create it"):
        run.save(tmp_path / "nowhere" / "run.nc")
    with pytest.raises(MjskipError, match="is a folder: name a file"):
        run.save(tmp_path)


def test_a_file_that_is_no_trajectory_is_refused(run, tmp_path):
    with pytest.raises(MjskipError, match="cannot be read as a trajectory"):
        Trajectory.load(tmp_path / "missing.nc")
    (tmp_path / "text.nc").write_text("no NetCDF")
    with pytest.raises(MjskipError, match="cannot be read as a trajectory"):
        Trajectory.load(tmp_path / "text.nc")
    xr.Dataset({"a": 1.0}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(MjskipError, match="cannot be read as a trajectory"):
        Trajectory.load(tmp_path / "other.nc")
    run.to_dataset().drop_vars("force").to_netcdf(tmp_path / "part.nc", engine="h5netcdf")
    with pytest.raises(MjskipError, match="cannot be read as a trajectory"):
        Trajectory.load(tmp_path / "part.nc")


UNFIT = {
    "a list for provenance": {"provenance": "[]"},
    "a number for provenance": {"provenance": "5"},
    "provenance without end": {"provenance": "[" * 100_000},
    "no gravity": {"provenance": '{"gravity": null}'},
    "two counts of skips": {"skips": [1, 2]},
    "half a skip": {"skips": 0.5},
    "no mass": {"mass_kg": float("nan")},
    "less than no mass": {"mass_kg": -1.0},
}


@pytest.mark.parametrize("attributes", UNFIT.values(), ids=UNFIT.keys())
def test_attributes_that_make_no_sense_are_refused_in_one_line(run, tmp_path, attributes):
    data = run.to_dataset()
    data.attrs |= attributes
    (tmp_path / "odd.nc").write_bytes(data.to_netcdf(engine="h5netcdf"))
    with pytest.raises(MjskipError, match=r"odd\.nc cannot be read as a trajectory") as refused:
        Trajectory.load(tmp_path / "odd.nc")
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "values"),
    [("position", np.nan), ("force", np.inf), ("time", 0.0), ("clearance", np.nan)],
)
def test_series_that_are_no_motion_are_refused(run, tmp_path, name, values):
    data = run.to_dataset()
    data[name] = data[name] * 0.0 + values
    (tmp_path / "odd.nc").write_bytes(data.to_netcdf(engine="h5netcdf"))
    with pytest.raises(MjskipError, match="cannot be read as a trajectory"):
        Trajectory.load(tmp_path / "odd.nc")


def test_a_damaged_file_is_read_or_refused_in_one_line(run, tmp_path):
    path = tmp_path / "damaged.nc"
    run.save(path)
    sound = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = []
    for _ in range(60):
        damaged = bytearray(sound)
        for at in rng.integers(0, min(len(sound), 8000), 3):
            damaged[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            Trajectory.load(path)
        except MjskipError as error:
            refused.append(str(error))
    assert refused
    assert all(text.startswith(f"{path} cannot be read as a trajectory (") for text in refused)
    assert all(len(text.splitlines()) == 1 for text in refused)


def test_a_summary_is_in_degrees_and_says_so(run):
    first = run.contacts[0].summary()
    assert set(first) == {"entry", "exit", "depth", "impulse", "airtime"}
    assert set(first["entry"]) == {
        "time", "position", "velocity", "attack_deg", "bank_deg", "spin_rev_s",
    }  # fmt: skip
    assert first["entry"]["attack_deg"] == pytest.approx(20.0, abs=0.5)
    assert first["entry"]["spin_rev_s"] == pytest.approx(20.0, rel=1e-3)
    assert run.contacts[-1].summary()["exit"] is None
    json.dumps([contact.summary() for contact in run.contacts], allow_nan=False)


def test_touches_come_in_order_and_say_what_the_rows_say(run):
    for contact in run.contacts:
        entry = contact.entry
        row = int(np.searchsorted(run.time, entry.time))
        assert run.clearance[row - 1] >= 0.0 > run.clearance[min(row + 1, len(run.time) - 1)]
        np.testing.assert_allclose(entry.position, run.position[row], atol=0.02)
        assert entry.speed == pytest.approx(np.linalg.norm(run.velocity[row]), rel=0.1)
        if contact.exit:
            during = (run.time >= entry.time) & (run.time <= contact.exit.time)
            assert contact.depth == pytest.approx(-run.clearance[during].min())
    times = [m.time for c in run.contacts for m in (c.entry, c.exit) if m]
    assert times == sorted(times)
    assert run.skips == sum(c.airtime >= 0.01 for c in run.contacts)
    for one, two in zip(run.contacts, run.contacts[1:], strict=False):
        assert one.airtime == pytest.approx(two.entry.time - one.exit.time)
