"""The surface is recorded while it is felt, and what is shown is the recording."""

import numpy as np
import pytest
from flights import SMALL, flight, small

from mjskip import HeightField, Limits
from mjskip.draw.render import Shot, frames, surface_frames
from mjskip.draw.stage import Stage
from mjskip.draw.surface import patch_of
from mjskip.throws.engines import MujocoEngine
from mjskip.throws.rings import loads_between, recorded_rings
from mjskip.throws.run import Run
from mjskip.throws.simulate import simulate_all
from mjskip.waves import recording
from mjskip.waves.driven import DrivenWater
from mjskip.waves.recording import SurfaceFrames, SurfaceRecorder


def moving(**settings):
    field = HeightField.endless(**settings)
    field.displace(0.3, -0.2, height=0.02, radius=0.2)
    return field


@pytest.mark.parametrize("in_memory", [1 << 28, 100])
def test_a_recording_gives_back_each_moment_to_the_last_bit(monkeypatch, in_memory):
    monkeypatch.setattr(recording, "IN_MEMORY", in_memory)
    field = moving()
    recorder = SurfaceRecorder(SurfaceFrames(rate=40.0, linger=0.2), field, timestep=0.005)
    kept = []
    for _ in range(100):
        if recorder.is_due(field.time):
            recorder.record(field)
            kept.append((field.time, field.window(0, 0, (200, 200))[0]))
        field.advance(0.005)
    recorder.linger(field)
    made = recorder.recording
    np.testing.assert_allclose(made.times[:20], np.arange(20) / 40.0, atol=1e-12)
    assert made.times[-1] == pytest.approx(0.7)
    for time, level in kept:
        for near in (time, time + 0.0024):  # within half a step
            np.testing.assert_array_equal(made.at(near).window(0, 0, (200, 200))[0], level)
    assert made.spacing == field.spacing


def test_between_two_moments_the_surface_is_interpolated_and_beyond_them_it_is_the_nearest():
    field = moving()
    recorder = SurfaceRecorder(SurfaceFrames(rate=10.0), field, timestep=1e-3)
    for _ in range(3):
        recorder.record(field)
        field.advance(recorder.due - field.time)
    made, shape = recorder.recording, (150, 150)
    first, second, last = (made.at(t).window(0, 0, shape)[0] for t in (0.0, 0.1, 0.2))
    between = made.at(0.125)
    np.testing.assert_allclose(
        between.window(0, 0, shape)[0], 0.75 * second + 0.25 * last, atol=1e-8
    )
    assert between.time == 0.125
    np.testing.assert_array_equal(made.at(9.0).elevation, made.at(0.2).elevation)
    np.testing.assert_array_equal(made.at(-1.0).elevation, made.at(0.0).elevation)
    assert abs(first - second).max() > 1e-3
    # what is given is a field with all verbs, and nobody else's
    again = made.at(0.1)
    again.advance(0.1)
    np.testing.assert_array_equal(made.at(0.1).window(0, 0, shape)[0], second)


def test_what_cannot_be_recorded_is_refused():
    with pytest.raises(ValueError, match="nothing was recorded"):
        SurfaceRecorder(SurfaceFrames(), moving(), timestep=1e-3).recording.at(0.0)
    with pytest.raises(ValueError, match="rate is 0"):
        SurfaceFrames(rate=0.0)
    with pytest.raises(ValueError, match="linger is -1"):
        SurfaceFrames(linger=-1.0)


# Films -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["lake", "duel"])
def test_a_film_shows_the_water_that_was_felt_to_the_last_bit(name, monkeypatch):
    scene = small(name)
    shot = Shot(fps=30.0, slow=2.0, size=SMALL, linger=0.2)
    felt, shown = {}, {}
    record, draw = SurfaceRecorder.record, Stage.draw

    def recorded(self, field):
        felt[round(60 * field.time)] = field.window(-2.0, 0.0, (800, 700))
        record(self, field)

    def drawn(self, time, surface, **options):
        shown[round(60 * time)] = patch_of(surface)
        return draw(self, time, surface, **options)

    monkeypatch.setattr(SurfaceRecorder, "record", recorded)
    monkeypatch.setattr(Stage, "draw", drawn)
    flights = simulate_all(
        scene, surface="waves", limits=Limits(duration=0.45), record=surface_frames(shot)
    )
    assert len({id(one.surface) for one in flights.values()}) == 1
    list(frames(scene, flights, shot))
    assert len(shown) > 30
    assert felt.keys() >= shown.keys()
    highest = 0.0
    for moment, patch in shown.items():
        level, x, y = felt[moment]
        i, j = (round((at - cells[0]) / patch.spacing)
                for at, cells in zip(patch.origin, (x, y), strict=True))  # fmt: skip
        nx, ny = patch.elevation.shape
        np.testing.assert_array_equal(patch.elevation, level[i : i + nx, j : j + ny])
        highest = max(highest, float(np.abs(patch.elevation).max()))
    assert highest > 5e-3


def test_what_is_recorded_is_what_the_stones_feel():
    """The patch under a stone holds the very cells that the recording has of that moment."""
    scene = small("duel")
    field = scene.field()
    recorder = SurfaceRecorder(SurfaceFrames(rate=2000.0), field, timestep=5e-4)
    with MujocoEngine(scene, None, 5e-4, frozen_attitude=False) as engine:
        run = Run(scene, engine, 5e-4, field=field, feel=True, recorder=recorder)
        run.advance(340)
        run.finish()
        water = run._water.coupled
    boxes = water.boxes[: water.counts[0]]
    assert len(boxes) == 2
    # the stones looked at the surface before the last step
    before = recorder.recording.at(339 * 5e-4)
    for i, j, nx, ny, patch, *_ in boxes.tolist():
        level = water.patches[patch + 6 :][: nx * ny].reshape(nx, ny)
        middle = field.cell_position(i + nx // 2, j + ny // 2)
        np.testing.assert_array_equal(before.window(*middle, (nx, ny))[0], level)
        assert abs(level).max() > 1e-3


def test_over_still_water_rings_are_recorded_with_the_run_and_are_those_of_the_saved_throw():
    scene = small()
    frames_of = SurfaceFrames(rate=50.0, linger=0.3)
    (one,) = simulate_all(scene, limits=Limits(duration=0.45), record=frames_of).values()
    (bare,) = simulate_all(scene, limits=Limits(duration=0.45)).values()
    np.testing.assert_array_equal(one.position, bare.position)
    assert bare.surface is None
    again = recorded_rings(scene, [bare], frames_of)
    np.testing.assert_allclose(again.times[:20], one.surface.times[:20], atol=1e-9)
    for time in (0.2, 0.3, 0.44):
        ours, theirs = one.surface.at(time), again.at(time)
        here = ours.window(-0.4, 0.0, (200, 150))[0]
        scale = abs(here).max()
        assert scale > 1e-3
        # the same impulses; means over other slices of two milliseconds
        assert abs(here - theirs.window(-0.4, 0.0, (200, 150))[0]).max() < 0.05 * scale


# Driven water ------------------------------------------------------------------------------------


class Ledger:
    """A water that only writes down what it is given."""

    def __init__(self):
        self.given = self.time = 0.0
        self.advances, self._load, self.max_timestep = 0, 0.0, 0.017

    def press(self, x, y, *, force, radius, density):
        self._load += force

    def advance(self, duration):
        self.given += self._load * duration
        self._load = 0.0
        self.time += duration
        self.advances += 1


def drive(water, trajectory, cuts=()):
    columns = trajectory.water_load, trajectory.wetted_centre[:, :2], trajectory.wetted_area
    for rows in np.split(np.arange(len(trajectory.time)), cuts):
        water.extend(*(column[rows, None] for column in columns))
    water.catch_up()


@pytest.mark.parametrize("seed", range(5))
def test_the_water_gets_back_the_impulse_the_stone_took(seed):
    trajectory, ledger = flight(seed=seed), Ledger()
    timestep = float(trajectory.time[1] - trajectory.time[0])
    cuts = np.sort(np.random.default_rng(seed).choice(len(trajectory.time), 9, replace=False))
    drive(DrivenWater(ledger, timestep=timestep, density=1000.0), trajectory, cuts)
    # sums of a thousand rounded products of order 1e-2 N s
    assert ledger.given == pytest.approx(timestep * trajectory.water_load.sum(), abs=1e-13)
    assert ledger.time == pytest.approx(timestep * len(trajectory.time), abs=1e-12)


def test_untouched_water_moves_in_its_largest_steps():
    ledger = Ledger()
    water = DrivenWater(ledger, timestep=1e-3, density=1000.0)
    water.extend(np.zeros((100, 2)), np.zeros((100, 2, 2)), np.zeros((100, 2)))
    water.catch_up()
    assert ledger.advances == 6  # of 17 ms at most
    assert ledger.given == 0.0


def test_the_loads_of_two_stones_add():
    one, two = Ledger(), Ledger()
    flights = flight(seed=1), flight(seed=2)
    both = np.stack([f.water_load for f in flights], axis=1)
    places = np.stack([f.wetted_centre[:, :2] for f in flights], axis=1)
    areas = np.stack([f.wetted_area for f in flights], axis=1)
    DrivenWater(one, timestep=1e-3, density=1000.0).extend(both, places, areas)
    for k in range(2):
        two.time = 0.0
        DrivenWater(two, timestep=1e-3, density=1000.0).extend(
            both[:, k : k + 1], places[:, k : k + 1], areas[:, k : k + 1]
        )
    assert one.given == pytest.approx(two.given, rel=1e-12)


def test_rings_make_no_water():
    field = HeightField((160, 100), 0.02, centre=(-3.5, 0.0))
    drive(DrivenWater(field, timestep=1e-3, density=1000.0), flight())
    assert np.abs(field.elevation).max() > 1e-4
    # single precision: 16000 cells of 4e-4 m^2, each off by about 1e-9 m in some 100 steps
    assert abs(field.volume()) < 2e-7


@pytest.mark.parametrize("seed", range(3))
def test_a_saved_throw_gives_its_impulse_over_any_interval_and_its_place(seed):
    trajectory = flight(seed=seed)
    held = np.append(np.diff(trajectory.time), 0.0)
    taken = np.concatenate([[0.0], np.cumsum(trajectory.water_load * held)[:-1]])
    times = np.sort(np.random.default_rng(seed).uniform(0.0, 0.45, 37))
    impulses, centres, areas = loads_between(trajectory, times)
    expected = np.diff(np.interp(times, trajectory.time, taken))
    np.testing.assert_allclose(impulses, expected, atol=1e-14)
    wet = impulses != 0.0
    assert wet.any()
    assert (centres[wet, 0] >= trajectory.position[0, 0]).all()
    assert np.abs(centres[wet, 0] + 4.0 - 2.0 * 0.5 * (times[1:] + times[:-1])[wet]).max() < 0.05
    np.testing.assert_allclose(areas[wet], 3e-3, rtol=1e-9)
    assert not areas[~wet].any()
