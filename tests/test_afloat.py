"""Bodies that radiate inside MuJoCo: by attach and by the plugin."""

import json
import math
import pickle
import resource

import hulls
import mujoco
import mujoco.rollout
import numpy as np
import pytest
import xarray

import mjskip
from mjskip.cli import main
from mjskip.coupling.loading import load_model
from mjskip.coupling.plugin import plugin_surface, register_plugin
from mjskip.coupling.water_surface import model_surface
from mjskip.hydro.radiation import table_coefficients
from mjskip.hydro.seas import Sea
from mjskip.throws.scene import shipped_scenes
from mjskip.waves.recording import SurfaceFrames

SPHERE = '<body name="float"><freejoint/><geom type="sphere" size=".15" mass="7.0686"/>{}</body>'
BARGE = '<body name="barge"{}><freejoint/><geom name="deck" type="box" size=".5 .2 .1" mass="{}"/>{}</body>'
ON_DECK = '<body name="box" pos="{} 0 {}"><freejoint/><geom type="box" size=".05 .05 .03" mass="2"/></body>'
CARRIES = '<plugin instance="sea"/>'


def model(bodies, *, sea="", timestep=0.002, integrator="implicitfast", options="", plugged=True):
    register_plugin()
    words = f'<config key="sea" value="{sea}"/>' if sea else ""
    plugin = (
        '<extension><plugin plugin="mjskip.water"><instance name="sea"><config key="preset" value="floating"/>'
        f'<config key="radiation" value="true"/>{words}</instance></plugin></extension>'
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{timestep}" integrator="{integrator}" {options}/>{plugin if plugged else ""}'
        f"<worldbody>{bodies}</worldbody></mujoco>"
    )


def heaves(data_model, data, count):
    path = []
    for _ in range(count):
        mujoco.mj_step(data_model, data)
        path.append(data.qpos[2])
    return np.array(path)


def turning_points(path, timestep):
    """Times and values where a path turns."""
    slope = np.diff(path)
    at = np.flatnonzero(slope[1:] * slope[:-1] <= 0.0) + 1
    return (at + 1) * timestep, path[at]


def amplitude(path, omega, timestep):
    """Of the oscillation at omega in the last four periods."""
    count = round(4 * 2.0 * math.pi / omega / timestep)
    time = timestep * np.arange(count)
    tail = path[-count:] - path[-count:].mean()
    return 2.0 * abs(np.mean(tail * np.exp(1j * omega * time)))


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
@pytest.mark.parametrize("door", ["plugin", "attach"])
def test_a_sphere_bobs_as_cummins_equation_with_capytaines_coefficients(door, integrator):
    """Oracle: first trough -0.865 at 0.386 s, first peak 0.630 at 0.770 s."""
    compiled = model(
        SPHERE.format(CARRIES if door == "plugin" else ""),
        integrator=integrator,
        plugged=door == "plugin",
    )
    data = mujoco.MjData(compiled)
    data.qpos[2] = 0.03
    if door == "plugin":
        path = heaves(compiled, data, 450)
    else:
        with mjskip.attach(compiled, data, water=mjskip.Water.floating(radiation=True)):
            path = heaves(compiled, data, 450)
    times, values = turning_points(path / 0.03, 0.002)
    np.testing.assert_allclose(times[:2], [0.386, 0.770], rtol=0.02)
    np.testing.assert_allclose(values[:2], [-0.865, 0.630], rtol=0.05)


def test_a_shallow_disc_bobs_as_cummins_equation_with_capytaines_coefficients():
    """Oracle: first trough -0.733 at 0.299 s, first peak 0.336 at 0.601 s."""
    disc = f'<body><freejoint/><geom type="cylinder" size=".15 .04" mass="1.4137"/>{CARRIES}</body>'
    compiled = model(disc)
    rest = plugin_surface(compiled).rests[0].height
    data = mujoco.MjData(compiled)
    data.qpos[2] = rest + 0.01
    times, values = turning_points((heaves(compiled, data, 350) - rest) / 0.01, 0.002)
    np.testing.assert_allclose(times[:2], [0.299, 0.601], rtol=0.02)
    np.testing.assert_allclose(values[0], -0.733, rtol=0.05)
    np.testing.assert_allclose(values[1], 0.336, rtol=0.10)


@pytest.mark.parametrize("ka", [0.6, 1.0, 1.6])
def test_a_sphere_answers_regular_waves_as_in_capytaine(ka):
    """Heave over wave amplitude 1.174, 1.852, 0.383 (two_way.md's Capytaine numbers)."""
    known = {0.6: 1.174, 1.0: 1.852, 1.6: 0.383}[ka]
    omega = math.sqrt(9.81 * ka / 0.15)
    sea = f"height=0.004 period={2.0 * math.pi / omega}"
    compiled = model(SPHERE.format(CARRIES), sea=sea, timestep=0.004)
    data = mujoco.MjData(compiled)
    path = heaves(compiled, data, 3000)
    assert amplitude(path, omega, 0.004) / 0.002 == pytest.approx(known, rel=0.05)


def test_what_floats_at_rest_stays_at_rest():
    compiled = model(BARGE.format("", 40, CARRIES))
    data = mujoco.MjData(compiled)
    data.qpos[2] = plugin_surface(compiled).rests[0].height
    heaves(compiled, data, 2000)
    assert np.abs(data.qvel).max() < 1e-12
    assert np.abs(data.qpos[:2]).max() < 1e-12


@pytest.mark.parametrize("yaw", [0.9, 2.5])
def test_heading_and_place_do_not_matter(yaw):
    """The barge in waves from ahead, and the same turned and moved with the waves: one heave, one pitch."""

    def run(angle, place):
        pose = f' pos="{place} 0 0" euler="0 0 {math.degrees(angle)}"'
        compiled = model(
            BARGE.format(pose, 40, CARRIES),
            sea=f"height=0.02 period=1.2 direction={math.degrees(angle)}",
            timestep=0.005,
        )
        data = mujoco.MjData(compiled)
        path, tilt = [], []
        for _ in range(600):
            mujoco.mj_step(compiled, data)
            path.append(data.qpos[2])
            tilt.append(data.xmat[1].reshape(3, 3)[2, 0])
        return np.array(path), np.array(tilt)

    for one, other in zip(run(0.0, 0.0), run(yaw, 0.0), strict=True):
        np.testing.assert_allclose(other, one, atol=0.02 * np.abs(one).max())


def test_a_rollout_and_a_pickled_state_go_on_bit_for_bit():
    compiled = model(
        BARGE.format("", 40, CARRIES) + ON_DECK.format(0.1, 0.13), sea="hs=0.05 tp=1.5"
    )
    data = mujoco.MjData(compiled)
    heaves(compiled, data, 100)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros(mujoco.mj_stateSize(compiled, kind))
    mujoco.mj_getState(compiled, data, start, kind)
    found, _ = mujoco.rollout.rollout(
        compiled,
        mujoco.MjData(compiled),
        initial_state=start[None],
        nstep=200,
        initial_warmstart=data.qacc_warmstart.copy()[None],
    )
    copied = pickle.loads(pickle.dumps(data))
    for each in (data, copied):
        heaves(compiled, each, 200)
    end = np.zeros_like(start)
    mujoco.mj_getState(compiled, data, end, kind)
    np.testing.assert_array_equal(found[0, -1], end)
    np.testing.assert_array_equal(copied.qpos, data.qpos)


def test_added_mass_stands_in_mujocos_mass_matrix_once():
    compiled = model(BARGE.format(' euler="0 0 30"', 40, CARRIES))
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    added = plugin_surface(compiled).tables[0].added_mass
    assert data.qM[0] > 40.0 + 0.9 * min(added[0, 0], added[1, 1]) if hasattr(data, "qM") else True
    full = np.zeros((6, 6))
    mujoco.mj_fullM(compiled, data, full)
    assert full[2, 2] == pytest.approx(40.0 + added[2, 2])
    mujoco.mj_forwardSkip(compiled, data, mujoco.mjtStage.mjSTAGE_POS, 0)
    again = np.zeros((6, 6))
    mujoco.mj_fullM(compiled, data, again)
    np.testing.assert_array_equal(again, full)


def test_contacts_know_the_added_mass():
    """A box on a rocking deck: what the contacts give it is its mass times what it does, at two time steps."""
    pushes = []
    for timestep in (0.002, 0.001):
        compiled = model(
            BARGE.format("", 40, CARRIES) + ON_DECK.format(0.1, 0.13),
            sea="height=0.04 period=1.5",
            timestep=timestep,
        )
        data = mujoco.MjData(compiled)
        force, lift, speed = np.zeros(6), [], []
        for _ in range(round(4.0 / timestep)):
            mujoco.mj_step(compiled, data)
            speed.append(data.qvel[8])
            total = 0.0
            for c in range(data.ncon):
                mujoco.mj_contactForce(compiled, data, c, force)
                total += abs((data.contact[c].frame.reshape(3, 3).T @ force[:3])[2])
            lift.append(total)
        lift, speed = np.array(lift), np.array(speed)
        later = round(1.0 / timestep)
        rising = np.diff(speed)[later:] / timestep
        np.testing.assert_allclose(lift[later + 1 :], 2.0 * (9.81 + rising), rtol=0.02)
        pushes.append(lift[later :: round(0.004 / timestep)])
    assert np.abs(pushes[0] - pushes[1]).max() < 0.03 * 2.0 * 9.81


def test_two_hulls_that_touch_push_each_other_equally():
    pair = "".join(
        f'<body name="{name}" pos="{x} 0 0"><freejoint/><geom type="sphere" size=".15" mass="7.0686"/>{CARRIES}</body>'
        for name, x in (("a", -0.14), ("b", 0.14))
    )
    compiled = model(pair)
    data = mujoco.MjData(compiled)
    heaves(compiled, data, 1000)
    assert data.qpos[0] == pytest.approx(-data.qpos[7], rel=2e-3)
    assert data.qpos[7] > 0.145
    assert np.isfinite(data.qpos).all()


@pytest.mark.parametrize("mass", [4.0])
def test_added_mass_ten_times_the_body_is_stable(mass):
    """Tied to the last step's acceleration instead, such a body leaves the water within a few steps."""
    compiled = model(BARGE.format("", mass, CARRIES), integrator="Euler")
    rest = plugin_surface(compiled)
    assert rest.tables[0].added_mass[2, 2] > 10.0 * mass
    data = mujoco.MjData(compiled)
    data.qpos[2] = rest.rests[0].height + 0.01
    path = heaves(compiled, data, 2500) - rest.rests[0].height
    assert np.abs(path).max() < 0.0101
    assert np.abs(path[-300:]).max() < 1e-3


def test_two_bodies_feel_each_others_waves():
    """One is held down and let go; the other, 0.45 m away, begins to move when its waves arrive."""
    pair = "".join(
        f'<body name="{name}" pos="{x} 0 0"><joint type="slide" axis="0 0 1"/>'
        f'<geom type="sphere" size=".15" mass="7.0686"/>{CARRIES}</body>'
        for name, x in (("a", -hulls.APART / 2), ("b", hulls.APART / 2))
    )
    compiled = model(pair)
    data = mujoco.MjData(compiled)
    data.qpos[0] = 0.02
    other = []
    for _ in range(1500):
        mujoco.mj_step(compiled, data)
        other.append(data.qpos[1])
    assert 0.05 < np.abs(other).max() / 0.02 < 0.6
    assert np.abs(other[:50]).max() < 0.05 * np.abs(other).max()


def test_a_neutral_speck_follows_the_orbit():
    """A small sunk ball as heavy as its water goes where the water goes.

    To first order: the pressure of a linear wave leaves out -1/2 rho u^2, which holds it up in steep waves.
    """
    ball = f'<body pos="0 0 -.4"><freejoint/><geom type="sphere" size=".02" mass="{1000 * 4 / 3 * math.pi * 0.02**3}"/>{CARRIES}</body>'
    compiled = model(ball, sea="height=0.01 period=2", timestep=0.002)
    sea = Sea.regular(height=0.01, period=2.0)
    data = mujoco.MjData(compiled)
    data.qvel[:3] = sea.velocity([[0.0, 0.0, -0.4]], 0.0)[0]
    place, path, orbit = np.array([[0.0, 0.0, -0.4]]), [], []
    for n in range(1000):
        mujoco.mj_step(compiled, data)
        middle = place + 0.001 * sea.velocity(place, n * 0.002)
        place = place + 0.002 * sea.velocity(middle, (n + 0.5) * 0.002)
        path.append(data.qpos[:3].copy())
        orbit.append(place[0])
    path, orbit = np.array(path), np.array(orbit)
    assert np.abs(path - orbit).max() < 0.05 * np.ptp(orbit[:, 2])


def test_energy_in_is_energy_radiated_over_60_seconds():
    """A force shakes a sphere: its work is what the damping of frequency analysis takes, friction left out."""
    omega, timestep = 8.0, 0.005
    compiled = model(SPHERE.format(CARRIES), timestep=timestep)
    surface = plugin_surface(compiled)
    data = mujoco.MjData(compiled)
    work, path, speed = 0.0, [], []
    steps = round(60.0 / timestep)
    last = round(40 * 2.0 * math.pi / omega / timestep)
    for n in range(steps):
        data.xfrc_applied[1, 2] = 1.0 * math.sin(omega * data.time)
        before = data.qvel[2]
        force = data.xfrc_applied[1, 2]
        mujoco.mj_step(compiled, data)
        path.append(data.qpos[2])
        speed.append(data.qvel[2])
        if n >= steps - last:
            work += timestep * force * 0.5 * (before + data.qvel[2])
    tail = np.array(speed[-last:])
    time = timestep * np.arange(last)
    shaken = 2.0 * abs(np.mean(tail * np.exp(1j * omega * time)))
    _, damping = table_coefficients(surface.tables[0], omega)
    radiated = 0.5 * damping[0, 2, 2] * shaken**2 * last * timestep
    assert work == pytest.approx(radiated, rel=0.03)
    # what is left goes into skin friction: at most 1% of the work once that is counted
    friction = 0.5 * 1000.0 * 0.075 * tail**2 * np.abs(tail) * 2.0 * math.pi * 0.15**2
    assert abs(work - radiated) < 0.01 * work + timestep * friction.sum()


def test_what_sinks_is_said_to():
    with pytest.warns(
        mjskip.errors.MjskipWarning, match="it sinks, and has the added mass of where"
    ):
        model(
            '<body pos="0 0 -.4"><freejoint/><geom type="sphere" size=".02" mass=".1"/>'
            + CARRIES
            + "</body>"
        )


def test_a_current_carries_what_floats():
    compiled = model(SPHERE.format(CARRIES), sea="current=0.2 current_direction=90", timestep=0.005)
    data = mujoco.MjData(compiled)
    data.qvel[1] = 0.2
    heaves(compiled, data, 800)
    assert data.qpos[1] == pytest.approx(0.8, rel=1e-3)  # the air holds it back a little
    assert np.abs(data.qpos[[0, 2]]).max() < 1e-4


def test_the_surface_can_be_asked_for():
    compiled = model(SPHERE.format(""), plugged=False)
    data = mujoco.MjData(compiled)
    data.qpos[2] = 0.03
    with mjskip.attach(compiled, data, water=mjskip.Water.floating(radiation=True)) as coupling:
        heaves(compiled, data, 100)
        near = coupling.elevation(data, [[0.2, 0.0], [0.0, 0.2], [5.0, 0.0]])
        assert near[0] == pytest.approx(near[1], rel=0.05)
        assert abs(near[0]) > 1e-4
        assert near[2] == 0.0
        x, y = np.array([0.0, 0.2, 5.0]), np.array([-0.3, 0.0])
        points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        np.testing.assert_allclose(
            coupling.grid_elevation(data, x, y).ravel(),
            coupling.elevation(data, points),
            atol=1e-12,
        )
        assert coupling.wrench(data, "float").force[2] == pytest.approx(
            7.0686 * 9.81 + 7.0686 * data.qacc[2], rel=0.5
        )


@pytest.mark.parametrize(
    ("water", "sea", "match"),
    [
        ({}, "hs=1 tp=3", "sea is given and the water's radiation is off"),
        ({"radiation": True}, "hs=1", "says too little"),
        ({"radiation": True}, 3, "sea is 3: give a mjskip.Sea"),
    ],
)
def test_a_sea_that_cannot_act_is_refused_in_one_line(water, sea, match):
    compiled = model(SPHERE.format(""), plugged=False)
    with pytest.raises(ValueError, match=match):
        mjskip.attach(compiled, water=mjskip.Water.floating(**water), sea=sea)


def test_what_radiates_must_bear():
    with pytest.raises(ValueError, match="radiation is on and buoyancy is off"):
        mjskip.Water(radiation=True)


def test_the_plugin_refuses_a_sea_without_radiation():
    register_plugin()
    with pytest.raises(ValueError, match="sea is 'hs=1 tp=3' and radiation is off"):
        mujoco.MjModel.from_xml_string(
            '<mujoco><extension><plugin plugin="mjskip.water"><instance name="sea"><config key="sea" value="hs=1 tp=3"/>'
            f"</instance></plugin></extension><worldbody>{SPHERE.format(CARRIES)}</worldbody></mujoco>"
        )


def test_a_hull_that_lies_deeper_is_prepared_again():
    """A load at one end: draft and trim change, and the added mass in MuJoCo's matrix is that of the new pose."""
    load = '<body name="load" pos="0.25 0 0.16"><freejoint/><geom type="box" size=".06 .1 .05" mass="16" friction="2"/></body>'
    compiled = model(BARGE.format("", 40, CARRIES) + load, timestep=0.004)
    data = mujoco.MjData(compiled)
    before, after = np.zeros((12, 12)), np.zeros((12, 12))
    mujoco.mj_forward(compiled, data)
    mujoco.mj_fullM(compiled, data, before)
    heaves(compiled, data, 3000)
    mujoco.mj_forward(compiled, data)
    mujoco.mj_fullM(compiled, data, after)
    assert np.isfinite(data.qpos).all()
    assert after[0, 0] - 40.0 > 1.2 * (before[0, 0] - 40.0)  # surge: its ends are deeper
    copied = pickle.loads(pickle.dumps(data))
    for each in (data, copied):
        heaves(compiled, each, 20)
    np.testing.assert_array_equal(copied.qpos, data.qpos)


@pytest.mark.parametrize(
    ("set_motion", "match"),
    [
        (lambda data: data.qvel.__setitem__(0, 3.0), "it planes"),
        (lambda data: data.qvel.__setitem__(2, -2.5), "it slams"),
        (
            lambda data: data.qpos.__setitem__(slice(3, 7), [0.8, 0.6, 0.0, 0.0]),
            "degrees from that in which it floats",
        ),
    ],
)
def test_where_the_theory_ends_is_said_once(set_motion, match):
    compiled = model(BARGE.format("", 39.5 + len(match) / 100.0, CARRIES))
    data = mujoco.MjData(compiled)
    data.qpos[2] = plugin_surface(compiled).rests[0].height
    set_motion(data)
    with pytest.warns(mjskip.errors.MjskipWarning, match=match) as told:
        heaves(compiled, data, 5)
    assert len(told) == 1


def test_added_water_can_have_a_sea():
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{SPHERE.format('')}</worldbody></mujoco>")
    mjskip.add_water(spec, mjskip.Water.floating(radiation=True), sea="height=0.02 period=1.2")
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    heaves(compiled, data, 200)
    assert plugin_surface(compiled).sea.significant_height > 0.0
    assert data.sensordata[2] == pytest.approx(7.0686 * 9.81, rel=0.5)


SCENES = {"boat_in_swell": 0.6, "drone_deck": 0.4, "buoy": 0.8}
"""Shipped scenes, and how far above still water the body may come [m]."""


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_afloat_runs(name):
    compiled = load_model(shipped_scenes()[name])
    data = mujoco.MjData(compiled)
    path = heaves(compiled, data, 500)
    assert np.isfinite(path).all()
    assert np.abs(path).max() < SCENES[name]
    assert not data.warning.number.any()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_scene_afloat_runs_for_ten_minutes_in_flat_memory(name):
    compiled = load_model(shipped_scenes()[name])
    data = mujoco.MjData(compiled)
    heaves(compiled, data, 1000)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    highest = 0.0
    for _ in range(round(600.0 / compiled.opt.timestep)):
        mujoco.mj_step(compiled, data)
        highest = max(highest, abs(data.qpos[2]))
    assert np.isfinite(data.qpos).all()
    assert highest < SCENES[name]
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < memory + 200_000


def test_the_command_hydro_knows_its_bodies(tmp_path, capsys):
    file = tmp_path / "sphere.xml"
    file.write_text(f"<mujoco><worldbody>{SPHERE.format('')}</worldbody></mujoco>")
    with pytest.raises(SystemExit) as ended:
        main(["hydro", str(file), "--json", "--omega", "4:12:5", "--save", str(tmp_path / "a.nc")])
    assert ended.value.code == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dofs"] == ["Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"]
    assert len(found["omega"]) == 5
    heave = found["natural_period"][2]
    assert heave == pytest.approx(0.77, rel=0.02)  # of the decay's oracle
    assert found["infinite_added_mass"][2][2] == pytest.approx(0.5 * 7.0686, rel=0.02)
    saved = xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf")
    assert {"added_mass", "radiation_damping", "excitation_force", "diffraction_force"} <= set(
        saved
    )
    assert set(saved.excitation_force.dims) == {
        "complex",
        "omega",
        "wave_direction",
        "influenced_dof",
    }
    decay = np.array(found["decay"], dtype=float)[:, 2]
    assert np.nanmin(decay) == pytest.approx(-0.865, rel=0.05)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["--omega", "3"], "give LOW:HIGH:COUNT"),
        (["--omega", "3:1:5"], "give 0 < LOW < HIGH"),
        (["--save", "a.txt"], "such files end in .nc"),
        (["--depth", "-1"], "depth is -1.0"),
    ],
)
def test_the_command_hydro_refuses_in_one_line(words, match, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["hydro", "buoy", *words])
    assert ended.value.code == 2
    assert match in capsys.readouterr().err


def test_what_is_lifted_out_of_the_water_is_free_of_it():
    compiled = model(BARGE.format("", 40, CARRIES), sea="height=0.05 period=1.5")
    data = mujoco.MjData(compiled)
    data.qpos[2] = 1.0
    full = np.zeros((6, 6))
    mujoco.mj_forward(compiled, data)
    mujoco.mj_fullM(compiled, data, full)
    assert full[2, 2] == 40.0
    heaves(compiled, data, 100)
    np.testing.assert_allclose(data.qvel, [0.0, 0.0, -9.81 * 0.2, 0.0, 0.0, 0.0], atol=0.05)
    assert not plugin_state(compiled, data)[5:800].any()


def plugin_state(compiled, data):
    return data.plugin_state[int(compiled.plugin_stateadr[0]) :]


def test_a_sea_is_given_at_the_command_line(capsys):
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "run",
                "buoy",
                "--sea",
                "height=0.3 period=2",
                "--duration",
                "1",
                "--max-contact",
                "9",
                "--json",
            ]
        )
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["sim_seconds"] == pytest.approx(1.0)
    with pytest.raises(SystemExit) as ended:
        main(["run", "lake", "--sea", "height=0.3 period=2"])
    assert ended.value.code == 2
    assert "a sea acts on bodies that radiate" in capsys.readouterr().err


def test_a_run_of_what_floats_keeps_its_joints_and_the_sea_that_acts():
    scene = mjskip.load_scene("boat_in_swell")
    frames = SurfaceFrames(rate=10.0)
    run = mjskip.simulate(scene, limits=mjskip.Limits(duration=0.5), record=frames)
    assert run.qpos.shape == (len(run.time), scene.model.nq)
    np.testing.assert_allclose(run.surface.times[:6], np.arange(6) / 10.0, atol=1e-9)
    data = mujoco.MjData(scene.model)
    while data.time < 0.4 - 1e-9:
        mujoco.mj_step(scene.model, data)
    np.testing.assert_array_equal(run.qpos[round(0.4 / scene.model.opt.timestep)], data.qpos)
    surface = model_surface(scene.model, data)
    for x, y in ((0.0, 1.5), (-2.0, 0.0)):
        felt = surface.elevation(data, [[x, y]])[0]
        assert abs(felt) > 1e-3
        assert run.surface.at(0.4).sample(x, y).elevation[0] == pytest.approx(felt, abs=2e-3)
