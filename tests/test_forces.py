"""Water pushes on the immersed part of every face, air on the disc: equations (1)-(4)."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from conftest import hulls, immersed, meshes, motions, rotation, stones, twin
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from mjskip import Stone, Water, wrench
from mjskip._compile.vector import log10
from mjskip.hydro._clip_kernels import immersed_part
from mjskip.hydro.laws import LAWS
from mjskip.hydro.water import GATES
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.rigid.state import pack_states

CENTRED = [name for name, law in LAWS.items() if not law.forward and name != "none"]
waters = st.builds(
    Water,
    gate=st.sampled_from(GATES),
    law=st.sampled_from(list(LAWS)),
    quadrature=st.booleans(),
)
centred = st.builds(  # loads at the centroids of triangles, as the papers have it
    Water, gate=st.sampled_from(GATES), law=st.sampled_from(CENTRED)
)
PEBBLE = Stone.pebble()


def placed(stone, motion):
    """The stone's triangles in the world (m, 3, 3)."""
    return motion["position"] + stone.triangles @ rotation(motion["q"]).T


def wet_parts(stone, motion):
    """Immersed area vector (m, 3) and centroid (m, 3) of every triangle, by the kernel itself."""
    triangles = placed(stone, motion)
    found = np.array(
        [
            immersed_part(*(float(v) for corner in t for v in (*corner, corner[2])))
            for t in triangles
        ]
    )
    return found[:, :1] * stone.area_vectors @ rotation(motion["q"]).T, found[:, 1:]


def assert_same_wrench(stone, water, motion, expected, rel=1e-9):
    """Equal to rounding of sums over faces, each as large as the sum of their magnitudes allows."""
    found = wrench(stone, water, **motion)
    fastest = np.linalg.norm(motion["velocity"]) + stone.radius * np.linalg.norm(motion["omega"])
    area = np.linalg.norm(stone.area_vectors, axis=1).sum()
    scale = (water.density + water.air_density) * area * fastest**2
    for name, value, size in zip(
        ("force", "torque", "air_force", "air_torque"),
        expected,
        (scale, scale * stone.radius, scale, scale * stone.radius),
        strict=True,
    ):
        np.testing.assert_allclose(
            getattr(found, name), value, rtol=rel, atol=1e-13 * size, err_msg=name
        )


@given(meshes, motions())
def test_the_immersed_surface_is_the_one_that_trimesh_slices_off(mesh, motion):
    stone = Stone.from_mesh(mesh)
    world = trimesh.Trimesh(
        motion["position"] + stone.vertices @ rotation(motion["q"]).T, stone.faces, process=False
    )
    below = trimesh.intersections.slice_mesh_plane(world, [0, 0, -1], [0, 0, 0])
    found = wrench(stone, **motion)
    # trimesh takes corners within 1e-8 m of the plane to lie on it: an error of at most that times
    # the length of the waterline, some tenths of a metre
    assert found.wetted_area == pytest.approx(below.area, abs=1e-8, rel=1e-9)
    if below.area > 1e-5:
        centre = below.area_faces @ below.triangles_center / below.area
        np.testing.assert_allclose(
            found.wetted_centre, centre, rtol=1e-9, atol=1e-8 / below.area * 0.3
        )
    assert found.clearance == pytest.approx(world.vertices[:, 2].min(), abs=1e-13)


@given(stones, motions(), centred)
def test_the_kernel_agrees_with_its_slow_twin_for_every_law_and_gate(stone, motion, water):
    assert_same_wrench(stone, water, motion, twin(stone, water, **motion))


@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("law", CENTRED)
def test_each_law_and_gate_by_its_twin_on_the_pebble(law, gate):
    rng = np.random.default_rng(3)
    for _ in range(20):
        q = rng.normal(size=4)
        motion = {
            "position": np.array([0.0, 0.0, rng.uniform(-0.03, 0.03)]),
            "q": q / np.linalg.norm(q),
            "velocity": rng.normal(size=3) * 10,
            "omega": rng.normal(size=3) * 200,
        }
        water = Water(law=law, gate=gate)
        assert_same_wrench(PEBBLE, water, motion, twin(PEBBLE, water, **motion))


FINE = Stone.from_mesh(trimesh.creation.torus(0.08, 0.03, major_sections=48, minor_sections=32))
"""Many groups of faces (3072), not convex."""


@given(motions(), centred)
def test_a_mesh_of_many_groups_agrees_with_its_twin(motion, water):
    # all, some and none of the groups wet
    for height in (-0.5, -0.05, 0.0, 0.02):
        at = motion | {"position": np.array([0.0, 0.0, height])}
        assert_same_wrench(FINE, water, at, twin(FINE, water, **at))


@given(stones, motions(), st.integers(0, 17))
def test_what_is_not_a_number_reaches_the_wrench(stone, motion, place):
    # a comparison with it holds for no face: without care a lost state would feel no force at all
    position = motion["position"] * [1.0, 1.0, 0.0]
    state = pack_states(
        position[None], rotation(motion["q"])[None], motion["velocity"][None], motion["omega"][None]
    )
    state[0, place] = np.nan
    found = wrench_and_immersion(pack(stone, Water()), state)[0, :6]
    assert np.isnan(found).any() == (
        place not in (0, 1)
    )  # where it is over still water is no matter


def test_the_logarithm_of_the_kernels_is_that_of_the_library():
    x = np.concatenate([np.geomspace(1.0, 1e300, 5001), np.linspace(1.0, 3.0, 5001)])
    found = np.array([log10(v) for v in x])
    np.testing.assert_allclose(found, np.log10(x), rtol=5e-16, atol=2e-16)


def test_one_face_feels_density_times_normal_speed_squared_times_area():
    cube = Stone.from_mesh(trimesh.creation.box((0.1, 0.1, 0.1)))
    down = {"position": [0, 0, -0.02], "velocity": [0, 0, -3.0]}
    # equation (1) without any factor: rho v^2 S upwards on the bottom alone
    np.testing.assert_allclose(wrench(cube, **down).force, [0, 0, 1000 * 9.0 * 0.01], atol=1e-9)
    ahead = {"position": [0, 0, -0.02], "velocity": [3.0, 0, 0]}
    # 7 cm of the front face are below the surface, their middle 1.5 cm below the centre of mass
    found = wrench(cube, **ahead)
    np.testing.assert_allclose(found.force, [-1000 * 9.0 * 0.1 * 0.07, 0, 0], atol=1e-9)
    np.testing.assert_allclose(found.torque, [0, 0.015 * 63.0, 0], atol=1e-9)


@given(hulls, motions())
def test_uniform_pressure_on_the_immersed_surface_and_the_waterplane_cancels(mesh, motion):
    stone = Stone.from_mesh(mesh)
    areas, _ = wet_parts(stone, motion)
    total = areas.sum(axis=0)
    size = np.linalg.norm(stone.area_vectors, axis=1).sum()
    np.testing.assert_allclose(total[:2], 0.0, atol=1e-13 * size)
    triangles = placed(stone, motion)
    start, end = triangles, np.roll(triangles, -1, axis=1)
    cut = (start[..., 2] < 0) != (end[..., 2] < 0)
    waterplane = 0.0
    if cut.any():
        a, b = start[cut], end[cut]
        points = a + (a[:, 2] / (a[:, 2] - b[:, 2]))[:, None] * (b - a)
        waterplane = ConvexHull(points[:, :2], qhull_options="QJ").volume
    # qhull joggles its input by about 1e-11 of its size
    assert -total[2] == pytest.approx(waterplane, rel=1e-7, abs=1e-10 * size)


@given(meshes, motions())
def test_uniform_pressure_on_a_sunken_stone_gives_no_force_and_no_torque(mesh, motion):
    stone = Stone.from_mesh(mesh)
    areas, centroids = wet_parts(stone, motion | {"position": np.array([1.0, 2.0, -0.5])})
    size = np.linalg.norm(stone.area_vectors, axis=1).sum()
    np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-13 * size)
    # arms of about 2.3 m
    np.testing.assert_allclose(np.cross(centroids, areas).sum(axis=0), 0.0, atol=3e-13 * size)


@given(hulls, motions())
def test_pressure_at_the_immersed_centroids_lifts_by_the_volume_below_water(mesh, motion):
    """Archimedes: a linear pressure acts on a plane face as its value at the centroid does."""
    stone = Stone.from_mesh(mesh)
    areas, centroids = wet_parts(stone, motion)
    lift = (centroids[:, 2:] * areas).sum(axis=0)  # depth times inward area: a volume, upwards
    triangles = placed(stone, motion)
    start, end = triangles, np.roll(triangles, -1, axis=1)
    cut = (start[..., 2] < 0) != (end[..., 2] < 0)
    a, b = start[cut], end[cut]
    points = np.vstack(
        [triangles[triangles[..., 2] < 0], a + (a[:, 2:] / (a[:, 2:] - b[:, 2:])) * (b - a)]
    )
    volume = ConvexHull(points, qhull_options="QJ").volume if len(points) > 3 else 0.0
    whole = stone.mass / 2600.0
    np.testing.assert_allclose(lift, [0, 0, volume], rtol=1e-7, atol=1e-9 * whole)


@given(stones, motions(), waters, st.floats(-np.pi, np.pi))
def test_the_wrench_turns_with_the_stone_and_does_not_care_where_it_is(stone, motion, water, angle):
    base = wrench(stone, water, **motion)
    turn = rotation([np.cos(angle / 2), 0, 0, np.sin(angle / 2)])
    w, x, y, z = motion["q"]
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    turned = {
        "position": turn @ motion["position"] + [10.0, -7.0, 0.0],
        "q": np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]),
        "velocity": turn @ motion["velocity"],
        "omega": turn @ motion["omega"],
    }
    assert_same_wrench(
        stone, water, turned,
        (turn @ base.force, turn @ base.torque, turn @ base.air_force, turn @ base.air_torque),
        rel=1e-8,  # a waterline that grazes an edge
    )  # fmt: skip


@given(stones, motions(), waters)
def test_a_mirrored_stone_feels_the_mirrored_wrench(stone, motion, water):
    base = wrench(stone, water, **motion)
    mirror = np.array([1.0, -1.0, 1.0])
    mesh = trimesh.Trimesh(stone.vertices * mirror, stone.faces[:, ::-1], process=False)
    image = Stone.of_parts(
        vertices=np.asarray(mesh.vertices),
        faces=np.asarray(mesh.faces, dtype=np.int32),
        mass=stone.mass,
        centre=np.zeros(3),
        inertia=stone.inertia * np.outer(mirror, mirror),
    )
    w, x, y, z = motion["q"]
    axial = -mirror  # of angular velocity and torque
    mirrored = {
        "position": motion["position"] * mirror,
        "q": np.array([w, -x, y, -z]),
        "velocity": motion["velocity"] * mirror,
        "omega": motion["omega"] * axial,
    }
    water_part = (base.force * mirror, base.torque * axial)
    air_part = (base.air_force * mirror, base.air_torque * axial)
    assert_same_wrench(image, water, mirrored, water_part + air_part, rel=1e-8)


@given(stones, motions(), waters, st.integers(0, 10**6))
def test_the_order_of_triangles_does_not_matter(stone, motion, water, seed):
    base = wrench(stone, water, **motion)
    rng = np.random.default_rng(seed)
    faces = np.array([np.roll(face, rng.integers(3)) for face in rng.permutation(stone.faces)])
    shuffled = Stone.of_parts(
        vertices=stone.vertices,
        faces=faces,
        mass=stone.mass,
        centre=np.zeros(3),
        inertia=stone.inertia,
    )
    expected = (base.force, base.torque, base.air_force, base.air_torque)
    assert_same_wrench(shuffled, water, motion, expected)


@given(stones, motions(), centred)
def test_splitting_triangles_changes_nothing_for_pure_translation(stone, motion, water):
    motion = motion | {"omega": np.zeros(3)}
    vertices, faces = trimesh.remesh.subdivide(stone.vertices, stone.faces)
    split = Stone.of_parts(
        vertices=vertices,
        faces=np.asarray(faces, dtype=np.int32),
        mass=stone.mass,
        centre=np.zeros(3),
        inertia=stone.inertia,
    )
    assert len(split.faces) == 4 * len(stone.faces)
    base, found = wrench(stone, water, **motion), wrench(split, water, **motion)
    assert found.wetted_area == pytest.approx(base.wetted_area, rel=1e-9, abs=1e-15)
    np.testing.assert_allclose(found.wetted_centre, base.wetted_centre, rtol=1e-9, atol=1e-9)
    # faces of one plane have equal normals only to rounding, and a gate asks for their sign
    face = np.einsum("ni,i->n", stone.area_vectors, rotation(motion["q"]).T @ motion["velocity"])
    if np.abs(face).min() > 1e-9:
        expected = (base.force, base.torque, base.air_force, base.air_torque)
        assert_same_wrench(split, water, motion, expected)


def divided(stone, times=1):
    """The same stone, every triangle cut in four."""
    vertices, faces = stone.vertices, stone.faces
    for _ in range(times):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return Stone.of_parts(
        vertices=vertices,
        faces=np.asarray(faces, dtype=np.int32),
        mass=stone.mass,
        centre=np.zeros(3),
        inertia=stone.inertia,
    )


@given(
    stones, motions(), st.sampled_from(list(LAWS)), st.sampled_from(GATES), st.integers(0, 10**6)
)
def test_with_quadrature_splitting_triangles_changes_nothing_spin_included(
    stone, motion, law, gate, seed
):
    water = Water(law=law, gate=gate, quadrature=True)
    base = wrench(stone, water, **motion)
    # one triangle cut across, beside all of them cut in four
    rng = np.random.default_rng(seed)
    k = int(rng.integers(len(stone.faces)))
    a, b, c = stone.faces[k]
    extra = stone.triangles[k].T @ rng.dirichlet([1.0, 1.0, 1.0])
    d = len(stone.vertices)
    three = np.array([[a, b, d], [b, c, d], [c, a, d]], dtype=np.int32)
    split = Stone.of_parts(
        vertices=np.vstack([stone.vertices, extra]),
        faces=np.vstack([np.delete(stone.faces, k, axis=0), three]),
        mass=stone.mass,
        centre=np.zeros(3),
        inertia=stone.inertia,
    )
    face = np.einsum("ni,i->n", stone.area_vectors, rotation(motion["q"]).T @ motion["velocity"])
    if gate == "centre" and np.abs(face).min() < 1e-9:
        return  # faces of one plane have equal normals only to rounding, and a gate asks for their sign
    for other in (divided(stone), split):
        expected = (base.force, base.torque, base.air_force, base.air_torque)
        assert_same_wrench(other, water, motion, expected, rel=1e-10)


@given(stones, motions(), centred)
def test_where_nothing_turns_quadrature_is_the_centroid_rule(stone, motion, water):
    motion = motion | {"omega": np.zeros(3)}
    base = wrench(stone, water, **motion)
    expected = (base.force, base.torque, base.air_force, base.air_torque)
    assert_same_wrench(stone, replace(water, quadrature=True), motion, expected)


@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("law", CENTRED)
def test_quadrature_is_what_ever_finer_triangles_come_to(law, gate):
    rng = np.random.default_rng(11)
    box = Stone.from_mesh(trimesh.creation.box((0.1, 0.06, 0.02)))
    q = rng.normal(size=4)
    motion = {
        "position": np.array([0.0, 0.0, 0.004]),
        "q": q / np.linalg.norm(q),
        "velocity": np.array([2.0, 0.5, -1.0]),
        "omega": np.array([30.0, -20.0, 50.0]),
    }
    exact = wrench(box, Water(law=law, gate=gate, quadrature=True), **motion)
    errors = []
    for times in (1, 3, 5):
        rough = wrench(divided(box, times), Water(law=law, gate=gate), **motion)
        gap = np.concatenate([rough.force - exact.force, (rough.torque - exact.torque) / 0.06])
        errors.append(np.linalg.norm(gap) / np.linalg.norm(exact.force))
    assert errors[2] < 2e-3
    assert errors[2] < 0.2 * errors[0] + 1e-14  # of second order but where a gate cuts a face


def test_a_disc_that_turns_while_it_sinks_is_damped_by_its_second_moment():
    """tau = rho integral of (V + w y)^2 y dA = 2 rho V w I over the lower face, I of the polygon.

    With loads at the centroids of a fan I comes out as 4/9 instead of 1/2 of A R^2 / 2.
    """
    disc = Stone.disc(0.1, 0.001, segments=64)
    sink, turn = 2.0, 3.0
    motion = {"position": [0, 0, -1.0], "velocity": [0, 0, -sink], "omega": [turn, 0, 0]}
    found = wrench(disc, Water(quadrature=True, air_density=0.0), **motion)
    fan = wrench(disc, Water(air_density=0.0), **motion)
    a = 2.0 * np.pi / 64
    second = 64 * 0.1**4 / 24.0 * np.sin(a) * (2.0 + np.cos(a))  # of a regular polygon
    damping = -2.0 * 1000.0 * sink * turn * second
    assert found.torque[0] == pytest.approx(damping, rel=2e-3)  # half the thickness moves sideways
    assert fan.torque[0] == pytest.approx(damping * 8.0 / 9.0, rel=5e-3)


@pytest.mark.parametrize("law", CENTRED)
def test_a_coarse_rim_that_spins_is_loaded_on_the_parts_that_advance(law):
    """16 flat facets at 400 rev/s: each advances with one end and recedes with the other."""
    disc = Stone.disc(0.025, 0.00275, segments=16, density=2700.0)
    tilt = np.radians(10.0)
    motion = {
        "position": np.array([0.0, 0.0, 0.0]),
        "q": np.array([np.cos(tilt), 0.0, -np.sin(tilt), 0.0]),
        "velocity": np.array([3.3, 0.0, -1.2]),
        "omega": 2.0 * np.pi * 400.0 * np.array([-np.sin(2 * tilt), 0.0, np.cos(2 * tilt)]),
    }
    water = Water(law=law, gate="local", air_density=0.0)
    true = wrench(divided(disc, 5), water, **motion)
    exact = wrench(disc, replace(water, quadrature=True), **motion)
    coarse = wrench(disc, water, **motion)
    assert np.linalg.norm(exact.force - true.force) < 0.01 * np.linalg.norm(true.force)
    if law == "lee2010":
        assert coarse.force[0] < 5.0 * true.force[0] < 0.0


@given(stones, motions(), st.sampled_from(["lee2010", "nagahiro2005", "rosellini2005"]))
def test_water_never_does_work_on_a_stone_with_the_local_gate(stone, motion, law):
    found = wrench(stone, Water(gate="local", law=law), **motion)
    power = found.force @ motion["velocity"] + found.torque @ motion["omega"]
    assert power <= 1e-12 * np.linalg.norm(found.force) * np.linalg.norm(motion["velocity"])


@given(stones, motions())
def test_air_never_does_work_on_a_stone(stone, motion):
    found = wrench(stone, **motion)
    assert found.air_force @ motion["velocity"] + found.air_torque @ motion["omega"] <= 1e-15


def test_the_centre_gate_pushes_a_receding_face_and_adds_energy_as_the_paper_does():
    """A cube creeps ahead while it turns nose down: the wet part of its front moves back."""
    cube = Stone.from_mesh(trimesh.creation.box((0.1, 0.1, 0.1)))
    motion = {"position": [0, 0, 0], "velocity": [0.1, 0, 0], "omega": [0, 20.0, 0]}
    found = wrench(cube, Water(gate="centre", air_density=0), **motion)
    assert found.force[0] < 0.0
    assert found.force @ motion["velocity"] + found.torque @ motion["omega"] > 0.0
    still = wrench(cube, Water(gate="local", air_density=0), **motion)
    # there the back advances: it goes the other way, and is braked
    assert still.force @ motion["velocity"] + still.torque @ motion["omega"] < 0.0


@given(stones, motions(), waters)
def test_a_dry_stone_feels_no_water(stone, motion, water):
    found = wrench(
        stone, water, **motion | {"position": np.array([0.0, 0.0, 1.001 * stone.radius])}
    )
    assert not found.force.any()
    assert not found.torque.any()
    assert found.wetted_area == 0.0
    assert found.clearance > 0.0


def test_a_stone_at_rest_feels_nothing():
    found = wrench(PEBBLE, position=[0, 0, 0])
    assert not found.force.any()
    assert not found.air_force.any()


def test_air_pushes_the_disc_against_its_broadside_motion():
    found = wrench(PEBBLE, Water(air_density=1.2), position=[0, 0, 1], velocity=[0, 0, -20.0])
    assert found.air_force[2] == pytest.approx(1.2 * 400.0 * PEBBLE.disc_area, rel=1e-12)
    edge_on = wrench(PEBBLE, Water(air_density=1.2), position=[0, 0, 1], velocity=[20.0, 0, 0])
    np.testing.assert_allclose(edge_on.air_force, 0.0, atol=1e-12)


@given(stones, motions())
def test_the_length_of_the_quaternion_does_not_matter(stone, motion):
    base = wrench(stone, **motion)
    longer = motion | {"q": 3.0 * motion["q"]}
    assert_same_wrench(
        stone, Water(), longer, (base.force, base.torque, base.air_force, base.air_torque), rel=1e-8
    )


@given(
    st.lists(
        st.lists(st.floats(-1, 1, allow_subnormal=False), min_size=3, max_size=3),
        min_size=3,
        max_size=3,
    )
)
def test_the_immersed_part_of_any_triangle_however_thin(corners):
    triangle = np.array(corners)
    area = 0.5 * np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]))
    if area < 1e-6:
        return
    fraction, *centroid = immersed_part(*(float(v) for c in triangle for v in (*c, c[2])))
    expected, where = immersed(triangle[None])
    assert 0.0 <= fraction <= 1.0
    assert fraction * area == pytest.approx(expected[0], abs=1e-12)
    if expected[0] > 1e-9:
        # the twin divides rounding of unit size by the area
        np.testing.assert_allclose(centroid, where[0], atol=1e-15 / expected[0] + 1e-9)
    if fraction > 0.0:
        assert (np.array(centroid) <= triangle.max(axis=0) + 1e-12).all()
        assert (np.array(centroid) >= triangle.min(axis=0) - 1e-12).all()
        assert centroid[2] <= 1e-15  # rounding of corners of unit size


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("position", [0, 0]),
        ("position", [0, 0, np.nan]),
        ("velocity", [[0, 0, 1]]),
        ("omega", [np.inf, 0, 0]),
        ("q", [1, 0, 0]),
    ],
)
def test_a_pose_that_is_none_is_refused(argument, value):
    with pytest.raises(ValueError, match=f"^{argument} is .*: give [34] finite numbers"):
        wrench(PEBBLE, **{"position": [0, 0, 0], argument: value})


def test_a_zero_quaternion_is_refused():
    with pytest.raises(ValueError, match="q is zero"):
        wrench(PEBBLE, position=[0, 0, 0], q=[0, 0, 0, 0])


@pytest.mark.parametrize("name", ["density", "air_density"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_water_of_no_density_is_refused(name, value):
    with pytest.raises(ValueError, match=f"^{name} is .*finite number of at least 0"):
        Water(**{name: value})


def test_an_unknown_gate_or_law_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match="gate is 'none': use one of centre, local"):
        Water(gate="none")
    with pytest.raises(ValueError, match="law is 'newton': use one of lee2010, "):
        Water(law="newton")


def test_a_disc_of_many_faces_that_surface_and_waterline_mix_stays_within_its_room():
    """Faces that are cut and whole ones alternate along a 256-gon at the waterline: every place is used."""
    stone = Stone.disc(0.025, 0.00275, density=2700.0, segments=256)
    coarse = Stone.disc(0.025, 0.00275, density=2700.0, segments=128)
    rng = np.random.default_rng(1)
    for _ in range(300):
        motion = {
            "position": (0.0, 0.0, rng.uniform(-0.01, 0.01)),
            "q": Rotation.random(rng=rng).as_quat(scalar_first=True),
            "velocity": rng.normal(size=3),
            "omega": 30.0 * rng.normal(size=3),
        }
        fine = wrench(stone, Water.floating(), **motion).force
        other = wrench(coarse, Water.floating(), **motion).force
        np.testing.assert_allclose(fine, other, atol=0.02 * np.linalg.norm(other) + 0.01)
