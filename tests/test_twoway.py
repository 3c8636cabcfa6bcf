"""Stones and moving water: what one loses the other gains, and still water is the limit."""

import math
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import GRAVITY, motions, stones
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import dctn

from mjskip import Limits, Stone, Throw, Water, load_scene, simulate
from mjskip.errors import MjskipWarning
from mjskip.hydro import _block as kernels
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.rigid.attitude import matrices
from mjskip.rigid.state import pack_states
from mjskip.throws.engines import MujocoEngine
from mjskip.throws.reference import Integrator
from mjskip.throws.simulate import simulate_all
from mjskip.throws.throw import State
from mjskip.waves._lake_kernels import largest_share
from mjskip.waves.lake import Lake
from mjskip.waves.twoway import MovingSurface

DENSITY = 1000.0


class Run:
    """Stones of the pure integrator over their moving surface."""

    def __init__(self, starts, lake, *, timestep=5e-4, water=None, integrator="rk4", **options):
        water = water or Water(air_density=0.0, gate="local")
        self.timestep = timestep
        self.stones = {
            name: Integrator(stone, start, water=water, integrator=integrator, timestep=timestep)
            for name, (stone, start) in starts.items()
        }
        blocks = {name: stone.block for name, stone in self.stones.items()}
        self.surface = MovingSurface(lake, blocks, **options)
        self.states = {name: stone.start() for name, stone in self.stones.items()}

    def step(self):
        """Move on by a step; what was seen before it, and the shares of it that were given back."""
        seen = self.surface.look(self.states)
        shares = self.surface.advance(self.timestep)
        self.states = {name: stone.advance(1) for name, stone in self.stones.items()}
        return seen, shares

    def advance(self, steps):
        """Move on; what was seen in the last step."""
        for _ in range(steps):
            seen, _ = self.step()
        return seen


def thrown(stone, **throw):
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


def wave_energy(lake, timestep):
    """Energy of undamped waves inside walls by linear theory [J], half a step on: kept exactly.

    E = rho g d^2 / 2 sum [z+ z + (z+ - z) (-r L)^-1 (z+ - z)], r = (c t / d)^2: the discrete form of
    potential energy and of the kinetic energy of the flow that moves the surface. The cosines
    diagonalise L inside walls. Moves the lake on by a step.
    """
    level = lake.window(0.0, 0.0, lake.shape)[0].astype(np.float64)
    lake.step(timestep)
    after = lake.window(0.0, 0.0, lake.shape)[0].astype(np.float64)
    a, b = (np.pi * np.arange(n) / n for n in lake.shape)
    symbol = np.outer(4 + 2 * np.cos(a), 4 + 2 * np.cos(b)) / 6.0 - 6.0
    symbol[0, 0] = -np.inf  # the mean level cannot move
    change = dctn(after - level, type=2, norm="ortho")
    courant = lake.wave_speed * timestep / lake.spacing
    kinetic = (change**2 / (-(courant**2) * symbol)).sum()
    return 0.5 * DENSITY * GRAVITY * lake.spacing**2 * float((after * level).sum() + kinetic)


def test_the_energy_of_free_waves_is_kept_by_the_measure_used_here():
    lake = Lake((64, 64), damping=0.0, sleep_amplitude=0.0)
    lake.press(0.0, 0.0, force=20.0, radius=0.05)
    lake.step(0.01)
    energies = [wave_energy(lake, 0.01) for _ in range(60)]
    assert energies[0] > 1e-4
    # round-off of single precision
    np.testing.assert_allclose(energies, energies[0], rtol=1e-4)


@pytest.mark.parametrize("own_dent", [False, True])
@pytest.mark.parametrize(
    "start",
    [
        thrown(DISC), thrown(DISC, speed=2.0, descent=80, attack=0), dropped(DISC, 3.0),
        dropped(Stone.disc(0.05, 0.02, density=50.0), 4.0), thrown(Stone.pebble(), speed=12.0),
    ],
    ids=["skip", "plunge", "slap", "cork", "pebble"],
)  # fmt: skip
@pytest.mark.parametrize("steps", [3, 40, 300])
def test_waves_never_gain_more_energy_than_the_stone_lost(start, own_dent, steps):
    lake = Lake((128, 128), damping=0.0, sleep_amplitude=0.0)
    run = Run({"stone": start}, lake, own_dent=own_dent)
    run.advance(steps)
    balance = run.surface.balance
    run.surface.settle()
    measured = wave_energy(lake, run.timestep)
    assert balance.lost > 0.0
    assert 0.0 < measured <= balance.lost
    assert balance.gained <= balance.lost * (1.0 + 1e-12)


def test_the_gain_is_counted_as_the_waves_have_it():
    lake = Lake((128, 128), damping=0.0, sleep_amplitude=0.0)
    run = Run({"stone": thrown(DISC)}, lake, timestep=1e-4)
    run.advance(600)
    run.surface.settle()
    # Counted with the whole speed at the end of each step, where the mean over it would be exact:
    # never too little, and too much by a share of (step / rise of the load).
    measured = wave_energy(lake, 1e-4)
    assert measured <= run.surface.balance.gained
    assert measured == pytest.approx(run.surface.balance.gained, rel=0.02)


@given(st.floats(-1, 1), st.floats(0, 1), st.floats(0, 1))
def test_the_share_is_the_largest_that_the_stone_can_pay_for(linear, square, loss):
    share = largest_share(linear, square, loss)
    cost = share * linear + share**2 * square
    assert 0.0 <= share <= 1.0
    assert cost <= loss + 1e-12
    assert share == 1.0 or cost == pytest.approx(loss, abs=1e-9)


@pytest.mark.parametrize("own_dent", [False, True])
def test_the_water_is_given_the_momentum_that_the_stone_took(own_dent):
    steps, timestep = 60, 5e-4
    start = thrown(DISC)
    run = Run({"stone": start}, Lake(), timestep=timestep, integrator="euler", own_dent=own_dent)
    given = taken = 0.0
    for _ in range(steps):
        seen, share = run.step()
        taken += timestep * seen["stone"][0, 2]
        given += share["stone"] * timestep * seen["stone"][0, 2]
    balance = run.surface.balance
    # Euler's step is the force at its beginning: what was observed there is all that acted.
    rise = run.states["stone"][0, 14] - start[1].velocity[2]
    gained = DISC.mass * (rise + GRAVITY * steps * timestep)
    assert balance.taken == pytest.approx(taken, rel=1e-12)
    assert balance.taken == pytest.approx(gained, rel=1e-12)
    # All of it, but where the load had to be cut down.
    assert balance.given == pytest.approx(given, rel=1e-12)
    assert (balance.given < balance.taken) == (balance.limited > 0)
    if own_dent:
        assert balance.limited == 0
        assert balance.given == pytest.approx(balance.taken, rel=1e-12)


def test_the_head_that_is_pressed_weighs_what_the_stone_feels():
    lake = Lake()
    for place, radius in ((0.0, 0.05), (0.0137, 0.03), (0.6391, 0.001)):
        head, _, _ = lake.head(place, 0.3 * place, radius=radius, volume=2.5)
        assert head.sum(dtype=np.float64) == pytest.approx(2.5, rel=1e-6)  # single precision


def flat_patch(side, *, level=0.0, speed=0.0, rate=50.0):
    """A patch about the origin on which the surface is flat, and its address."""
    patch = np.zeros(kernels.PATCH_POINTS + 2 * side * side)
    patch[: kernels.PATCH_POINTS] = [
        -side / rate / 2,
        -side / rate / 2,
        rate,
        side,
        side,
        abs(level),
    ]
    patch[kernels.PATCH_POINTS : kernels.PATCH_POINTS + side * side] = level
    patch[kernels.PATCH_POINTS + side * side :] = speed
    return patch, np.array([patch.ctypes.data], np.int64).view(np.float64)[0]


WATERS = [
    Water(), Water(gate="local"), Water(buoyancy=True, skin_friction=True), Water(law="bocquet2003"),
]  # fmt: skip


def packed(motion, *, lift=0.0, rise=0.0):
    x, q, v, w = (np.asarray(motion[k], float) for k in ("position", "q", "velocity", "omega"))
    x, v = x - [x[0], x[1], lift], v - [0.0, 0.0, rise]
    return pack_states(x[None], matrices(q)[None], v[None], w[None])


@given(stones, motions(), st.sampled_from(WATERS))
def test_a_patch_of_level_water_is_still_water(stone, motion, water):
    block, (patch, address) = pack(stone, water), flat_patch(81)
    states = packed(motion)
    still = wrench_and_immersion(block, states)
    block[kernels.SURFACE] = address
    # the same faces in another order: rounding of sums, in which opposite faces nearly cancel
    scale = 1.0 + 1e3 * stone.radius**2 * np.linalg.norm(motion["velocity"]) ** 2
    scale += 1e3 * stone.radius**4 * np.linalg.norm(motion["omega"]) ** 2
    found = wrench_and_immersion(block, states)
    np.testing.assert_allclose(found, still, rtol=1e-12, atol=1e-13 * scale)
    assert patch.size  # alive until here


@given(
    stones, motions(), st.sampled_from(WATERS), st.floats(-0.05, 0.05), st.floats(-2, 2)
)  # fmt: skip
def test_on_a_level_that_is_raised_and_rising_only_what_is_relative_counts(
    stone, motion, water, level, speed
):
    block = pack(stone, replace(water, air_density=0.0))
    lowered = wrench_and_immersion(block, packed(motion, lift=level, rise=speed))
    patch, address = flat_patch(81, level=level, speed=speed)
    block[kernels.SURFACE] = address
    there = wrench_and_immersion(block, packed(motion))
    scale = 1.0 + abs(lowered[:, :6]).max()
    # The difference of two heights is rounded, and a sliver at the waterline comes or goes with it.
    np.testing.assert_allclose(there[:, :6], lowered[:, :6], atol=1e-9 * scale)
    assert patch.size


def test_two_way_water_that_is_left_alone_is_still_water():
    runs = []
    for strength in (0.0, None):
        run = Run({"stone": thrown(DISC)}, Lake(), own_dent=True, strength=strength or 0.0)
        if strength is None:
            run.stones["stone"].advance(200)
            runs.append(run.stones["stone"].advance(1))
        else:
            run.advance(200)
            runs.append(run.stones["stone"].advance(1))
    np.testing.assert_array_equal(*runs)


def test_flat_and_two_way_agree_as_the_reaction_tends_to_zero():
    ends = {}
    for strength in (0.0, 0.005, 0.01, 0.02):
        run = Run({"stone": thrown(DISC)}, Lake(), own_dent=True, strength=strength)
        run.advance(120)
        ends[strength] = run.states["stone"][0, [2, 12, 14]]
    change = {s: np.linalg.norm(ends[s] - ends[0.0]) for s in ends}
    assert change[0.02] > 1e-5
    # Linear in the strength; the remainder halves with it.
    assert change[0.01] / change[0.005] == pytest.approx(2.0, abs=0.1)
    assert change[0.02] / change[0.01] == pytest.approx(2.0, abs=0.2)


def test_the_hollow_under_a_floating_disc_is_the_static_head():
    cork = Stone.disc(0.1, 0.04, segments=32, density=500.0)
    lake = Lake((64, 64), damping=6.0, sleep_amplitude=0.0)
    water = Water(air_density=0.0, gate="local", buoyancy=True, skin_friction=True)
    start = dropped(cork, 0.0, height=-0.02)
    run = Run({"cork": start}, lake, timestep=2e-3, water=water, own_dent=True)
    seen = run.advance(4000)["cork"][0]
    run.surface.settle()
    load = cork.mass / (DENSITY * lake.spacing**2)
    heights, i, j = lake.head(0.0, 0.0, radius=math.sqrt(seen[12] / math.pi), volume=load)
    level, _, _ = lake.window(0.0, 0.0, lake.shape)
    expected = np.full(lake.shape, load / 64**2)
    at = np.s_[i : i + heights.shape[0], j : j + heights.shape[1]]
    expected[at] -= heights
    # Waves of e^-24, and a disc that still bobs by less than 0.2 mm.
    assert heights.max() > 0.02
    np.testing.assert_allclose(level, expected, atol=4e-4)


@pytest.mark.parametrize(
    ("start", "ratio"),
    [
        # Second order in the grid.
        (dropped(DISC, 2.0), 0.3),
        # The rim of a skipping stone's small wet spot counts from 1.5 cells up: first order.
        (thrown(DISC), 0.65),
    ],
    ids=["slap", "skip"],
)
def test_a_stone_in_its_own_dent_converges_as_the_grid_is_refined(start, ratio):
    ends = []
    for spacing in (0.02, 0.01, 0.005, 0.0025):
        run = Run({"stone": start}, Lake(spacing=spacing, sleep_amplitude=0.0), own_dent=True)
        run.advance(50)
        ends.append(run.states["stone"][0, 2])
    change = np.abs(np.diff(ends))
    assert change[0] > 1e-4
    assert (change[1:] < ratio * change[:-1]).all()


def test_a_stone_feels_the_waves_of_another_and_not_its_own():
    maker, feeler = dropped(DISC, 3.0), dropped(DISC, 0.0, y=0.16, height=0.05)
    lake = Lake(sleep_amplitude=0.0)
    run = Run({"maker": maker, "feeler": feeler}, lake)
    for _ in range(100):
        run.surface.look(run.states)
        run.surface.advance(run.timestep)
        run.states["maker"] = run.stones["maker"].advance(1)
    seen = run.surface.look(run.states)
    own = run.surface._stones["maker"].own.lake
    assert abs(own.highest) > 5e-3
    assert not lake.highest  # the touch is not over
    # lowest point of the flat disc over the highest water under its rim
    rim = DISC.vertices[:, :2] + [0.0, 0.16]
    expected = 0.05 - own.sample(rim[:, 0], rim[:, 1]).elevation.max()
    assert seen["feeler"][0, 16] == pytest.approx(expected, abs=1e-9)
    assert abs(expected - 0.05) > 1e-4
    still = wrench_and_immersion(
        pack(DISC, Water(air_density=0.0, gate="local")), run.states["maker"]
    )
    np.testing.assert_array_equal(seen["maker"], still)


def test_in_a_periodic_lake_a_stone_feels_what_went_over_the_edge():
    width = 128 * 0.02
    runs = []
    for where in (0.0, width):
        lake = Lake((128, 64), periodic=True, sleep_amplitude=0.0)
        lake.displace(0.3, 0.0, height=0.02, radius=0.2)
        lake.advance(0.4)
        run = Run({"stone": dropped(DISC, 1.0, x=where, height=0.0)}, lake)
        run.advance(60)
        runs.append(run.states["stone"][0])
    runs[1][0] -= width
    still = Run({"stone": dropped(DISC, 1.0)}, Lake())
    still.advance(60)
    assert abs(runs[0] - still.states["stone"][0]).max() > 1e-3  # it does feel waves
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)


def test_when_a_touch_is_over_its_waves_are_the_lakes_and_it_is_felt_by_its_maker():
    run = Run({"stone": thrown(DISC)}, Lake())
    run.advance(30)
    run.states["stone"][0, 2] = 1.0  # out of the water
    for _ in range(30):
        run.surface.look(run.states)
        run.surface.advance(run.timestep)
    assert run.surface.lake.highest > 1e-3
    assert run.surface._stones["stone"].own.lake.awake_tiles == 0
    run.states["stone"][0, :3] = 0.0, 0.0, 0.0
    seen = run.surface.look(run.states)["stone"]
    still = wrench_and_immersion(
        pack(DISC, Water(air_density=0.0, gate="local")), run.states["stone"]
    )
    assert abs(seen[0, 16] - still[0, 16]) > 1e-4


LIMITS = Limits(duration=0.35)


@pytest.mark.parametrize("own_dent", [False, True])
def test_both_engines_agree_over_waves(lake, own_dent):
    ours, theirs = (
        simulate(
            lake, engine=engine, surface="waves", own_dent=own_dent, timestep=2.5e-4, limits=LIMITS
        )
        for engine in ("mujoco", "reference")
    )
    touched = ours.clearance < 0.0
    assert touched.any()
    # The water is single precision: a last bit of a 1 cm wave is 1e-9 m, or 4e-6 m/s over a step.
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0.0, atol=1e-6)


def test_a_fast_stone_outruns_its_waves_but_not_its_own_dent(lake):
    still = simulate(lake, limits=LIMITS)
    outrun = simulate(lake, surface="waves", limits=LIMITS)
    np.testing.assert_array_equal(outrun.x, still.x)
    assert outrun.water_load.any()
    dented = simulate(lake, surface="waves", own_dent=True, limits=LIMITS)
    assert abs(dented.x - still.x).max() > 1e-3


@pytest.mark.parametrize(
    "throw", [{}, {"speed": 9.0, "descent": 12}, {"speed": 5.0, "attack": 45, "descent": 60}]
)
@pytest.mark.parametrize("boundary", ["absorb", "reflect"])
def test_a_touch_in_compiled_code_is_the_touch_step_by_step(lake, throw, boundary, monkeypatch):
    settings = {"speed": 12.0, "spin": 15, "attack": 20, "descent": 6, "height": 0.05} | throw
    scene = replace(lake, grid=lake.grid | {"boundary": boundary, "shape": (1024, 256)})
    glides = []
    made = MovingSurface.glide

    def counted(*args):
        parts = made(*args)
        glides.append(sum(len(shares) for _, _, shares in (parts or {}).values()))
        return parts

    monkeypatch.setattr(MovingSurface, "glide", counted)
    fast = simulate(scene, Throw.from_degrees(**settings), surface="waves")
    assert sum(glides) > 0.5 * len(fast.time)
    monkeypatch.setattr(MujocoEngine, "hop", None)
    slow = simulate(scene, Throw.from_degrees(**settings), surface="waves")
    for name in ("time", "x", "q", "P", "L", "force", "water_load", "wetted_centre", "clearance"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(slow, name), err_msg=name)
    assert (fast.end, fast.contacts) == (slow.end, slow.contacts)


def test_over_waves_as_over_still_water_the_same_throw_gives_the_same_path_twice():
    scene = load_scene("duel")
    first, second = (
        simulate_all(scene, surface="waves", own_dent=True, limits=LIMITS) for _ in range(2)
    )
    for name in first:
        np.testing.assert_array_equal(first[name].x, second[name].x)


def test_a_load_is_cut_down_where_the_water_outruns_the_stone():
    # A leaf's weight of stone that is slapped from below by a wave as high as itself.
    light = Stone.disc(0.05, 0.01, density=100.0)
    lake = Lake(sleep_amplitude=0.0)
    lake.displace(0.0, 0.0, height=-0.05, radius=0.08)
    lake.advance(0.02)
    run = Run({"stone": dropped(light, 0.5, height=-0.03)}, lake, own_dent=True)
    run.advance(200)
    balance = run.surface.balance
    assert balance.loads > balance.limited > 0
    assert balance.gained <= balance.lost * (1.0 + 1e-12)
    assert math.isfinite(lake.highest)


def test_many_throws_of_three_stones_leave_the_mean_level_and_the_memory_as_they_were():
    sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
    from soak import soak

    reports = list(soak(3.0, every=1.0))
    for report in reports:
        assert report["finite"]
        assert math.isfinite(report["highest"])
        assert 0.0 < report["gained"] <= report["lost"]
        # A rounding of 6e-10 m a cell and step is a speed that damping takes 2 s to end: over 37 000
        # cells and 3000 steps some 2e-7 m of mean level.
        assert abs(report["mean_level"]) < 1e-6
    assert reports[-1]["highest"] > 0.01
    # nine tiles, two levels, and two more for changes of step
    assert reports[-1]["water_bytes"] < 2e6


def test_a_stone_that_its_own_dent_has_driven_is_doubted(lake):
    throw = Throw.from_degrees(speed=12, spin=15, attack=30, descent=12, height=0.3)
    with pytest.warns(
        MjskipWarning, match=r"times the energy of its release at \d\.\d+ s: its own dent"
    ):
        simulate(lake, throw, surface="waves", own_dent=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(lake, throw, surface="waves")


def test_what_a_lake_cannot_take_is_refused_before_the_run(lake):
    with (
        pytest.raises(
            ValueError, match=r"time step 0\.05 s is too long for the waves of .*at most 0\.0173 s"
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
    fine = replace(lake, grid=lake.grid | {"spacing": 1e-6})
    with pytest.raises(ValueError, match=r"covers \d+ x \d+ cells .* GB: use a larger spacing"):
        simulate(fine, surface="waves", timestep=1e-7, limits=Limits(duration=0.01))
    with pytest.warns(MjskipWarning, match=r"covers \d+ x \d+ cells of 0\.0001 m: that is slow"):
        MovingSurface(Lake(spacing=1e-4), {"stone": pack(DISC, Water())})
