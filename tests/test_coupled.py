"""Stones and moving water: what one loses the other gains, and all of them share one surface."""

import math
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import GRAVITY
from scipy.fft import dctn
from test_surface_coupling import (
    CELLS,
    RHO,
    SPACING,
    SPEED,
    Pool,
    coupled,
    kinetic,
    shapes,
    states_of,
    thrown,
    waves,
)

from mjskip import HeightField, Limits, Stone, Throw, Water, load_scene, simulate
from mjskip.errors import DivergedError, MjskipWarning
from mjskip.hydro.columns import CLEARANCE
from mjskip.hydro.wrench import pack
from mjskip.throws.engines import MujocoEngine, ReferenceEngine
from mjskip.throws.kick import KickedStones
from mjskip.throws.reference import rigid_body
from mjskip.throws.run import Run
from mjskip.throws.simulate import simulate_all
from mjskip.throws.throw import State
from mjskip.waves import _coupled_arrays as arrays
from mjskip.waves import _coupled_loads as on_surface
from mjskip.waves import _coupling_kernels as twin
from mjskip.waves import _face_kernels as faces
from mjskip.waves.coupled import LONGEST_FACE, CoupledWater

FLUID = Water(density=RHO, air_density=0.0)
LIMITS = Limits(duration=0.35)


class Stones(KickedStones):
    """Stones of the pure integrator on water."""

    def __init__(self, starts, field, *, timestep=5e-4, water=FLUID, **options):
        stones, states = zip(*starts, strict=True)
        super().__init__(stones, states, timestep=timestep, gravity=np.array([0, 0, -GRAVITY]))
        blocks = [pack(stone, water, gravity=GRAVITY) for stone in stones]
        self.water = CoupledWater(
            field, blocks, timestep=timestep, density=water.density, gravity=GRAVITY, stages=0,
            **options,
        )  # fmt: skip
        self.couple(self.water)

    def advance(self, steps):
        """Move on: states before each step, loads, reactions."""
        path, loads, reactions = self.water.advance(self, self.states(), steps)
        return path[:-1], loads, reactions


def skipping(stone, **throw):
    """A stone in the water as it is let go."""
    settings = {"speed": 5.0, "spin": 40, "attack": 20, "descent": 20, "height": 0} | throw
    return stone, Throw.from_degrees(**settings).state(stone)


def dropped(stone, speed, *, x=0.0, y=0.0, height=0.0):
    """A stone that falls flat, its lowest point at a height."""
    low = float(stone.vertices[:, 2].min())
    return stone, State(
        position=np.array([x, y, height - low]), q=np.array([1.0, 0, 0, 0]),
        velocity=np.array([0.0, 0.0, -speed]), omega=np.zeros(3),
    )  # fmt: skip


DISC = Stone.disc(0.05, 0.01, segments=32, density=2500.0)
TILES = 1e-30  # a sleep amplitude [m] with which nothing is lost


# The solver --------------------------------------------------------------------------------------


def bodies_on(pool, stones, *, law="lee2010", damping=0.0, kick=True):
    """Bodies on the surface of a twin's pool, in the arrays of the coupled step."""
    field = HeightField(
        (CELLS, CELLS), SPACING, SPEED, damping, boundary="periodic", sleep_amplitude=TILES
    )
    blocks = [pack(stone, replace(FLUID, law=law)) for stone in stones]
    water = CoupledWater(
        field, blocks, timestep=pool.dt, density=RHO, gravity=GRAVITY, stages=0 if kick else 1
    )
    water._make_cells(CELLS**2)
    c = water.coupled
    c.clusters[:] = 0
    c.counts[[arrays.CLUSTERS, arrays.STAGE]] = 1, 0
    c.boxes[0] = 0, 0, CELLS, CELLS, 0, 0, 0, 0
    c.numbers[[arrays.ORIGIN_X, arrays.ORIGIN_Y]] = pool.surface.x, pool.surface.y
    c.numbers[[arrays.TOLERANCE, arrays.AHEAD]] = 1e-14, -1.0
    size = CELLS**2
    c.patches[6 : 6 + size] = pool.z.ravel()
    c.patches[6 + size : 6 + 2 * size] = pool.surface.rate.ravel()
    c.fastest[0] = np.abs(pool.surface.rate).max()
    c.open_cells[:] = 1.0
    return water, c


@pytest.mark.parametrize(
    "law", ["lee2010", "rosellini2005", "lee2010_forward", "rayleigh1876_forward"]
)
def test_loads_found_cell_by_cell_are_those_found_with_the_whole_matrix(law):
    rng = np.random.default_rng(3)
    stones = shapes()
    for _ in range(6):
        z, before = waves(rng)
        pool = Pool("waves", z, before, timestep=2e-4, damping=3.0)
        y = thrown(rng, stones, spread=0.05)
        states = states_of(y, stones)
        expected = coupled(stones, "waves", law=law, damping=3.0, longest_face=LONGEST_FACE).loads(
            states, pool.surface, pool.dt
        )
        _, c = bodies_on(pool, stones, law=law, damping=3.0)
        c.states[:] = states
        on_surface.find_faces(c)
        on_surface.add_loads(c, 0.0)
        assert len(expected.loads) > 20
        scale = abs(expected.wrenches).max()
        np.testing.assert_allclose(c.wrenches[:, :6], expected.wrenches, atol=1e-10 * scale)
        c.heads[:] = 0.0
        faces.add_reaction(
            c.faces, 0, int(c.boxes[0, arrays.LAST]), 5, 1.0 / SPACING**2,
            c.heads[: CELLS**2].reshape(CELLS, CELLS), c.reactions,
        )  # fmt: skip
        pressed = c.heads[: CELLS**2].reshape(CELLS, CELLS)
        np.testing.assert_allclose(pressed, expected.pressure, atol=1e-9 * abs(pressed).max())
        np.testing.assert_allclose(c.reactions, expected.wrenches[:, 2], atol=1e-10 * scale)


@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_in_a_kick_the_energy_of_stones_and_water_closes_to_rounding(damping):
    rng = np.random.default_rng(12)
    stones, dt = shapes(), 2e-4
    for _ in range(8):
        z, before = waves(rng)
        pool = Pool("waves", z, before, timestep=dt, damping=damping)
        y = thrown(rng, stones)
        first = kinetic(y, stones)
        _, c = bodies_on(pool, stones, damping=damping)
        rows = np.array(
            [rigid_body(s, pack(s, FLUID), np.zeros(3), frozen_attitude=False) for s in stones]
        )
        twin.prepare_kick(y, rows, np.zeros((2, 6)), dt, c.states, c.means, c.mobilities)
        on_surface.find_faces(c)
        c.wrenches[:] = 0.0
        on_surface.add_loads(c, 0.5 * dt)
        y[:, 7:13] += dt * c.wrenches[:, :6]
        wet = c.faces[: int(c.boxes[0, arrays.LAST])]
        dissipation = float(wet[:, faces.LOAD] @ wet[:, faces.SPEED])
        pressure = np.zeros((CELLS, CELLS))
        faces.add_reaction(c.faces, 0, len(wet), 5, 1.0 / SPACING**2, pressure, c.reactions)
        after = pool.next(pressure)
        change = kinetic(y, stones) - first + pool.energy(z, after) - pool.energy(before, z)
        lost = dt * (dissipation + pool.damped(after))
        assert dissipation > 0.0
        assert change == pytest.approx(-lost, abs=1e-10 * first)


def test_a_pose_ahead_is_that_of_a_steady_turn_and_a_steady_motion():
    rng = np.random.default_rng(2)
    from scipy.spatial.transform import Rotation

    for spin in (0.0, 1e-9, 3.0, 600.0):
        state, out = rng.normal(size=18), np.zeros(18)
        turn = Rotation.random(random_state=5)
        omega = spin * np.array([0.6, 0.0, 0.8])
        state[3:12], state[15:18] = turn.as_matrix().ravel(), omega
        faces.place_ahead(state, 2e-3, out)
        ahead = Rotation.from_rotvec(2e-3 * omega) * turn
        np.testing.assert_allclose(out[3:12].reshape(3, 3), ahead.as_matrix(), atol=1e-13)
        np.testing.assert_allclose(out[:3], state[:3] + 2e-3 * state[12:15], rtol=1e-13)
        np.testing.assert_array_equal(out[12:], state[12:])


# The surface -------------------------------------------------------------------------------------


def wave_energy(level, after, field, timestep):
    """Energy of undamped waves inside walls by linear theory [J] between two levels: kept exactly.

    E = rho g d^2 / 2 sum [z+ z + (z+ - z) (-r L)^-1 (z+ - z)], r = (c t / d)^2: the discrete form of
    potential energy and of the kinetic energy of the flow that moves the surface. The cosines
    diagonalise L inside walls.
    """
    a, b = (np.pi * np.arange(n) / n for n in field.shape)
    symbol = np.outer(4 + 2 * np.cos(a), 4 + 2 * np.cos(b)) / 6.0 - 6.0
    symbol[0, 0] = -np.inf  # the mean level cannot move
    change = dctn(after - level, type=2, norm="ortho")
    courant = field.wave_speed * timestep / field.spacing
    motion = (change**2 / (-(courant**2) * symbol)).sum()
    return 0.5 * RHO * GRAVITY * field.spacing**2 * float((after * level).sum() + motion)


@pytest.mark.parametrize(
    "start",
    [
        pytest.param(skipping(DISC), marks=pytest.mark.slow),
        skipping(DISC, speed=2.0, descent=80, attack=0), dropped(DISC, 3.0),
        dropped(Stone.disc(0.05, 0.02, density=50.0), 4.0), skipping(Stone.pebble(), speed=12.0),
    ],
    ids=["skip", "plunge", "slap", "cork", "pebble"],
)  # fmt: skip
def test_stone_and_waves_together_never_gain_energy(start):
    field = HeightField((128, 128), damping=0.0, sleep_amplitude=TILES)
    run = Stones([start], field, timestep=2.5e-4)
    stone = start[0]
    levels, energies = [field.elevation.astype(np.float64)], []
    for _ in range(160):
        run.advance(1)
        levels.append(field.elevation.astype(np.float64))
        y = run.y[0]
        # the loads have acted between the last two levels; the stone is half a flight on
        motion = kinetic(y[None], [stone]) + stone.mass * GRAVITY * y[2]
        energies.append(motion + wave_energy(levels[-2], levels[-1], field, 2.5e-4))
    # the first step starts from rest: a level and the one before are the same
    energies = np.array(energies[1:])
    moving = energies - energies.min()
    assert energies[-1] < energies[0]
    # Single precision: a last bit of a wave of 2 cm is 1e-9 m, over a step 4e-6 m/s of some hundred cells.
    assert np.diff(energies).max() < 1e-5 * moving.max()
    assert wave_energy(levels[-2], levels[-1], field, 2.5e-4) > 1e-3 * moving.max()


def test_the_water_is_given_the_vertical_force_that_the_law_takes():
    run = Stones([skipping(DISC)], HeightField.endless())
    _, loads, reactions = run.advance(80)
    wet = loads[:, 0, CLEARANCE] < 0.0
    assert wet.sum() > 60
    assert reactions[wet].min() >= 0.0
    # without air and buoyancy the law is all of the load
    np.testing.assert_allclose(reactions, loads[:, :, 2], rtol=1e-12)
    moved = float(np.abs(run.water.field.elevation).sum()) * 0.02**2
    assert abs(run.water.field.volume()) < 1e-4 * moved


def test_a_stone_feels_the_surface_that_there_is():
    field = HeightField.endless(sleep_amplitude=0.0)
    field.displace(0.1, 0.05, height=0.03, radius=0.2)
    field.advance(0.1)
    run = Stones([dropped(DISC, 0.1, y=0.1, height=0.03)], field)
    _, loads, _ = run.advance(1)
    run.water.catch_up()
    # lowest point of the flat disc over the highest water under its rim
    vertices = DISC.vertices[:, :2] + [0.0, 0.1]
    low = DISC.vertices[:, 2] - DISC.vertices[:, 2].min() + 0.03
    level = field.sample(vertices[:, 0], vertices[:, 1]).elevation
    # the surface has gone on by a step since
    assert loads[0, 0, CLEARANCE] == pytest.approx((low - level).min(), abs=2e-4)
    assert abs(level).max() > 5e-3


def test_two_stones_far_apart_do_as_each_does_alone_until_their_waves_meet():
    one, other = skipping(DISC), skipping(Stone.pebble(), speed=7.0)
    other[1].position[1] += 1.28 * 3
    both = Stones([one, other], HeightField.endless())
    path, _, reactions = both.advance(120)
    for k, start in enumerate((one, other)):
        alone = Stones([start], HeightField.endless())
        expected, _, reaction = alone.advance(120)
        np.testing.assert_array_equal(path[:, k], expected[:, 0])
        np.testing.assert_array_equal(reactions[:, k], reaction[:, 0])


def test_two_stones_side_by_side_share_a_block_of_cells_and_feel_each_other():
    half = np.array([-1, -1, 1])
    starts = [dropped(DISC, 2.0, x=0.055), dropped(DISC, 2.0, x=-0.055)]
    run = Stones(starts, HeightField.endless())
    path, _, _ = run.advance(60)
    assert run.water.coupled.counts[arrays.CLUSTERS] == 1
    # images of each other, but for how their round faces were halved
    np.testing.assert_allclose(path[:, 0, :3], path[:, 1, :3] * half, atol=5e-5)
    alone = Stones([dropped(DISC, 2.0, x=0.055)], HeightField.endless())
    expected, _, _ = alone.advance(60)
    assert abs(path[-1, 0, :3] - expected[-1, 0, :3]).max() > 3e-4


def test_in_periodic_water_a_stone_feels_what_went_over_the_edge():
    width = 128 * 0.02
    runs = []
    for where in (0.0, width):
        field = HeightField((128, 64), boundary="periodic", sleep_amplitude=TILES)
        field.displace(0.3, 0.0, height=0.02, radius=0.2)
        field.advance(0.4)
        run = Stones([dropped(DISC, 1.0, x=where)], field)
        path, _, _ = run.advance(60)
        runs.append(path[-1, 0])
    runs[1][0] -= width
    still, _, _ = Stones([dropped(DISC, 1.0)], HeightField.endless()).advance(60)
    assert abs(runs[0] - still[-1, 0]).max() > 1e-3  # it does feel waves
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)


def test_a_finer_grid_and_a_shorter_step_change_a_touch_little():
    """With one radius of the bumps; the paper's equation leaves the answer to that radius (docs/water.md)."""
    ends = []
    for spacing, timestep in ((0.02, 5e-4), (0.01, 5e-4), (0.005, 5e-4), (0.01, 2.5e-4)):
        field = HeightField.endless(spacing=spacing)
        path, _, _ = Stones([dropped(DISC, 2.0)], field, timestep=timestep).advance(
            round(0.025 / timestep)
        )
        ends.append(path[-1, 0, 14])
    coarse, middle, fine, short = ends
    assert abs(fine - middle) < 0.5 * abs(middle - coarse)
    assert abs(middle - coarse) < 0.1 * abs(fine)
    assert short == pytest.approx(middle, rel=0.01)


# Runs --------------------------------------------------------------------------------------------


def test_both_engines_agree_over_waves(lake):
    ours, theirs = (
        simulate(lake, engine=engine, surface="waves", timestep=1.25e-4, limits=LIMITS)
        for engine in ("mujoco", "reference")
    )
    touched = ours.clearance < 0.0
    assert touched.any()
    assert theirs.attributes["integrator"] == "kick"
    # Both hold the surface over a step: they differ to the order of the step in what happens within it.
    np.testing.assert_allclose(ours.position, theirs.position, rtol=0.0, atol=3e-4)
    assert (
        abs(ours.position - simulate(lake, timestep=1.25e-4, limits=LIMITS).position).max() > 3e-3
    )


def test_a_run_is_the_same_in_blocks_of_any_length(lake):
    ends = []
    for block in (1, 7, 350):
        with MujocoEngine(lake, None, 5e-4, frozen_attitude=False) as engine:
            run = Run(lake, engine, 5e-4, field=lake.field(), feel=True)
            parts = [run.advance(block) for _ in range(700 // block)]
            ends.append((np.concatenate([p.states for p in parts]), run.show().elevation))
    for states, elevation in ends[1:]:
        np.testing.assert_array_equal(states, ends[0][0])
        np.testing.assert_allclose(elevation, ends[0][1], atol=1e-7)
    assert abs(ends[0][1]).max() > 1e-3


@pytest.mark.parametrize("integrator", ["RK4", "Euler", "implicitfast"])
def test_no_throw_over_waves_gains_energy(lake, integrator):
    rng = np.random.default_rng(8)
    for _ in range(6):
        throw = Throw.from_degrees(
            speed=rng.uniform(4, 14), spin=rng.uniform(0, 60), attack=rng.uniform(5, 45),
            descent=rng.uniform(3, 45), height=0.02,
        )  # fmt: skip
        flight = simulate(lake, throw, integrator=integrator, surface="waves", timestep=2.5e-4,
                          limits=Limits(duration=0.25))  # fmt: skip
        assert (flight.clearance < 0.0).any()
        assert flight.energy.max() < flight.energy[0] * 1.001


def test_over_waves_as_over_still_water_the_same_throw_gives_the_same_path_twice():
    scene = load_scene("duel")
    first, second = (simulate_all(scene, surface="waves", limits=LIMITS) for _ in range(2))
    for name in first:
        np.testing.assert_array_equal(first[name].position, second[name].position)


def test_what_waves_cannot_take_is_refused_before_the_run(lake):
    with (
        pytest.raises(
            ValueError, match=r"time step 0\.05 s is too long for the waves: .* 0\.0173 s"
        ),
        pytest.warns(MjskipWarning, match="too large"),
    ):
        simulate(lake, surface="waves", timestep=0.05)
    walled = replace(lake, grid=lake.grid | {"shape": (128, 128), "boundary": "reflect"})
    with pytest.raises(
        ValueError,
        match=r"'stone' starts at \(-4, 0\), outside the walls .* x from -1\.28 to 1\.28 m",
    ):
        simulate(walled, surface="waves")
    with pytest.raises(ValueError, match=r"load_radius is 0\.01 m and cells are 0\.02 m wide"):
        simulate(lake, surface="waves", load_radius=0.01)
    with pytest.raises(ValueError, match=r"bocquet2003.*use one of lee2010"):
        simulate(replace(lake, water=Water(law="bocquet2003")), surface="waves")
    with pytest.raises(ValueError, match=r"the reference engine has kick over waves"):
        simulate(lake, surface="waves", engine="reference", integrator="rk4")
    five = replace(lake, grid=lake.grid | {"stencil": "five_point", "boundary": "reflect"})
    with pytest.raises(ValueError, match=r"stencil is 'five_point': bodies move nine_point"):
        simulate(five, surface="waves")
    with pytest.raises(ValueError, match=r"bodies move no absorbing field"):
        CoupledWater(HeightField(boundary="absorb"), [], timestep=1e-3, stages=1)


@pytest.mark.parametrize("gravity", [(0, 0, 0), (1e9, 0, 0), (0, 0, 9.81)])
def test_water_that_is_not_held_down_has_no_waves(lake, gravity):
    import copy

    model = copy.copy(lake.model)
    model.opt.gravity[:] = gravity
    with pytest.raises(ValueError, match=r"m/s\^2 along z: waves need water that is held down"):
        simulate(replace(lake, model=model), surface="waves", limits=LIMITS)


def test_a_stone_too_far_away_is_refused_and_a_force_that_is_none_is_a_divergence(lake):
    far = replace(lake, throws={"stone": replace(lake.throw, height=0.0)})
    import copy

    model = copy.copy(lake.model)
    model.body("stone").pos[0] = 1e300
    with pytest.raises(ValueError, match=r"'stone' starts at \(1e\+300, 0\): .* within 2e\+07 m"):
        simulate(replace(far, model=model), surface="waves", limits=LIMITS)
    run = Stones([dropped(DISC, 1.0)], HeightField.endless())
    run.advance(5)
    run.y[0, 7] = math.nan
    with pytest.raises(DivergedError, match=r"force on body 0 is not finite at t = 0\.003 s"):
        run.advance(5)


def test_a_large_stone_is_said_to_be_slow_or_refused_with_its_size():
    large = Stone.disc(10.0, 2.0, segments=32)
    with pytest.raises(
        ValueError, match=r"radius 10 m has more than 4000 triangles .* load_radius"
    ):
        Stones([dropped(large, 1.0)], HeightField.endless())
    with pytest.warns(
        MjskipWarning, match=r"10\.0499 m covers 1007 x 1007 cells of 0\.02 m, and \d+ faces"
    ):
        Stones([dropped(large, 1.0)], HeightField.endless(), load_radius=1.5)


def test_buoyancy_over_waves_is_that_of_the_water_displaced_under_the_surface():
    cork = Stone.disc(0.1, 0.04, segments=32, density=500.0)
    field = HeightField((64, 64), damping=6.0, sleep_amplitude=TILES)
    water = Water(air_density=0.0, buoyancy=True, skin_friction=True)
    run = Stones([dropped(cork, 0.0, height=-0.022)], field, timestep=2e-3, water=water)
    path, _, _ = run.advance(3000)
    # at rest it displaces its weight: half of it, up to the waves that are left
    assert path[-1, 0, 2] == pytest.approx(0.0, abs=5e-4)
    assert abs(field.elevation).max() < 1e-3


def test_the_pure_engine_and_a_scene_give_what_the_test_bench_gives(lake):
    flight = simulate(lake, engine="reference", surface="waves", limits=Limits(duration=0.25))
    with ReferenceEngine(lake, None, 5e-4, frozen_attitude=False, over_waves=True) as engine:
        run = Run(lake, engine, 5e-4, field=lake.field(), feel=True)
        block = run.advance(len(flight.time))
    np.testing.assert_array_equal(block.states[:, 0, :3], flight.position)


def test_many_throws_of_three_stones_leave_the_mean_level_and_the_memory_as_they_were():
    sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
    from soak import soak

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reports = list(soak(3.0, every=1.0))
    for report in reports:
        assert report["finite"]
        assert math.isfinite(report["highest"])
        # A rounding of 6e-10 m a cell and step is a speed that damping takes 2 s to end: over 37 000
        # cells and 3000 steps some 2e-7 m of mean level.
        assert abs(report["mean_level"]) < 1e-6
    assert reports[-1]["highest"] > 0.01
    # nine tiles, two levels, and two more for changes of step
    assert reports[-1]["water_bytes"] < 2e6
