"""Water inside MuJoCo: assigned at every evaluation, to the attached bodies alone, from any thread."""

import copy
import ctypes
import threading
import time
from collections import Counter

import mujoco
import numpy as np
import pytest
from mujoco import batch, rollout

from mjskip import Limits, Stone, Water, attach, integrate, load_scene
from mjskip.coupling._control_kernels import library
from mjskip.coupling.wet import body_stone
from mjskip.errors import DivergedError, MeshError, MjskipWarning, SceneError
from mjskip.rigid.attitude import difference, matrices
from mjskip.throws.throw import State

SLOT = ctypes.c_void_p.in_dll(library, "mjcb_control")
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
PEBBLE = Stone.pebble()
ENDLESS = Water(density=1e308, buoyancy=True)
"""So dense that its force is beyond floating point."""
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS

GEOMS = {
    "mesh": '<geom name="mesh" type="mesh" mesh="pebble" density="2600"/>',
    "box": '<geom name="box" type="box" size=".05 .04 .01" density="2000"/>',
    "sphere": '<geom name="sphere" type="sphere" size=".03" density="2000"/>',
    "ellipsoid": '<geom name="ellipsoid" type="ellipsoid" size=".05 .04 .01" density="2000"/>',
    "cylinder": '<geom name="cylinder" type="cylinder" size=".05 .008" density="2000"/>',
    "capsule": '<geom name="capsule" type="capsule" size=".02 .03" density="2000"/>',
}
OFF_CENTRE = """<geom name="plate" type="box" size=".06 .04 .005" density="2000"/>
    <geom name="knob" type="box" size=".02 .01 .008" pos=".04 .01 .015" euler="10 20 30"
      density="4000"/>"""


def numbers(values):
    return " ".join(f"{v!r}" for v in np.ravel(values).tolist())


def world(*bodies, integrator="RK4", flags="", others=""):
    """A model with free bodies s0, s1, ... of these geoms and one bystander, 'float'."""
    free = "".join(
        f'<body name="s{k}" pos="0 {0.5 * k} .05"><freejoint/>{geoms}</body>'
        for k, geoms in enumerate(bodies)
    )
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep=".0005" integrator="{integrator}">{flags}</option>
      <asset><mesh name="pebble" inertia="exact" vertex="{numbers(PEBBLE.vertices)}"
             face="{numbers(PEBBLE.faces)}"/>
        <mesh name="tent" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1" face="0 2 1  0 1 3  0 3 2"
             inertia="shell"/></asset>
      <worldbody>{free}
        <body name="hinged" pos="0 -1 0"><joint name="hinge" axis="0 1 0"/>
          <geom name="vane" type="box" pos=".1 0 0" size=".05 .05 .005"/></body>
        <body name="float" pos="0 -2 0"><freejoint/><geom name="f" size=".05"/></body>
        {others}
      </worldbody></mujoco>""")


def thrown(model, seed=0, height=0.0):
    """Data with the bodies s0, s1, ... wet and moving at random."""
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        q, v = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        turn = np.array([1.0, 0, -0.17, 0]) + 0.1 * rng.normal(size=4)
        data.qpos[q + 2] = height + 0.01 * rng.random()
        data.qpos[q + 3 : q + 7] = turn / np.linalg.norm(turn)
        data.qvel[v : v + 6] = [5, 0.1, -1, 0.5, 0.5, 100] + 0.1 * rng.normal(size=6)
    return data


def stones_of(model):
    return [f"s{k}" for k in range(model.nbody) if mujoco.mj_name2id(model, 1, f"s{k}") > 0]


def assert_xfrc_is(data, body, found):
    scale = np.abs(found.force).max() + 1e-12
    force, torque = found.force + found.air_force, found.torque + found.air_torque
    # MuJoCo's rotation matrix and ours round differently; arms are centimetres
    np.testing.assert_allclose(data.xfrc_applied[body, :3], force, atol=1e-11 * scale)
    np.testing.assert_allclose(data.xfrc_applied[body, 3:], torque, atol=1e-11 * scale)


# --- the right force, at the right moment ----------------------------------------------------------


@pytest.mark.parametrize("kind", GEOMS)
@pytest.mark.parametrize("native", [True, False])
def test_what_is_applied_is_the_wrench_of_the_pose(kind, native):
    model = world(GEOMS[kind])
    data = thrown(model)
    with attach(model, data, bodies=["s0"], native=native) as water:
        mujoco.mj_forward(model, data)
        body = model.body("s0").id
        found = water.wrench(data, body)
        assert np.linalg.norm(found.force) > 0.01
        assert_xfrc_is(data, body, found)


@pytest.mark.parametrize("kind", GEOMS)
def test_a_primitive_keeps_the_volume_that_its_mass_says(kind):
    model = world(GEOMS[kind])
    stone = body_stone(model, model.body("s0").id)
    a, b, c = np.moveaxis(stone.triangles, 1, 0)
    volume = np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6.0
    density = 2600.0 if kind == "mesh" else 2000.0
    # MuJoCo keeps meshes in single precision
    mass = model.body_mass[model.body("s0").id]
    assert density * volume == pytest.approx(mass, rel=1e-6)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_every_integrator_follows_the_pure_one_to_its_order(integrator):
    """A body whose centre of mass and principal axes are off its frame, through 20 ms of water."""
    model = world(OFF_CENTRE, integrator=integrator)
    body = model.body("s0").id
    stone = body_stone(model, body)
    gap = {}
    for step in (2e-4, 1e-4):
        model.opt.timestep = step
        data = thrown(model, seed=4, height=0.02)
        mujoco.mj_forward(model, data)
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        start = State(
            position=data.xipos[body].copy(), q=data.xquat[body].copy(),
            velocity=velocity[3:].copy(), omega=velocity[:3].copy(),
        )  # fmt: skip
        same = (
            integrator == "RK4"
        )  # its fourth order is lost at kinks of the force, and alike in both
        finer = step if same else 1e-5
        exact = integrate(stone, start, timestep=finer, limits=Limits(duration=0.02))
        assert exact.contacts
        with attach(model, data, bodies=["s0"]):
            for _ in range(round(0.02 / step)):
                mujoco.mj_step(model, data)
            mujoco.mj_forward(model, data)
        gap[step] = (
            np.linalg.norm(data.xipos[body] - exact.position[-1]),
            float(difference(data.xquat[body], exact.q[-1])),
        )
    position, attitude = gap[1e-4]
    if integrator == "RK4":
        assert position < 1e-8
        assert attitude < 1e-6
    else:
        # first order: some 1e-3 m/s^2 dt T, halving with the step
        assert position < 2e-3
        assert gap[2e-4][0] / position == pytest.approx(2.0, abs=0.3)
        assert gap[2e-4][1] / attitude == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_native_callback_and_the_python_one_agree_to_rounding(integrator):
    model = world(OFF_CENTRE, GEOMS["cylinder"], integrator=integrator)
    ends = []
    for native in (True, False):
        data = thrown(model, height=0.01)
        with attach(model, data, bodies=["s0", "s1"], native=native):
            for _ in range(40):
                mujoco.mj_step(model, data)
        ends.append(np.concatenate([data.qpos, data.qvel]))
    # rounding, grown through 20 ms of touch
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9, atol=1e-9)


def test_the_force_acts_at_every_sub_stage_of_rk4():
    """Held over a step it would be first order: the last digits of the path would not be there."""
    model = world(GEOMS["mesh"])
    calls = Counter()
    bystander = control_counter(calls)
    SLOT.value = ctypes.cast(bystander, ctypes.c_void_p).value
    try:
        data = thrown(model)
        with attach(model, data, bodies=["s0"]):
            mujoco.mj_step(model, data)
            assert calls["all"] == 4
    finally:
        SLOT.value = None


def test_the_wrench_is_assigned_not_added():
    model = world(GEOMS["mesh"])
    data = thrown(model)
    with attach(model, data, bodies=["s0"]):
        for _ in range(3):
            mujoco.mj_forward(model, data)
            first = data.xfrc_applied.copy()
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(data.xfrc_applied, first)


def test_several_bodies_feel_their_own_water():
    model = world(GEOMS["mesh"], GEOMS["box"], OFF_CENTRE)
    data = thrown(model)
    with attach(model, data, bodies=["s2", "s0", "s1"]) as water:
        mujoco.mj_forward(model, data)
        for name in stones_of(model):
            body = model.body(name).id
            assert np.linalg.norm(data.xfrc_applied[body, :3]) > 0.1
            assert_xfrc_is(data, body, water.wrench(data, body))


def test_all_free_bodies_are_attached_unless_some_are_named():
    model = world(GEOMS["mesh"], GEOMS["box"])
    with attach(model) as water:
        assert {model.body(b).name for b in water.bodies} == {"s0", "s1", "float"}
    with attach(model, bodies=["s1"]) as water:
        assert [model.body(b).name for b in water.bodies] == ["s1"]


def test_a_hinged_body_can_be_attached_by_name():
    model = world(GEOMS["mesh"])
    data = mujoco.MjData(model)
    data.qvel[model.joint("hinge").dofadr[0]] = 30.0
    with attach(model, data, bodies=["hinged"]) as water:
        mujoco.mj_forward(model, data)
        body = model.body("hinged").id
        assert np.linalg.norm(data.xfrc_applied[body, :3]) > 0.1
        assert_xfrc_is(data, body, water.wrench(data, body))


def test_water_acts_on_chosen_geoms_alone():
    model = world(OFF_CENTRE)
    body = model.body("s0").id
    areas = {}
    for geoms in (None, ["plate"], ["knob"]):
        data = thrown(model, height=-1.0)
        with attach(model, data, bodies=["s0"], geoms=geoms) as water:
            mujoco.mj_forward(model, data)
            areas[str(geoms)] = water.wrench(data, body).wetted_area
    assert areas["None"] < areas["['plate']"] + areas["['knob']"]  # the knob stands in the plate
    assert areas["['plate']"] == pytest.approx(
        4 * (2 * 0.06 * 0.04 + 2 * 0.06 * 0.005 + 2 * 0.04 * 0.005)
    )


def test_a_body_is_placed_by_its_centre_of_mass_and_axes():
    model = world(OFF_CENTRE)
    body = model.body("s0").id
    stone = body_stone(model, body)
    assert np.linalg.norm(model.body_ipos[body]) > 1e-3
    axes = matrices(model.body_iquat[body])
    np.testing.assert_allclose(
        axes.T @ stone.inertia @ axes, np.diag(model.body_inertia[body]), atol=1e-15
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name in ("plate", "knob"):
        geom = data.geom(name)
        corner = geom.xpos + geom.xmat.reshape(3, 3) @ model.geom(name).size - data.xipos[body]
        assert np.linalg.norm(stone.vertices - corner, axis=1).min() < 1e-12


# --- strangers, and what was here before -----------------------------------------------------------


def control_counter(calls):
    @ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    def count(model, data):
        calls["all"] += 1
        calls[model] += 1

    return count


def test_other_models_and_other_bodies_are_left_alone():
    model = world(GEOMS["mesh"], GEOMS["box"])
    stranger = copy.copy(model)
    data, other = thrown(model), thrown(stranger)
    push = np.arange(6.0)
    data.xfrc_applied[model.body("s1").id] = push
    other.xfrc_applied[:] = push
    with attach(model, data, bodies=["s0"]):
        mujoco.mj_step(model, data)
        mujoco.mj_step(stranger, other)
    np.testing.assert_array_equal(data.xfrc_applied[model.body("s1").id], push)
    np.testing.assert_array_equal(other.xfrc_applied, np.tile(push, (model.nbody, 1)))


@pytest.mark.parametrize("native", [True, False])
def test_applied_forces_are_put_back(native):
    model = world(GEOMS["mesh"])
    data = thrown(model)
    before = np.random.default_rng(0).normal(size=data.xfrc_applied.shape)
    data.xfrc_applied[:] = before
    with attach(model, data, bodies=["s0"], native=native):
        mujoco.mj_step(model, data)
        assert (data.xfrc_applied[model.body("s0").id] != before[model.body("s0").id]).all()
    np.testing.assert_array_equal(data.xfrc_applied, before)
    assert SLOT.value is None


@pytest.mark.parametrize("native", [True, False])
def test_a_c_callback_that_was_here_is_called_and_comes_back(native):
    model, calls = world(GEOMS["mesh"]), Counter()
    before = control_counter(calls)
    SLOT.value = address = ctypes.cast(before, ctypes.c_void_p).value
    try:
        data = thrown(model)
        with attach(model, data, bodies=["s0"], native=native) as water:
            mujoco.mj_forward(model, data)
            assert calls[model._address] == 1
            assert_xfrc_is(data, model.body("s0").id, water.wrench(data, model.body("s0").id))
        assert SLOT.value == address
        mujoco.mj_forward(model, data)
        assert calls[model._address] == 2
    finally:
        SLOT.value = None


@pytest.mark.parametrize("native", [True, False])
def test_a_python_callback_that_was_here_is_called_and_comes_back(native):
    model, seen = world(GEOMS["mesh"]), []

    def before(model, data):
        seen.append(data.time)

    mujoco.set_mjcb_control(before)
    try:
        data = thrown(model)
        with attach(model, data, bodies=["s0"], native=native):
            mujoco.mj_forward(model, data)
            assert len(seen) == 1
            assert data.xfrc_applied[model.body("s0").id].any()
        mujoco.mj_forward(model, data)
        assert len(seen) == 2
        assert mujoco.get_mjcb_control() is before
    finally:
        mujoco.set_mjcb_control(None)


@pytest.mark.parametrize("outer", [True, False])
@pytest.mark.parametrize("inner", [True, False])
def test_attachments_nest(outer, inner):
    first, second = world(GEOMS["mesh"]), world(GEOMS["box"])
    a, b = thrown(first), thrown(second)
    with attach(first, a, bodies=["s0"], native=outer):
        mujoco.mj_forward(first, a)
        alone = a.xfrc_applied.copy()
        with attach(second, b, bodies=["s0"], native=inner):
            mujoco.mj_forward(first, a)
            mujoco.mj_forward(second, b)
            np.testing.assert_array_equal(a.xfrc_applied, alone)
            assert b.xfrc_applied[second.body("s0").id].any()
        a.xfrc_applied[:] = 0.0
        mujoco.mj_forward(first, a)
        np.testing.assert_array_equal(a.xfrc_applied, alone)
        b.xfrc_applied[:] = 7.0
        mujoco.mj_forward(second, b)
        assert (b.xfrc_applied == 7.0).all()
    assert SLOT.value is None


def test_attachments_may_end_in_any_order():
    first, second = world(GEOMS["mesh"]), world(GEOMS["box"])
    a, b = thrown(first), thrown(second)
    one, two = attach(first, a, bodies=["s0"]), attach(second, b, bodies=["s0"])
    one.__enter__()
    two.__enter__()
    one.__exit__(None, None, None)
    mujoco.mj_forward(second, b)
    assert b.xfrc_applied[second.body("s0").id].any()
    mujoco.mj_forward(first, a)
    assert not a.xfrc_applied.any()
    two.__exit__(None, None, None)
    assert SLOT.value is None


@pytest.mark.parametrize("native", [True, False])
def test_everything_is_put_back_after_an_error(native):
    model = world(GEOMS["mesh"])
    data = thrown(model)
    with pytest.raises(KeyError), attach(model, data, bodies=["s0"], native=native):  # noqa: PT012
        mujoco.mj_step(model, data)
        raise KeyError
    assert SLOT.value is None
    assert not data.xfrc_applied.any()


def test_models_can_be_compiled_and_copied_while_water_is_attached():
    model = world(GEOMS["mesh"])
    with attach(model, bodies=["s0"]):
        again = world(GEOMS["mesh"], GEOMS["box"])
        mujoco.mj_step(again, mujoco.MjData(again))
        twin = copy.deepcopy(model)
        data = thrown(twin)
        mujoco.mj_step(twin, data)
        assert not data.xfrc_applied.any()


# --- threads ---------------------------------------------------------------------------------------


def one_by_one(model, states, steps):
    """Full states after some steps of each start, on one thread."""
    ends, data = [], mujoco.MjData(model)
    for state in states:
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, state, FULL)
        for _ in range(steps):
            mujoco.mj_step(model, data)
        end = np.empty(mujoco.mj_stateSize(model, FULL))
        mujoco.mj_getState(model, data, end, FULL)
        ends.append(end)
    return np.array(ends)


def starts(model, count, height=0.01):
    rows = []
    for seed in range(count):
        row = np.empty(mujoco.mj_stateSize(model, FULL))
        mujoco.mj_getState(model, thrown(model, seed, height), row, FULL)
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_rollout_with_threads_is_one_by_one_stepping_to_the_last_bit(integrator):
    model = world(GEOMS["mesh"], OFF_CENTRE, integrator=integrator)
    states = starts(model, 24)
    with attach(model, bodies=["s0", "s1"]):
        expected = one_by_one(model, states, 60)
        threads = [mujoco.MjData(model) for _ in range(4)]
        for _ in range(2):  # nothing leaks from one rollout into the next
            ends, _ = rollout.rollout(model, threads, states, nstep=60)
            np.testing.assert_array_equal(ends[:, -1], expected)
    dry = one_by_one(model, states, 60)
    assert (np.abs(dry - expected).max(axis=1) > 1e-3).all()  # water did act


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
@pytest.mark.parametrize("persistent", [False, True])
def test_a_batch_on_the_callers_model_is_one_by_one_stepping_to_the_last_bit(
    integrator, persistent
):
    model = world(GEOMS["mesh"], OFF_CENTRE, integrator=integrator)
    states = starts(model, 12)
    with attach(model, bodies=["s0", "s1"]):
        expected = one_by_one(model, states, 60)
        runs = batch.Batch(model, nsim=12, nthread=4, persistent=persistent)
        runs.set_models(model)
        probe = mujoco.MjData(model)
        for k, state in enumerate(states):
            mujoco.mj_setState(model, probe, state, FULL)
            runs.qpos[k], runs.qvel[k] = probe.qpos, probe.qvel
        runs.step(nstep=60)
        for k, end in enumerate(expected):
            mujoco.mj_setState(model, probe, end, FULL)
            np.testing.assert_array_equal(runs.qpos[k], probe.qpos)
            np.testing.assert_array_equal(runs.qvel[k], probe.qvel)


def test_models_come_and_go_in_threads():
    """For two seconds, threads attach, step, detach and compile; every run is what it is alone."""
    kinds = list(GEOMS)
    expected = {}
    for kind in kinds:
        model = world(GEOMS[kind])
        with attach(model, bodies=["s0"]):
            expected[kind] = one_by_one(model, starts(model, 1), 20)
    failures, rounds = [], Counter()
    until = time.monotonic() + 2.0

    def churn(which):
        try:
            while time.monotonic() < until:
                kind = kinds[(which + rounds[which]) % len(kinds)]
                model = world(GEOMS[kind])
                with attach(model, bodies=["s0"]):
                    ends = one_by_one(model, starts(model, 1), 20)
                np.testing.assert_array_equal(ends, expected[kind])
                rounds[which] += 1
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=churn, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert min(rounds[k] for k in range(4)) > 2
    assert SLOT.value is None


# --- divergence and refusals -----------------------------------------------------------------------


@pytest.mark.parametrize("native", [True, False])
def test_a_force_that_is_not_finite_is_reported_with_body_and_time(native):
    model = world(GEOMS["box"], GEOMS["mesh"])
    data = thrown(model)
    data.time = 0.25
    with (  # noqa: PT012
        pytest.raises(DivergedError, match=r"body 's1' is not finite at t = 0\.25 s") as it,
        attach(model, data, bodies=["s1"], water=ENDLESS, native=native) as water,
    ):
        mujoco.mj_forward(model, data)
        assert not data.xfrc_applied.any()  # no poison for MuJoCo
        if native:
            assert data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0
        with pytest.raises(DivergedError):
            water.check()
        data.time = 0.5
        mujoco.mj_forward(model, data)  # the first one counts
    assert (it.value.body, it.value.time) == ("s1", 0.25)
    assert SLOT.value is None


def test_a_rollout_that_diverges_stops_and_is_reported():
    model = world(GEOMS["mesh"])
    states = starts(model, 4, height=-0.02)
    with pytest.raises(DivergedError), attach(model, bodies=["s0"], water=ENDLESS):  # noqa: PT012
        threads = [mujoco.MjData(model) for _ in range(2)]
        ends, _ = rollout.rollout(model, threads, states, nstep=10)
        assert (ends[:, -1, 0] < 10 * model.opt.timestep - 1e-9).all()


@pytest.fixture(autouse=True)
def _no_log_file(tmp_path, monkeypatch):
    """MuJoCo writes its warnings to a file in the working directory."""
    monkeypatch.chdir(tmp_path)
    mujoco.set_mju_user_warning(lambda _: None)
    yield
    mujoco.set_mju_user_warning(None)


def test_a_model_that_silences_callbacks_is_refused():
    model = world(GEOMS["mesh"], flags='<flag actuation="disable"/>')
    with pytest.raises(SceneError, match=r'<flag actuation="disable"/>.*remove it'), attach(model):
        pass
    assert SLOT.value is None


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("second", [True, False])
def test_a_model_is_attached_once(first, second):
    model = world(GEOMS["mesh"])
    with attach(model, bodies=["s0"], native=first):
        with (
            pytest.raises(SceneError, match="attached already"),
            attach(model, bodies=["s0"], native=second),
        ):
            pass
        data = thrown(model)
        mujoco.mj_forward(model, data)
        assert data.xfrc_applied.any()
    assert SLOT.value is None


PLANE = '<geom name="floor" type="plane" size="1 1 1" pos="0 0 -9"/>'


def test_fixed_bodies_are_refused_by_name():
    others = (
        '<body name="ground"><geom name="floor" type="plane" size="1 1 1"/><geom size=".1"/></body>'
    )
    model = world(GEOMS["mesh"], others=others)
    with (
        pytest.raises(SceneError, match="body 'ground' is fixed to the world: water cannot move"),
        attach(model, bodies=["ground"]),
    ):
        pass


def test_an_open_mesh_is_its_convex_hull_with_one_warning_or_refused():
    model = world('<geom name="tent" type="mesh" mesh="tent" mass="1"/>')
    with (
        pytest.raises(MeshError, match="geom 'tent' of body 's0': the mesh is open"),
        attach(model, bodies=["s0"], strict=True),
    ):
        pass
    with pytest.warns(MjskipWarning, match="geom 'tent' of body 's0' is open") as told:
        coupling = attach(model, bodies=["s0"])
    coupling.close()
    assert len(told) == 1
    assert coupling.hulls[0].volume == pytest.approx(0.1**3 / 6.0)


def test_bodies_and_geoms_that_are_not_there_are_refused_with_those_that_are():
    model = world(GEOMS["mesh"], GEOMS["box"])
    with (
        pytest.raises(
            SceneError, match=r"no body named 'pebble': the free bodies .*: s0, s1, float"
        ),
        attach(model, bodies=["pebble"]),
    ):
        pass
    with (
        pytest.raises(SceneError, match="no geom 'h' on these bodies: their geoms are mesh"),
        attach(model, bodies=["s0"], geoms=["h"]),
    ):
        pass
    still = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"
    )
    with pytest.raises(SceneError, match="no free body"), attach(still):
        pass


def test_a_wrench_is_asked_for_by_name_or_id_of_an_attached_body():
    model = mujoco.MjModel.from_xml_path(str(load_scene("lake").path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with attach(model, data) as coupling:
        by_name = coupling.wrench(data, "stone")
        by_id = coupling.wrench(data, coupling.bodies[0])
        np.testing.assert_array_equal(by_name.force, by_id.force)
        with pytest.raises(SceneError, match="not attached: the water acts on 'stone'"):
            coupling.wrench(data, 0)
