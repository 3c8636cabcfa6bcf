"""A stone has the mass, inertia and silhouette of its solid, and a mesh that is no solid is refused."""

import math

import numpy as np
import pytest
import trimesh
from conftest import rotation, stones
from hypothesis import given
from hypothesis import strategies as st

from mjskip import Stone
from mjskip.errors import MeshError

sizes = st.floats(0.005, 0.5)


def polygon_area(radius, segments):
    return 0.5 * segments * radius**2 * math.sin(2 * math.pi / segments)


@given(sizes, sizes, st.integers(3, 80), st.floats(500, 8000))
def test_a_disc_is_a_regular_prism(radius, thickness, segments, density):
    disc = Stone.disc(radius, thickness, segments=segments, density=density)
    area = polygon_area(radius, segments)
    mass = density * area * thickness
    axial = mass * radius**2 * (2.0 + math.cos(2 * math.pi / segments)) / 6.0
    across = 0.5 * axial + mass * thickness**2 / 12.0
    assert len(disc.faces) == 4 * segments
    # rounding of sums over faces
    assert disc.mass == pytest.approx(mass, rel=1e-10)
    np.testing.assert_allclose(
        disc.inertia, np.diag([across, across, axial]), rtol=1e-9, atol=1e-12 * max(axial, across)
    )
    assert disc.thickness > 0.0
    assert disc.radius == pytest.approx(math.hypot(radius, 0.5 * thickness))


def test_a_flat_disc_is_a_disc_to_the_air():
    disc = Stone.disc(0.05, 0.01, segments=12)
    np.testing.assert_array_equal(disc.disc_normal, [0, 0, 1])
    np.testing.assert_array_equal(disc.disc_centre, [0, 0, 0])
    assert disc.disc_area == pytest.approx(polygon_area(0.05, 12), rel=1e-12)
    assert disc.thickness == pytest.approx(0.01)


def test_the_pebble_of_the_paper_has_44_triangles():
    pebble = Stone.pebble(radius=0.045, thickness=0.015, density=2600)
    assert len(pebble.faces) == 44
    assert len(pebble.vertices) == 24
    # a prism of 2/5 of the thickness between two cones of 3/10 each
    volume = polygon_area(0.045, 11) * 0.015 * (0.4 + 2 * 0.3 / 3)
    assert pebble.mass == pytest.approx(2600 * volume, rel=1e-12)
    assert pebble.disc_area == pytest.approx(polygon_area(0.045, 11), rel=1e-12)


def test_a_fine_lens_is_two_spherical_caps():
    lens = Stone.lens(0.05, 0.02, segments=200, rings=60, density=1000)
    caps = 2 * math.pi * 0.01 * (3 * 0.05**2 + 0.01**2) / 6
    # an inscribed mesh lacks (2 pi / 200)^2 / 6 = 0.016% around, a like part along the rings
    assert lens.mass == pytest.approx(1000 * caps, rel=5e-4)
    assert lens.mass < 1000 * caps
    assert lens.thickness == pytest.approx(0.02, rel=1e-12)


def test_a_fine_ball_has_two_fifths_of_m_r_squared():
    ball = Stone.from_mesh(trimesh.creation.icosphere(5, radius=0.1), density=1000)
    # inscribed: lacks about 0.1%
    assert ball.mass == pytest.approx(4 / 3 * math.pi * 0.1**3 * 1000, rel=2e-3)
    np.testing.assert_allclose(np.diag(ball.inertia), 0.4 * ball.mass * 0.1**2, rtol=1e-3)


@given(sizes, sizes, sizes)
def test_a_box_anywhere_has_the_inertia_of_a_box(a, b, c):
    mesh = trimesh.creation.box((a, b, c))
    mesh.apply_translation([1.0, -2.0, 3.0])
    box = Stone.from_mesh(mesh, mass=2.0)
    expected = 2.0 / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    # the shift of 3.7 m costs digits: rounding of (3.7 m)^2 against a few mm squared
    np.testing.assert_allclose(np.diag(box.inertia), expected, rtol=1e-6, atol=1e-11)
    np.testing.assert_allclose(np.abs(box.vertices).max(axis=0), np.array([a, b, c]) / 2, rtol=1e-9)


@given(stones)
def test_a_stone_is_closed_and_stands_about_its_centre_of_mass(stone):
    areas = np.linalg.norm(stone.area_vectors, axis=1)
    np.testing.assert_allclose(stone.area_vectors.sum(axis=0), 0.0, atol=1e-13 * areas.sum())
    a, b, c = np.moveaxis(stone.triangles, 1, 0)
    volumes = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
    centre = (volumes[:, None] * (a + b + c) / 4.0).sum(axis=0) / volumes.sum()
    np.testing.assert_allclose(centre, 0.0, atol=1e-12)
    assert stone.mass == pytest.approx(2600.0 * volumes.sum(), rel=1e-9)


@given(stones)
def test_the_inertia_is_that_of_a_rigid_body(stone):
    moments = np.linalg.eigvalsh(stone.inertia)
    np.testing.assert_allclose(stone.inertia, stone.inertia.T, rtol=1e-12, atol=1e-18)
    assert (moments > 0).all()
    assert moments[2] < moments[0] + moments[1]  # equal for a flat sheet only
    np.testing.assert_allclose(
        stone.inertia @ stone.disc_normal, moments[2] * stone.disc_normal, atol=1e-5 * moments[2]
    )
    assert stone.disc_normal[2] >= 0.0


@given(stones)
def test_the_silhouette_covers_half_the_projected_surface_or_less(stone):
    across = 0.5 * np.abs(stone.area_vectors @ stone.disc_normal).sum()
    convex = trimesh.Trimesh(stone.vertices, stone.faces).is_convex
    if convex:  # each line of sight meets a convex stone twice
        assert stone.disc_area == pytest.approx(across, rel=1e-9)
    else:
        assert stone.disc_area < across * (1 + 1e-9)


def test_a_turned_disc_has_a_turned_normal():
    turn = rotation([0.9, 0.3, 0.2, -0.1] / np.linalg.norm([0.9, 0.3, 0.2, -0.1]))
    disc = Stone.disc(0.05, 0.01, segments=24)
    mesh = trimesh.Trimesh(disc.vertices @ turn.T, disc.faces)
    turned = Stone.from_mesh(mesh)
    np.testing.assert_allclose(turned.disc_normal, turn[:, 2], atol=1e-9)
    assert turned.disc_area == pytest.approx(disc.disc_area, rel=1e-9)
    np.testing.assert_allclose(turned.inertia, turn @ disc.inertia @ turn.T, atol=1e-12)


def test_a_lopsided_stone_has_its_disc_off_the_centre_of_mass():
    light = trimesh.creation.box((0.2, 0.1, 0.01))
    heavy = trimesh.creation.box((0.05, 0.1, 0.03), transform=np.diag([1.0, 1, 1, 1]))
    heavy.apply_translation([0.125, 0, 0])
    stone = Stone.from_mesh(trimesh.util.concatenate([light, heavy]))
    # silhouette 25 cm long from -0.1; volumes 2e-4 at 0 and 1.5e-4 at 0.125
    centre_of_mass = 1.5e-4 * 0.125 / 3.5e-4
    np.testing.assert_allclose(stone.disc_centre, [0.025 - centre_of_mass, 0, 0], atol=1e-9)
    assert stone.disc_area == pytest.approx(0.025, rel=1e-9)


def test_mass_and_density_are_two_ways_to_say_one_thing():
    by_mass = Stone.disc(0.05, 0.01, mass=0.2)
    again = Stone.disc(0.05, 0.01, density=0.2 / (polygon_area(0.05, 64) * 0.01))
    assert by_mass.mass == pytest.approx(0.2, rel=1e-12)
    np.testing.assert_allclose(by_mass.inertia, again.inertia, rtol=1e-10, atol=1e-18)


def test_a_mesh_file_in_millimetres(tmp_path):
    path = tmp_path / "stone.stl"
    trimesh.creation.box((100, 60, 20)).export(path)
    stone = Stone.from_mesh(path, density=1000, scale=1e-3)
    assert stone.mass == pytest.approx(0.12, rel=1e-6)  # STL is single precision
    np.testing.assert_allclose(stone.disc_normal, [0, 0, 1], atol=1e-9)


def box(**changes):
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    faces, vertices = mesh.faces.copy(), mesh.vertices.copy()
    if "drop" in changes:
        faces = faces[changes["drop"] :]
    if "turn" in changes:
        faces[: changes["turn"]] = faces[: changes["turn"], ::-1]
    if "flat" in changes:
        faces = np.vstack([faces, [[faces[0, 0], faces[0, 0], faces[0, 1]]]])
    if "nan" in changes:
        vertices[0, 0] = np.nan
    return trimesh.Trimesh(vertices, faces, process=False)


REFUSED = [
    ({"turn": 2}, r"some triangles of the mesh face inwards: pass fix_normals=True"),
    ({"turn": 12}, r"the normals of the mesh point inwards: pass fix_normals=True"),
    ({"drop": 12}, r"the mesh has no triangles"),
    ({"nan": 1}, r"vertices that are not finite"),
]


@pytest.mark.parametrize(("changes", "message"), REFUSED)
def test_a_mesh_that_is_no_solid_is_refused(changes, message):
    with pytest.raises(MeshError, match=message) as refused:
        Stone.from_mesh(box(**changes))
    assert isinstance(refused.value, ValueError)
    assert "\n" not in str(refused.value)


def test_a_mesh_without_volume_is_refused():
    sheet = trimesh.Trimesh(
        [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2], [2, 1, 0]], process=False
    )
    with pytest.raises(MeshError, match=r"no volume|open"):
        Stone.from_mesh(sheet)
    corners = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.1, 0.1, 0]]
    flat = trimesh.Trimesh(corners, [[0, 1, 2], [1, 3, 2], [0, 2, 3], [0, 3, 1]], process=False)
    with pytest.raises(MeshError, match="the mesh has no volume"):
        Stone.from_mesh(flat)


@pytest.mark.parametrize("turn", [1, 5, 12])
def test_inverted_normals_are_turned_when_asked(turn):
    fixed = Stone.from_mesh(box(turn=turn), fix_normals=True)
    np.testing.assert_allclose(fixed.inertia, Stone.from_mesh(box()).inertia, rtol=1e-9, atol=1e-12)
    assert np.einsum("ni,ni->n", fixed.area_vectors, fixed.triangles[:, 0]).min() > 0.0


def test_a_given_mesh_is_not_altered():
    mesh = box(turn=3)
    before = mesh.faces.copy(), mesh.vertices.copy()
    Stone.from_mesh(mesh, fix_normals=True, scale=2.0)
    np.testing.assert_array_equal(mesh.faces, before[0])
    np.testing.assert_array_equal(mesh.vertices, before[1])


def test_a_file_that_is_missing_or_no_mesh_is_refused(tmp_path):
    with pytest.raises(MeshError, match=r"no mesh file .*nothing\.stl"):
        Stone.from_mesh(tmp_path / "nothing.stl")
    broken = tmp_path / "broken.ply"
    broken.write_text("not a mesh")
    with pytest.raises(MeshError, match="cannot be read as a mesh"):
        Stone.from_mesh(broken)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["density", "mass", "radius", "thickness"])
def test_sizes_that_are_none_are_refused(name, value):
    with pytest.raises(ValueError, match=f"^{name} is .*finite number greater than 0"):
        Stone.pebble(**{name: value})


def test_other_arguments_that_make_no_stone_are_refused():
    with pytest.raises(ValueError, match="segments is 2: give a whole number between 3 and"):
        Stone.disc(0.05, 0.01, segments=2)
    with pytest.raises(ValueError, match="rings is 0"):
        Stone.lens(0.05, 0.01, rings=0)
    with pytest.raises(ValueError, match="both density 1 and mass 1 are given"):
        Stone.pebble(density=1, mass=1)
    with pytest.raises(ValueError, match="scale is 0"):
        Stone.from_mesh(box(), scale=0)
