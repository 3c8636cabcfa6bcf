"""The water surface obeys the damped wave equation, its exact laws and its exact limits."""

import math

import numpy as np
import numpy.typing as npt
import pytest

from mjskip.errors import MjskipError
from mjskip.waves import HeightField, wind_waves
from mjskip.waves import _medium_kernels as medium
from mjskip.waves import _tile_kernels as kernels
from mjskip.waves.grid import WaveGrid

Grid = npt.NDArray[np.float32]
NINE = ((2.0 / 3.0, 1.0 / 6.0), "nine_point", math.sqrt(3.0) / 2.0)
FIVE = ((1.0, 0.0), "five_point", 1.0 / math.sqrt(2.0))


def laplacian(z: npt.NDArray[np.float64], edge: float, corner: float) -> npt.NDArray[np.float64]:
    """The slow twin: weights written out, walls mirrored."""
    p = np.pad(z, 1, mode="edge")
    edges = p[:-2, 1:-1] + p[2:, 1:-1] + p[1:-1, :-2] + p[1:-1, 2:]
    corners = p[:-2, :-2] + p[:-2, 2:] + p[2:, :-2] + p[2:, 2:]
    return edge * edges + corner * corners - 4.0 * (edge + corner) * z


def energy(z: Grid, v: Grid, *, spacing: float, wave_speed: float) -> float:
    """What the undamped wave equation conserves: half the integral of z_t^2 + c^2 |grad z|^2."""
    z = z.astype(np.float64)
    slopes = (np.diff(z, axis=0) ** 2).sum() + (np.diff(z, axis=1) ** 2).sum()
    return 0.5 * (
        float((v.astype(np.float64) ** 2).sum()) * spacing**2 + wave_speed**2 * float(slopes)
    )


def raw_growth(stencil: str, courant: float, m: float, steps: int = 3000) -> float:
    """Largest elevation, over the first one, after unchecked steps from noise; `m` is mu t / 2."""
    grid = WaveGrid((32, 32), courant, 2.0 * m, stencil=stencil, periodic=True)
    grid.z[...] = np.random.default_rng(1).uniform(-1, 1, grid.z.shape)
    grid.prev[...] = grid.z
    grid.last_timestep = 1.0
    for _ in range(steps):
        grid.step(1.0)
        if not abs(grid.z).max() < 1e6:
            return math.inf
    return float(abs(grid.z).max())


@pytest.mark.parametrize(("scheme", "m"), [(NINE, 0.0), (NINE, 0.1), (FIVE, 0.0), (FIVE, 0.1)])
def test_steps_are_stable_below_the_exact_limit_and_not_above_it(scheme, m):
    _, stencil, limit = scheme
    # Undamped noise may beat to a few times its start, and without damping round-off may add to
    # the constant mode; nothing that is stable comes near 20.
    assert raw_growth(stencil, 0.99 * limit, m) < 20.0
    assert raw_growth(stencil, 1.005 * limit, m) == math.inf


def test_equation_9_is_too_generous_when_there_is_damping():
    water = HeightField((32, 32), spacing=0.02, damping=20.0, stencil="five_point")
    paper = water.paper_max_timestep
    c, d, mu = 1.0, 0.02, 20.0
    assert c == pytest.approx(d / (2 * paper) * math.sqrt(mu * paper + 2))  # it is equation (9)
    assert paper > water.max_timestep
    assert raw_growth("five_point", 0.99 * paper * c / d, 0.5 * mu * paper, steps=200) == math.inf


def test_equation_9_is_exact_without_damping_for_the_five_point_stencil():
    water = HeightField((32, 32), damping=0.0, stencil="five_point")
    assert water.paper_max_timestep == pytest.approx(water.max_timestep, rel=1e-12)


def test_equation_8_as_printed_blows_up_within_50_steps_and_the_repaired_one_does_not():
    for stencil, blows_up in (("paper_eq8", True), ("nine_point", False)):
        water = HeightField((64, 64), stencil=stencil)
        water.displace(0.0, 0.0, height=0.01, radius=0.1)
        for _ in range(50):
            water.step(0.5 * water.max_timestep)
        assert (abs(water.elevation).max() > 1e3) == blows_up


@pytest.mark.parametrize("stencil", ["nine_point", "five_point"])
@pytest.mark.parametrize("boundary", ["reflect", "periodic"])
def test_steps_agree_with_a_slow_twin_in_double_precision(stencil, boundary):
    weights = NINE[0] if stencil == "nine_point" else FIVE[0]
    mode = {"reflect": "edge", "periodic": "wrap"}[boundary]
    water = HeightField((45, 38), damping=0.7, stencil=stencil, boundary=boundary)
    water.displace(0.2, -0.1, height=0.01, radius=0.1)
    t = 0.9 * water.max_timestep
    z = water.elevation.astype(np.float64)
    m, r = 0.5 * 0.7 * t, (t / 0.02) ** 2

    def bend(z):
        p = np.pad(z, 1, mode=mode)
        return laplacian(p, *weights)[1:-1, 1:-1]

    prev = z + 0.5 * r * bend(z)  # at rest
    for _ in range(100):
        # Equation (7) as it is written, with the sum of neighbours replaced by the Laplacian.
        new = (4 * z + 2 * r * bend(z)) / (2 * m + 2) + (2 * m - 2) / (2 * m + 2) * prev
        z, prev = new, z
        water.step(t)
    # Single precision: 100 steps of round-off 6e-8 of 1 cm each, growing with the square at worst.
    assert abs(water.elevation - z).max() < 2e-7


def pools(n, *, seed):
    """Levels of one tile of n x n cells between walls, and what the kernels want to know of it."""
    rng = np.random.default_rng(seed)
    grid = WaveGrid((n, n), 1.0, 0.0)
    for level in (grid.z, grid.prev):
        level[...] = rng.normal(size=level.shape)
    return grid.tiles


def test_the_general_step_is_the_same_scheme_as_the_fast_one():
    n, m, r = 40, np.float32(0.05), np.float32(0.6)
    tiles = pools(n, seed=2)
    slow = tiles.second[1].copy()
    around, none = np.empty((n + 2, n + 2), np.float32), np.zeros(n, np.float32)
    medium.surround(tiles.first, tiles.neighbours, 1, around)
    medium.step_general(
        around, np.ones((n + 2, n + 2), np.float32), slow, 0, n, 0, n, np.float32(1), m, r,
        np.float32(2 / 3), np.float32(1 / 6), none, none, np.float32(0),
    )  # fmt: skip
    kernels.step_fast(
        tiles.first, tiles.second, tiles.neighbours, 1, 0, n, 0, (1 - m) / (1 + m), r / (1 + m)
    )
    # Elevations of order 3, sums of 36 of them, single precision.
    assert abs(slow - tiles.second[1])[:, :n].max() < 2e-5


def test_an_open_edge_lets_a_level_surface_be_and_passes_a_wave_that_runs_out():
    z, prev = (np.full((9, 7), 0.25, np.float32) for _ in range(2))
    z[[0, -1]] = z[:, [0, -1]] = np.nan  # to be filled, corners and all
    medium.fill_open_edge(z, prev, 9, 7, np.float32(-0.4))
    np.testing.assert_array_equal(z, prev)
    # z = f(x - c t) with c t / d = 1 / 2: the cell beyond has what was half a cell before it.
    x = np.arange(9.0)[:, None] + np.zeros(7)
    prev[...], z[...] = x, x - 0.5
    z[-1] = np.nan
    medium.fill_open_edge(z, prev, 9, 7, np.float32((0.5 - 1) / (0.5 + 1)))
    np.testing.assert_allclose(z[-1, 1:-1], 8 - 0.5, rtol=1e-6)


@pytest.mark.parametrize("stencil", ["nine_point", "five_point"])
@pytest.mark.parametrize("boundary", ["reflect", "periodic"])
def test_loads_move_water_and_make_none(stencil, boundary):
    water = HeightField((60, 50), stencil=stencil, boundary=boundary)
    rng = np.random.default_rng(4)
    for _ in range(300):
        # Some over the edge, some outside.
        x, y = rng.uniform(-0.8, 0.8, 2)
        water.press(x, y, force=rng.uniform(-5, 20), radius=rng.uniform(0.01, 0.2))
        water.advance(rng.uniform(0.005, 0.05))
    moved = float(abs(water.elevation).sum()) * water.spacing**2
    assert moved > 1e-4
    # Round-off: a step errs by some 2e-7 of a cell's elevation, 3000 cells average that to 4e-9, and
    # as it enters the speed, which friction forgets in 300 steps, it adds up to 4e-9 300^1.5 = 2e-5.
    assert abs(water.volume()) < 1e-4 * moved


def test_a_displaced_volume_stays_in_the_field():
    drifts = []
    for x, y in np.random.default_rng(5).uniform(-0.6, 0.6, (12, 2)).tolist():
        water = HeightField((80, 80))
        water.displace(x, y, height=0.01, radius=0.1)
        volume = water.volume()
        # The integral of (1 - r^2 / 2R^2)^2 is 2 pi R^2 / 3; the grid's sum is 1% off.
        assert volume == pytest.approx(0.01 * 2 * math.pi * 0.1**2 / 3, rel=1e-2)
        water.advance(20.0)
        drifts.append((water.volume() - volume) / 1.6**2)
    # Round-off, with no preferred sign: a step of waves of 1 mm errs by some 3e-11 m a cell, 4e-13 m in the
    # mean of 6400 cells; the speed keeps that for 300 steps and 1200 of them add up as noise: 4e-9 m.
    spread = float(np.std(drifts))
    assert spread < 8e-9
    assert abs(np.mean(drifts)) < 3.0 * spread / math.sqrt(len(drifts))


@pytest.mark.parametrize("width", [1, 2, 15, 16, 17, 31, 32, 33, 48, 100])
def test_a_step_of_any_width_is_the_written_out_sum_and_touches_nothing_else(width):
    rng = np.random.default_rng(width)
    high, stride = 9, 160
    z, prev = (rng.uniform(-1, 1, (2, high, stride)).astype(np.float32) for _ in range(2))
    before, q, s = prev.copy(), 0.97, 0.6
    neighbours = np.full((2, kernels.NEIGHBOUR_COLUMNS), kernels.WALL, np.int32)
    neighbours[1, [4, kernels.ROWS, kernels.COLUMNS]] = 1, high, width
    kernels.step_fast(z, prev, neighbours, 1, 0, high, 0, q, s)
    cells = np.s_[1, :, :width]
    block = z[cells].astype(np.float64)
    exact = block + q * (block - before[cells]) + s * laplacian(block, 2 / 3, 1 / 6)
    assert abs(prev[cells] - exact).max() < 3e-6  # a sum of 36 numbers below 1, single precision
    prev[cells] = before[cells]
    assert np.array_equal(prev, before)


def test_a_margin_is_left_alone_and_read():
    tiles = pools(40, seed=8)
    z, prev, neighbours = tiles.first, tiles.second, tiles.neighbours
    whole, before = prev.copy(), prev.copy()
    kernels.step_fast(z, whole, neighbours, 1, 0, 40, 0, 0.97, 0.6)
    kernels.step_fast(z, prev, neighbours, 1, 5, 35, 5, 0.97, 0.6)
    inner = np.s_[1, 5:35, 5:35]
    np.testing.assert_array_equal(prev[inner], whole[inner])
    prev[inner] = before[inner]
    np.testing.assert_array_equal(prev, before)


def test_under_a_steady_load_the_surface_sinks_by_the_static_head():
    water = HeightField((151, 151), damping=4.0)
    density, gravity, force, radius = 900.0, 5.0, 3.0, 0.2
    for _ in range(2500):
        water.press(0, 0, force=force, radius=radius, density=density, gravity=gravity)
        water.advance(0.016)
    peak = 3.0 * force / (2.0 * math.pi * radius**2)  # of the profile (1 - r^2 / 2R^2)^2
    raised = force / (density * gravity) / 3.02**2  # the water that went elsewhere
    head = peak / (density * gravity)
    # The sum over cells differs from the integral of a profile of 14 cells by a few 1e-4.
    assert water.sample(0, 0).elevation[0] == pytest.approx(raised - head, rel=1e-3)
    assert abs(water.velocity).max() < 1e-6


def test_a_load_is_gone_after_one_advance_and_does_not_act_in_none():
    water = HeightField((40, 40))
    water.press(0, 0, force=1.0, radius=0.05)
    assert water.advance(0.0) == 0
    water.advance(0.01)
    pressed = water.velocity.copy()
    assert abs(pressed).max() > 0
    twin = HeightField((40, 40))
    twin.press(0, 0, force=1.0, radius=0.05)
    twin.step(0.01)
    for lake in (water, twin):
        lake.step(0.01)
    np.testing.assert_array_equal(water.elevation, twin.elevation)


def test_the_load_is_the_force_wherever_it_falls_between_cells():
    for x in (0.0, 0.003, 0.0099):
        water = HeightField((40, 40), damping=0.0)
        water.press(x, -x / 2, force=2.0, radius=0.06)
        water.step(0.01)
        # One step from rest adds t^2 c^2 lap(p / rho g): its second moment is 4 F t^2 c^2 / rho g.
        second = (water.elevation * ((water.x[:, None] - x) ** 2 + (water.y + x / 2) ** 2)).sum()
        expected = 4 * 2.0 / 9810.0 * 0.01**2
        # Both Laplacians have this moment exactly; what is left is single precision.
        assert second * 0.02**2 == pytest.approx(expected, rel=1e-4)


def test_loads_outside_are_ignored():
    water = HeightField((40, 40))
    water.press(5.0, 0.0, force=100.0, radius=0.1)
    water.step(0.01)
    assert not water.elevation.any()


def test_amplitude_decays_as_exp_of_minus_half_mu_t():
    mu, length = 0.5, 1.6
    water = HeightField((80, 8), damping=mu, boundary="periodic")
    water.set(0.01 * np.cos(2 * np.pi * water.x / length)[:, None])
    timestep = 0.9 * water.max_timestep
    amplitude, times = [], []
    for _ in range(400):
        water.step(timestep)
        spectrum = np.fft.rfft(water.elevation[:, 0].astype(float))
        speed = np.fft.rfft(water.velocity[:, 0].astype(float))
        omega = 2 * np.pi / length
        amplitude.append(math.hypot(abs(spectrum[1]), abs(speed[1]) / omega))
        times.append(water.time)
    rate = -np.polyfit(times, np.log(amplitude), 1)[0]
    assert rate == pytest.approx(mu / 2, rel=0.02)


# The table of dispersion errors: at a vanishing time step, so that only the grid's error is left.
PHASE_SPEED = {
    ("five_point", 8): (-0.0255, -0.0128),
    ("nine_point", 8): (-0.0255, -0.0252),
    ("five_point", 12): (-0.0114, -0.0057),
    ("nine_point", 12): (-0.0114, -0.0113),
}


def phase_error(stencil: str, cells: int, *, diagonal: bool) -> float:
    """Relative error of the measured phase speed of a standing wave, at a tenth of the limit."""
    # Twelve whole waves along each side; on the diagonal cells * sqrt(2) is whole to 0.2%.
    n = round(12 * cells * (math.sqrt(2.0) if diagonal else 1.0))
    water = HeightField((n, n), spacing=1.0, damping=0.0, stencil=stencil, boundary="periodic")
    k = 2 * np.pi * 12 / n
    shape = np.cos(k * (water.x[:, None] + (water.y[None, :] if diagonal else 0 * water.y)))
    water.set(shape)
    timestep = 0.1 * water.max_timestep
    wavenumber = k * (math.sqrt(2.0) if diagonal else 1.0)
    for _ in range(round(4.5 * np.pi / wavenumber / timestep)):
        water.step(timestep)
    # Elevation = cos(omega t) times the start, near the zero at 9/2 pi where it is steepest.
    now = float((water.elevation * shape).sum() / (shape**2).sum())
    return (4.5 * np.pi - math.asin(now)) / water.time / wavenumber - 1.0


@pytest.mark.parametrize(("case", "table"), PHASE_SPEED.items())
def test_phase_speed_lags_as_the_theory_of_each_stencil_says(case, table):
    stencil, cells = case
    axis = phase_error(stencil, cells, diagonal=False)
    diagonal = phase_error(stencil, cells, diagonal=True)
    # The table is rounded to 0.01%; a step of a tenth of the limit adds 0.02%.
    assert axis == pytest.approx(table[0], abs=3e-4)
    assert diagonal == pytest.approx(table[1], abs=3e-4)


def test_rings_of_the_nine_point_stencil_are_round_to_a_fifth_of_a_percent():
    differences = {
        stencil: abs(
            phase_error(stencil, 8, diagonal=True) - phase_error(stencil, 8, diagonal=False)
        )
        for stencil in ("nine_point", "five_point")
    }
    assert differences["nine_point"] < 2e-3 < 1e-2 < differences["five_point"]


def test_a_front_runs_at_the_wave_speed():
    water = HeightField((300, 300), wave_speed=0.7, damping=0.0)
    water.displace(0.0, 0.0, height=0.01, radius=0.2)
    water.advance(3.0)
    along = water.elevation[149, 150:]
    # The crest of a ring of radius 2 m, its source 0.2 m broad.
    assert water.x[150 + int(along.argmax())] == pytest.approx(0.7 * 3.0, abs=0.15)


@pytest.mark.parametrize("boundary", ["reflect", "absorb", "periodic"])
def test_mirrored_loads_make_mirrored_waves(boundary):
    left, right = (HeightField((61, 50), boundary=boundary) for _ in range(2))
    left.press(-0.2, 0.1, force=3.0, radius=0.04)
    right.press(0.2, 0.1, force=3.0, radius=0.04)
    left.advance(1.0)
    right.advance(1.0)
    scale = float(abs(left.elevation).max())
    # The load's position differs in the last bit of a double; the steps themselves are symmetric.
    assert abs(left.elevation - right.elevation[::-1]).max() < 1e-5 * scale


@pytest.mark.parametrize(("place", "radius"), [((0.0, 0.0), 0.06), ((1.2, 0.0), 0.06),
                                               ((0.0, 0.0), 0.3), ((1.0, 1.0), 0.2)])  # fmt: skip
def test_an_absorbing_edge_returns_less_than_a_hundredth_of_a_ring(place, radius):
    n = 160
    small = HeightField((n, n), damping=0.0, boundary="absorb")
    large = HeightField((3 * n, 3 * n), damping=0.0)  # its walls are too far away to be felt
    for water in (small, large):
        water.displace(*place, height=0.01, radius=radius)
    timestep = 0.99 * small.max_timestep
    returned, start = 0.0, 0.0
    for k in range(240):  # 4 m: to the far edge and back
        small.step(timestep)
        large.step(timestep)
        if k == 0:
            start = energy(small.elevation, small.velocity, spacing=0.02, wave_speed=1.0)
        if k % 10 == 9:
            seen = np.s_[n : 2 * n, n : 2 * n]
            returned = max(
                returned,
                energy(
                    small.elevation - large.elevation[seen],
                    small.velocity - large.velocity[seen],
                    spacing=0.02,
                    wave_speed=1.0,
                ),
            )
    assert 0.0 < returned / start < 0.01


def test_walls_and_periodic_edges_keep_the_energy_of_undamped_waves():
    for boundary in ("reflect", "periodic"):
        water = HeightField((80, 60), damping=0.0, boundary=boundary)
        water.displace(0.1, 0.0, height=0.01, radius=0.15)
        sizes = []
        for _ in range(600):
            water.step(0.25 * water.max_timestep)
            sizes.append(energy(water.elevation, water.velocity, spacing=0.02, wave_speed=1.0))
        # The leapfrog conserves a neighbour of this sum; they differ with the square of the step.
        assert np.std(sizes) / np.mean(sizes) < 0.02


def test_a_change_of_step_keeps_the_waves_going():
    fine, mixed = (HeightField((80, 80), damping=0.3) for _ in range(2))
    for water in (fine, mixed):
        water.displace(0.0, 0.0, height=0.01, radius=0.2)
    limit = fine.max_timestep
    for k in range(60):
        for _ in range(10):
            fine.step(0.05 * limit)
        for _ in range(1 + (k // 10) % 2):
            mixed.step(0.5 * limit / (1 + (k // 10) % 2))
    difference = mixed.elevation - fine.elevation
    # Half the limit on waves of about 20 cells: (0.43 k d)^2 / 24 = 8e-4 of the phase of 1.5 periods
    # is 0.7%, and five changes take 0.1% each.
    assert abs(difference).max() < 0.02 * abs(fine.elevation).max()


@pytest.mark.parametrize("cycle", [(0.999, 0.9), (0.58, 0.48, 0.48), (0.12, 0.96), (0.99, 0.5)])
def test_steps_that_change_again_and_again_do_not_make_waves_grow(cycle):
    # Without the calming of short waves these cycles grow by 11%, 7%, 43% and 98% each.
    for stencil in ("nine_point", "five_point"):
        water = HeightField((40, 36), damping=0.0, stencil=stencil)
        water.set(np.random.default_rng(6).uniform(-1, 1, (40, 36)))
        for _ in range(300):
            for part in cycle:
                water.step(part * water.max_timestep)
        assert abs(water.elevation).max() < 1.0


def test_a_change_of_step_hardly_touches_waves_that_the_grid_resolves():
    water = HeightField((120, 120), damping=0.0, boundary="periodic", spacing=1.0)
    k = 2 * np.pi / 24
    shape = np.cos(k * water.x)[:, None]
    water.set(shape, 0.0)
    for _ in range(100):
        water.step(0.3)
        water.step(0.4)
    water.step(1e-3)  # the vertical speed is half a step behind: make that nothing
    left = math.hypot(
        2 * float((water.elevation * shape).mean()), 2 * float((water.velocity * shape).mean()) / k
    )
    # 200 changes take (24-cell wave: (k/k_max)^4 = 1.6e-4) of the speed, half of the energy: 1.6%.
    assert left == pytest.approx(1.0 - 0.016, abs=0.006)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("count", [2, 7, 8, 9, 21])
@pytest.mark.parametrize(
    "shape", [(50, 37), (60, 9000)]
)  # all of it in the cache, four rows at a time
def test_several_steps_in_one_pass_are_single_steps_to_the_last_bit(threads, count, shape):
    deep, single = (HeightField(shape, threads=threads) for _ in range(2))
    for water in (deep, single):
        water.displace(0.1, 0.2, height=0.01, radius=0.3)
        water.step(0.01)
    assert deep.advance(count * 0.017) == count
    for _ in range(count):
        single.step(count * 0.017 / count)
    assert np.array_equal(deep.elevation, single.elevation)
    assert np.array_equal(deep.velocity, single.velocity)


def test_threads_do_not_change_a_bit():
    one, three = (HeightField((100, 64), threads=n) for n in (1, 3))
    for water in (one, three):
        water.press(0.0, 0.0, force=5.0, radius=0.05)
        water.advance(1.0)
    np.testing.assert_array_equal(one.elevation, three.elevation)
    assert one.elevation.any()


def test_samples_interpolate_a_plane_exactly_and_are_still_outside():
    water = HeightField((30, 20), centre=(3.0, -1.0))
    water.set(0.1 * water.x[:, None] - 0.2 * water.y[None, :])
    got = water.sample([3.0, 3.05, 9.0], [-1.0, -0.93, 0.0])
    # Single precision of numbers of order 0.5.
    np.testing.assert_allclose(got.elevation, [0.5, 0.491, 0.0], atol=1e-6)
    np.testing.assert_allclose(got.slope, [[0.1, -0.2], [0.1, -0.2], [0.0, 0.0]], atol=1e-5)
    assert water.contains(3.0, -1.0)
    assert not water.contains(3.31, -1.0)


def test_a_window_is_the_surface_there_and_still_water_beyond_the_walls():
    water = HeightField((60, 50))
    water.displace(0.1, 0.0, height=0.01, radius=0.2)
    seen, x, y = water.window(0.5, 0.3, (40, 30))
    np.testing.assert_allclose(seen, water.sample(*np.meshgrid(x, y, indexing="ij"))
                               .elevation.reshape(40, 30), atol=1e-9)  # fmt: skip
    assert seen.max() > 1e-3
    assert not seen[x > 0.6].any()
    whole, x, _ = water.window(0.0, 0.0, (60, 50))
    np.testing.assert_array_equal(whole, water.elevation)
    np.testing.assert_allclose(x, water.x, atol=1e-12)


def test_the_sampled_vertical_speed_is_the_change_of_elevation():
    water = HeightField((60, 60))
    water.displace(0.0, 0.0, height=0.01, radius=0.2)
    water.advance(0.3)
    before = water.sample(0.1, 0.2).elevation[0]
    water.step(1e-3)
    after = water.sample(0.1, 0.2)
    assert after.vertical_speed[0] == pytest.approx((after.elevation[0] - before) / 1e-3, rel=1e-6)


def test_reset_is_still_water_at_time_zero():
    water = HeightField((30, 30), boundary="absorb")
    water.press(0, 0, force=1.0, radius=0.1)
    water.advance(0.5)
    water.press(0, 0, force=1.0, radius=0.1)
    water.reset()
    water.advance(0.1)
    assert not water.elevation.any()
    assert water.time == pytest.approx(0.1)


def test_the_grid_is_float32_and_centred():
    water = HeightField((5, 4), 0.5, centre=(1.0, 2.0))
    assert water.elevation.dtype == np.float32
    assert water.elevation.shape == (5, 4)
    np.testing.assert_allclose(water.x, [0.0, 0.5, 1.0, 1.5, 2.0])
    np.testing.assert_allclose(water.y, [1.25, 1.75, 2.25, 2.75])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"shape": (2, 50)}, r"shape is \(2, 50\): give two whole numbers from 3 to 1e.09"),
        ({"shape": 50}, "shape is 50: give two whole numbers"),
        ({"shape": (50.5, 50)}, "give two whole numbers"),
        ({"shape": (2_000_000, 2_000_000)}, r"needs 3.2e\+04 GB and .* GB are free"),
        ({"spacing": 0.0}, "spacing is 0.0: give a finite number greater than 0"),
        ({"wave_speed": math.nan}, "wave_speed is nan"),
        ({"damping": -0.1}, "damping is -0.1: give a finite number of at least 0"),
        ({"stencil": "seven"}, "'seven': use one of nine_point, five_point, paper_eq8"),
        ({"boundary": "wall"}, "'wall': use one of reflect, absorb, periodic"),
        ({"centre": (0.0, math.inf)}, "centre is"),
        ({"threads": 0}, "threads is 0"),
    ],
)
def test_what_cannot_be_a_field_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message) as caught:
        HeightField(**arguments)
    assert "\n" not in str(caught.value)


def test_a_step_too_large_is_refused_with_both_limits():
    water = HeightField((10, 10), damping=2.0)
    limit, paper = water.max_timestep, water.paper_max_timestep
    assert limit == pytest.approx(0.02 * math.sqrt(3) / 2)
    message = f"step of 0.05 s is unstable: use at most {limit:.6g} s .*allow {paper:.6g} s"
    with pytest.raises(ValueError, match=message):
        water.step(0.05)
    for bad in (math.nan, -0.01, 0.0):
        with pytest.raises(
            ValueError, match=r"timestep is .*: give a finite number greater than 0"
        ):
            water.step(bad)
    for bad in (math.nan, -0.01):
        with pytest.raises(ValueError, match="duration is"):
            water.advance(bad)


def test_a_load_that_is_no_load_is_refused():
    water = HeightField((10, 10))
    with pytest.raises(ValueError, match="force is nan"):
        water.press(0, 0, force=math.nan, radius=0.1)
    with pytest.raises(ValueError, match="radius is 0"):
        water.press(0, 0, force=1.0, radius=0)
    with pytest.raises(ValueError, match="height is inf"):
        water.displace(0, 0, height=math.inf, radius=0.1)


@pytest.mark.parametrize("stencil", ["nine_point", "five_point"])
@pytest.mark.parametrize("boundary", ["reflect", "periodic", "absorb"])
def test_far_from_land_the_water_does_not_know_of_it(stencil, boundary):
    land = np.zeros((120, 90), bool)
    land[-1, -1] = True
    with_land = HeightField((120, 90), stencil=stencil, boundary=boundary, terrain_mask=land)
    without = HeightField((120, 90), stencil=stencil, boundary=boundary)
    for water in (with_land, without):
        water.displace(-0.3, 0.0, height=0.01, radius=0.1)
        for k in range(40):  # the front needs more to get there and back
            water.press(-0.9, 0.1, force=2.0, radius=0.05)
            water.step(0.01 if k % 3 else 0.012)
    # Another order of the same sums in single precision, of waves of a centimetre.
    near = np.s_[:80, :70]
    assert abs(with_land.elevation - without.elevation)[near].max() < 1e-7


@pytest.mark.parametrize("stencil", ["nine_point", "five_point"])
@pytest.mark.parametrize("boundary", ["reflect", "periodic"])
def test_islands_keep_the_volume_and_stay_dry(stencil, boundary):
    rng = np.random.default_rng(5)
    land = rng.uniform(size=(60, 50)) < 0.2  # the roughest coast there is
    water = HeightField(
        (60, 50), damping=0.0, stencil=stencil, boundary=boundary, terrain_mask=land
    )
    for k in range(400):
        if k < 50:
            water.press(*rng.uniform(-0.6, 0.6, 2), force=3.0, radius=0.05)
        water.step((0.999 if k % 2 else 0.9) * water.max_timestep)
    assert not water.elevation[land].any()
    assert 1e-4 < abs(water.elevation).max() < 1.0  # stable at the limit of open water
    # Round-off of single precision; undamped, it adds up as steps^1.5.
    assert abs(water.volume()) < 2e-4 * float(abs(water.elevation).sum()) * water.spacing**2


def test_a_pier_across_the_lake_reflects_as_a_wall_does_and_nothing_gets_behind_it():
    land = np.zeros((100, 60), bool)
    land[50:] = True
    divided = HeightField((100, 60), stencil="five_point", terrain_mask=land)
    small = HeightField((50, 60), stencil="five_point", centre=(-0.5, 0.0))
    for water in (divided, small):
        water.displace(-0.3, 0.1, height=0.01, radius=0.08)
        for _ in range(200):
            water.step(0.01)
    # For five points a missing neighbour and a mirrored one are the same sum in another order.
    assert abs(divided.elevation[:50] - small.elevation).max() < 1e-7
    land[50:] = False
    land[50:52] = True
    pier = HeightField((100, 60), terrain_mask=land)
    pier.displace(-0.3, 0.1, height=0.01, radius=0.08)
    pier.advance(2.0)
    assert abs(pier.elevation[:50]).max() > 1e-3
    assert not pier.elevation[50:].any()


def test_a_saved_surface_goes_on_where_it_stopped(tmp_path):
    land = np.zeros((50, 40), bool)
    land[10:12, 5:9] = True
    for k, settings in enumerate(
        (
            {"boundary": "absorb"},
            {"terrain_mask": land, "centre": (1.0, 2.0)},
            {"stencil": "five_point"},
        )
    ):
        water = HeightField((50, 40), **settings)
        water.displace(*water.centre, height=0.01, radius=0.1)
        water.advance(0.5)
        path = tmp_path / f"{k}.npz"
        water.save(path)
        again = HeightField.load(path)
        assert again.time == water.time
        np.testing.assert_array_equal(again.x, water.x)
        water.advance(0.3)
        again.advance(0.3)
        np.testing.assert_array_equal(again.elevation, water.elevation)


def test_what_is_no_saved_surface_is_refused(tmp_path):
    with pytest.raises(MjskipError, match="cannot be read as a water surface"):
        HeightField.load(tmp_path / "none.npz")
    other = tmp_path / "other.npz"
    np.savez(other, a=1)
    with pytest.raises(MjskipError, match="give one that"):
        HeightField.load(other)


def test_a_wave_that_is_set_travels_the_way_it_was_set():
    water = HeightField((128, 16), damping=0.0, boundary="periodic")
    length = 128 * 0.02 / 2
    k = 2 * np.pi / length
    wave = 0.01 * np.cos(k * water.x)[:, None]
    water.set(wave, 0.01 * k * np.sin(k * water.x)[:, None])  # cos(k (x - t)) at t = 0
    water.advance(length / 4)
    expected = 0.01 * np.cos(k * (water.x - length / 4))[:, None]
    # Dispersion at 64 cells a wave is 4e-4 of a quarter period's phase.
    assert abs(water.elevation - expected).max() < 0.002 * 0.01


def test_a_wind_sea_has_its_height_its_seed_and_its_direction():
    water = HeightField((300, 300), boundary="periodic", damping=0.0)
    sea = {"wave_speed": 1.0, "height": 0.02, "wavelength": 0.5, "periodic": True}
    elevation, speed = wind_waves(water.x, water.y, **sea, seed=3, direction=0.4)
    # 48 waves: the standard deviation of one sea scatters by about a tenth.
    assert 4 * elevation.std() == pytest.approx(0.02, rel=0.2)
    same, _ = wind_waves(water.x, water.y, **sea, seed=3, direction=0.4)
    np.testing.assert_array_equal(same, elevation)
    other, _ = wind_waves(water.x, water.y, **sea, seed=4, direction=0.4)
    assert abs(other - elevation).max() > 1e-3
    # -z_t grad z points the way the waves run.
    east, north = (np.gradient(elevation, 0.02, axis=axis) for axis in (0, 1))
    heading = math.atan2(-(speed * north).mean(), -(speed * east).mean())
    assert heading == pytest.approx(0.4, abs=0.3)
    water.set(elevation, speed)
    start = energy(water.elevation, water.velocity, spacing=0.02, wave_speed=1.0)
    water.advance(2.0)
    # Whole waves in a periodic field, so nothing is lost; leapfrog's energy wavers by a percent.
    assert energy(water.elevation, water.velocity, spacing=0.02, wave_speed=1.0) == pytest.approx(
        start, rel=0.03
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"terrain_mask": np.ones((10, 10), bool)}, "terrain_mask covers every cell"),
        ({"terrain_mask": np.zeros((10, 9), bool)}, r"terrain_mask has shape \(10, 9\)"),
        ({"terrain_mask": np.eye(10, dtype=bool), "stencil": "paper_eq8"}, "knows no terrain"),
    ],
)
def test_land_that_cannot_be_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        HeightField((10, 10), **arguments)


def test_values_that_are_no_finite_numbers_are_not_set_nor_sampled():
    for value in (math.nan, 1j, "high", [[math.inf]]):
        with pytest.raises(ValueError, match=r"^elevation is .*: give finite numbers$"):
            HeightField((10, 10)).set(value)
    for value in (math.nan, [0.0, math.inf], "x"):
        with pytest.raises(ValueError, match=r"^y is .*: give finite numbers$"):
            HeightField((10, 10)).sample(0.0, value)
    with pytest.raises(ValueError, match=r"^height is -1: give a finite number of at least 0 m$"):
        wind_waves([0, 1], [0, 1], wave_speed=1.0, height=-1, wavelength=1.0)
    with pytest.raises(ValueError, match="height is nan"):
        wind_waves([0, 1], [0, 1], wave_speed=1.0, height=math.nan, wavelength=1.0)


def test_a_file_that_was_cut_off_is_refused_by_name(tmp_path):
    path = tmp_path / "water.npz"
    HeightField((20, 20)).save(path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(MjskipError, match=r"cannot be read as a water surface.*HeightField\.save"):
        HeightField.load(path)
