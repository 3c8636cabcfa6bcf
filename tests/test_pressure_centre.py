"""Laws whose load acts ahead of the middle of the wet face, by Rayleigh (1876)."""

from __future__ import annotations

import itertools
import math

import mujoco
import numpy as np
import pytest
import shapely
import trimesh
from conftest import rotation
from scipy.integrate import quad

from mjskip import Limits, Stone, Throw, Water, attach, integrate, simulate, wrench
from mjskip.hydro.laws import LAWS
from mjskip.hydro.water import GATES
from mjskip.sweeps.batch import throw_all

FORWARD = [name for name, law in LAWS.items() if law.forward]


def tilted(degrees):
    """Nose up: turned about -y."""
    half = math.radians(degrees) / 2.0
    return math.cos(half), 0.0, -math.sin(half), 0.0


@pytest.mark.parametrize("degrees", [5.0, 20.0, 60.0])
def test_a_half_wet_plate_is_loaded_where_rayleigh_says(degrees):
    # a thin square plate moving level, nose up by `degrees`, wet up to its middle line
    side, thin = 0.2, 1e-4
    plate = Stone.from_mesh(trimesh.creation.box((side, side, thin)), density=2700.0)
    load = wrench(
        plate,
        Water(air_density=0.0, law="lee2010_forward"),
        position=(0.0, 0.0, 0.5 * thin * math.cos(math.radians(degrees))),
        q=tilted(degrees),
        velocity=(1.0, 0.0, 0.0),
    )
    lever = load.torque[1] / np.linalg.norm(load.force)  # nose down: the load is behind the middle
    wet, theta = side / 2.0, math.radians(degrees)
    ahead = 0.75 * math.cos(theta) / (4.0 + math.pi * math.sin(theta)) * wet
    # the edge of thickness 1e-4 has no load in this motion but at 90 degrees to the face; its lever is nil
    assert lever == pytest.approx(wet / 2.0 - ahead, rel=5e-3)


@pytest.mark.parametrize("degrees", [5.0, 30.0, 60.0, 89.0])
def test_rayleighs_formula_is_that_of_kirchhoffs_flow_past_a_plate(degrees):
    """The flow itself, by quadrature: on the plate w = V l' / (t - cos theta)^2 and V dz/dw = |t| + sqrt(t^2 - 1),
    |t| > 1, the rims at t = 1 (behind) and -1, the stagnation point at infinity; u = 1 / t."""
    theta = math.radians(degrees)

    def slowness(u):
        return (1.0 + math.sqrt(1.0 - u * u)) / abs(u)

    def length(u):
        return 2.0 * slowness(u) / abs(1.0 / u - math.cos(theta)) ** 3 / u**2

    def load(u):  # over rho V^2
        return 0.5 * (1.0 - slowness(u) ** -2) * length(u)

    def over(function, start, stop):
        return quad(function, start, stop, limit=500)[0]

    behind, front = over(length, 0.0, 1.0), over(length, -1.0, 0.0)
    total, force = behind + front, over(load, 0.0, 1.0) + over(load, -1.0, 0.0)
    moment = over(lambda u: load(u) * over(length, u, 1.0), 0.0, 1.0)
    moment += over(lambda u: load(u) * (behind + over(length, u, 0.0)), -1.0, 0.0)
    sine = math.pi * math.sin(theta)
    assert force / total == pytest.approx(sine / (4.0 + sine), rel=1e-8)
    ahead = 0.75 * math.cos(theta) / (4.0 + sine)
    assert moment / force / total - 0.5 == pytest.approx(ahead, abs=1e-8)


@pytest.mark.parametrize("law", ["lee2010", "rosellini2005"])
def test_the_force_is_that_of_the_law_when_nothing_turns(law):
    # without rotation every point of a face has one velocity: only the place of the load differs
    stone = Stone.lens(0.04, 0.02)
    pose = {"position": (0.0, 0.0, 0.002), "q": tilted(15.0), "velocity": (8.0, 0.5, -2.0)}
    ahead = wrench(stone, Water(law=f"{law}_forward"), **pose)
    middle = wrench(stone, Water(law=law), **pose)
    assert ahead.force == pytest.approx(middle.force, rel=1e-12)  # rounding
    assert ahead.torque[1] < middle.torque[1]  # less nose down


@pytest.mark.parametrize("degrees", [2.0, 20.0, 70.0, 90.0])
def test_rayleighs_load_is_that_of_a_plate_with_a_cavity_behind_it(degrees):
    # a square plate under water, moving level against its face tilted by `degrees`
    side, thin, speed, theta = 0.2, 1e-4, 3.0, math.radians(degrees)
    plate = Stone.from_mesh(trimesh.creation.box((side, side, thin)), density=2700.0)
    load = wrench(
        plate,
        Water(air_density=0.0, law="rayleigh1876_forward"),
        position=(0.0, 0.0, -1.0),
        q=tilted(degrees),
        velocity=(speed, 0.0, 0.0),
    )
    sine = math.sin(theta)
    expected = 1000.0 * speed**2 * side**2 * math.pi * sine / (4.0 + math.pi * sine)
    normal = np.array([-sine, 0.0, math.cos(theta)])
    edge = 1000.0 * speed**2 * side * thin  # at most, of the edges
    assert load.force @ normal == pytest.approx(expected, abs=edge)
    ahead = 0.75 * math.cos(theta) / (4.0 + math.pi * sine) * side
    assert load.torque[1] == pytest.approx(-expected * ahead, abs=edge * side)


def prism(outline, height=0.004, holes=()):
    """A plate of this outline about its centre of mass."""
    polygon = shapely.Polygon(outline, holes)
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    points = np.array([shapely.get_coordinates(shapely.normalize(p).reverse())[:3] for p in pieces])
    flat, faces = np.unique(points.reshape(-1, 2), axis=0, return_inverse=True)
    mesh = trimesh.creation.extrude_triangulation(flat, faces.reshape(-1, 3), height)
    return Stone.from_mesh(mesh, density=1500.0, fix_normals=True)


SHAPES = {
    "bar": [(0, 0), (0.3, 0), (0.3, 0.02), (0, 0.02)],
    "L": [(0, 0), (0.2, 0), (0.2, 0.05), (0.05, 0.05), (0.05, 0.15), (0, 0.15)],
    "U": [(0, 0), (0.2, 0), (0.2, 0.15), (0.15, 0.15), (0.15, 0.03), (0.05, 0.03), (0.05, 0.15), (0, 0.15)],
    "paddle": [(-0.03, 0), (0.03, 0), (0.04, 0.2), (0.01, 0.22), (0.01, 0.8), (-0.01, 0.8), (-0.01, 0.22), (-0.04, 0.2)],
    "pointed": [(0, 0), (0.25, 0.06), (0, 0.12), (0.08, 0.06)],
}  # fmt: skip
SHAPED = {name: prism(outline) for name, outline in SHAPES.items()}
SHAPED["holed"] = prism(
    [(0, 0), (0.2, 0), (0.2, 0.15), (0, 0.15)],
    holes=[[(0.05, 0.05), (0.05, 0.1), (0.12, 0.1), (0.12, 0.05)]],
)


def strips_by_shapely(stone, water, position, q, velocity, omega):
    """Force and torque of a forward law by other means: faces by trimesh, outlines and strips by shapely.

    Gauss points across the motion between the corners of the wet outline, and along each strip's front part.
    """
    law, turn = LAWS[water.law], rotation(q)
    mesh = trimesh.Trimesh(stone.vertices @ turn.T, stone.faces, process=False)
    groups = [list(f) for f in mesh.facets]
    inside = {i for group in groups for i in group}
    groups += [[i] for i in range(len(mesh.faces)) if i not in inside]
    nodes, weights = np.polynomial.legendre.leggauss(12)
    force, torque, speed = np.zeros(3), np.zeros(3), np.linalg.norm(velocity)
    for group in groups:
        n = mesh.face_normals[group[0]]
        vn = n @ velocity
        if vn < 0.0:
            continue
        t = (velocity - vn * n) / np.linalg.norm(velocity - vn * n)
        s, d = np.cross(n, t), n @ mesh.triangles[group[0], 0]
        flat = shapely.union_all(
            [shapely.Polygon(c @ np.array([t, s]).T) for c in mesh.triangles[group]],
            grid_size=1e-12,
        )
        # below water: position_z + t_z x + s_z y + d n_z < 0
        slope, far = np.array([t[2], s[2]]), 10.0
        foot = -(position[2] + d * n[2]) / (slope @ slope) * slope
        down, side = -slope / np.linalg.norm(slope), np.array([slope[1], -slope[0]])
        side = side / np.linalg.norm(side)
        half = [
            foot + far * side,
            foot - far * side,
            foot - far * side + far * down,
            foot + far * (side + down),
        ]
        wet = shapely.intersection(flat, shapely.Polygon(half))
        if wet.is_empty:
            continue
        sine = abs(vn) / speed
        share = 1.5 * math.sqrt(1.0 - sine * sine) / (4.0 + math.pi * sine)
        levels = np.unique(shapely.get_coordinates(wet)[:, 1])
        for low, high in itertools.pairwise(levels):
            for y, wy in zip(0.5 * (low + high) + 0.5 * (high - low) * nodes, weights, strict=True):
                cut = shapely.intersection(wet, shapely.LineString([(-far, y), (far, y)]))
                for piece in shapely.get_parts(cut):
                    if piece.geom_type != "LineString" or piece.is_empty:
                        continue
                    x0, x1 = sorted(shapely.get_coordinates(piece)[:, 0])
                    x0 = x0 + share * (x1 - x0)
                    for x, wx in zip(
                        0.5 * (x0 + x1) + 0.5 * (x1 - x0) * nodes, weights, strict=True
                    ):
                        r = x * t + y * s + d * n
                        v = n @ (velocity + np.cross(omega, r))
                        p = law.normal_squared * v * v + law.speed_normal * speed * v
                        p += law.cavity * speed**2 * math.pi * v / (4.0 * speed + math.pi * abs(v))
                        area = 0.25 * wx * (x1 - x0) * wy * (high - low) / (1.0 - share)
                        push = -water.density * p * area * n
                        force += push
                        torque += np.cross(r, push)
    return force, torque


@pytest.mark.parametrize("law", FORWARD)
@pytest.mark.parametrize("name", SHAPED)
def test_strips_of_any_outline_are_those_that_shapely_cuts(name, law):
    stone, rng = SHAPED[name], np.random.default_rng(sum(map(ord, name + law)))
    for _ in range(3):
        q = rng.normal(size=4)
        motion = {
            "position": np.array([0.0, 0.0, rng.uniform(-0.05, 0.05)]),
            "q": q / np.linalg.norm(q),
            "velocity": rng.normal(size=3) * 5.0,
            "omega": rng.normal(size=3) * 5.0,
        }
        water = Water(law=law, air_density=0.0)
        found = wrench(stone, water, **motion)
        force, torque = strips_by_shapely(stone, water, **motion)
        scale = np.linalg.norm(force)
        # outlines by shapely are rounded to 1e-12 m; where v changes sign Rayleigh's load has a kink
        rel = 1e-8 if law != "rayleigh1876_forward" else 1e-3
        np.testing.assert_allclose(found.force, force, atol=rel * scale)
        np.testing.assert_allclose(found.torque, torque, atol=rel * scale * stone.radius)


@pytest.mark.parametrize("law", FORWARD)
@pytest.mark.parametrize("name", SHAPED)
def test_the_load_of_a_face_acts_within_it(name, law):
    """Of the lower face alone: the plates are thin, and level motion meets no edge but its own."""
    stone = SHAPED[name]
    outline = shapely.convex_hull(shapely.MultiPoint(stone.vertices[:, :2]))
    for heading in np.linspace(0.0, 2.0 * math.pi, 9):
        # a face that sinks while it goes: the normal is vertical, the motion oblique to the face
        velocity = np.array([4.0 * math.cos(heading), 4.0 * math.sin(heading), -1.0])
        faces = {"position": (0.0, 0.0, -1.0), "velocity": velocity}
        found = wrench(stone, Water(law=law, air_density=0.0), **faces)
        # forces on the edges have no vertical part; their torque about x and y is at most that of half the height
        edge = 0.5 * 0.004 * np.linalg.norm(found.force[:2])
        place = np.array([-found.torque[1], found.torque[0]]) / found.force[2]
        assert outline.distance(shapely.Point(place)) <= edge / found.force[2]
        assert place @ velocity[:2] > -edge / found.force[2] - 1e-12 or name in (
            "L",
            "U",
            "pointed",
            "paddle",
        )


@pytest.mark.parametrize("law", FORWARD)
@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("name", ["L", "holed", "bar"])
def test_cutting_the_triangles_of_plane_faces_changes_nothing(name, gate, law):
    stone, rng = SHAPED[name], np.random.default_rng(7)
    mesh = trimesh.Trimesh(stone.vertices, stone.faces, process=False)
    fine = Stone.from_mesh(mesh.subdivide().subdivide(), density=1500.0)
    for _ in range(4):
        q = rng.normal(size=4)
        motion = {
            "position": np.array([0.0, 0.0, rng.uniform(-0.05, 0.05)]),
            "q": q / np.linalg.norm(q),
            "velocity": rng.normal(size=3) * 5.0,
            "omega": rng.normal(size=3) * 40.0,
        }
        water = Water(law=law, gate=gate, air_density=0.0)
        whole, cut = wrench(stone, water, **motion), wrench(fine, water, **motion)
        scale = np.linalg.norm(whole.force) + 1e-9
        np.testing.assert_allclose(cut.force, whole.force, atol=1e-10 * scale)
        np.testing.assert_allclose(cut.torque, whole.torque, atol=1e-10 * scale * stone.radius)


def test_a_plane_face_of_single_precision_is_one_face():
    # as MuJoCo keeps the vertices of meshes
    stone = SHAPED["bar"]
    mesh = trimesh.Trimesh(stone.vertices, stone.faces, process=False).subdivide().subdivide()
    vertices = mesh.vertices.astype(np.float32).astype(float)
    bent = Stone.from_mesh(trimesh.Trimesh(vertices, mesh.faces, process=False), density=1500.0)
    water = Water(law="lee2010_forward", air_density=0.0)
    motion = {"position": (0, 0, -1.0), "velocity": (3.0, 1.0, -1.0)}
    exact, found = wrench(stone, water, **motion), wrench(bent, water, **motion)
    np.testing.assert_allclose(found.torque, exact.torque, atol=1e-5 * abs(exact.torque).max())


@pytest.mark.parametrize("law", FORWARD)
@pytest.mark.parametrize("spin", [0.0, 10.0, 65.0])
def test_water_only_takes_energy_by_the_local_gate(law, spin):
    # the velocity of the face is taken where the load acts: the power is -load (V.n) <= 0
    disc = Stone.disc(0.025, 0.00275, density=2700.0)
    throw = Throw.from_degrees(speed=3.5, spin=spin, attack=20.0, descent=20.0, height=0.0)
    water = Water(air_density=0.0, law=law, gate="local")
    energy = integrate(disc, throw, water=water, timestep=1e-4, limits=Limits(duration=0.1)).energy
    assert np.diff(energy).max() <= 1e-9 * energy[0]  # truncation of RK4


def test_the_real_discs_throw_bounces_where_the_papers_law_keeps_it():
    disc = Stone.disc(0.025, 0.00275, density=2700.0)
    throw = Throw.from_degrees(speed=3.5, spin=65.0, attack=20.0, descent=20.0, height=0.0)
    skips = {
        law: integrate(disc, throw, water=Water(air_density=0.0, law=law), timestep=2e-4).skips > 0
        for law in ("lee2010", "lee2010_forward")
    }
    assert skips == {"lee2010": False, "lee2010_forward": True}


def test_a_disc_let_go_under_water_takes_the_added_mass_with_it():
    """From rest m a = m g - m_a a: N = m_a g / (1 + m_a / m) on the face that would sink."""
    disc = Stone.disc(0.05, 0.004, segments=128, density=3000.0)
    still = {"position": (0.0, 0.0, -1.0), "velocity": (0.0, 0.0, -1e-6)}
    found = wrench(
        disc, Water(law="rayleigh1876_forward", added_mass=1.0, air_density=0.0), **still
    )
    area = disc.disc_area
    lam = 0.1**2 / area
    square = 1.0 + lam**2
    mass = 1000.0 * math.pi / 8.0 * 0.1 * area * (1.0 - 0.425 * lam / square) / math.sqrt(square)
    assert found.force[2] == pytest.approx(
        mass * 9.81 / (1.0 + mass / disc.mass), rel=2e-3
    )  # 128-gon
    assert found.force[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert wrench(disc, Water(law="rayleigh1876_forward"), **still).force[2] < 1e-6


def test_a_plate_that_grows_wetter_is_pressed_by_the_growth():
    """Without weight and with endless inertia N - Q = V.n dm_a/dt, here by differences of m_a of rectangles."""
    beam, angle, speed = 0.2, math.radians(15.0), np.array([4.0, 0.0, -1.0])
    plate = Stone.from_mesh(trimesh.creation.box((0.6, beam, 1e-4)), density=1e9)
    wet = 0.25  # of the lower face, from its trailing edge
    height = (0.3 - wet) * math.sin(angle)
    at = {"position": (0.0, 0.0, height), "q": tilted(15.0), "velocity": speed}
    loads = [
        wrench(plate, Water(law="rayleigh1876_forward", added_mass=share, air_density=0.0), **at)
        for share in (0.0, 1.0)
    ]
    normal = np.array([-math.sin(angle), 0.0, math.cos(angle)])
    sinking = -normal @ speed

    def mass(length):
        lam = length / beam
        square = 1.0 + lam**2
        shape = (1.0 - 0.425 * lam / square) / math.sqrt(square)
        return 1000.0 * math.pi / 8.0 * length**2 * beam * shape

    growth = -speed[2] / math.sin(angle)  # of the wetted length
    rate = (mass(wet + 1e-6) - mass(wet - 1e-6)) / 2e-6 * growth
    weight = mass(wet) * 9.81 * math.cos(angle)  # of the water that a0 = g would take along
    gained = (loads[1].force - loads[0].force) @ normal
    assert gained == pytest.approx(sinking * rate + weight, rel=5e-3)  # edges of 0.1 mm


def test_added_mass_is_for_plates_and_for_what_is_thrown():
    with pytest.raises(ValueError, match="law 'lee2010' has no plates: use one of lee2010_forward"):
        Water(added_mass=1.0)
    with pytest.raises(ValueError, match="added_mass"):
        Water(law="lee2010_forward", added_mass=1.5)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="b"><freejoint/><geom type="box" size=".1 .1 .1"/></body></worldbody></mujoco>'
    )
    water = Water(law="rayleigh1876_forward", added_mass=1.0)
    with pytest.raises(ValueError, match="added_mass is 1, which needs a body that is free"):
        attach(model, mujoco.MjData(model), water=water)


@pytest.mark.parametrize("law", ["rayleigh1876_forward", "birkhoff1944"])
def test_both_engines_the_plugin_and_a_sweep_take_a_law_alike(law, tmp_path):
    path = tmp_path / "disc.xml"
    scene = f"""<custom><text name="mjskip.law" data="{law}"/>
        <numeric name="mjskip.air_density" data="0"/></custom>"""
    plugin = f"""<extension><plugin plugin="mjskip.water"><instance name="w">
        <config key="law" value="{law}"/><config key="air_density" value="0"/>
        </instance></plugin></extension>"""
    for head, carried in ((scene, ""), (plugin, '<plugin instance="w"/>')):
        path.write_text(f"""<mujoco><option timestep=".0002" integrator="RK4"/>{head}
            <worldbody><body name="b"><freejoint/>{carried}
            <geom type="box" size=".05 .04 .01" density="1500"/></body></worldbody></mujoco>""")
        throw = Throw.from_degrees(speed=6.0, spin=20.0, attack=20.0, descent=20.0, height=0.005)
        limits = Limits(duration=0.05)
        runs = [
            simulate(path, throw, engine=engine, timestep=2e-4, limits=limits)
            for engine in ("mujoco", "reference")
        ]
        assert runs[0].position[-1] == pytest.approx(runs[1].position[-1], abs=1e-5)
    outcomes = [
        throw_all(
            SHAPED["bar"],
            [throw],
            water=[Water(law=name, air_density=0.0)],
            timestep=2e-4,
            limits=limits,
            air="fixed",
        )
        for name in (law, "lee2010")
    ]
    one = integrate(
        SHAPED["bar"], throw, water=Water(law=law, air_density=0.0), timestep=2e-4, limits=limits
    )
    assert outcomes[0].distance[0] == pytest.approx(one.position[-1, 0], abs=1e-6)
    assert outcomes[0].distance[0] != outcomes[1].distance[0]
