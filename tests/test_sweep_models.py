"""Sweeps of models in which nothing is thrown: what floats and what sensors show, over parameters by name."""

import json
import math
import pickle

import numpy as np
import pytest
from click.testing import CliRunner

import mjskip.sweeps.sweep as sweep_module
from mjskip.cli import cli
from mjskip.hydro.seas import Sea, sea_numbers, sea_text
from mjskip.sweeps.models import STATES, sweep_model
from mjskip.sweeps.plot import plot_sweep
from mjskip.sweeps.store import open_sweep

BOX = """
<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <extension><plugin plugin="mjskip.water"><instance name="w">
    <config key="preset" value="floating"/></instance></plugin></extension>
  <worldbody>
    <body name="box"><freejoint/><plugin instance="w"/>
      <geom type="box" size=".5 .3 .1" mass="60"/><site name="deck" pos="0 0 .1"/></body>
  </worldbody>
  <sensor><framepos name="deck" objtype="site" objname="deck"/></sensor>
</mujoco>"""

ARM = """
<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body pos="0 0 1"><joint name="hinge" axis="0 1 0" damping="2" stiffness="4"/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3" mass="0"/>
      <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body>
  </worldbody>
  <actuator><motor name="hinge" joint="hinge"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>"""


@pytest.fixture
def box(tmp_path):
    file = tmp_path / "box.xml"
    file.write_text(BOX)
    return file


def test_a_box_draws_the_water_that_it_displaces_whatever_it_weighs(box):
    found = sweep_model(
        box, {"water_density": [900.0, 1100.0], "mass": [30.0, 60.0]}, duration=8.0, settle=7.0
    )
    assert dict(found.sizes) == {"water_density": 2, "mass": 2}
    assert set(STATES) <= set(found.data_vars)
    expected = np.array([30.0, 60.0]) / (np.array([[900.0], [1100.0]]) * 0.6)
    np.testing.assert_allclose(found.draft, expected, rtol=0.02)
    assert found.draft.attrs["units"] == "m"
    assert found.mass.attrs["units"] == "kg"


def test_where_a_body_begins_is_a_parameter(box):
    found = sweep_model(
        box, {"roll": [0.0, 0.2]}, given={"z": 0.05, "x": 3.0}, results=["heel_max", "drift", "deck"],
        duration=0.5, settle=0.0,
    )  # fmt: skip
    np.testing.assert_allclose(found.heel_max, [0.0, 0.2], atol=1e-6)
    assert float(found.deck_0_max[0]) == pytest.approx(3.0)
    assert float(found.deck_2_max[0]) == pytest.approx(0.15, abs=1e-3)


def test_a_sensor_of_a_robot_over_its_controls(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(ARM)
    found = sweep_model(
        file, {"ctrl_hinge": [-1.0, 0.0, 2.0]}, results=["angle"], duration=6.0, settle=5.0
    )
    np.testing.assert_allclose(found.angle_mean, [-0.25, 0.0, 0.5], atol=1e-3)
    assert np.all(found.angle_min <= found.angle_mean)
    with pytest.raises(ValueError, match="no free body: name sensors as results, angle"):
        sweep_model(file, {"ctrl_hinge": [1.0]})


def test_a_point_without_a_result_is_a_row_with_its_reason(box):
    found = sweep_model(box, {"mass": [-1.0, 60.0]}, results=["draft"], duration=0.2)
    np.testing.assert_array_equal(found.status, ["refused", "ok"])
    assert "mass" in str(found.reason[0].values)
    assert np.isnan(found.draft[0])


def test_a_store_says_what_made_it_and_goes_on_where_it_stopped(box, tmp_path, monkeypatch):
    question = {"vary": {"roll": [0.0, 0.1, 0.2]}, "duration": 0.5, "results": ["heel_max", "deck"]}
    whole = sweep_model(box, **question)
    real, done = sweep_module.run_chunk, []

    def as_on_a_worker(job, index, **_):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(index)
        return real(pickle.loads(pickle.dumps(job)), index, threads=1)

    monkeypatch.setattr(sweep_module, "run_chunk", as_on_a_worker)
    with pytest.raises(KeyboardInterrupt):
        sweep_model(box, **question, path=tmp_path / "a.zarr", chunk=1)
    assert list(open_sweep(tmp_path / "a.zarr").status.values) == ["ok", "ok", ""]
    monkeypatch.setattr(sweep_module, "run_chunk", real)
    again = sweep_model(box, **question, path=tmp_path / "a.zarr", chunk=1)
    assert again.equals(whole)
    made = json.loads(again.attrs["request"])
    assert made["version"]
    assert made["model"].startswith("box.xml (sha256 ")
    assert made["results"] == ["heel_max", "deck"]
    assert again.heel_max.attrs["units"] == "rad"
    plot_sweep(again, tmp_path / "a.svg")
    assert "heel max [degrees]" in (tmp_path / "a.svg").read_text()


def test_the_command_prints_a_table_in_degrees(box):
    command = [
        "sweep",
        str(box),
        "--vary",
        "roll=0,10",
        "--result",
        "heel_max",
        "--duration",
        "0.2",
        "--settle",
        "0",
    ]
    found = CliRunner().invoke(cli, command)
    assert found.exit_code == 0, found.output
    assert "2 runs" in found.output
    assert "deg" in found.output
    rows = [line.split() for line in found.output.splitlines()]
    assert ["10", "10"] in rows
    for more, says in (
        (["--speed", "3"], "nothing is thrown in this sweep: leave out --speed"),
        (["--vary", "sea_wind=1,2"], "choose from water_density"),
    ):
        found = CliRunner().invoke(cli, [*command, *more])
        assert found.exit_code != 0
        assert says in " ".join(found.output.split())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"results": ["joy"]}, "no result 'joy': choose from draft"),
        ({"vary": {"salt": [1.0]}}, "no parameter 'salt': choose from water_density"),
        ({"settle": 30.0}, "settle is 30.0: give a time from 0 to less than the duration, 20 s"),
        ({"body": "duck"}, "no free body 'duck': it has box"),
        ({"vary": {"mass": [1.0]}, "given": {"mass": 2.0}}, "mass is both given and varied"),
    ],
)
def test_what_cannot_be_asked_is_named(box, options, says):
    with pytest.raises(Exception, match=says):
        sweep_model(box, **options)


def test_one_kind_of_waves_takes_the_place_of_the_other():
    before = "hs=0.3 tp=3 direction=180 seed=1 current=0.2"
    text = sea_text({"height": 0.1, "period": 2.0, "direction": math.pi / 2}, before)
    assert sea_numbers(text) == pytest.approx(
        {"height": 0.1, "period": 2.0, "direction": math.pi / 2, "current": 0.2}
    )
    assert Sea.from_text(text).omega == pytest.approx([math.pi])
    assert Sea.from_text(sea_text({"seed": 4.0}, before)).phase[0] != Sea.from_text(before).phase[0]


@pytest.mark.slow
def test_a_box_follows_long_waves_and_not_short_ones(box):
    found = sweep_model(
        box, {"sea_period": [0.5, 4.0]}, given={"sea_height": 0.06}, results=["heave", "heave_period"],
        duration=24.0, settle=12.0,
    )  # fmt: skip
    assert list(found.status.values) == ["ok", "ok"]
    short, long = found.heave.values
    assert long == pytest.approx(0.03, rel=0.05)
    assert short < 0.2 * long
    assert float(found.heave_period[1]) == pytest.approx(4.0, rel=0.02)
