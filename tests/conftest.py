"""What the tests share: random stones and motions, a slow twin of the force law, costly runs."""

import numpy as np
import pytest
import trimesh
from hypothesis import settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mjskip import Limits, Stone, Throw, Water, integrate
from mjskip.throws.scene import load_scene

settings.register_profile("mjskip", deadline=None, database=None, derandomize=True, max_examples=40)
settings.load_profile("mjskip")

GRAVITY = 9.81


def _hull(seed):
    """A random convex polyhedron, 5 to 20 cm across, flat or long."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(6, 30)), 3)) * rng.uniform(0.02, 0.1, 3)
    return trimesh.convex.convex_hull(points)


def _ring(seed):
    """A torus: not convex, with a hole."""
    rng = np.random.default_rng(seed)
    return trimesh.creation.torus(
        rng.uniform(0.05, 0.1), rng.uniform(0.01, 0.04), major_sections=9, minor_sections=7
    )


hulls = st.integers(0, 10**6).map(_hull)
meshes = st.one_of(hulls, st.integers(0, 10**6).map(_ring))
stones = st.one_of(
    meshes.map(Stone.from_mesh), st.sampled_from([Stone.pebble(), Stone.disc(0.05, 0.01)])
)


@st.composite
def motions(draw, speed=10.0, spin=300.0):
    """A pose with the centre within 8 cm of the surface, and a motion: arguments of `wrench`."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    q = rng.normal(size=4)
    return {
        "position": np.array([*rng.uniform(-2, 2, 2), rng.uniform(-0.08, 0.08)]),
        "q": q / np.linalg.norm(q),
        "velocity": rng.normal(size=3) * speed,
        "omega": rng.normal(size=3) * spin,
    }


def rotation(q):
    """Rotation matrix of a w-x-y-z quaternion."""
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def immersed(triangles):
    """Immersed area (m,) and its centroid (m, 3) of world triangles (m, 3, 3), water at z = 0.

    Every edge is clipped at the surface and spans a small triangle with one point of the waterline
    (or a corner): the fan of them is the immersed polygon.
    """
    start, end = triangles, np.roll(triangles, -1, axis=1)
    h0, h1 = start[..., 2], end[..., 2]
    cut = (h0 < 0) != (h1 < 0)
    with np.errstate(all="ignore"):
        where = np.where(cut, h0 / (h0 - h1), 0.0)
    crossing = start + where[..., None] * (end - start)
    first = np.where((h0 < 0)[..., None], start, crossing)
    last = np.where((h1 < 0)[..., None], end, crossing)
    dry = (h0 >= 0) & (h1 >= 0)
    last = np.where(dry[..., None], first, last)
    rows, edge = np.arange(len(triangles)), np.argmax(cut, axis=1)
    apex = np.where(cut.any(axis=1)[:, None], crossing[rows, edge], start[:, 0])[:, None]
    areas = 0.5 * np.cross(first - apex, last - apex)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    signed = np.einsum("nej,nj->ne", areas, normal)
    total = signed.sum(axis=1)
    moment = np.einsum("ne,nej->nj", signed, (apex + first + last) / 3.0)
    with np.errstate(all="ignore"):
        centroid = np.where(total[:, None] > 0, moment / total[:, None], 0.0)
    return total, centroid


def twin(stone, water, position, q, velocity, omega, *, handed=1.0):
    """Equations (1)-(4) and the other laws whose load acts at centroids: vectorised, in world axes, from the papers.

    handed = -1 is the paper as printed, V_i = r x omega and tau = F x r.

    Returns:
        Water force, water torque, air force, air torque.
    """
    turn = rotation(q)
    triangles = position + stone.vertices[stone.faces] @ turn.T
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    area, centroid = immersed(triangles)
    r = centroid - position
    at_face = velocity + handed * np.cross(omega, r)
    vn = np.einsum("nj,nj->n", at_face, normal)
    vn_centre = normal @ velocity
    loaded = (vn > 0 if water.gate == "local" else vn_centre >= 0) & (area > 0)
    speed = np.linalg.norm(velocity)
    along = velocity - vn_centre[:, None] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    push = {
        "none": lambda: np.zeros_like(normal),
        "lee2010": lambda: vn[:, None] ** 2 * normal,
        "nagahiro2005": lambda: 0.5 * 1.4 * vn[:, None] ** 2 * normal,
        "birkhoff1944": lambda: 0.5 * vn[:, None] ** 2 * normal,
        "rosellini2005": lambda: 0.5 * speed * vn[:, None] * normal,
        "bocquet2003": lambda: 0.5 * speed**2 * normal + 0.5 * speed**2 * along,
    }[water.law]()
    forces = -water.density * np.where(loaded, area, 0.0)[:, None] * push
    torque = handed * np.cross(r, forces).sum(axis=0)
    n = turn @ stone.disc_normal
    arm = turn @ stone.disc_centre
    vn_disc = n @ (velocity + handed * np.cross(omega, arm))
    air = -water.air_density * vn_disc * abs(vn_disc) * stone.disc_area * n
    return forces.sum(axis=0), torque, air, handed * np.cross(arm, air)


@pytest.fixture(scope="session")
def clanet():
    """The aluminium disc of Clanet, Hersen & Bocquet (2004)."""
    return Stone.disc(0.025, 0.00275, density=2700.0)


@pytest.fixture(scope="session")
def frozen_touch(clanet):
    """The oracle's touch: 3.5 m/s at 20/20 degrees with frozen attitude, no air."""
    return integrate(
        clanet,
        Throw.from_degrees(speed=3.5, spin=0, attack=20, descent=20, height=0),
        water=Water(air_density=0),
        timestep=1e-4,
        limits=Limits(duration=0.12),
        frozen_attitude=True,
    )


@pytest.fixture(scope="session")
def lake():
    """The default scene."""
    return load_scene("lake")


@pytest.fixture(scope="session")
def clanet_scene():
    """Clanet's disc as a scene."""
    return load_scene("clanet_disc")
