"""Water of tiles is one large grid of which only the moving part is stored."""

import math

import numpy as np
import pytest

from mjskip.errors import MjskipError
from mjskip.waves import HeightField
from mjskip.waves._tile_kernels import TILE, find_tile

SMALLEST = 1e-30
"""A sleep amplitude [m] so small that nothing is lost: tiles are stored from when a wave reaches them on."""


def drive(water, steps=120, timestep=0.015):
    """A few loads, some across tile edges and walls."""
    rng = np.random.default_rng(7)
    for _ in range(steps):
        if rng.uniform() < 0.2:
            x, y = rng.uniform(-1.4, 1.4, 2)
            water.press(x, y, force=rng.uniform(-3, 10), radius=rng.uniform(0.01, 0.1))
        water.step(timestep)


SHAPES = [(3 * TILE, 2 * TILE), (TILE, 2 * TILE), (100, 150), (70, 64)]
"""Whole tiles, two of them that are each other's neighbours on both sides, and tiles that are cut off."""


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("boundary", ["reflect", "periodic"])
def test_tiles_are_the_whole_field_to_rounding(shape, boundary):
    whole = HeightField(shape, boundary=boundary)
    tiles = HeightField(shape, boundary=boundary, sleep_amplitude=SMALLEST)
    for water in (whole, tiles):
        water.displace(0.1, 0.2, height=0.01, radius=0.3)
        drive(water)
    assert whole.active_tiles == 1 < tiles.active_tiles
    assert abs(whole.elevation).max() > 1e-3
    # What a tile misses before a wave of SMALLEST reaches it may turn the rounding of the last bit.
    assert abs(tiles.elevation - whole.elevation).max() < 5e-9
    np.testing.assert_array_equal(tiles.x, whole.x)
    assert tiles.time == whole.time
    rng = np.random.default_rng(8)
    at = rng.uniform(-1.5, 1.5, (2, 200))
    ours, theirs = tiles.sample(*at), whole.sample(*at)
    np.testing.assert_allclose(ours.elevation, theirs.elevation, atol=1e-8)
    np.testing.assert_allclose(ours.slope, theirs.slope, atol=1e-6)
    np.testing.assert_allclose(ours.vertical_speed, theirs.vertical_speed, atol=1e-6)


def test_endless_water_is_a_field_whose_walls_are_far():
    n = 6 * TILE + 1  # its middle cell is at the origin, like cell (0, 0) of endless water
    whole = HeightField((n, n), damping=0.4)
    endless = HeightField.endless(damping=0.4, sleep_amplitude=0.0)
    for water in (whole, endless):
        water.displace(0.0, 0.0, height=0.01, radius=0.25)
        for _ in range(150):
            water.step(0.015)
    elevation, x, _ = endless.window(0.0, 0.0, (n, n))
    np.testing.assert_array_equal(elevation, whole.elevation)
    np.testing.assert_array_equal(x, whole.x)
    assert endless.volume() == pytest.approx(whole.volume(), abs=1e-9)


def test_what_is_periodic_repeats():
    water = HeightField((2 * TILE, TILE), boundary="periodic")
    water.displace(0.1, 0.2, height=0.01, radius=0.3)
    water.advance(1.0)
    width = 2 * TILE * water.spacing
    at = np.linspace(-0.5, 0.5, 7)
    here, there = water.sample(at, 0.1 + 0 * at), water.sample(at + 2 * width, 0.1 + 0 * at)
    np.testing.assert_allclose(here.elevation, there.elevation, atol=1e-9)
    assert abs(here.elevation).max() > 1e-4
    assert water.contains(5 * width, 0.0)


def test_a_wave_activates_the_tiles_it_reaches_and_no_others():
    water = HeightField.endless()
    assert water.active_tiles == 0
    water.advance(1.0)
    assert water.active_tiles == 0
    assert water.elevation.shape == (0, 0)
    water.press(0.64, 0.64, force=10.0, radius=0.05)
    water.advance(0.02)
    assert water.active_tiles <= 4
    water.advance(3.0)
    reach = 3.02 / (TILE * water.spacing) + 1.5  # tiles on either side that a front at c can touch
    assert 4 < water.active_tiles <= (2 * reach) ** 2


def test_tiles_that_are_calm_again_are_given_up_with_their_memory():
    water = HeightField.endless(damping=3.0, sleep_amplitude=1e-5)
    for k in range(6):
        water.press(2.0 * k, 0.0, force=20.0, radius=0.05)
        water.advance(0.1)
    busy, memory = water.active_tiles, water.memory
    assert busy > 10
    water.advance(20.0)
    assert water.active_tiles == 0
    assert water.memory < memory
    # What was given up lay within half the amplitude over its tiles.
    assert abs(water.lost_volume) < 0.5e-5 * 10 * busy * (TILE * water.spacing) ** 2


def test_letting_small_waves_go_changes_the_rest_by_about_their_amplitude():
    amplitude = 2e-5
    exact, water = (HeightField.endless(sleep_amplitude=a) for a in (SMALLEST, amplitude))
    for each in (exact, water):
        for k in range(5):
            each.press(0.8 * k, 0.3, force=5.0, radius=0.04)
            each.advance(0.3)
        each.advance(3.0)
    shape = (600, 600)
    difference = exact.window(1.5, 0.3, shape)[0] - water.window(1.5, 0.3, shape)[0]
    assert water.active_tiles < exact.active_tiles
    # Each still edge can return a wave of the amplitude; a few of them meet.
    assert abs(difference).max() < 3.0 * amplitude
    assert abs(exact.window(1.5, 0.3, shape)[0]).max() > 10.0 * amplitude


@pytest.mark.parametrize("where", [(0.0, 0.0), (1.27, -0.01)])
def test_loads_move_water_and_make_none_across_tiles(where):
    water = HeightField((2 * TILE, 2 * TILE), sleep_amplitude=SMALLEST)
    water.press(*where, force=10.0, radius=0.1)
    drive(water)
    moved = float(abs(water.elevation).sum()) * water.spacing**2
    assert moved > 1e-4
    # Single-precision round-off.
    assert abs(water.volume()) < 1e-4 * moved


def test_tiles_are_told_apart_after_many_came_and_went():
    water = HeightField.endless(damping=2.0, sleep_amplitude=1e-4)
    rng = np.random.default_rng(9)
    gone = 0
    for _ in range(60):
        water.press(*rng.uniform(-8, 8, 2), force=30.0, radius=0.05)
        water.advance(0.2)
        grid = water.grid
        gone += water.lost_volume != 0.0
        slots = {tuple(name): k + 1 for k, name in enumerate(grid.names.tolist())}
        assert len(slots) == water.active_tiles
        for (a, b), slot in slots.items():
            assert find_tile(grid.tiles, a, b) == slot
            for direction in range(9):
                around = (a + direction // 3 - 1, b + direction % 3 - 1)
                assert grid.tiles.neighbours[slot, direction] == slots.get(around, 0)
                assert find_tile(grid.tiles, *around) == slots.get(around, 0)
    assert gone > 10
    assert not grid.tiles.first[0].any()
    assert not grid.tiles.second[0].any()


def test_endless_water_has_the_verbs_of_a_rectangle(tmp_path):
    water = HeightField.endless(centre=(0.3, -0.2), damping=0.1)
    bump = np.zeros((90, 101))
    bump[30:60, 20:70] = 0.01
    water.set(bump, 0.1 * bump)
    np.testing.assert_array_equal(water.window(0.3, -0.2, bump.shape)[0], bump.astype(np.float32))
    assert water.volume() == pytest.approx(bump.sum() * 0.02**2, rel=1e-6)
    water.step(0.01)
    assert water.elevation.shape == water.velocity.shape == (len(water.x), len(water.y))
    k = int(np.searchsorted(water.x, 0.3))
    np.testing.assert_allclose(
        water.sample(water.x[k], water.y).elevation, water.elevation[k], atol=1e-12
    )
    water.press(0.3, 0.0, force=5.0, radius=0.05)
    water.advance(0.4)
    water.save(tmp_path / "water.npz")
    again = HeightField.load(tmp_path / "water.npz")
    assert again.time == water.time
    for each in (water, again):
        each.advance(0.5)
    np.testing.assert_array_equal(again.elevation, water.elevation)
    np.testing.assert_array_equal(again.x, water.x)
    again.reset()
    assert again.active_tiles == 0
    with pytest.raises(ValueError, match=r"give an array \(nx, ny\) for endless water"):
        again.set(0.01)


def test_islands_given_as_a_function_are_the_same_in_tiles_and_in_the_whole(tmp_path):
    def islands(x, y):
        return np.hypot(x[:, None] - 0.5, y + 0.1) < 0.3

    whole = HeightField((150, 100), terrain_mask=islands)
    tiles = HeightField((150, 100), terrain_mask=islands, sleep_amplitude=SMALLEST)
    endless = HeightField.endless(centre=(0.01, 0.01), terrain_mask=islands)
    for water in (whole, tiles, endless):
        water.displace(-0.1, 0.1, height=0.01, radius=0.2)
        for _ in range(60):
            water.press(0.2, 0.0, force=3.0, radius=0.06)
            water.step(0.012)
    # the general step serves all of the whole field, and only the tiles that have land in them
    assert abs(tiles.elevation - whole.elevation).max() < 1e-7
    seen, x, y = endless.window(0.0, 0.0, (150, 100))
    np.testing.assert_allclose(x, whole.x, atol=1e-12)
    for elevation in (whole.elevation, seen):
        assert not elevation[islands(x, y)].any()
    assert abs(whole.elevation).max() > 1e-3
    endless.save(tmp_path / "islands.npz")
    with pytest.raises(MjskipError, match=r"was a function: give it to load\(\) again"):
        HeightField.load(tmp_path / "islands.npz")
    again = HeightField.load(tmp_path / "islands.npz", terrain_mask=islands)
    for water in (again, endless):
        water.advance(0.3)
    np.testing.assert_array_equal(again.elevation, endless.elevation)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HeightField.endless(spacing=-1.0), "spacing is -1.0"),
        (lambda: HeightField.endless(sleep_amplitude=math.nan), "sleep_amplitude is nan"),
        (lambda: HeightField.endless(centre=(math.inf, 0.0)), r"centre is \(inf, 0.0\)"),
        (
            lambda: HeightField.endless(terrain_mask=np.zeros((64, 64), bool)),
            "give a function of x",
        ),
        (
            lambda: HeightField(boundary="absorb", sleep_amplitude=1e-5),
            r"does not sleep: .* HeightField\.endless\(\)",
        ),
        (lambda: HeightField.endless().press(1e12, 0.0, force=1.0, radius=0.1), "is too far"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_an_unstable_step_is_refused_as_in_a_rectangle():
    with pytest.raises(ValueError, match=r"unstable: use at most 0\.0173205 s"):
        HeightField.endless().step(0.02)
    with pytest.raises(ValueError, match=r"timestep is .*: give a finite number greater than 0"):
        HeightField.endless().step(-1.0)
    with pytest.raises(ValueError, match="duration is nan"):
        HeightField.endless().advance(math.nan)


@pytest.mark.parametrize("water", [HeightField.endless(), HeightField((10, 10))])
def test_steps_that_round_to_nothing_or_never_end_are_refused(water):
    with pytest.raises(ValueError, match=r"1e-100 s is lost in rounding: use at least 1\.73e-12 s"):
        water.step(1e-100)
    assert water.advance(1e-100) == 0
    with pytest.raises(ValueError, match=r"that makes 5\.83e\+11 steps .* 1e\+10 are allowed"):
        water.advance(1e10)
    with pytest.raises(
        ValueError, match=r"height is 1e\+39: give a number that single precision holds"
    ):
        water.displace(0.0, 0.0, height=1e39, radius=0.1)
