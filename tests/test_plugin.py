"""Plugin mjskip.water: the same water as `attach`, wherever MuJoCo takes a model."""

import copy
import gc
import os
import pickle
import resource
import threading
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco import batch, rollout

from mjskip import Water, attach, register_plugin, wrench
from mjskip.coupling import _struct_layout as layout
from mjskip.coupling import _table_kernels
from mjskip.coupling import plugin as plugin_module
from mjskip.coupling.plugin_keys import plugin_water
from mjskip.coupling.wet import body_stone
from mjskip.errors import MjskipError, SceneError

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
PEBBLE = """
    0 0 .0075  0 0 -.0075  .045 0 .003  .014 .043 .003  -.036 .026 .003  -.036 -.026 .003
    .014 -.043 .003  .045 0 -.003  .014 .043 -.003  -.036 .026 -.003  -.036 -.026 -.003  .014 -.043 -.003
"""
START = [0.0, 0.0, 0.002, 0.98, 0.05, -0.17, 0.02], [4.0, 0.3, -1.0, 3.0, 2.0, 60.0]
"""A pebble half in the water: qpos and qvel of a free joint."""


@pytest.fixture(scope="module", autouse=True)
def _registered():
    register_plugin()


def stone_xml(*, name="stone", instance=None, pos="0 0 .002", geom='type="mesh" mesh="pebble"'):
    plugin = f'<plugin instance="{instance}"/>' if instance else ""
    return (
        f'<body name="{name}" pos="{pos}"><freejoint/>{plugin}'
        f'<geom name="{name}" {geom} density="2600" contype="0"/></body>'
    )


def xml(bodies, *, instances=None, sensor="", integrator="RK4", extra=""):
    """A model; `instances`: configuration by name of the plugin's instances."""
    told = "".join(
        f'<instance name="{name}">'
        + "".join(f'<config key="{key}" value="{value}"/>' for key, value in config.items())
        + "</instance>"
        for name, config in (instances or {}).items()
    )
    extension = f'<plugin plugin="mjskip.water">{told}</plugin>' if told else ""
    return f"""
    <mujoco>
      <option timestep=".0005" integrator="{integrator}"/>
      <extension>{extension}</extension>
      <asset><mesh name="pebble" inertia="exact" vertex="{PEBBLE}"/></asset>
      <worldbody>{bodies}</worldbody>
      <sensor>{sensor}</sensor>{extra}
    </mujoco>"""


def plain(**options):
    return mujoco.MjModel.from_xml_string(xml(stone_xml(), **options))


def plugged(config=None, **options):
    options.setdefault("sensor", "")
    return mujoco.MjModel.from_xml_string(
        xml(stone_xml(instance="lake"), instances={"lake": config or {}}, **options)
    )


def started(model, *, scale=1.0):
    data = mujoco.MjData(model)
    data.qpos[:7] = START[0]
    data.qvel[:6] = scale * np.array(START[1])
    return data


def run(model, data, steps):
    mujoco.mj_step(model, data, nstep=steps)
    return full_state(model, data)


def full_state(model, data):
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    return state


def assert_no_warnings(data):
    assert not any(warning.number for warning in data.warning)


# --- the same water as attach ---------------------------------------------------------------------


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@pytest.mark.parametrize(
    "config",
    [
        {},
        {"density": 800, "air_density": 5, "gate": "local"},
        {"law": "bocquet2003"},
        {"law": "nagahiro2005", "density": "1.3e3"},
        {"buoyancy": "true", "skin_friction": "true", "viscosity": 1e-5},
    ],
    ids=str,
)
def test_a_free_stone_skips_as_it_does_with_attach(integrator, config):
    meant = {key: {"true": True}.get(value, value) for key, value in config.items()}
    for key in meant.keys() & {"density", "air_density", "viscosity"}:
        meant[key] = float(meant[key])
    first, second = plain(integrator=integrator), plugged(config, integrator=integrator)
    here, there = started(first), started(second)
    with attach(first, here, water=Water(**meant)):
        run(first, here, 300)
    run(second, there, 300)
    assert abs(here.qpos[0]) > 0.1  # it went somewhere
    # the wrench reaches the joint by other sums: rounding of numbers up to 100, 300 times
    np.testing.assert_allclose(there.qpos, here.qpos, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(there.qvel, here.qvel, rtol=1e-12, atol=1e-11)
    assert_no_warnings(there)


@pytest.mark.parametrize(
    "geom",
    ['type="box" size=".05 .04 .01"', 'type="ellipsoid" size=".05 .04 .01" pos=".01 0 .005"',
     'type="cylinder" size=".04 .01" euler="10 20 30"', 'type="capsule" size=".02 .03"',
     'type="sphere" size=".03"'],
)  # fmt: skip
def test_every_solid_geom_is_wet_as_it_is_with_attach(geom):
    first = mujoco.MjModel.from_xml_string(xml(stone_xml(geom=geom)))
    second = mujoco.MjModel.from_xml_string(
        xml(stone_xml(geom=geom, instance="lake"), instances={"lake": {}})
    )
    here, there = started(first), started(second)
    with attach(first, here):
        mujoco.mj_forward(first, here)
    mujoco.mj_forward(second, there)
    np.testing.assert_allclose(
        there.qacc, here.qacc, rtol=1e-11, atol=1e-11 * np.abs(here.qacc).max()
    )


PADDLE = """
  <body name="arm" pos="0 0 .3" euler="0 10 5">
    <joint name="shoulder" axis="0 1 0"/><joint name="sway" axis="1 0 0" damping=".01"/>
    <geom type="capsule" size=".02" fromto="0 0 0 .3 0 0" contype="0"/>
    <body name="forearm" pos=".3 0 0" euler="20 40 0">
      <joint name="elbow" axis="0 .6 .8"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .2 0 0" contype="0"/>
      <body name="hand" pos=".2 0 0"><joint name="slide" type="slide" axis="1 0 0" stiffness="100"/>
        <geom size=".02" contype="0"/>
        <body name="paddle" pos=".05 0 -.1" euler="0 70 20">{plugin}
          <geom type="box" size=".1 .06 .01" pos=".02 .01 0" contype="0"/>
        </body>
      </body>
    </body>
  </body>
"""


def test_a_paddle_on_an_arm_feels_the_water_as_with_attach():
    first = mujoco.MjModel.from_xml_string(xml(PADDLE.format(plugin="")))
    second = mujoco.MjModel.from_xml_string(
        xml(PADDLE.format(plugin='<plugin instance="lake"/>'), instances={"lake": {}})
    )
    here, there = mujoco.MjData(first), mujoco.MjData(second)
    for data in (here, there):
        data.qvel[:] = 3.0, -2.0, 4.0, 0.5
    with attach(first, here, bodies=["paddle"]):
        mujoco.mj_forward(first, here)
        pushed = here.xfrc_applied.any()
        start = here.qacc.copy()
        run(first, here, 200)
    mujoco.mj_forward(second, there)
    assert pushed
    assert np.abs(there.qfrc_passive).max() > 1.0  # it is in the water
    np.testing.assert_allclose(there.qacc, start, rtol=1e-12, atol=1e-12 * np.abs(start).max())
    run(second, there, 200)
    # chaotic arms are not: rounding grows little in 0.1 s
    np.testing.assert_allclose(there.qpos, here.qpos, rtol=0.0, atol=1e-11)


def test_several_waters_act_each_on_its_own_stone():
    waters = {"lake": {}, "oil": {"density": 600, "law": "bocquet2003"}, "air": {"density": 0}}
    stones = "".join(stone_xml(name=name, instance=name) for name in waters)
    model = mujoco.MjModel.from_xml_string(xml(stones, instances=waters))
    data = mujoco.MjData(model)
    for k in range(3):
        data.qpos[7 * k : 7 * k + 7], data.qvel[6 * k : 6 * k + 6] = START
    run(model, data, 100)
    for k, config in enumerate(waters.values()):
        alone = plugged(config)
        expected = started(alone)
        run(alone, expected, 100)
        # stones in one model share a mass matrix, so only rounding
        np.testing.assert_allclose(data.qpos[7 * k : 7 * k + 7], expected.qpos, atol=1e-12, rtol=0)
    assert plugin_water(model, 2) == Water(density=600.0, law="bocquet2003")


def test_one_water_acts_on_several_stones():
    stones = "".join(stone_xml(name=name, instance="lake") for name in "ab")
    model = mujoco.MjModel.from_xml_string(xml(stones, instances={"lake": {}}))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = START[0] * 2, START[1] * 2
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[:6].any()
    np.testing.assert_array_equal(data.qfrc_passive[:6], data.qfrc_passive[6:])


def test_users_forces_stay_the_users():
    model = plugged()
    data = started(model)
    data.xfrc_applied[1] = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0
    run(model, data, 10)
    np.testing.assert_array_equal(data.xfrc_applied[1], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


def test_inverse_dynamics_knows_the_water():
    model = plugged(integrator="Euler")
    data = started(model)
    mujoco.mj_forward(model, data)
    mujoco.mj_inverse(model, data)
    # nothing but gravity and water acts; forces here are up to 100
    np.testing.assert_allclose(data.qfrc_inverse, 0.0, atol=1e-11)


def test_a_sleeping_body_is_left_alone():
    bodies = stone_xml(instance="lake").replace(
        'name="stone" pos', 'name="stone" sleep="init" pos', 1
    )
    text = xml(bodies, instances={"lake": {}}).replace(
        "<option", '<option sleep_tolerance="1e-3"', 1
    )
    model = mujoco.MjModel.from_xml_string(
        text.replace('integrator="RK4"/>', 'integrator="Euler"><flag sleep="enable"/></option>')
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for awake in (False, True):
        data.body_awake[1] = awake
        data.cvel[1] = 0.0, 0.0, 30.0, 4.0, 0.0, -1.0
        data.qfrc_passive[:] = 0.0
        mujoco.mj_passive(model, data)
        assert data.qfrc_passive.any() == awake


# --- sensors --------------------------------------------------------------------------------------


def test_a_sensor_shows_force_torque_and_wetted_area():
    model = plugged({"density": 900}, sensor='<plugin name="s" instance="lake"/>')
    data = started(model)
    mujoco.mj_forward(model, data)
    velocity = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, 1, velocity, 0)
    expected = wrench(
        body_stone(model, 1),
        Water(density=900.0),
        position=data.xipos[1],
        q=data.xquat[1],
        velocity=velocity[3:],
        omega=velocity[:3],
    )
    told = data.sensor("s").data
    assert expected.wetted_area > 0.0
    np.testing.assert_allclose(told[:3], expected.force + expected.air_force, rtol=1e-12)
    np.testing.assert_allclose(told[3:6], expected.torque + expected.air_torque, rtol=1e-11)
    assert told[6] == pytest.approx(expected.wetted_area, rel=1e-12)
    assert model.sensor("s").dim == 7


def test_a_sensor_shows_the_bodies_of_its_instance_in_turn():
    stones = "".join(
        stone_xml(name=name, instance=water)
        for name, water in (("a", "lake"), ("b", "sea"), ("c", "lake"))
    )
    sensors = '<plugin name="sea" instance="sea"/><plugin name="lake" instance="lake"/>'
    model = mujoco.MjModel.from_xml_string(
        xml(stones, instances={"lake": {}, "sea": {}}, sensor=sensors)
    )
    data = mujoco.MjData(model)
    for k in range(3):
        data.qpos[7 * k : 7 * k + 7], data.qvel[6 * k : 6 * k + 6] = START
        data.qvel[6 * k] = k
    mujoco.mj_forward(model, data)
    shown = [data.sensor("lake").data[:7], data.sensor("sea").data, data.sensor("lake").data[7:]]
    for k, row in enumerate(shown):
        # a free joint's first three forces are the force
        np.testing.assert_allclose(row[:3], data.qfrc_passive[6 * k : 6 * k + 3], rtol=1e-12)
        assert row[6] > 0.0


def test_a_sensor_that_names_a_body_is_refused():
    with pytest.raises(ValueError, match="leave out objtype"):
        plugged(sensor='<plugin instance="lake" objtype="body" objname="stone"/>')


def test_the_model_in_the_docs_floats():
    text = (Path(__file__).parent.parent / "docs" / "routes.md").read_text()
    model = mujoco.MjModel.from_xml_string(text.split("```xml\n")[1].split("```")[0])
    data = mujoco.MjData(model)
    data.qpos[2] = -0.02
    mujoco.mj_forward(model, data)
    force, weight = data.sensor("water").data[2], 9.81 * model.body_mass[1]
    assert force > weight
    assert data.sensor("water").data[6] > 0.0


# --- what a configuration may say -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("config", "says"),
    [
        ({"dense": 3}, "unrecognized attribute 'plugin:dense' for plugin mjskip.water"),
        ({"density": "thick"}, "instance 'lake': density is 'thick': give a number"),
        ({"buoyancy": "yes"}, "buoyancy is 'yes': give true or false"),
        ({"density": -1}, "density is -1.0: give a finite number"),
        ({"air_density": "nan"}, "air_density is nan: give a finite number"),
        ({"gate": "side%ways"}, "gate is 'side%ways': use one of centre, local"),
        ({"law": "newton"}, "law is 'newton': use one of lee2010"),
        ({"surface": "waves", "size": 1e6}, "give 16 to 512 cells along a side"),
        (
            {"surface": "waves", "wave_speed": 1e300},
            "a number is too large or too small (surface=waves",
        ),
        ({"resolution": 10**6}, "resolution is 1000000: give a whole number between 4 and 1000"),
        (
            {"preset": "floating", "radiation": "true", "sea": "hs=1e300 tp=3"},
            r"hs is 1e\+300: give a finite number between",
        ),
    ],
)
def test_a_bad_configuration_is_a_compile_error_that_names_it(config, says):
    with pytest.raises(ValueError, match=says.replace("(", r"\(")):
        plugged(config)


@pytest.mark.parametrize("gravity", ["0 0 0"])
@pytest.mark.parametrize(
    "config",
    [{"surface": "waves"}, {"surface": "deep"}, {"preset": "floating", "radiation": "true"}],
)
def test_waves_of_water_that_is_not_held_down_are_refused_still_water_is_not(gravity, config):
    option = f'<option gravity="{gravity}" '
    moving, still = (
        xml(stone_xml(instance="lake"), instances={"lake": keys}).replace("<option ", option)
        for keys in (config, {})
    )
    with pytest.raises(ValueError, match=r"m/s.2 along z: waves need water that is held down"):
        mujoco.MjModel.from_xml_string(moving)
    mujoco.mj_step(model := mujoco.MjModel.from_xml_string(still), mujoco.MjData(model))


def test_a_bad_configuration_is_refused_although_no_body_uses_it():
    with pytest.raises(ValueError, match="law is 'newton'"):
        mujoco.MjModel.from_xml_string(xml(stone_xml(), instances={"lake": {"law": "newton"}}))


def test_a_body_that_is_no_solid_is_a_compile_error():
    bodies = '<body name="bare"><freejoint/><plugin instance="lake"/><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body>'
    with pytest.raises(ValueError, match="body 'bare' has no geom for water to act on"):
        mujoco.MjModel.from_xml_string(xml(bodies, instances={"lake": {}}))


def test_the_water_of_a_body_can_be_asked_for():
    model = plugged({"gate": "local"})
    assert plugin_water(model, 1) == Water(gate="local")
    assert plugin_water(model, 0) is None
    assert plugin_water(plain(), 1) is None


def test_registering_again_changes_nothing():
    slot = plugin_module.plugin_slot()
    register_plugin()
    assert plugin_module.plugin_slot() == slot >= 0


def test_a_force_that_is_not_finite_is_a_counted_warning_and_no_force():
    model = plugged()
    data = started(model)
    data.qvel[0] = 1e200
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0
    assert not data.qfrc_passive.any()


def test_another_layout_is_refused_with_the_version(monkeypatch):
    shown = {name: layout.members(name) for name in ("mjModel", "mjData", "mjOption")}
    shown["mjModel"] = {**shown["mjModel"], "body_ipos": shown["mjModel"]["body_iquat"]}
    monkeypatch.setattr(layout, "members", shown.__getitem__)
    with pytest.raises(
        MjskipError, match=rf"MuJoCo {mujoco.mj_versionString()} keeps mjModel.body_ipos"
    ):
        layout.check(("xipos",))
    model = plain()
    with attach(model):
        assert np.isfinite(run(model, started(model), 10)).all()


# --- wherever MuJoCo takes a model ----------------------------------------------------------------


def expected_run(steps=100):
    model = plugged()
    return run(model, started(model), steps)


def test_copies_of_model_and_data_behave_as_the_first():
    model = plugged()
    expected = expected_run()
    for other in (copy.copy(model), copy.deepcopy(model)):
        np.testing.assert_array_equal(run(other, started(other), 100), expected)
    data = started(model)
    run(model, data, 50)
    for other in (copy.copy(data), pickle.loads(pickle.dumps(data))):
        np.testing.assert_array_equal(run(model, other, 50), expected)
    del model
    gc.collect()
    np.testing.assert_array_equal(run(plugged(), data, 50), expected)
    mujoco.mj_resetData(plugged(), data)
    assert not data.qfrc_passive.any()


def test_a_model_round_trips_through_xml_and_recompiles():
    spec = mujoco.MjSpec.from_string(
        xml(stone_xml(instance="lake"), instances={"lake": {"density": 900}})
    )
    model = spec.compile()
    again = mujoco.MjModel.from_xml_string(spec.to_xml())
    assert plugin_water(again, 1) == Water(density=900.0)
    expected = run(model, started(model), 100)
    # XML carries fewer digits than doubles have
    np.testing.assert_allclose(run(again, started(again), 100), expected, rtol=1e-4, atol=1e-6)
    data = started(model)
    run(model, data, 50)
    spec.worldbody.add_site(name="mark")
    model, data = spec.recompile(model, data)
    np.testing.assert_array_equal(run(model, data, 50), expected)


def test_models_attached_with_prefixes_bring_their_water():
    configs = {"a_": {"density": 700}, "b_": {"law": "bocquet2003"}}
    parent = mujoco.MjSpec.from_string(
        '<mujoco><option timestep=".0005" integrator="RK4"/></mujoco>'
    )
    for prefix, config in configs.items():
        child = mujoco.MjSpec.from_string(
            xml(stone_xml(instance="lake"), instances={"lake": config})
        )
        parent.attach(child, prefix=prefix, frame=parent.worldbody.add_frame())
    model = parent.compile()
    for prefix, config in configs.items():
        alone = plugged(config)
        index = model.body(f"{prefix}stone").id
        assert plugin_water(model, index) == plugin_water(alone, 1)
        data, expected = mujoco.MjData(model), started(alone)
        for k in range(2):
            data.qpos[7 * k : 7 * k + 7], data.qvel[6 * k : 6 * k + 6] = START
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(alone, expected)
        np.testing.assert_array_equal(
            data.qfrc_passive.reshape(2, 6)[index - 1], expected.qfrc_passive
        )


def test_altering_a_model_while_it_lives_alters_its_water():
    model, other = plugged(), plain()
    expected = expected_run(1)
    for m in (model, other):
        m.body_ipos[1] += 0.004, 0.0, 0.001
        m.mesh_vert[:] *= np.float32(1.1)
    here, there = started(other), started(model)
    with attach(other, here):
        mujoco.mj_forward(other, here)
    mujoco.mj_forward(model, there)
    np.testing.assert_allclose(there.qacc, here.qacc, rtol=1e-11, atol=1e-9)
    assert not np.array_equal(run(model, there, 1), expected)


def test_a_floating_stone_knows_the_gravity_of_its_model():
    model = plugged({"buoyancy": "true"})
    data = mujoco.MjData(model)
    data.qpos[2] = -1.0
    lifts = []
    for gravity in (-9.81, -1.62):
        model.opt.gravity[2] = gravity
        mujoco.mj_forward(model, data)
        lifts.append(data.qfrc_passive[2])
    volume = model.body_mass[1] / 2600.0
    # vertices of a compiled mesh have single precision
    np.testing.assert_allclose(lifts, [9810.0 * volume, 1620.0 * volume], rtol=1e-6)


def test_attach_refuses_a_body_that_has_its_water_already():
    with pytest.raises(SceneError, match="'stone' has its water from plugin"), attach(plugged()):
        pass


def test_mirror_images_are_not_taken_for_each_other():
    """A hash that forgets signs would give both the block of the first."""
    forces = []
    for sign in (1.0, -1.0):
        model = plugged()
        shape = np.array([1.0, sign, 1.0], np.float32)
        model.mesh_vert[:] *= shape
        if sign < 0.0:
            model.mesh_face[:] = model.mesh_face[:, ::-1]
        data = started(model)
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_passive.copy())
    assert not np.array_equal(*forces)


def altered(model, k):
    """A copy of the same sizes whose stone is another."""
    other = copy.copy(model)
    other.body_ipos[1, 0] += 1e-4 * k
    return other


def test_rollout_over_several_models_equals_one_by_one_to_the_last_bit():
    model = plugged(sensor='<plugin instance="lake"/>')
    models = [altered(model, k) for k in range(24)]
    start = full_state(model, started(model))
    workers = [mujoco.MjData(model) for _ in range(2)]
    with rollout.Rollout(nthread=2) as pool:
        states, sensed = pool.rollout(models, workers, np.tile(start, (24, 1)), nstep=60)
    for k, other in enumerate(models):
        data = mujoco.MjData(other)
        mujoco.mj_setState(other, data, start, FULL)
        np.testing.assert_array_equal(states[k, -1], run(other, data, 60))
        np.testing.assert_array_equal(sensed[k, -1], data.sensordata)
    assert len({row[-1, 1] for row in states}) == 24


def test_a_batch_of_256_on_two_threads_equals_one_by_one_to_the_last_bit():
    model = plugged()
    many = batch.Batch(model, 256, 2)
    qpos, qvel = many.bind("qpos"), many.bind("qvel")
    qpos[:] = START[0]
    qvel[:] = np.linspace(0.5, 1.5, 256)[:, None] * START[1]
    many.step(nstep=60)
    for k in range(256):
        data = started(model)
        data.qvel[:] = np.linspace(0.5, 1.5, 256)[k] * np.array(START[1])
        run(model, data, 60)
        np.testing.assert_array_equal(qpos[k], data.qpos)
        np.testing.assert_array_equal(qvel[k], data.qvel)


def test_a_batch_whose_stones_differ_knows_each():
    model = plugged()
    many = batch.Batch(model, 8, 2)
    many.expand("body_ipos")[:, 1, 0] = model.body_ipos[1, 0] + 1e-4 * np.arange(8)
    qpos, qvel = many.bind("qpos"), many.bind("qvel")
    qpos[:], qvel[:] = START
    many.step(nstep=60)
    for k in range(8):
        other = altered(model, 0)
        other.body_ipos[1, 0] = model.body_ipos[1, 0] + 1e-4 * k
        data = started(other)
        run(other, data, 60)
        np.testing.assert_array_equal(qpos[k], data.qpos)


def test_thousands_of_stones_are_found_again_and_those_nobody_uses_are_forgotten(monkeypatch):
    class Kept:
        def __init__(self, key):
            self.record, self.nbytes = np.full(15, float(key)), 20

    monkeypatch.setattr(plugin_module.Records, "KEPT_BYTES", 120 * 4000)
    root = plugin_module.kernels.root.copy()
    try:
        records = plugin_module.Records()
        monkeypatch.setattr(_table_kernels, "as_words", lambda _: records.table)
        look_up = _table_kernels.look_up_and_stamp.py_func
        keys = np.random.default_rng(1).integers(2, 2**62, 20_000).tolist()
        made = {}
        for number, key in enumerate(keys):
            made[key] = Kept(key)
            records.add(key, made[key])
            if number == 3999:
                for known, kept in made.items():
                    assert look_up(0, known, -1) == kept.record.ctypes.data
                assert look_up(0, 2**62 + 1, -1) == -1
            assert look_up(0, keys[number % 100], -1) == made[keys[number % 100]].record.ctypes.data
        assert set(keys[:100]) < set(records.made)  # looked up all the time
        assert keys[200] not in records.made
        assert look_up(0, keys[200], -1) == -1
        assert len(records.made) <= 2 * 4001
        assert records._bytes == 120 * len(records.made)
    finally:
        plugin_module.kernels.root[:] = root


def test_what_models_in_use_look_up_is_never_forgotten_however_much_it_is(monkeypatch):
    class Kept:
        nbytes = 20

        def __init__(self):
            self.record = np.zeros(15)

    monkeypatch.setattr(plugin_module.Records, "KEPT_BYTES", 120 * 50)
    root = plugin_module.kernels.root.copy()
    try:
        records = plugin_module.Records()
        monkeypatch.setattr(_table_kernels, "as_words", lambda _: records.table)
        look_up = _table_kernels.look_up_and_stamp.py_func
        for key in range(2, 502):  # ten times what is set aside, all of it in use
            records.add(key, Kept())
            assert all(look_up(0, known, -1) > 0 for known in range(2, key + 1))
    finally:
        plugin_module.kernels.root[:] = root


def test_models_that_are_freed_leave_no_more_than_what_is_set_aside(monkeypatch):
    monkeypatch.setattr(plugin_module.Records, "KEPT_BYTES", 2**17)
    root = plugin_module.kernels.root.copy()
    records = plugin_module.Records()
    monkeypatch.setattr(plugin_module, "_records", records)
    try:
        kept = mujoco.MjModel.from_xml_string(
            xml(stone_xml(instance="lake"), instances={"lake": {}})
        )
        data = mujoco.MjData(kept)
        (record,) = (k for k in records.made.values() if not isinstance(k, int))
        for number in range(60):
            water = {"density": 900 + number}
            text = xml(stone_xml(instance="lake"), instances={"lake": water})
            mujoco.mj_step(kept, data)
            model = mujoco.MjModel.from_xml_string(text)
            mujoco.mj_step(model, mujoco.MjData(model))
        assert record in records.made.values()
        assert records._bytes <= 2 * records.KEPT_BYTES + record.nbytes + 200
        assert sum(not isinstance(k, int) for k in records.made.values()) < 60
    finally:
        plugin_module.kernels.root[:] = root


@pytest.mark.filterwarnings("ignore:a copy of this model")
@pytest.mark.parametrize("seconds", [float(os.environ.get("MJSKIP_CHURN_SECONDS", "5"))])
def test_threads_that_make_copy_step_and_free_models_neither_mix_nor_grow(seconds):
    """MJSKIP_CHURN_SECONDS=25 for the long form."""
    kinds = ("plain", "plugged", "plugged other", "attached")
    texts = {
        "plain": xml(stone_xml()),
        "attached": xml(stone_xml()),
        "plugged": xml(stone_xml(instance="lake"), instances={"lake": {}}),
        "plugged other": xml(stone_xml(instance="lake"), instances={"lake": {"density": 500}}),
    }

    def once(kind):
        model = mujoco.MjModel.from_xml_string(texts[kind])
        model = copy.copy(model)
        data = started(model)
        if kind == "attached":
            with attach(model, data):
                return run(model, data, 40)
        run(model, data, 20)
        data = copy.copy(data)
        return run(model, data, 20)

    expected = {kind: once(kind) for kind in kinds}
    assert len({state[1] for state in expected.values()}) == 3  # attached equals plugged
    np.testing.assert_allclose(expected["attached"], expected["plugged"], rtol=0, atol=1e-11)
    until = time.monotonic() + seconds
    wrong, done, sizes = [], [], []

    def churn(offset):
        count = 0
        while (time.monotonic() < until or count <= 20) and not wrong:
            kind = kinds[(count + offset) % len(kinds)]
            try:
                if not np.array_equal(once(kind), expected[kind]):
                    wrong.append(f"{kind} differs after {count} rounds")
            except Exception as error:
                wrong.append(repr(error))
            count += 1
            if offset == 0 and count % 20 == 0:
                gc.collect()
                sizes.append(resident())
        done.append(count)

    threads = [threading.Thread(target=churn, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    settled, last = sizes[len(sizes) // 4], sizes[-1]
    assert last - settled < 20e6, f"{(last - settled) / 1e6:.1f} MB over {sum(done)} rounds"


def resident():
    """Memory of this process [bytes]."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


IDLE = {
    "world": (
        "<body name='a'><freejoint/><geom size='.1'/></body>{}",
        "'world' carries it, which does not move",
    ),
    "mocap": (
        "<body name='a' mocap='true'><geom size='.1'/>{}</body>",
        "'a' carries it, which does not move",
    ),
    "flags": ("<body><freejoint/><geom size='.1'/>{}</body>", "silences every passive force"),
}


@pytest.mark.parametrize("what", IDLE)
def test_an_instance_that_nothing_would_feel_is_refused(what):
    body, says = IDLE[what]
    flag = '<option><flag spring="disable" damper="disable"/></option>' if what == "flags" else ""
    text = (
        f'<mujoco>{flag}<extension><plugin plugin="mjskip.water"/></extension><worldbody>'
        + body.format('<plugin plugin="mjskip.water"/>')
        + "</worldbody></mujoco>"
    )
    register_plugin()
    with pytest.raises(ValueError, match=says):
        mujoco.MjModel.from_xml_string(text)
