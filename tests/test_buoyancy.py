"""Water bears what floats: Archimedes, metacentres, and things that come to rest and stay there."""

import math

import mujoco
import numpy as np
import pytest
import trimesh
from conftest import GRAVITY, meshes, rotation
from hypothesis import given
from hypothesis import strategies as st

from mjskip import Stone, Water, attach, wrench
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.rigid.attitude import matrices
from mjskip.rigid.state import pack_states

FLOATING = Water(buoyancy=True, skin_friction=True, gate="local")
STILL = Water(buoyancy=True)
WEIGHT = 1000.0 * GRAVITY


def immersed_solid(stone, position, q):
    """Volume below z = 0 and its centroid about the centre of mass, by slicing the mesh.

    Tetrahedra from a point of the surface z = 0 to every triangle below it: those to the cut itself
    have no height, so it needs no cap.
    """
    mesh = trimesh.Trimesh(position + stone.vertices @ rotation(q).T, stone.faces, process=False)
    mesh = trimesh.intersections.slice_mesh_plane(mesh, [0, 0, -1], [0, 0, 0])
    corners = mesh.triangles - [position[0], position[1], 0.0]
    volumes = np.linalg.det(corners) / 6.0
    centroid = (volumes[:, None] * corners.sum(axis=1) / 4.0).sum(axis=0)
    total = volumes.sum()
    return total, centroid / total - [0.0, 0.0, position[2]] if total > 0.0 else np.zeros(3)


@given(meshes.map(Stone.from_mesh), st.integers(0, 10**6))
def test_water_bears_the_weight_of_what_is_displaced_at_its_centroid(stone, seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    position = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-1.2, 1.2) * stone.radius])
    found = wrench(stone, STILL, position=position, q=q)
    volume, centroid = immersed_solid(stone, position, q)
    lift = np.array([0.0, 0.0, WEIGHT * volume])
    scale = WEIGHT * stone.radius**3
    np.testing.assert_allclose(found.force, lift, atol=1e-9 * scale)
    np.testing.assert_allclose(
        found.torque, np.cross(centroid, lift), atol=1e-9 * scale * stone.radius
    )


def test_a_mesh_of_many_groups_is_borne_as_one_of_few():
    stone = Stone.from_mesh(
        trimesh.creation.torus(0.08, 0.03, major_sections=48, minor_sections=32)
    )
    rng = np.random.default_rng(5)
    scale = WEIGHT * stone.radius**3
    for height in np.linspace(-1.1, 1.0, 12) * stone.radius:  # the first by Archimedes' closed form
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        found = wrench(stone, STILL, position=[0.3, -0.2, height], q=q)
        volume, centroid = immersed_solid(stone, np.array([0.3, -0.2, height]), q)
        lift = np.array([0.0, 0.0, WEIGHT * volume])
        np.testing.assert_allclose(found.force, lift, atol=1e-9 * scale)
        torque = np.cross(centroid, lift)
        np.testing.assert_allclose(found.torque, torque, atol=1e-9 * scale * stone.radius)


@given(meshes.map(Stone.from_mesh), st.integers(0, 10**6))
def test_on_what_is_quite_under_water_only_the_volume_counts(stone, seed):
    q = np.random.default_rng(seed).normal(size=4)
    depths = [
        wrench(stone, STILL, position=[0, 0, -k * stone.radius], q=q).force for k in (1.5, 30.0)
    ]
    mesh = trimesh.Trimesh(stone.vertices, stone.faces, process=False)
    expected = [0.0, 0.0, WEIGHT * mesh.volume]
    scale = WEIGHT * stone.radius**3
    np.testing.assert_allclose(depths, [expected] * 2, atol=1e-9 * scale * 30)


def heel(angle):
    """Quaternion of a turn about x."""
    return np.array([math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0])


def hull(length, width, height, *, density, ballast=0.0):
    """A box, its centre of mass below its middle by `ballast`."""
    mesh = trimesh.creation.box((length, width, height))
    mass = density * mesh.volume
    inertia = mass / 12.0 * np.diag(
        [width**2 + height**2, length**2 + height**2, length**2 + width**2]
    )  # fmt: skip
    return Stone.of_parts(
        vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces, dtype=np.int32), mass=mass,
        centre=np.array([0.0, 0.0, -ballast]), inertia=inertia,
    )  # fmt: skip


@pytest.mark.parametrize("ballast", [0.0, 0.03])
@pytest.mark.parametrize("degrees", [0.5, 5.0, 15.0])
def test_a_wall_sided_hull_is_righted_as_the_formula_says(ballast, degrees):
    length, width, height, density = 0.5, 0.2, 0.1, 450.0
    body = hull(length, width, height, density=density, ballast=ballast)
    angle, draft = math.radians(degrees), density / 1000.0 * height
    # At rest the waterline runs through the middle of the waterplane, which stays where it is; the
    # centre of mass is this far above it, in body axes.
    above = 0.5 * height - draft - ballast
    position = [0.0, 0.0, above * math.cos(angle)]
    found = wrench(body, STILL, position=position, q=heel(angle))
    weight = body.mass * GRAVITY
    metacentric = width**2 / (12.0 * draft)  # BM = I / V
    keel_to_mass = 0.5 * height - ballast
    arm = math.sin(angle) * (
        0.5 * draft + metacentric * (1.0 + 0.5 * math.tan(angle) ** 2) - keel_to_mass
    )  # GZ = sin (GM + BM tan^2 / 2), exact until an edge dips or leaves
    assert 0.5 * width * math.tan(angle) < min(draft, height - draft)
    assert found.force[2] == pytest.approx(weight, rel=1e-12)
    assert found.torque[0] == pytest.approx(-weight * arm, rel=1e-9)
    assert (arm > 0.0) or not ballast
    assert found.torque[1:] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_skin_friction_is_the_plate_line_of_ittc_1957():
    plate = hull(1.0, 0.5, 0.002, density=1000.0)
    speed = 2.0
    water = Water(
        skin_friction=True, density=1000.0, viscosity=1.1e-6, air_density=0.0, gate="local"
    )
    bare = Water(density=1000.0, air_density=0.0, gate="local")
    at = {"position": [0, 0, -1.0], "velocity": [speed, 0, 0]}
    drag = wrench(plate, water, **at).force[0] - wrench(plate, bare, **at).force[0]
    # the equivalent length of `Stone`: diameter of the disc of the same area
    reynolds = speed * 2.0 * math.sqrt(0.5 / math.pi) / 1.1e-6
    coefficient = 0.075 / (math.log10(reynolds) - 2.0) ** 2
    wetted = 2.0 * 0.5 + 2.0 * 1.0 * 0.002  # sides along the flow; not the two edges across it
    assert drag == pytest.approx(-0.5 * 1000.0 * speed**2 * wetted * coefficient, rel=1e-6)


def model_of(geom, *, pos="0 0 0", timestep=0.002, integrator="implicitfast"):
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" integrator="{integrator}"/>
      <worldbody><body name="float" pos="{pos}"><freejoint/>{geom}</body></worldbody></mujoco>""")


def test_a_ball_half_as_dense_as_water_comes_to_rest_half_immersed():
    model = model_of('<geom type="sphere" size=".1" density="500"/>', pos="0 0 .15")
    data = mujoco.MjData(model)
    with attach(model, data, water=FLOATING):
        mujoco.mj_step(model, data, nstep=10000)
    # The tessellated ball displaces less than the round one, whose mass MuJoCo gives it; its section at
    # the waterline is what makes up for it. Left over is a bobbing that drag, being quadratic, ends slowly.
    volume = 4.0 / 3.0 * math.pi * 0.1**3
    missing = 0.02 * 0.5 * volume / (math.pi * 0.1**2)
    assert abs(data.qpos[2]) < missing + 2e-3
    assert abs(data.qvel).max() < 0.02


def test_a_floating_box_stays_where_it_is_and_does_not_turn():
    model = model_of('<geom type="box" size=".2 .15 .05" density="600"/>', pos="0 0 -.01")
    data = mujoco.MjData(model)
    with attach(model, data, water=FLOATING):
        mujoco.mj_step(model, data, nstep=30000)
    assert data.time == pytest.approx(60.0)
    assert abs(data.qpos[:2]).max() < 1e-9
    assert abs(data.qvel[:2]).max() < 1e-9
    turn = matrices(data.qpos[3:7])
    assert abs(math.atan2(turn[1, 0], turn[0, 0])) < 1e-9
    # at its draft, 0.6 of 10 cm
    assert data.qpos[2] == pytest.approx(-0.01, abs=1e-6)


def mirrored_box(x, y, z):
    """A box whose sides are split into four triangles each, so that its mesh is as symmetric as it is."""
    corners = [(a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z)]
    middles = [(-x, 0, 0), (x, 0, 0), (0, -y, 0), (0, y, 0), (0, 0, -z), (0, 0, z)]
    rings = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [
        (8 + side, ring[k], ring[(k + 1) % 4]) for side, ring in enumerate(rings) for k in range(4)
    ]
    return corners + middles, faces


def test_a_box_set_down_askew_comes_upright_without_yaw():
    vertices, faces = mirrored_box(0.2, 0.15, 0.05)
    numbers = [" ".join(str(v) for v in np.ravel(part)) for part in (vertices, faces)]
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="0.002" integrator="implicitfast"/>
      <asset><mesh name="box" inertia="exact" vertex="{numbers[0]}" face="{numbers[1]}"/></asset>
      <worldbody><body name="float" pos="0 0 .02"><freejoint/>
        <geom type="mesh" mesh="box" density="600"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[3:7] = heel(0.2)
    with attach(model, data, water=FLOATING):
        mujoco.mj_step(model, data, nstep=30000)
    turn = matrices(data.qpos[3:7])
    # Symmetric about x = 0: nothing may push it along x or turn it about z but rounding.
    assert abs(data.qpos[0]) < 1e-6
    assert abs(math.atan2(turn[1, 0], turn[0, 0])) < 1e-6
    assert abs(turn[2, 1]) < 0.05


def test_buoyancy_and_skin_friction_are_off_unless_asked_for():
    stone, states = Stone.pebble(), np.array([[0.0, 0, -0.001]])
    states = pack_states(states, np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, 3)))
    assert not wrench_and_immersion(pack(stone, Water()), states)[0, :12].any()
    assert wrench_and_immersion(pack(stone, STILL), states)[0, 2] > 0.0
