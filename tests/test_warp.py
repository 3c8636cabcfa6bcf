"""Water for MuJoCo Warp, on Warp's CPU device: the same forces as the engine plugin's, in single precision."""

from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import mjskip.envs
from mjskip import LAWS, Stone, Water, attach, register_plugin, wrench
from mjskip.errors import SceneError

wp = pytest.importorskip("warp")
import mjskip.warp  # noqa: E402

wp.config.quiet = True
wp.init()

STONE = """
<mujoco>
  <option timestep="0.0005" integrator="RK4"/>
  <extension><plugin plugin="mjskip.water"><instance name="w">{config}</instance></plugin></extension>
  <asset><mesh name="stone" inertia="exact" vertex="{vertex}" face="{face}"/></asset>
  <worldbody><body name="stone"><freejoint/><plugin instance="w"/>
    <geom type="mesh" mesh="stone" density="2600" contype="0" conaffinity="0"/></body></worldbody>
  <sensor><plugin name="water" instance="w"/></sensor>
</mujoco>"""


def text(values):
    return " ".join(f"{value:.9g}" for value in np.ravel(values))


def stone_model(**config):
    """The paper's pebble, with this water by the plugin."""
    register_plugin()
    pebble = Stone.pebble()
    keys = "".join(f'<config key="{key}" value="{value}"/>' for key, value in config.items())
    return mujoco.MjModel.from_xml_string(
        STONE.format(config=keys, vertex=text(pebble.vertices), face=text(pebble.faces))
    )


def quadruped():
    register_plugin()
    return mujoco.MjModel.from_xml_path(
        str(Path(mjskip.envs.__file__).parent / "assets" / "wade.xml")
    )


def states(model, count, height, seed=0, speed=5.0, spin=30.0):
    """Random poses about the surface and motions, exact in single precision (count, nq), (count, nv)."""
    rng = np.random.default_rng(seed)
    qpos = np.tile(model.qpos0, (count, 1))
    q = rng.normal(size=(count, 4))
    qpos[:, :3] = np.column_stack(
        [rng.uniform(-1, 1, (count, 2)), rng.uniform(-height, height, count)]
    )
    qpos[:, 3:7] = q / np.linalg.norm(q, axis=1, keepdims=True)
    qpos[:, 7:] += rng.uniform(-1, 1, (count, model.nq - 7))
    qvel = rng.normal(size=(count, model.nv)) * np.r_[[speed] * 3, [spin] * (model.nv - 3)]
    return qpos.astype(np.float32).astype(float), qvel.astype(np.float32).astype(float)


def passive(model, qpos, qvel):
    """qfrc_passive of MuJoCo and what Warp's kernels read, for every state."""
    data = mujoco.MjData(model)
    forces, seen = [], {name: [] for name in ("xpos", "xmat", "cvel", "subtree_com", "cdof")}
    for q, v in zip(qpos, qvel, strict=True):
        data.qpos, data.qvel = q, v
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_passive.copy())
        for name, values in seen.items():
            values.append(np.array(getattr(data, name)))
    return np.array(forces), {name: np.array(values) for name, values in seen.items()}


def warp_passive(model, seen, **options):
    """What the water's callback adds to qfrc_passive in these states, without compiling MuJoCo Warp."""
    kinds = {
        "xpos": wp.vec3, "xmat": wp.mat33, "cvel": wp.spatial_vector, "subtree_com": wp.vec3,
        "cdof": wp.spatial_vector,
    }  # fmt: skip
    m = SimpleNamespace(
        nv=model.nv,
        qpos0=wp.zeros(1, dtype=float, device="cpu"),
        callback=SimpleNamespace(passive=None),
        body_rootid=wp.array(model.body_rootid, dtype=int, device="cpu"),
        opt=SimpleNamespace(
            gravity=wp.array(
                model.opt.gravity[None].astype(np.float32), dtype=wp.vec3, device="cpu"
            )
        ),
    )
    water = mjskip.warp.attach(m, model, **options)
    count = len(seen["xpos"])
    d = SimpleNamespace(
        nworld=count,
        qfrc_passive=wp.zeros((count, model.nv), dtype=float, device="cpu"),
        **{
            name: wp.array(
                values.reshape(*values.shape[:2], -1).reshape(
                    *values.shape[:2], *((3, 3) if name == "xmat" else (values.shape[-1],))
                ).astype(np.float32),
                dtype=kinds[name],
                device="cpu",
            )
            for name, values in seen.items()
        },
    )  # fmt: skip
    m.callback.passive(m, d)
    return d.qfrc_passive.numpy(), water


def assert_close(found, expected, share=1e-5):
    """Within a share of the greatest entry of each row, or of the median row's where forces of faces cancel."""
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert np.mean(scale > 1e-3) > 0.3
    error = np.abs(found - expected) / np.maximum(scale, np.median(scale))
    assert error.max() < share


@pytest.mark.parametrize("quadrature", ["false", "true"])
@pytest.mark.parametrize("law", [name for name in LAWS if name != "none"])
@pytest.mark.parametrize("gate", ["centre", "local"])
def test_every_law_is_the_plugins(law, gate, quadrature):
    model = stone_model(law=law, gate=gate, quadrature=quadrature)
    bare = mjskip.warp.strip_plugin(model)
    qpos, qvel = states(model, 500, 0.05)
    with_water, seen = passive(model, qpos, qvel)
    found, _ = warp_passive(model, seen)
    assert_close(found, with_water - passive(bare, qpos, qvel)[0])


def test_what_bears_and_rubs_is_the_plugins():
    model = stone_model(buoyancy="true", skin_friction="true", gate="local", density=900)
    qpos, qvel = states(model, 500, 0.05, speed=0.3, spin=3.0)
    with_water, seen = passive(model, qpos, qvel)
    assert_close(warp_passive(model, seen)[0], with_water)


def test_a_law_integrated_over_faces_stands_beside_what_bears_and_rubs():
    model = stone_model(
        buoyancy="true", skin_friction="true", law="rosellini2005_forward", density=900
    )
    qpos, qvel = states(model, 500, 0.05, speed=0.5, spin=3.0)
    with_water, seen = passive(model, qpos, qvel)
    assert_close(warp_passive(model, seen)[0], with_water)


@pytest.mark.parametrize("law", ["rayleigh1876_forward", "birkhoff1944"])
def test_bodies_of_a_tree_have_laws_integrated_over_their_faces(law):
    register_plugin()
    spec = mujoco.MjSpec.from_file(str(Path(mjskip.envs.__file__).parent / "assets" / "wade.xml"))
    for plugin in spec.plugins:
        plugin.config = {**plugin.config, "law": law, "quadrature": "true"}
    model = spec.compile()
    qpos, qvel = states(model, 300, 0.3, speed=1.0, spin=3.0)
    with_water, seen = passive(model, qpos, qvel)
    without, _ = passive(mjskip.warp.strip_plugin(model), qpos, qvel)
    assert_close(warp_passive(model, seen)[0], with_water - without)


def test_bodies_of_a_tree_push_every_joint_above_them():
    model = quadruped()
    qpos, qvel = states(model, 300, 0.3, speed=1.0, spin=3.0)
    with_water, seen = passive(model, qpos, qvel)
    without, _ = passive(mjskip.warp.strip_plugin(model), qpos, qvel)
    found, water = warp_passive(model, seen)
    assert len(water.bodies) == 9
    assert_close(found, with_water - without)


def test_the_wrench_is_the_one_of_the_public_function():
    model, stone = stone_model(), Stone.pebble()
    qpos, qvel = states(model, 200, 0.03)
    _, seen = passive(model, qpos, qvel)
    _, water = warp_passive(model, seen)
    forces, torques = water.force.numpy()[:, 0], water.torque.numpy()[:, 0]
    expected = []
    for q, v, turn in zip(qpos, qvel, seen["xmat"][:, 1].reshape(-1, 3, 3), strict=True):
        one = wrench(stone, position=q[:3], q=q[3:], velocity=v[:3], omega=turn @ v[3:])
        expected.append([*(one.force + one.air_force), *(one.torque + one.air_torque)])
    expected = np.array(expected)
    # MuJoCo keeps meshes in single precision: 1e-7 of 5 cm, in depths of millimetres
    assert_close(forces, expected[:, :3])
    assert_close(torques, expected[:, 3:])


def test_given_water_and_bodies_come_before_the_plugins():
    model = stone_model(density=500)
    qpos, qvel = states(model, 50, 0.02)
    _, seen = passive(model, qpos, qvel)
    light = warp_passive(model, seen)[0]
    heavy = warp_passive(
        model, seen, water=Water(density=1000.0, air_density=0.0), bodies=["stone"]
    )[0]
    half = warp_passive(model, seen, water=Water(density=500.0, air_density=0.0))[0]
    np.testing.assert_allclose(heavy, 2.0 * half, rtol=1e-5, atol=1e-6)
    assert not np.allclose(light, heavy)


def test_detaching_brings_back_the_callback_that_was_there():
    calls = []
    model = stone_model()
    m = SimpleNamespace(
        qpos0=wp.zeros(1, dtype=float, device="cpu"),
        callback=SimpleNamespace(passive=lambda m, d: calls.append(1)),
    )
    before = m.callback.passive
    water = mjskip.warp.attach(m, model)
    assert m.callback.passive is water
    water.detach()
    assert m.callback.passive is before


def test_what_cannot_be_attached_is_named():
    model = stone_model()
    m = SimpleNamespace(
        qpos0=wp.zeros(1, dtype=float, device="cpu"), callback=SimpleNamespace(passive=None)
    )
    with pytest.raises(
        ValueError, match=r"warp_model is a MjModel: give what mujoco_warp.put_model"
    ):
        mjskip.warp.attach(model, model)
    with pytest.raises(ValueError, match=r"mujoco_model is 'lake': give a compiled mujoco.MjModel"):
        mjskip.warp.attach(m, "lake")
    with pytest.raises(SceneError, match="no body named 'duck'"):
        mjskip.warp.attach(m, model, bodies=["duck"])
    dry = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(SceneError, match="no free body"):
        mjskip.warp.attach(m, dry)
    with pytest.raises(ValueError, match=r"radiation is True: for Warp water is still"):
        mjskip.warp.attach(m, model, water=Water.floating(radiation=True))
    with pytest.raises(ValueError, match=r"added_mass is 1: for Warp leave it out"):
        mjskip.warp.attach(m, model, water=Water(law="rayleigh1876_forward", added_mass=1.0))


# what follows compiles MuJoCo Warp itself, for a minute or two


def worlds(model, qpos, qvel):
    """Warp's model with water and its data, in these states."""
    import mujoco_warp

    bare = mjskip.warp.strip_plugin(model)
    m, d = mujoco_warp.put_model(bare), mujoco_warp.make_data(bare, nworld=len(qpos))
    mjskip.warp.attach(m, model)
    d.qpos.assign(qpos.astype(np.float32))
    d.qvel.assign(qvel.astype(np.float32))
    return m, d


@pytest.mark.slow
def test_sixty_four_throws_fly_as_in_c_attach():
    import mujoco_warp

    rng = np.random.default_rng(0)
    plugged = stone_model()
    model = mujoco.MjModel.from_xml_string(
        STONE.format(config="", vertex=text(Stone.pebble().vertices), face=text(Stone.pebble().faces))
        .replace('<plugin instance="w"/>', "")
        .replace('<sensor><plugin name="water" instance="w"/></sensor>', "")
    )  # fmt: skip
    qpos, qvel = np.zeros((64, 7)), np.zeros((64, 6))
    for k in range(64):
        throw = mjskip.Throw.from_degrees(
            speed=rng.uniform(7, 12), attack=rng.uniform(15, 25), descent=rng.uniform(5, 15),
            spin=rng.uniform(10, 30), height=0.1,
        )  # fmt: skip
        start = throw.state(Stone.pebble())
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, start.q)
        qpos[k] = [*start.position, *start.q]
        qvel[k] = [*start.velocity, *(turn.reshape(3, 3).T @ start.omega)]
    m, d = worlds(plugged, qpos, qvel)
    for _ in range(2000):
        mujoco_warp.step(m, d)
    data, ends = mujoco.MjData(model), []
    with attach(model, data):
        for q, v in zip(qpos.astype(np.float32), qvel.astype(np.float32), strict=True):
            mujoco.mj_resetData(model, data)
            data.qpos, data.qvel = q, v
            mujoco.mj_step(model, data, 2000)
            ends.append(data.qpos[:3].copy())
    apart = np.linalg.norm(d.qpos.numpy()[:, :3] - ends, axis=1)
    print(
        f"64 throws apart after 1 s: median {1e3 * np.median(apart):.4f}, max {1e3 * apart.max():.4f} mm"
    )
    assert np.linalg.norm(np.ptp(ends, axis=0)) > 1.0
    assert apart.max() < 1e-4


BOX = """
<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <extension><plugin plugin="mjskip.water"><instance name="w">
    <config key="buoyancy" value="true"/><config key="skin_friction" value="true"/>
    <config key="gate" value="local"/></instance></plugin></extension>
  <worldbody><body name="b" pos="0 0 .03" euler="{euler}"><freejoint/><plugin instance="w"/>
    <geom type="box" size=".3 .2 .1" density="{density}" contype="0" conaffinity="0"/>{more}</body></worldbody>
</mujoco>"""


def resting(model, steps, *, warp):
    """Height, and vertical in body axes, after so many steps from the model's own pose."""
    qpos = np.array(model.key_qpos[0] if model.nkey else model.qpos0)
    qpos[:3] = [0.0, 0.0, qpos[2]]
    if warp:
        import mujoco_warp

        m, d = worlds(model, qpos[None], np.zeros((1, model.nv)))
        for _ in range(steps):
            mujoco_warp.step(m, d)
        qpos = d.qpos.numpy()[0].astype(float)
    else:
        data = mujoco.MjData(model)
        data.qpos = qpos
        mujoco.mj_step(model, data, steps)
        qpos = data.qpos
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, qpos[3:7] / np.linalg.norm(qpos[3:7]))
    return np.array([qpos[2], *turn.reshape(3, 3)[2]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("euler", "more"),
    [
        ("4 6 0", ""),
        # a load to one side: trim and heel
        ("0 0 0", '<geom type="box" size=".03 .03 .03" pos=".12 .07 .1" density="4000" contype="0" conaffinity="0"/>'),
    ],
    ids=["buoyant box", "tilted hull"],
)  # fmt: skip
def test_what_floats_has_the_same_draft_trim_and_heel_as_in_c(euler, more):
    register_plugin()
    model = mujoco.MjModel.from_xml_string(BOX.format(euler=euler, density=500, more=more))
    found, expected = resting(model, 4000, warp=True), resting(model, 4000, warp=False)
    np.testing.assert_allclose(found, expected, atol=2e-4)
    if more:
        assert np.abs(expected[1:3]).min() > 0.01


@pytest.mark.slow
def test_a_quadruped_of_primitives_floats_as_in_c():
    register_plugin()
    text = (Path(mjskip.envs.__file__).parent / "assets" / "wade.xml").read_text()
    # lighter than water, over no ground
    text = text.replace('mass="6"', 'mass="1.2"').replace('z=".34"', "").replace(
        'contype="2" conaffinity="1"', 'contype="0" conaffinity="0"'
    )  # fmt: skip
    text = text.replace('mass=".35"', 'mass=".12"').replace('mass=".15"', 'mass=".06"')
    model = mujoco.MjModel.from_xml_string(text)
    model.key_qpos[0, 2] = 0.05
    found, expected = resting(model, 2500, warp=True), resting(model, 2500, warp=False)
    np.testing.assert_allclose(found, expected, atol=1e-3)
