"""Bodies and a moving surface, solved together: `mjskip.waves.coupling`."""

import itertools

import numpy as np
import pytest

from mjskip.hydro.laws import LAWS
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, triangles_of, wrench_and_immersion
from mjskip.rigid.attitude import matrices
from mjskip.rigid.body import body_row
from mjskip.rigid.state import pack_states
from mjskip.waves import _coupling_kernels as kernels
from mjskip.waves import coupling
from mjskip.waves.coupling import Surface, SurfaceCoupling

RHO, G0 = 1000.0, 9.81
CELLS, SPACING = 32, 0.01
SPEED, DEPTH = 1.0, 0.05
MONOTONE = [n for n, a in LAWS.items() if not (a.friction or a.speed_squared)]


def operator(kind):
    """Symbol of G on the periodic window of the tests, for rfft2."""
    if kind == "deep":
        return coupling.deep_operator(CELLS, spacing=SPACING, depth=DEPTH)
    corner = np.zeros((CELLS, CELLS))
    stencil = coupling.wave_impulse(wave_speed=SPEED, gravity=G0, spacing=SPACING)
    for i, j in itertools.product((-1, 0, 1), repeat=2):
        corner[i, j] = stencil[i + 1, j + 1]
    return np.fft.rfft2(corner).real


def impulse(kind):
    if kind == "deep":
        return coupling.deep_impulse(CELLS, spacing=SPACING, depth=DEPTH)
    return coupling.wave_impulse(wave_speed=SPEED, gravity=G0, spacing=SPACING)


class Pool:
    """A periodic window of water, moved by NumPy's FFT: the twin of whatever carries the surface."""

    def __init__(self, kind, z, before, *, timestep, damping=0.0):
        self.symbol, self.dt, self.damping = operator(kind), timestep, damping
        self.m = 0.5 * damping * timestep
        self.z, self.before = z, before
        self.free = self.next(np.zeros_like(z))
        x0 = -0.5 * (CELLS - 1) * SPACING
        self.surface = Surface(
            x=x0, y=x0, spacing=SPACING, level=z, rate=(self.free - before) / (2 * timestep)
        )

    def apply(self, symbol, field):
        return np.fft.irfft2(symbol * np.fft.rfft2(field), s=field.shape)

    def next(self, pressure):
        pull = self.apply(self.symbol, G0 * self.z + pressure / RHO)
        old = (1 - self.m) * self.before
        return (2 * self.z - old - self.dt**2 * pull) / (1 + self.m)

    def energy(self, z, after):
        """E between two levels."""
        rate = (after - z) / self.dt
        return SPACING**2 * RHO * (0.5 * G0 * np.sum(z * after) + 0.5 * self.inertia(rate))

    def inertia(self, rate):
        """<rate, G^-1 rate>."""
        inverse = np.divide(1.0, self.symbol, out=np.zeros_like(self.symbol), where=self.symbol > 0)
        return float(np.sum(rate * self.apply(inverse, rate)))

    def damped(self, after):
        rate = (after - self.before) / (2 * self.dt)
        return SPACING**2 * RHO * self.damping * self.inertia(rate)


def waves(rng, height=0.004):
    """Two levels of random waves without short ones and without a mean."""
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(CELLS), np.fft.rfftfreq(CELLS), indexing="ij"))
    found = []
    for _ in range(2):
        spectrum = np.fft.rfft2(rng.standard_normal((CELLS, CELLS))) * np.exp(-((8 * k) ** 2))
        spectrum[0, 0] = 0.0
        found.append(np.fft.irfft2(spectrum, s=(CELLS, CELLS)))
    scale = height / np.abs(found[0]).max()
    return scale * found[0], scale * (found[0] + 0.05 * found[1])


def shapes():
    return Stone.pebble(), Stone.disc(0.03, 0.008, segments=12)


def thrown(rng, stones, spread=0.06):
    """Random wet poses and motions y (n, 13) = x, q, P, L."""
    y = np.zeros((len(stones), 13))
    for row, stone in zip(y, stones, strict=True):
        row[:3] = *rng.uniform(-spread, spread, 2), rng.uniform(-0.01, 0.01)
        row[3:7] = rng.standard_normal(4)
        row[3:7] /= np.linalg.norm(row[3:7])
        row[7:10] = stone.mass * rng.uniform([-4, -4, -4], [4, 4, 1])
        turn = matrices(row[3:7])
        row[10:13] = turn @ stone.inertia @ turn.T @ rng.uniform(-30, 30, 3)
    return y


def states_of(y, stones):
    turns = matrices(y[:, 3:7])
    velocity = np.array([p / s.mass for p, s in zip(y[:, 7:10], stones, strict=True)])
    omega = np.array(
        [
            t @ np.linalg.solve(s.inertia, t.T @ a)
            for t, s, a in zip(turns, stones, y[:, 10:13], strict=True)
        ]
    )
    return pack_states(y[:, :3], turns, velocity, omega)


def kinetic(y, stones):
    s = states_of(y, stones)
    return 0.5 * np.sum(y[:, 7:10] * s[:, 12:15]) + 0.5 * np.sum(y[:, 10:13] * s[:, 15:18])


def coupled(stones, kind, *, law="lee2010", **options):
    water = Water(density=RHO, law=law, air_density=0.0)
    options.setdefault("impulse", impulse(kind))
    return SurfaceCoupling(
        [pack(s, water) for s in stones], spacing=SPACING, density=RHO, **options
    )


def rows_of(stones):
    return np.array([body_row(s.mass, s.inertia) for s in stones])


@pytest.mark.parametrize("law", MONOTONE)
@pytest.mark.parametrize("kind", ["waves", "deep"])
@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_what_bodies_and_surface_lose_is_what_their_relative_motion_dissipates(kind, law, damping):
    rng = np.random.default_rng(12)
    stones, dt = shapes(), 2e-4
    solver = coupled(stones, kind, law=law, damping=damping)
    pressed = 0
    for _ in range(8):
        z, before = waves(rng)
        pool = Pool(kind, z, before, timestep=dt, damping=damping)
        y = thrown(rng, stones)
        first = kinetic(y, stones)
        found = solver.kick(y, pool.surface, dt, rows=rows_of(stones))
        after = pool.next(found.pressure)
        change = kinetic(y, stones) - first + pool.energy(z, after) - pool.energy(before, z)
        lost = dt * (found.dissipation + pool.damped(after))
        assert found.dissipation >= 0.0
        assert change == pytest.approx(-lost, abs=1e-12 * first)
        pressed += len(found.loads)
    assert pressed > 100


def test_forces_of_other_kinds_do_their_work_in_the_same_kick():
    rng = np.random.default_rng(3)
    stones, dt = shapes(), 2e-4
    solver = coupled(stones, "deep")
    z, before = waves(rng)
    pool = Pool("deep", z, before, timestep=dt)
    y, others = thrown(rng, stones), rng.uniform(-1, 1, (2, 6)) * [5, 5, 5, 0.05, 0.05, 0.05]
    first, motion = kinetic(y, stones), states_of(y, stones)[:, 12:]
    found = solver.kick(y, pool.surface, dt, others=others, rows=rows_of(stones))
    mean = 0.5 * (motion + states_of(y, stones)[:, 12:])
    after = pool.next(found.pressure)
    change = kinetic(y, stones) - first + pool.energy(z, after) - pool.energy(before, z)
    work = dt * (np.sum(others * mean) - found.dissipation)
    assert change == pytest.approx(work, abs=1e-12 * first)


def solved(kind, rng, stones, **options):
    z, before = waves(rng)
    pool = Pool(kind, z, before, timestep=2e-4)
    solver = coupled(stones, kind, **options)
    y = thrown(rng, stones)
    states = states_of(y, stones)
    return solver, pool, states, solver.loads(states, pool.surface, pool.dt)


@pytest.mark.parametrize("kind", ["waves", "deep"])
def test_a_slow_twin_finds_the_same_loads(kind):
    """Weights, G and law again in NumPy, each fixed point by bisection under a relaxed iteration."""
    rng = np.random.default_rng(5)
    stones = shapes()
    _, pool, states, found = solved(kind, rng, stones)
    cells = pool.surface.x + SPACING * np.arange(CELLS)
    gap = 1 - (
        ((cells[None, :, None] - found.points[:, 0, None, None]) ** 2)
        + (cells[None, None, :] - found.points[:, 1, None, None]) ** 2
    ) / (coupling.LOAD_RADIUS**2)
    bumps = np.where(gap > 0, gap, 0) ** 2
    bumps /= bumps.sum(axis=(1, 2), keepdims=True)
    nz = found.normals[:, 2]
    pressure = np.einsum("nij,n->ij", bumps, -found.loads * nz) / SPACING**2
    assert found.pressure == pytest.approx(pressure, rel=1e-12, abs=1e-9)
    rate = (pool.next(pressure) - pool.before) / (2 * pool.dt)
    v, w = states[found.bodies, 12:15], states[found.bodies, 15:18]
    own = np.sum(found.normals * (v + np.cross(w, found.arms)), axis=1)
    speeds = own - nz * np.einsum("nij,ij->n", bumps, rate)
    assert found.speeds == pytest.approx(speeds, abs=1e-11)
    loaded = found.loads > 0
    assert (found.speeds[loaded] > 0).all()
    assert (found.speeds[~loaded] <= 0).all()
    area = found.loads[loaded] / (RHO * found.speeds[loaded] ** 2)
    assert (area > 0).all()
    assert area.max() < 1e-3


def test_loads_over_still_hard_water_are_those_of_the_force_kernel():
    """Without response of the surface the law is the one of still water, split or not."""
    rng = np.random.default_rng(8)
    stones = shapes()
    water = Water(density=RHO, gate="local", air_density=0.0)
    still = Surface(
        x=-0.2, y=-0.2, spacing=SPACING, level=np.zeros((40, 40)), rate=np.zeros((40, 40))
    )
    solver = SurfaceCoupling(
        [pack(s, water) for s in stones], spacing=SPACING, impulse=np.zeros((1, 1)), radius=0.2
    )
    for _ in range(20):
        states = states_of(thrown(rng, stones), stones)
        found = solver.loads(states, still, 1e-4)
        for body, stone in enumerate(stones):
            expected = wrench_and_immersion(pack(stone, water), states[body : body + 1])[0, :6]
            assert found.wrenches[body] == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_the_weights_that_sample_are_those_that_spread():
    rng = np.random.default_rng(1)
    _, pool, _, _ = solved("deep", rng, shapes())
    frame = np.array([pool.surface.x, pool.surface.y, SPACING, 0.0])
    faces = np.zeros((50, kernels.FACE))
    faces[:, :2] = rng.uniform(-0.2, 0.2, (50, 2))  # some reach over the edge, some are outside
    side = 5
    spots = np.zeros((50, kernels.SPOT + side**2))
    open_cells = np.ones((CELLS, CELLS), np.uint8)
    open_cells[20:, 25:] = 0
    kernels.spread_bumps(faces, 50, frame, 0.02, open_cells, side, spots)
    field, loads = rng.standard_normal((CELLS, CELLS)), rng.standard_normal(50)
    pressed = np.zeros((CELLS, CELLS))
    sampled = np.array([kernels.sample(spot, side, field) for spot in spots])
    for spot, load in zip(spots, loads, strict=True):
        kernels.add_spot(spot, side, load, pressed)
    assert np.dot(sampled, loads) == pytest.approx(np.sum(field * pressed), rel=1e-13)
    sums = spots[:, kernels.SPOT :].sum(axis=1)
    assert np.minimum(abs(sums - 1), abs(sums)).max() < 1e-14
    assert (pressed[open_cells == 0] == 0).all()


@pytest.mark.parametrize("kind", ["waves", "deep"])
def test_the_response_is_symmetric_and_takes_energy_from_no_load(kind):
    rng = np.random.default_rng(2)
    solver, _, _, found = solved(kind, rng, shapes())
    n = len(found.loads)
    matrix = solver._work[2][:n, :n]
    assert (matrix == matrix.T).all()
    values = np.linalg.eigvalsh(matrix)
    assert values.min() > -1e-13 * values.max()


@pytest.mark.parametrize("kind", ["waves", "deep"])
def test_the_profile_of_a_bump_is_the_response_on_fine_cells(kind):
    """To second order in the cells."""
    radius, cells, spacing = 0.02, 128, 0.0025
    if kind == "deep":
        table = coupling.deep_impulse(cells, spacing=spacing)
        profile = coupling.deep_profile(radius=radius, extent=0.15)
    else:
        table = coupling.wave_impulse(wave_speed=1.0, gravity=G0, spacing=spacing)
        profile = coupling.wave_profile(wave_speed=1.0, gravity=G0, radius=radius)
    gaps = np.array([0.0, 0.007, 0.013, 0.021, 0.03])
    faces = np.zeros((5, kernels.FACE))
    faces[:, 0], faces[:, 5 + 2] = gaps + 0.11, -1.0
    faces[:, 1] = 0.1513
    side = int(2 * radius / spacing) + 1
    spots, exact, quick = np.zeros((5, 2 + side**2)), np.zeros((5, 5)), np.zeros((5, 5))
    everywhere = np.ones((cells, cells), np.uint8)
    kernels.spread_bumps(
        faces, 5, np.array([0.0, 0.0, spacing, 0.0]), radius, everywhere, side, spots
    )
    field = np.empty((cells, cells))
    kernels.surface_response(faces, 5, spots, side, table, 1.0 / spacing**2, field, exact)
    kernels.surface_response_by_distance(
        faces, 5, profile, coupling.PROFILE_PER_RADIUS / radius, 1.0, quick
    )
    assert quick[0] == pytest.approx(exact[0], abs=1.5 * (spacing / radius) ** 2 * exact[0, 0])


def test_the_water_takes_the_vertical_impulse_that_the_bodies_give():
    """Newton's third law; the pressure is vertical, the horizontal impulse is not given to the water."""
    rng = np.random.default_rng(4)
    for _ in range(5):
        _, _, _, found = solved("deep", rng, shapes())
        pressed = np.sum(found.pressure) * SPACING**2
        assert pressed == pytest.approx(found.wrenches[:, 2].sum(), rel=1e-12, abs=1e-12)


def test_the_order_of_the_faces_does_not_matter():
    rng = np.random.default_rng(6)
    stones = shapes()
    _, pool, states, found = solved("deep", rng, stones)
    swapped = coupled(stones[::-1], "deep").loads(states[::-1].copy(), pool.surface, pool.dt)
    assert found.sweeps < 40
    assert swapped.wrenches[::-1] == pytest.approx(found.wrenches, rel=1e-10, abs=1e-12)
    assert swapped.pressure == pytest.approx(found.pressure, rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("kind", ["waves", "deep"])
def test_two_equal_stones_that_meet_are_half_a_turn_of_each_other(kind):
    """Both are solved at once: neither is the first."""
    stone = Stone.disc(0.03, 0.008, segments=12)
    half, c, s = np.array([-1, -1, 1, -1, -1, 1]), np.cos(0.1), np.sin(0.1)
    y = np.zeros((2, 13))
    y[:, :7] = [0.025, 0.003, -0.002, c, 0, s, 0], [-0.025, -0.003, -0.002, 0, -s, 0, c]
    y[0, 7:] = *(stone.mass * np.array([-3.0, 0.4, -2.0])), 1e-4, 2e-4, 3e-3
    y[1, 7:] = half * y[0, 7:]
    z = np.zeros((CELLS, CELLS))
    pool = Pool(kind, z, z, timestep=2e-4)
    found = coupled((stone, stone), kind).loads(states_of(y, (stone, stone)), pool.surface, pool.dt)
    assert found.wrenches[0, 2] > 1.0
    assert found.wrenches[0] == pytest.approx(half * found.wrenches[1], rel=1e-12, abs=1e-12)
    alone = coupled((stone,), kind).loads(states_of(y[:1], (stone,)), pool.surface, pool.dt)
    assert abs(alone.wrenches[0, 2] - found.wrenches[0, 2]) > 1e-4 * found.wrenches[0, 2]


def test_a_flight_without_loads_keeps_energy_and_angular_momentum():
    stone = Stone.from_mesh(_box(), density=2000.0)
    rng = np.random.default_rng(0)
    y = thrown(rng, [stone])
    y[:, 10:13] *= 4
    first, spin = kinetic(y, [stone]) + stone.mass * G0 * y[0, 2], y[0, 10:13].copy()
    row = body_row(stone.mass, stone.inertia, gravity=(0.0, 0.0, -G0))
    for _ in range(2000):
        kernels.free_flight(row, y[0], 5e-4, 0.01, np.empty(18))
    assert kinetic(y, [stone]) + stone.mass * G0 * y[0, 2] == pytest.approx(first, rel=1e-10)
    assert (y[0, 10:13] == spin).all()


def _box():
    import trimesh

    return trimesh.creation.box(extents=(0.05, 0.03, 0.02))


def test_splitting_keeps_area_and_centroid_and_leaves_no_long_edge():
    block = pack(Stone.disc(0.05, 0.01, segments=24), Water())
    split = coupling.split_block(block, 0.02)
    corners, old = triangles_of(split), triangles_of(block)
    assert np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max() <= 0.02
    areas, old_areas = (
        0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
        for t in (corners, old)
    )
    assert areas.sum() == pytest.approx(old_areas.sum(), rel=1e-12)
    moment = np.einsum("nij,n->j", corners, areas)
    assert moment == pytest.approx(np.einsum("nij,n->j", old, old_areas), abs=1e-12)


def test_a_law_that_pulls_along_the_face_is_refused():
    with pytest.raises(ValueError, match=r"bocquet2003.*use one of lee2010"):
        coupling.check_law("bocquet2003")
    assert coupling.check_law("rosellini2005_forward").forward


def test_a_bump_narrower_than_a_cell_is_refused():
    with pytest.raises(ValueError, match="radius of a cell at least"):
        coupled(shapes(), "deep", radius=0.005)
