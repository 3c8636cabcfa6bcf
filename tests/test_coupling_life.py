"""A coupling lives as users' objects do, and says when it would be silently wrong."""

import copy
import gc
import math
import pickle
import re
import subprocess
import sys
import weakref

import mujoco
import numpy as np
import pytest

import mjskip
from mjskip import Water, attach, register_plugin
from mjskip.coupling.attach import Coupling
from mjskip.coupling.bodies import free_bodies
from mjskip.coupling.callback import _attached, _slot
from mjskip.errors import CouplingError, MjskipWarning, SceneError
from mjskip.throws.scene import shipped_scenes

FLOATING = Water.floating()
RAFT = """<mujoco><option timestep=".002" integrator="{}"/><worldbody><body name="b" pos="0 0 .03"><freejoint/>
  <geom type="box" size=".5 .5 .1" density="500"/></body></worldbody></mujoco>"""


def raft(integrator="Euler"):
    model = mujoco.MjModel.from_xml_string(RAFT.format(integrator))
    return model, mujoco.MjData(model)


@pytest.fixture(autouse=True)
def _nothing_is_left():
    yield
    gc.collect()
    mujoco.set_mjcb_control(None)
    assert not [entry for entry, coupling in _attached.values() if coupling() is not None]


def test_it_acts_at_once_is_closed_entered_again_and_closed_twice():
    model, data = raft()
    coupling = attach(model, data, water=FLOATING)
    mujoco.mj_step(model, data)
    assert data.xfrc_applied[1, 2] > 0.0
    assert "acting" in repr(coupling)
    assert len(repr(coupling)) < 80
    coupling.close()
    coupling.close()
    assert "closed" in repr(coupling)
    assert not data.xfrc_applied.any()
    for _ in range(2):
        with coupling as again:
            assert again is coupling
            with coupling:  # inside itself
                mujoco.mj_step(model, data)
            assert coupling.is_open
            assert data.xfrc_applied[1, 2] > 0.0
        assert not coupling.is_open
    mujoco.mj_step(model, data)
    assert not data.xfrc_applied.any()


def test_an_expression_puts_a_model_into_water_for_as_long_as_the_model_lives():
    model, data = raft()
    attach(model, data, water=FLOATING)
    gc.collect()
    mujoco.mj_step(model, data, nstep=3000)
    assert data.qpos[2] == pytest.approx(0.0, abs=0.03)  # half the density: floats half immersed
    again = attach(model, data, water=FLOATING)  # takes the place of the one that was dropped
    with pytest.raises(SceneError, match="attached already"):
        attach(model, data, water=FLOATING)
    again.close()


def test_models_and_couplings_are_collected():
    model, data = raft()
    coupling = attach(model, data, water=FLOATING)
    seen = weakref.ref(model), weakref.ref(coupling)
    del model, data, coupling
    gc.collect()
    assert [each() for each in seen] == [None, None]
    assert not _attached
    assert _slot.value is None


QUICK = ("expression", "generator")
ENDS = {
    "kept": "c = mjskip.attach(m, d, water=mjskip.Water.floating()); mujoco.mj_step(m, d, 5)",
    "entered": "c = mjskip.attach(m, d, water=mjskip.Water.floating()); c.__enter__(); mujoco.mj_step(m, d, 5)",
    "expression": "mjskip.attach(m, d, water=mjskip.Water.floating()); mujoco.mj_step(m, d, 5)",
    "generator": """
def run():
    with mjskip.attach(m, d, water=mjskip.Water.floating()):
        yield
g = run(); next(g)""",
    "python": "c = mjskip.attach(m, d, water=mjskip.Water.floating(), native=False); mujoco.mj_step(m, d, 5)",
    "error kept": """
try:
    with mjskip.attach(m, d, water=mjskip.Water.floating()): raise KeyError
except KeyError as error: kept = error""",
}


@pytest.mark.parametrize(
    "how", [how if how in QUICK else pytest.param(how, marks=pytest.mark.slow) for how in ENDS]
)
def test_an_interpreter_that_ends_with_water_open_is_silent(how):
    begin = (
        f"import mujoco, mjskip\nm = mujoco.MjModel.from_xml_string('''{RAFT.format('Euler')}''')\n"
    )
    code = f"{begin}d = mujoco.MjData(m)\n{ENDS[how]}\n"
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("other", [None, lambda model, data: None])
def test_a_callback_put_in_its_place_is_noticed_everywhere(native, other):
    model, data = raft()
    coupling = attach(model, data, water=FLOATING, native=native)
    mujoco.mj_step(model, data)
    mujoco.set_mjcb_control(other)
    mujoco.mj_step(model, data)
    for act in (coupling.check, lambda: coupling.wrench(data, "b"), coupling.close):
        with pytest.raises(CouplingError, match=r"set_mjcb_control\(\) was called while"):
            act()
    assert mujoco.get_mjcb_control() is other
    assert not data.xfrc_applied.any()
    mujoco.set_mjcb_control(None)
    with coupling:  # and it can be entered again
        mujoco.mj_step(model, data)


def test_leaving_says_so_but_hides_no_other_error():
    model, data = raft()
    with pytest.raises(CouplingError), attach(model, data, water=FLOATING):
        mujoco.set_mjcb_control(None)
    with pytest.raises(KeyError), attach(model, data, water=FLOATING):  # noqa: PT012
        mujoco.set_mjcb_control(None)
        raise KeyError


@pytest.mark.parametrize("route", ["native", "python", "plugin"])
def test_gravity_is_followed_when_it_changes(route):
    model, data = raft()
    if route == "plugin":
        register_plugin()
        text = (
            RAFT.format("Euler")
            .replace(
                "<worldbody>", '<extension><plugin plugin="mjskip.water"/></extension><worldbody>'
            )
            .replace(
                "<freejoint/>",
                '<freejoint/><plugin plugin="mjskip.water"><config key="preset" value="floating"/></plugin>',
            )
        )
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
    coupling = (
        attach(model, data, water=FLOATING, native=route == "native") if route != "plugin" else None
    )
    data.qpos[2] = -1.0
    for gravity in (9.81, 1.62, 0.0, 24.8):
        model.opt.gravity[2] = -gravity
        mujoco.mj_forward(model, data)
        lift = data.qfrc_passive[2] if coupling is None else data.xfrc_applied[1, 2]
        assert lift == pytest.approx(1000.0 * 0.2 * gravity)
        if coupling is not None:
            assert coupling.wrench(data, "b").force[2] == pytest.approx(lift)
    if coupling is not None:
        coupling.close()


def test_data_of_another_model_are_refused_and_of_a_copy_taken():
    model, data = raft()
    coupling = attach(model, data, water=FLOATING)
    mujoco.mj_forward(model, data)
    twin = copy.deepcopy(data)  # with a copy of the model of its own
    assert coupling.wrench(twin, "b").force[2] == coupling.wrench(data, "b").force[2]
    other, strange = raft()
    other.geom_size[0] *= 2.0
    for act in (lambda: coupling.wrench(strange, "b"), lambda: coupling.hydrostatics(strange)):
        with pytest.raises(SceneError, match="belongs to another model"):
            act()
    with pytest.raises(SceneError, match="belongs to another model"):
        attach(model, strange)
    with pytest.raises(ValueError, match="data is 'pose'"):
        coupling.wrench("pose", "b")
    coupling.close()


@pytest.mark.parametrize("how", ["copied", "recompiled", "batch"])
def test_a_copy_that_is_stepped_without_water_is_said(how):
    spec = mujoco.MjSpec.from_string(RAFT.format("Euler"))
    model = spec.compile()
    data = mujoco.MjData(model)
    coupling = attach(model, data, water=FLOATING)
    if how == "copied":
        other = copy.copy(model)
        mujoco.mj_step(other, mujoco.MjData(other), nstep=20)
    elif how == "recompiled":
        mujoco.mj_step(model, data)
        other, after = spec.recompile(model, data)
        mujoco.mj_step(other, after, nstep=20)
    else:
        from mujoco import batch

        runs = batch.Batch(model, nsim=2, nthread=1)
        runs.step(nstep=20)
    with pytest.warns(MjskipWarning, match=r"a copy of this model.*stepped without water"):
        coupling.check()
    coupling.close()  # once is enough


@pytest.mark.parametrize("which", ["attached", "stepped"])
def test_a_model_that_was_pickled_is_a_copy_too(which):
    """Files keep no signature: sizes and names tell it."""
    one, _ = raft()
    other = pickle.loads(pickle.dumps(one))
    assert other.signature == 0
    attached, stepped = (other, one) if which == "attached" else (one, other)
    coupling = attach(attached, water=FLOATING)
    mujoco.mj_step(stepped, mujoco.MjData(stepped), nstep=20)
    with pytest.warns(MjskipWarning, match="a copy of this model"):
        coupling.close()


def test_a_model_of_another_kind_is_no_copy_though_neither_has_a_signature(recwarn):
    one = pickle.loads(pickle.dumps(raft()[0]))
    other = pickle.loads(pickle.dumps(mujoco.MjModel.from_xml_string(LEGGED)))
    coupling = attach(one, water=FLOATING)
    mujoco.mj_step(other, mujoco.MjData(other), nstep=20)
    coupling.close()
    assert not list(recwarn)


def test_actuation_that_is_disabled_meanwhile_is_noticed_and_the_water_acts_again():
    model, data = raft()
    coupling = attach(model, data, water=FLOATING)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    for ask in (coupling.check, lambda: coupling.wrench(data, "b"), coupling.close):
        with pytest.raises(CouplingError, match="silences callbacks"):
            ask()
    model.opt.disableflags = 0
    with coupling:
        mujoco.mj_step(model, data, nstep=1000)
    assert abs(data.qpos[2]) < 0.1


CHANGES = {
    "size": lambda m: m.geom_size.__setitem__((0, 0), 0.3),
    "place": lambda m: m.geom_pos.__setitem__((0, 2), 0.1),
    "centre of mass": lambda m: m.body_ipos.__setitem__((1, 0), 0.1),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=list(CHANGES))
def test_a_hull_that_is_changed_after_attach_is_said_once(change, recwarn):
    model, data = raft()
    coupling = attach(model, data, water=FLOATING)
    coupling.check()
    assert not list(recwarn)
    change(model)
    coupling.check()
    coupling.close()
    assert [str(w.message) for w in recwarn] == [
        "geoms or the centre of mass of body 'b' were changed after attach(), and the water acts on the hull that it "
        "had: close(), and attach() again"
    ]
    recwarn.clear()
    attach(model, data, water=FLOATING).close()
    assert not list(recwarn)


def test_a_mass_that_is_changed_after_attach_is_right(recwarn):
    model, data = raft()
    with attach(model, data, water=FLOATING):
        model.body_mass[1], model.body_inertia[1] = 70.0, 2.0 * model.body_inertia[1]
        mujoco.mj_setConst(model, data)
        mujoco.mj_step(model, data, nstep=20000)
    assert data.qpos[2] == pytest.approx(0.1 - 0.07, abs=1e-4)
    assert not list(recwarn)


@pytest.mark.parametrize("route", ["native", "python", "plugin"])
def test_without_gravity_nothing_is_borne(route):
    carries = '<plugin plugin="mjskip.water"><config key="preset" value="floating"/></plugin>'
    register_plugin()
    text = RAFT.format("Euler").replace(
        "</body>", (carries if route == "plugin" else "") + "</body>"
    )
    extension = '<mujoco><extension><plugin plugin="mjskip.water"/></extension>'
    model = mujoco.MjModel.from_xml_string(text.replace("<mujoco>", extension, 1))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_GRAVITY
    data = mujoco.MjData(model)
    if route == "plugin":
        mujoco.mj_step(model, data, nstep=500)
    else:
        with attach(model, data, water=FLOATING, native=route == "native") as coupling:
            mujoco.mj_step(model, data, nstep=500)
            assert coupling.wrench(data, "b").force[2] == 0.0
    assert data.qpos[2] == pytest.approx(0.03, abs=1e-12)


def test_gravity_that_is_tilted_is_said_at_once_and_when_it_becomes_so():
    model, data = raft()
    model.opt.gravity[0] = 1.0
    with pytest.warns(MjskipWarning, match=r"gravity is \(1, 0, -9.81\).*turn the model instead"):
        attach(model, data, water=FLOATING).close()
    model.opt.gravity[0] = 0.0
    coupling = attach(model, data, water=FLOATING)
    model.opt.gravity[:] = 0.0, 0.0, 9.81
    with pytest.warns(MjskipWarning, match=r"gravity is \(0, 0, 9.81\)"):
        coupling.close()


def test_compiling_the_same_model_while_attached_is_no_copy():
    model, data = raft("RK4")
    with attach(model, data, water=FLOATING):
        raft("RK4")
        mujoco.mj_step(model, data)
        raft("RK4")


BALL = """<mujoco><option timestep="{timestep}" integrator="{integrator}"/>{extension}<worldbody>
  <body name="ball" pos="0 0 1.02"><freejoint/>{plugin}<geom size=".02" mass=".0027"/></body></worldbody></mujoco>"""
PLUGIN = {
    "extension": '<extension><plugin plugin="mjskip.water"/></extension>',
    "plugin": '<plugin plugin="mjskip.water"><config key="preset" value="floating"/></plugin>',
}


def ball(timestep, integrator="Euler", *, plugin=False):
    told = PLUGIN if plugin else {"extension": "", "plugin": ""}
    return mujoco.MjModel.from_xml_string(
        BALL.format(timestep=timestep, integrator=integrator, **told)
    )


def rebound(model, data):
    """Height to which the ball comes once it has met the water."""
    top, wet = 0.0, False
    while data.time < 1.5:
        mujoco.mj_step(model, data)
        wet |= data.qpos[2] < 0.02
        top = max(top, data.qpos[2] - 0.02) if wet else 0.0
    return top


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize("gate", ["local", "centre"])
def test_a_light_ball_at_a_coarse_step_is_not_thrown_up_and_the_step_is_said(integrator, gate):
    model = ball(0.005, integrator)
    data = mujoco.MjData(model)
    coupling = attach(model, data, water=Water.floating(gate=gate))
    assert rebound(model, data) < 0.05
    with pytest.warns(
        MjskipWarning, match=r"time step 0\.005 s is too large for body 'ball'"
    ) as told:
        coupling.close()
    assert len(told) == 1
    needed = float(str(told[0].message).rsplit("at most ", 1)[1].split()[0])
    assert 1e-5 < needed < 0.005


def test_at_the_step_that_is_said_nothing_is_limited_nor_said(recwarn):
    fine = ball(0.005)
    data = mujoco.MjData(fine)
    coupling = attach(fine, data, water=FLOATING)
    rebound(fine, data)
    _, _, needed = coupling._entry.limited
    coupling._end()
    model = ball(0.5 * needed)
    data = mujoco.MjData(model)
    with attach(model, data, water=FLOATING):
        assert rebound(model, data) < 0.02
    assert not [w for w in recwarn if w.category is MjskipWarning]


def test_fast_light_bodies_lose_energy_at_any_step():
    for timestep in (0.001, 0.005, 0.02):
        model = ball(timestep)
        data = mujoco.MjData(model)
        data.qpos[2] = 0.0
        data.qvel[:] = [0.0, 0.0, -12.0, 30.0, -20.0, 10.0]
        coupling = attach(model, data, water=Water(gate="local", buoyancy=True))
        before = math.inf
        model.opt.gravity[:] = 0.0
        mujoco.mj_forward(model, data)
        for _ in range(20):
            mujoco.mj_energyVel(model, data)
            assert data.energy[1] <= before * (1.0 + 1e-12)
            before = float(data.energy[1])
            mujoco.mj_step(model, data)
        coupling._end()


def test_the_plugin_limits_and_says_the_same():
    register_plugin()
    model = ball(0.005, plugin=True)
    data = mujoco.MjData(model)
    with pytest.warns(MjskipWarning, match=r"time step 0\.005 s is too large for body 'ball'"):
        top = rebound(model, data)
    other = ball(0.005)
    twin = mujoco.MjData(other)
    coupling = attach(other, twin, water=FLOATING)
    assert rebound(other, twin) == pytest.approx(top, abs=1e-12)
    coupling._end()


def test_a_limited_force_ends_the_motion_along_it():
    """One step of a ball that would be turned round: what is left of its velocity is gravity's."""
    model = ball(0.02)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[2] = -1.0, -10.0
    coupling = attach(model, data, water=Water.floating(air_density=0.0))
    mujoco.mj_step(model, data)
    assert abs(data.qvel[2]) < 1e-9
    coupling._end()


# --- what floats -------------------------------------------------------------------------------------

LEGGED = """<mujoco><option timestep="5e-4" integrator="RK4"><flag contact="disable" energy="enable"/></option><worldbody>
  <body name="t"><freejoint/><geom type="box" size=".2 .1 .05" density="500"/>
  <body pos=".2 0 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".03" density="700"/></body>
  <body pos="-.2 0 0"><joint axis="1 0 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".03" density="700"/></body>
  </body></worldbody></mujoco>"""


def energy(model, data, coupling, roots):
    """Kinetic, of gravity and springs, and of the water that is displaced [J]."""
    mujoco.mj_forward(model, data)
    held = [coupling.hydrostatics(data, root) for root in roots]
    return data.energy.sum() - 9810.0 * sum(
        h.displaced_volume * h.centre_of_buoyancy[2] for h in held
    )


PASSIVE = ["duck", "boat", "buoy", "boat_in_swell", "drone_deck"]
"""Shipped scenes in which nothing drives what floats, but the sea of the last three."""


def without_plugin(scene):
    """A shipped scene without its plugin, and the hull's options; what is afloat is let go in still water."""
    file = mjskip.load_scene(scene).path if scene in ("duck", "boat") else shipped_scenes()[scene]
    text = re.sub(
        r"<extension>.*?</extension>|<plugin instance=\S*/>", "", file.read_text(), flags=re.S
    )
    assets = {str(f.relative_to(file.parent)): f.read_bytes() for f in file.parent.rglob("*.xml")}
    options = {"interior": "deck", "geoms": "planks"} if scene == "boat" else {}
    return mujoco.MjModel.from_xml_string(text, assets), options


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "what", [pytest.param(w, marks=pytest.mark.slow) for w in PASSIVE[1:]] + ["duck", "legs"]
)
def test_released_from_anywhere_energy_never_grows(what, seed):
    if what == "legs":
        model, options = mujoco.MjModel.from_xml_string(LEGGED), {}
    else:
        model, options = without_plugin(what)
        model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 5e-4
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    data.qpos[3:7] = rng.normal(size=4)
    data.qpos[2] = rng.uniform(-0.1, 0.3)
    data.qvel[:] = rng.normal(size=model.nv)
    mujoco.mj_normalizeQuat(model, data.qpos)
    roots = free_bodies(model)
    with attach(model, data, water=FLOATING, **options) as coupling:
        had = [energy(model, data, coupling, roots)]
        for _ in range(600):
            mujoco.mj_step(model, data, nstep=5)
            had.append(energy(model, data, coupling, roots))
    spent = np.ptp(had)
    assert np.diff(had).max() < 1e-9 * spent
    assert spent > 0.01


@pytest.mark.parametrize("scene", ["duck", "boat"])
def test_a_floating_scene_stays_where_it_is_for_a_minute(scene):
    stays_for_a_minute(mjskip.load_scene(scene).model, attached=scene == "duck")


@pytest.mark.slow
@pytest.mark.parametrize("scene", PASSIVE[2:])
def test_what_floats_in_a_sea_stays_where_it_is_when_the_sea_is_calm(scene):
    """By the plugin: its body radiates; the mooring of two is left out, the drone sinks."""
    register_plugin()
    spec = mujoco.MjSpec.from_file(str(shipped_scenes()[scene]))
    for plugin in spec.plugins:
        plugin.config = {k: v for k, v in plugin.config.items() if k != "sea"}
    for tendon in spec.tendons:
        spec.delete(tendon)
    stays_for_a_minute(spec.compile(), attached=False)


def stays_for_a_minute(model, *, attached):
    """A body at rest on still water neither drifts nor turns."""
    data = mujoco.MjData(model)
    at_rest = mjskip.float_at_rest(model, body=free_bodies(model)[0])
    assert at_rest.stable
    data.qpos[:7] = at_rest.qpos[:7]
    coupling = attach(model, data, water=FLOATING) if attached else None
    mujoco.mj_step(model, data, nstep=round(60.0 / model.opt.timestep))
    assert np.abs(data.qpos[:3] - at_rest.qpos[:3]).max() < 1e-3
    w, x, y, z = data.qpos[3:7]
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    assert abs(math.degrees(yaw)) < 0.1
    if coupling is not None:
        coupling.close()


@pytest.mark.parametrize("scene", ["duck", "boat", "quadruped_wading", "paddle"])
def test_scenes_that_float_are_run_and_not_thrown(scene, recwarn):
    loaded = mjskip.load_scene(scene)
    flight = mjskip.simulate(loaded, limits=mjskip.Limits(duration=2.0))
    assert flight.end in ("out of time", "at rest")
    assert np.isfinite(flight.position).all()
    assert np.abs(flight.velocity[0]).max() == 0.0
    assert not list(recwarn)
    with pytest.raises(ValueError, match="is afloat"):
        loaded.rethrow(speed=3.0)
    with pytest.raises(ValueError, match="engine must be 'mujoco'"):
        mjskip.simulate(loaded, engine="reference")


def test_oars_drive_a_boat_ahead_and_a_quadruped_walks_through_the_water():
    rowed = mjskip.simulate("paddle", limits=mjskip.Limits(duration=4.0))
    assert rowed.position[-1, 0] - rowed.position[0, 0] > 2.0
    assert abs(rowed.position[-1, 1]) < 0.01
    walked = mjskip.simulate("quadruped_wading", limits=mjskip.Limits(duration=4.0))
    assert walked.position[-1, 0] - walked.position[0, 0] > 0.15
    assert abs(walked.position[-1, 2] - walked.position[1000, 2]) < 0.02  # on its feet


def test_a_coupling_that_is_not_open_answers_too():
    model, data = raft()
    mujoco.mj_forward(model, data)
    coupling = Coupling(model, None, FLOATING)
    assert coupling.wrench(data, "b").force[2] == pytest.approx(9810.0 * 0.07)
