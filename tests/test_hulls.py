"""Hulls: closed surfaces, their unions, few faces; and the registry that shares them."""

import math
import warnings

import manifold3d
import mujoco
import numpy as np
import pytest
import trimesh

from mjskip import Stone, attach
from mjskip.coupling.attach import Coupling
from mjskip.coupling.selection import wet_body
from mjskip.coupling.wet import HullOptions, Registry, hull_of, inertia_of, registry
from mjskip.errors import MeshError, MjskipWarning
from mjskip.hydro import primitives, solids
from mjskip.hydro.water import Water

SOLIDS = {
    "box": (lambda n: primitives.box([0.1, 0.2, 0.3]), 8 * 0.006),
    "ellipsoid": (lambda n: primitives.ellipsoid([0.1, 0.2, 0.3], n), 4 / 3 * math.pi * 0.006),
    "cylinder": (lambda n: primitives.cylinder(0.1, 0.3, n), math.pi * 0.01 * 0.6),
    "capsule": (lambda n: primitives.capsule(0.1, 0.3, n), math.pi * 0.01 * (0.6 + 0.4 / 3)),
}


def moved(mesh, *offset):
    copy = mesh.copy()
    copy.apply_translation(offset)
    return copy


def manifold_volume(meshes):
    parts = [
        manifold3d.Manifold(
            manifold3d.Mesh64(np.array(m.vertices, np.float64), np.array(m.faces, np.uint64))
        )
        for m in meshes
    ]
    return manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add).volume()


@pytest.mark.parametrize("resolution", [4, 8, 12, 16, 30])
@pytest.mark.parametrize("kind", SOLIDS)
def test_a_primitive_of_few_faces_has_the_exact_volume_and_is_closed(kind, resolution):
    make, volume = SOLIDS[kind]
    mesh = make(resolution)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume, rel=1e-14)


def test_default_primitives_have_few_faces():
    counts = {kind: len(make(primitives.RESOLUTION).faces) for kind, (make, _) in SOLIDS.items()}
    assert counts == {"box": 24, "ellipsoid": 72, "cylinder": 48, "capsule": 96}


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, -1, 1)])
@pytest.mark.parametrize("kind", SOLIDS)
def test_a_primitive_has_the_mirror_planes_of_its_solid(kind, mirror):
    triangles = SOLIDS[kind][0](12).triangles
    as_set = lambda t: {tuple(sorted(map(tuple, np.round(x, 9) + 0.0))) for x in t}  # noqa: E731
    assert as_set(triangles * mirror) == as_set(triangles)


def test_the_union_of_random_solids_is_that_of_manifold3d():
    rng = np.random.default_rng(3)
    for _ in range(10):
        parts = []
        for _ in range(int(rng.integers(2, 7))):
            mesh = [*SOLIDS.values()][int(rng.integers(4))][0](12)
            mesh.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
            parts.append(moved(mesh, *rng.uniform(-0.3, 0.3, 3)))
        assert solids.union(parts).volume == pytest.approx(manifold_volume(parts), rel=1e-6)


def test_a_twin_of_a_part_changes_nothing_and_a_single_part_is_handed_back():
    box = trimesh.creation.box((1, 2, 3))
    assert solids.union([box, box.copy()]).volume == pytest.approx(6.0, rel=1e-12)
    assert solids.union([box]) is box


def test_voids_that_water_cannot_reach_are_filled_and_open_ones_are_not():
    ball, hole = trimesh.creation.icosphere(3, 0.5), trimesh.creation.icosphere(3, 0.3)
    hole.invert()
    hollow = trimesh.util.concatenate([ball, hole])
    assert solids.union([hollow]).volume == pytest.approx(ball.volume, rel=1e-12)
    pearl = trimesh.creation.icosphere(2, 0.1)  # a solid within the void is dry too
    assert len(solids.union([trimesh.util.concatenate([ball, hole, pearl])]).faces) == len(
        ball.faces
    )
    plates = [
        moved(trimesh.creation.box(size), *(0.45 * sign * np.array(axis)))
        for size, axis in (
            ((1, 1, 0.1), (0, 0, 1)),
            ((0.1, 1, 1), (1, 0, 0)),
            ((1, 0.1, 1), (0, 1, 0)),
        )
        for sign in (1, -1)
    ]
    assert solids.union(plates).volume == pytest.approx(1.0, rel=1e-9)  # a sealed box of six plates
    opened = solids.union(plates[1:])
    assert opened.volume == pytest.approx(manifold_volume(plates[1:]), rel=1e-9)
    assert solids.decked(opened).volume == pytest.approx(1.0, rel=1e-9)


def test_a_deck_closes_a_boat_at_its_lowest_rim_and_leaves_what_looks_down():
    boat = manifold3d.Manifold.cube((4, 2, 1)) - manifold3d.Manifold.cube((3.6, 1.6, 1)).translate(
        (0.2, 0.2, 0.2)
    )
    notched = boat - manifold3d.Manifold.cube((1, 0.4, 0.3)).translate((1.5, -0.1, 0.7))
    tunnel = notched - manifold3d.Manifold.cube((4, 0.4, 0.1)).translate((0, 0.8, 0))
    mesh = solids._surface(tunnel, 4.0)
    # up to 0.7 the basin is dry; the slot in the bottom, open below, stays water
    want = tunnel.volume() + 3.6 * 1.6 * 0.5
    assert solids.decked(mesh).volume == pytest.approx(want, rel=1e-9)


def test_an_open_mesh_is_capped_across_its_edge():
    bowl = trimesh.creation.icosphere(3).slice_plane([0, 0, 0], [0, 0, -1])
    assert not solids.is_closed(bowl)
    capped = solids.closed_mesh(solids.capped(bowl), fix_normals=True)
    assert capped.volume == pytest.approx(2 / 3 * math.pi, rel=0.02)


@pytest.mark.parametrize("height", [0.9, 0.5, 0.0])
def test_a_stone_with_a_hole_is_its_convex_hull_said_once_and_the_advice_works(height):
    ball = trimesh.creation.icosphere(3).slice_plane([0, 0, height], [0, 0, -1])
    with pytest.warns(MjskipWarning, match="convex hull of .* is taken") as told:
        stone = Stone.from_mesh(ball)
    assert len(told) == 1
    with pytest.raises(MeshError, match=r"give its convex hull, mesh\.convex_hull"):
        Stone.from_mesh(ball, strict=True)
    assert Stone.from_mesh(ball.convex_hull, strict=True).mass == pytest.approx(stone.mass)


def test_one_sided_and_flat_meshes_are_refused_or_said():
    points = [(math.cos(t), math.sin(t), 0.0) for t in np.linspace(0, 2 * math.pi, 9)[:-1]]
    flat = trimesh.Trimesh(
        [(0, 0, 0), *points], [[0, k, k % 8 + 1] for k in range(1, 9)], process=False
    )
    with pytest.raises(MeshError, match="no volume"):
        Stone.from_mesh(flat)


def test_parts_that_touch_are_closed():
    box = trimesh.creation.box((1, 1, 1))
    for offset in ((1, 1, 0), (1, 1, 1)):  # along an edge, at a corner
        both = trimesh.util.concatenate([box, moved(box, *offset)])
        assert Stone.from_mesh(both, density=1.0).mass == pytest.approx(2.0, rel=1e-12)


def test_triangles_without_area_do_not_open_a_mesh():
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    faces = np.vstack([box.faces, [[box.faces[0, 0], box.faces[0, 0], box.faces[0, 1]]]])
    stone = Stone.from_mesh(trimesh.Trimesh(box.vertices, faces, process=False), density=1.0)
    assert stone.mass == pytest.approx(1e-3)
    assert np.isfinite(stone.area_vectors).all()


@pytest.mark.parametrize("wound", [True, False])
def test_normals_are_fixed_by_nesting(wound):
    ball, hole = trimesh.creation.icosphere(3, 0.5), trimesh.creation.icosphere(3, 0.3)
    want = ball.volume - hole.volume
    if wound:
        hole.invert()
    stone = Stone.from_mesh(trimesh.util.concatenate([ball, hole]), density=1.0, fix_normals=True)
    assert stone.mass == pytest.approx(want, rel=1e-12)
    assert stone.volume == pytest.approx(ball.volume, rel=1e-12)  # water does not reach the cavity


@pytest.mark.parametrize("budget", [120, 250, 600])
def test_a_face_budget_keeps_the_volume_and_says_its_error(budget):
    for mesh in (trimesh.creation.icosphere(4), trimesh.creation.torus(1, 0.3)):
        small, cost = solids.simplify(mesh, budget)
        assert len(small.faces) <= budget
        assert solids.is_closed(small)
        assert small.volume == pytest.approx(mesh.volume, rel=1e-12)
        assert cost.faces_before == len(mesh.faces)
        assert cost.area_error == pytest.approx(small.area / mesh.area - 1.0)
        assert abs(cost.volume_error) < 0.15


GEOMS = """<mujoco><asset>{asset}</asset><worldbody><body name="b" pos="0 0 -3"><freejoint/>
  <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>{geoms}</body></worldbody></mujoco>"""


def model_of(geoms, asset=""):
    return mujoco.MjModel.from_xml_string(GEOMS.format(geoms=geoms, asset=asset))


def numbers(values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


def test_a_sealed_ball_is_borne_by_its_outer_volume():
    ball, hole = trimesh.creation.icosphere(3, 0.5), trimesh.creation.icosphere(3, 0.45)
    hole.invert()
    shell = trimesh.util.concatenate([ball, hole])
    faces = " ".join(map(str, np.ravel(shell.faces)))
    asset = f'<mesh name="m" inertia="exact" vertex="{numbers(shell.vertices)}" face="{faces}"/>'
    model = model_of('<geom type="mesh" mesh="m"/>', asset)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with attach(model, data, water=Water.floating(), max_faces=0) as coupling:
        lift = coupling.wrench(data, "b").force[2]
    assert lift == pytest.approx(9810 * ball.volume, rel=1e-6)


def test_a_large_mesh_keeps_within_the_budget_and_the_report_says_so():
    mesh = trimesh.creation.torus(0.3, 0.1, major_sections=60, minor_sections=30)
    faces = " ".join(map(str, np.ravel(mesh.faces)))
    asset = f'<mesh name="m" inertia="exact" vertex="{numbers(mesh.vertices)}" face="{faces}"/>'
    model = model_of('<geom name="ring" type="mesh" mesh="m"/>', asset)
    coupling = Coupling(model, None, Water.floating())
    report = coupling.report().bodies[0]
    assert report.faces <= HullOptions.max_faces < report.faces_before == 3600
    assert report.volume == pytest.approx(mesh.volume, rel=1e-5)  # MuJoCo keeps single precision
    assert 0.0 < abs(report.area_error) < 0.01
    full = Coupling(model, None, Water.floating(), options=HullOptions(max_faces=0))
    assert len(full.hulls[0].faces) == 3600


def test_equal_bodies_share_their_hull_and_attaching_again_builds_nothing(monkeypatch):
    body = '<body pos="{x} 0 0"><freejoint/><geom type="capsule" size=".1 .2"/><geom size=".15"/></body>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{body.format(x=0)}{body.format(x=1)}</worldbody></mujoco>"
    )
    first = Coupling(model, None, Water.floating())
    assert first.hulls[0] is first.hulls[1]
    monkeypatch.setattr(solids, "union", None)
    assert Coupling(model, None, Water.floating()).hulls[0] is first.hulls[0]


def test_the_least_recently_used_hulls_go_first(monkeypatch):
    model = model_of('<geom name="g" size=".1"/>')
    wet = wet_body(model, 1, None)
    built = hull_of(model, wet, HullOptions(), inertia_of(model, 1, wet.members))
    kept = Registry()
    monkeypatch.setattr(Registry, "KEPT_BYTES", 3 * (1000 + 300 * len(built.hull.faces)))
    for key in (b"1", b"2", b"3"):
        kept.keep(key, built)
    assert kept.find(b"1") is built
    kept.keep(b"4", built)
    assert kept.find(b"2") is None
    assert all(kept.find(key) is built for key in (b"1", b"3", b"4"))
    assert len(registry) > 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"resolution": 3}, "resolution is 3"),
        ({"max_faces": 5}, "max_faces is 5: give at least 12, or 0"),
        ({"interior": "dry"}, "interior is 'dry': use one of flooded, deck, convex"),
        ({"strict": "yes"}, "strict is 'yes'"),
    ],
)
def test_options_that_are_none_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        HullOptions(**options)


def test_an_open_boat_is_dry_inside_only_if_asked():
    planks = "".join(
        f'<geom type="box" size="{s}" pos="{p}"/>'
        for s, p in (
            (".5 .3 .01", "0 0 -.1"), (".5 .01 .1", "0 .3 0"), (".5 .01 .1", "0 -.3 0"),
            (".01 .3 .1", ".5 0 0"), (".01 .3 .1", "-.5 0 0"),
        )
    )  # fmt: skip
    model = model_of(planks)
    volumes = {
        interior: Coupling(model, None, Water(), options=HullOptions(interior=interior))
        .hulls[0]
        .volume
        for interior in ("flooded", "deck", "convex")
    }
    assert volumes["flooded"] < 0.04
    assert volumes["deck"] > 0.11
    assert volumes["convex"] == pytest.approx(volumes["deck"], rel=0.03)


def test_nothing_is_said_of_sound_meshes():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Stone.from_mesh(trimesh.creation.torus(1, 0.3))
