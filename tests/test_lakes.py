"""A lake of tiles is one large grid of which only the moving part is stored."""

import math

import numpy as np
import pytest

from mjskip.waves import HeightField
from mjskip.waves.lake import TILE, Lake


def drive(water, steps=120, timestep=0.015):
    """The same few loads on any water, some across tile edges and walls."""
    rng = np.random.default_rng(7)
    for _ in range(steps):
        if rng.uniform() < 0.2:
            x, y = rng.uniform(-1.4, 1.4, 2)
            water.press(x, y, force=rng.uniform(-3, 10), radius=rng.uniform(0.01, 0.1))
        water.step(timestep * (1.0 if rng.uniform() < 0.8 else 0.7))


def test_inside_walls_a_lake_of_tiles_is_the_dense_field_to_rounding():
    shape = (3 * TILE, 2 * TILE)
    dense, lake = HeightField(shape), Lake(shape, sleep_amplitude=0.0)
    for water in (dense, lake):
        water.displace(0.1, 0.2, height=0.01, radius=0.3)
        drive(water)
    elevation, x, y = lake.window(0.0, 0.0, shape)
    np.testing.assert_allclose(x, dense.x, atol=1e-12)
    np.testing.assert_allclose(y, dense.y, atol=1e-12)
    # A load's place differs in the last bit of a double between the two, hence its cells in the
    # last bit of a float: 6e-9 m of waves of up to 10 cm, and each of some 40 changes of step
    # carries it on. Without loads nothing differs (below).
    assert abs(elevation - dense.elevation).max() < 1e-7
    assert lake.time == dense.time


def test_an_endless_lake_is_a_dense_field_whose_walls_are_far():
    n = 6 * TILE + 1  # its middle cell is at the origin, like cell (0, 0) of an endless lake
    dense, lake = HeightField((n, n), damping=0.4), Lake(damping=0.4, sleep_amplitude=0.0)
    for water in (dense, lake):
        water.displace(0.0, 0.0, height=0.01, radius=0.25)
        for _ in range(150):
            water.step(0.015)
    elevation, _, _ = lake.window(0.0, 0.0, (n, n))
    np.testing.assert_array_equal(elevation, dense.elevation)


@pytest.mark.parametrize("tiles", [(3, 2), (1, 2)])
def test_a_periodic_lake_of_tiles_is_the_periodic_dense_field(tiles):
    shape = tiles[0] * TILE, tiles[1] * TILE
    dense = HeightField(shape, boundary="periodic")
    lake = Lake(shape, periodic=True, sleep_amplitude=0.0)
    for water in (dense, lake):
        water.displace(0.1, 0.2, height=0.01, radius=0.3)
        for _ in range(150):
            water.step(0.015)
    elevation, _, _ = lake.window(0.0, 0.0, shape)
    assert abs(elevation[0]).max() > 1e-5  # it has come to the edge
    np.testing.assert_array_equal(elevation, dense.elevation)
    drive(dense)
    drive(lake)
    elevation, _, _ = lake.window(0.0, 0.0, shape)
    assert abs(elevation - dense.elevation).max() < 1e-7  # as inside walls
    width = shape[0] * lake.spacing
    at = np.linspace(-0.5, 0.5, 7)
    here, there = lake.sample(at, 0.1 + 0 * at), lake.sample(at + 2 * width, 0.1 + 0 * at)
    np.testing.assert_allclose(here.elevation, there.elevation, atol=1e-9)
    assert abs(lake.volume() - dense.volume()) < 1e-9


def test_a_wave_wakes_the_tiles_it_reaches_and_no_others():
    lake = Lake()
    assert lake.awake_tiles == 0
    lake.advance(1.0)
    assert lake.awake_tiles == 0
    lake.press(0.64, 0.64, force=10.0, radius=0.05)
    lake.advance(0.02)
    assert lake.awake_tiles <= 4
    lake.advance(3.0)
    reach = 3.02 / (TILE * lake.spacing) + 1.5  # tiles on either side that a front at c can touch
    assert 4 < lake.awake_tiles <= (2 * reach) ** 2


def test_water_falls_asleep_when_it_is_calm_again_and_gives_its_memory_back():
    lake = Lake(damping=3.0, sleep_amplitude=1e-5)
    for k in range(6):
        lake.press(2.0 * k, 0.0, force=20.0, radius=0.05)
        lake.advance(0.1)
    busy, memory = lake.awake_tiles, lake.memory
    assert busy > 10
    lake.advance(20.0)
    assert lake.awake_tiles == 0
    assert lake.memory < memory
    # What fell asleep lay within half the amplitude over its tiles.
    assert abs(lake.lost_volume) < 0.5e-5 * 10 * busy * (TILE * lake.spacing) ** 2


def test_letting_small_waves_go_changes_the_rest_by_about_their_amplitude():
    amplitude = 2e-5
    exact, lake = Lake(sleep_amplitude=0.0), Lake(sleep_amplitude=amplitude)
    for water in (exact, lake):
        for k in range(5):
            water.press(0.8 * k, 0.3, force=5.0, radius=0.04)
            water.advance(0.3)
        water.advance(3.0)
    shape = (600, 600)
    difference = exact.window(1.5, 0.3, shape)[0] - lake.window(1.5, 0.3, shape)[0]
    assert lake.awake_tiles < exact.awake_tiles
    # Each sleeping edge can return a wave of the amplitude; a few of them meet.
    assert abs(difference).max() < 3.0 * amplitude
    assert abs(exact.window(1.5, 0.3, shape)[0]).max() > 10.0 * amplitude


def test_loads_move_water_and_make_none_across_tiles():
    lake = Lake((2 * TILE, 2 * TILE), sleep_amplitude=0.0)
    drive(lake)
    moved = float(abs(lake.window(0, 0, (2 * TILE, 2 * TILE))[0]).sum()) * lake.spacing**2
    assert moved > 1e-4
    # Single-precision round-off, as in the dense field.
    assert abs(lake.volume()) < 1e-4 * moved


def test_samples_agree_with_the_dense_field_and_are_still_where_nothing_moves():
    shape = (2 * TILE, 3 * TILE)
    dense, lake = HeightField(shape), Lake(shape, sleep_amplitude=0.0)
    for water in (dense, lake):
        water.displace(0.1, 0.2, height=0.01, radius=0.3)
        for _ in range(40):
            water.step(0.015)
    rng = np.random.default_rng(8)
    x, y = rng.uniform(-1.5, 1.5, 200), rng.uniform(-2.2, 2.2, 200)
    ours, theirs = lake.sample(x, y), dense.sample(x, y)
    np.testing.assert_allclose(ours.elevation, theirs.elevation, atol=1e-9)
    np.testing.assert_allclose(ours.slope, theirs.slope, atol=1e-7)
    np.testing.assert_allclose(ours.vertical_speed, theirs.vertical_speed, atol=1e-7)
    assert abs(ours.elevation).max() > 1e-3
    assert not Lake().sample([1e6, np.nan], [-1e6, 0.0]).elevation.any()


def test_slots_are_told_apart_after_many_wakings_and_sleepings():
    lake = Lake(damping=2.0, sleep_amplitude=1e-4)
    rng = np.random.default_rng(9)
    for _ in range(60):
        lake.press(*rng.uniform(-8, 8, 2), force=30.0, radius=0.05)
        lake.advance(0.2)
        water = lake.water
        assert len(water.names) == water.used == len(water.slots) + 1
        for tile, slot in water.slots.items():
            assert water.names[slot] == tile
            for direction in range(9):
                around = (tile[0] + direction // 3 - 1, tile[1] + direction % 3 - 1)
                assert water.neighbours[slot, direction] == water.slots.get(around, 0)
    assert not lake.water.z[0].any()
    assert not lake.water.prev[0].any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"shape": (100, 128)}, r"tiles of 64 cells; use \(128, 128\)"),
        ({"shape": (1, 1)}, "whole numbers of at least 3"),
        ({"spacing": -1.0}, "spacing is -1.0"),
        ({"sleep_amplitude": math.nan}, "sleep_amplitude is nan"),
        ({"centre": (math.inf, 0.0)}, "centre_x is inf"),
        ({"land": np.zeros((64, 64), bool)}, "give a function of x"),
        ({"periodic": True}, "an endless lake cannot be periodic: give a shape"),
    ],
)
def test_what_cannot_be_a_lake_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Lake(**arguments)


def test_an_unstable_step_is_refused_as_in_the_dense_field():
    with pytest.raises(ValueError, match=r"unstable: use at most 0\.0173205 s"):
        Lake().step(0.02)
    with pytest.raises(ValueError, match="give a number above 0"):
        Lake().step(-1.0)
    with pytest.raises(ValueError, match="duration is nan"):
        Lake().advance(math.nan)


def test_a_lake_absorbs_its_siblings_only():
    lake = Lake()
    for other in (lake, Lake(spacing=0.01), Lake((64, 64))):
        with pytest.raises(ValueError, match=r"only a lake's sibling\(\)"):
            lake.absorb(other)
    lake.absorb(lake.sibling())


@pytest.mark.parametrize("water", [Lake(), HeightField((10, 10))])
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
