"""Hydrostatics against closed forms, and equilibria against volumes cut by manifold3d."""

import math

import manifold3d
import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import mjskip
from mjskip.hydro.hydrostatics import SinksError, float_at_rest, hydrostatics


def below(mesh, rotation, height):
    """Volume and centroid below z = 0 of a mesh turned and lifted, cut by manifold3d."""
    vertices = np.asarray(mesh.vertices) @ rotation.T + [0.0, 0.0, height]
    solid = manifold3d.Manifold(
        manifold3d.Mesh64(np.array(vertices), np.array(mesh.faces, np.uint64))
    )
    cut = solid.trim_by_plane((0.0, 0.0, -1.0), 0.0).to_mesh64()
    part = trimesh.Trimesh(
        np.array(cut.vert_properties)[:, :3], np.array(cut.tri_verts, np.int64), process=False
    )
    return float(part.volume), np.array(part.center_mass)


def test_a_floating_box_has_the_metacentric_heights_of_the_book():
    length, beam, depth, draft, rise = 4.0, 2.0, 1.0, 0.4, 0.1
    box = trimesh.creation.box((length, beam, depth)).triangles + np.array(
        [0, 0, 0.5 * depth - draft]
    )
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    found = hydrostatics(box @ turn.T, centre_of_mass=[0, 0, rise], heading=math.radians(30))
    volume = length * beam * draft
    assert found.displaced_volume == pytest.approx(volume)
    np.testing.assert_allclose(found.centre_of_buoyancy, [0, 0, -0.5 * draft], atol=1e-12)
    assert found.waterplane_area == pytest.approx(length * beam)
    assert found.wetted_area == pytest.approx(length * beam + 2 * draft * (length + beam))
    transverse = -0.5 * draft + beam**2 / (12 * draft) - rise
    longitudinal = -0.5 * draft + length**2 / (12 * draft) - rise
    assert found.metacentric_height == pytest.approx(transverse)
    assert found.longitudinal_metacentric_height == pytest.approx(longitudinal)


def test_what_is_dry_displaces_nothing():
    box = trimesh.creation.box((1, 1, 1)).triangles + np.array([0, 0, 2.0])
    found = hydrostatics(box, centre_of_mass=[0, 0, 2.0])
    assert found.displaced_volume == found.wetted_area == found.waterplane_area == 0.0


def random_hull(seed):
    """A closed hull about its centre of mass, its mass and its length."""
    rng = np.random.default_rng(seed)
    mesh = trimesh.convex.convex_hull(rng.normal(size=(25, 3)) * [1.0, 0.5, 0.3])
    mesh.apply_translation(
        -mesh.center_mass - rng.normal(size=3) * [0.05, 0.03, 0.02] + [0, 0, 0.08]
    )
    mass = 1000.0 * mesh.volume * rng.uniform(0.15, 0.85)
    return mesh, mass, float(np.ptp(mesh.vertices, axis=0).max())


@pytest.mark.parametrize("seed", range(30))
def test_random_hulls_float_in_balance_by_volumes_of_manifold3d(seed):
    mesh, mass, length = random_hull(seed)
    found = float_at_rest(mesh.triangles, mass=mass)
    volume, centre = below(mesh, found.rotation, found.centre_of_mass)
    assert volume == pytest.approx(mass / 1000.0, rel=1e-9)
    assert np.abs(centre[:2]).max() < 1e-6 * length  # buoyancy under gravity
    assert found.stable


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(n, marks=pytest.mark.slow) for n in range(4, 30))]
)
def test_draft_trim_and_heel_of_random_hulls_by_an_independent_search(seed):
    """The least of rho g V (z_G - z_B), by manifold3d and by Nelder and Mead."""
    mesh, mass, length = random_hull(seed)
    found = float_at_rest(mesh.triangles, mass=mass)
    draft, trim, heel = independent_equilibrium(mesh, mass, found)
    assert found.draft == pytest.approx(draft, abs=1e-4 * length)
    assert found.trim == pytest.approx(trim, abs=1e-4)
    assert found.heel == pytest.approx(heel, abs=1e-4)


def independent_equilibrium(mesh, mass, near):
    """Draft, trim and heel by minimising the energy that manifold3d's volumes have."""
    from scipy.optimize import brentq, minimize

    def turn_of(angles):
        heel, trim = angles
        return Rotation.from_euler("xy", [heel, -trim]).as_matrix()  # heel first, then the bow up

    def let_down(rotation):
        low = np.asarray(mesh.vertices) @ rotation.T
        return brentq(
            lambda h: below(mesh, rotation, h)[0] - mass / 1000.0,
            -low[:, 2].max() + 1e-9, -low[:, 2].min() - 1e-9, xtol=1e-12,
        )  # fmt: skip

    def energy(angles):
        rotation = turn_of(angles)
        height = let_down(rotation)
        return height - below(mesh, rotation, height)[1][2]

    start = [near.heel + 0.02, near.trim - 0.02]
    best = minimize(energy, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-15})
    rotation = turn_of(best.x)
    height = let_down(rotation)
    lowest = (np.asarray(mesh.vertices) @ rotation.T)[:, 2].min() + height
    up = rotation[2]
    return -lowest, math.asin(up[0]), math.atan2(up[1], up[2])


def test_an_unstable_attitude_is_left_and_a_stable_one_is_kept():
    plank = trimesh.creation.box((2.0, 0.3, 0.1))
    flat = float_at_rest(plank.triangles, mass=30.0)
    assert abs(flat.heel) < 1e-9
    on_edge = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    fallen = float_at_rest(plank.triangles, mass=30.0, rotation=on_edge)
    assert fallen.draft == pytest.approx(flat.draft, rel=1e-9)
    assert math.sin(fallen.heel) == pytest.approx(0.0, abs=1e-6)


def test_what_is_too_heavy_sinks():
    with pytest.raises(SinksError, match=r"it sinks: 1200 kg.*1000 kg"):
        float_at_rest(trimesh.creation.box((1, 1, 1)).triangles, mass=1200.0)


RAFT = """<mujoco><option timestep=".002" integrator="implicitfast"/><worldbody><body name="raft" pos="0 0 .3">
  <freejoint/><geom type="box" size=".5 .3 .1" density="600"/>
  <body name="mast" pos="0 0 .1"><geom type="cylinder" pos=".2 .02 .2" size=".03 .2" density="500"/></body>
  <body name="keel" pos=".1 0 -.1"><joint axis="0 1 0" stiffness="1e4" damping="10"/>
    <geom type="box" pos="0 0 -.1" size=".2 .01 .1" density="2000"/></body>
</body></worldbody></mujoco>"""


def test_a_model_floats_where_float_at_rest_says():
    model = mujoco.MjModel.from_xml_string(RAFT)
    data = mujoco.MjData(model)
    found = mjskip.float_at_rest(model)
    data.qpos[:] = found.qpos
    with mjskip.attach(model, data, water=mjskip.Water.floating()) as coupling:
        mujoco.mj_forward(model, data)
        total = coupling.tree_wrench(data)
        weight = model.body_subtreemass[1] * 9.81
        assert total.force[2] == pytest.approx(weight, rel=1e-9)
        assert np.abs(total.torque).max() < 1e-6 * weight
        held = coupling.hydrostatics(data)
        assert held.displaced_volume == pytest.approx(weight / 9810.0, rel=1e-9)
        assert held.metacentric_height == pytest.approx(found.hydrostatics.metacentric_height)
        mujoco.mj_step(model, data, nstep=1000)
        assert np.abs(data.qpos[:3] - found.qpos[:3]).max() < 1e-3  # the keel gives way a little


def test_only_what_has_a_free_joint_floats():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='b'><joint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    with pytest.raises(mjskip.errors.SceneError, match="only what has a free joint floats"):
        mjskip.float_at_rest(model)


def wigley(length=10.0, beam=1.5, draft=0.8, stations=41, waterlines=21):
    """Points (stations, waterlines, 3) of a side of Wigley's parabolic hull, up to the waterline."""
    x = np.linspace(-0.5, 0.5, stations) * length
    z = np.linspace(-1.0, 0.0, waterlines) * draft
    half = 0.5 * beam * np.outer(1.0 - (2.0 * x / length) ** 2, 1.0 - (z / draft) ** 2)
    return np.dstack(
        [np.broadcast_to(x[:, None], half.shape), half, np.broadcast_to(z, half.shape)]
    )


def quadrangles_of(side):
    """Quadrangles (n, 4, 3) of a side, outward, and of the other side."""
    a, b, c, d = side[:-1, :-1], side[1:, :-1], side[1:, 1:], side[:-1, 1:]
    port = np.stack([a, d, c, b], axis=2).reshape(-1, 4, 3)
    return np.concatenate([port, port[:, ::-1] * [1.0, -1.0, 1.0]])


def test_a_ships_hull_has_the_hydrostatics_of_its_formula_and_of_capytaine():
    length, beam, draft, rise = 10.0, 1.5, 0.8, 0.1
    quads = quadrangles_of(wigley(length, beam, draft))
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    found = hydrostatics(triangles, centre_of_mass=[0, 0, rise])
    volume = 4.0 / 9.0 * length * beam * draft
    assert found.displaced_volume == pytest.approx(volume, rel=2e-3)
    assert found.centre_of_buoyancy[2] == pytest.approx(-0.375 * draft, rel=2e-3)
    transverse = 2.0 / 3.0 * (0.5 * beam) ** 3 * 0.5 * length * 32.0 / 35.0 / volume
    assert found.metacentric_height == pytest.approx(transverse - 0.375 * draft - rise, rel=5e-3)
    cpt = pytest.importorskip("capytaine")
    corners = quads.reshape(-1, 3)
    mesh = cpt.Mesh(vertices=corners, faces=np.arange(len(corners)).reshape(-1, 4))
    centre = (0.0, 0.0, rise)
    body = cpt.FloatingBody(
        mesh=mesh, dofs=cpt.rigid_body_dofs(rotation_center=centre), center_of_mass=centre
    )
    theirs = body.compute_hydrostatics()
    assert found.displaced_volume == pytest.approx(float(theirs["disp_volume"]), rel=1e-3)
    for ours, name in (
        (found.metacentric_height, "transversal_metacentric_height"),
        (found.longitudinal_metacentric_height, "longitudinal_metacentric_height"),
    ):
        assert ours == pytest.approx(float(theirs[name]), rel=5e-3)


def test_a_boxs_metacentric_height_is_capytaines_and_what_its_middle_points_leave_out():
    cpt = pytest.importorskip("capytaine")
    beam, draft, rise, strips = 3.0, 1.3, -0.2, 6
    mesh = cpt.mesh_parallelepiped(
        size=(8.0, beam, 2.0), resolution=(8, strips, 4), center=(0, 0, -0.3)
    )
    centre = (0.0, 0.0, rise)
    body = cpt.FloatingBody(
        mesh=mesh, dofs=cpt.rigid_body_dofs(rotation_center=centre), center_of_mass=centre
    )
    theirs = float(body.immersed_part().compute_hydrostatics()["transversal_metacentric_height"])
    box = trimesh.creation.box((8.0, beam, 2.0))
    box.apply_translation((0.0, 0.0, -0.3))
    radius = beam**2 / (12.0 * draft)  # middles of n strips make it 1 / n^2 less
    ours = hydrostatics(box.triangles, centre_of_mass=centre).metacentric_height
    assert ours == pytest.approx(theirs + radius / strips**2, rel=1e-6)
