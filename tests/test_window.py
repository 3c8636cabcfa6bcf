"""A square of moving water that waves leave: `mjskip.waves.window`, and stones over it."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import hilbert

from mjskip.errors import DivergedError
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.throws.throw import Throw
from mjskip.throws.two_way import TwoWayIntegrator
from mjskip.waves import _window_kernels as kernels
from mjskip.waves.window import Window

G0, RHO = 9.81, 1000.0


def without_layer(window):
    """The same water, periodic and without friction."""
    window.water[kernels.WATER : kernels.WATER + window.cells] = 0.0
    return window


def theory(k, depth=math.inf, tension=0.0):
    return math.sqrt((G0 * k + tension / RHO * k**3) * math.tanh(k * min(depth, 1e6)))


@pytest.mark.parametrize("cells_a_wave", [8, 16, 32])
@pytest.mark.parametrize(
    ("depth", "tension"), [(math.inf, 0.0), (0.02, 0.0), (0.1, 0.0), (math.inf, 0.072)]
)
def test_waves_run_at_the_speed_of_linear_theory(cells_a_wave, depth, tension):
    window = without_layer(Window("deep", depth=depth, tension=tension))
    k = 2 * np.pi / (cells_a_wave * window.spacing)
    omega, dt = theory(k, depth, tension), 5e-4
    phase = k * window.spacing * np.arange(window.cells)
    mode = lambda: (window.level[:, 5] * np.exp(-1j * phase)).sum()  # noqa: E731
    window.level[:] = 1e-3 * np.cos(phase)[:, None]
    window.potential[:] = 1e-3 * omega / (k * np.tanh(k * min(depth, 1e6))) * np.sin(phase)[:, None]
    steps = int(3 * 2 * np.pi / omega / dt)
    before, turned = mode(), 0.0
    for _ in range(steps):
        window.step(dt)
        turned += np.angle(before / mode())
        before = mode()
    assert turned / (steps * dt) == pytest.approx(omega, rel=5e-3)


def test_a_group_on_deep_water_runs_at_half_its_waves_speed():
    window = without_layer(Window("deep", cells=256))
    k, dt = 2 * np.pi / 0.16, 1e-3
    omega = theory(k)
    x = window.spacing * (np.arange(256) - 128)
    envelope = np.exp(-((x / 0.3) ** 2))
    window.level[:] = (1e-3 * envelope * np.cos(k * x))[:, None]
    window.potential[:] = (1e-3 * G0 / omega * envelope * np.sin(k * x))[:, None]

    def middle():
        line = window.level[:, 0] ** 2
        return np.sum(x * line) / np.sum(line)

    start, steps = middle(), 1000
    for _ in range(steps):
        window.step(dt)
    assert (middle() - start) / (steps * dt) == pytest.approx(0.5 * omega / k, rel=0.02)


def ring(window, length, angle):
    """A packet of plane waves in the middle of a window."""
    waves = window.kind == "waves"
    k = 2 * np.pi / (length * window.spacing)
    omega = k if waves else math.sqrt(G0 * k)
    x = window.spacing * (np.arange(window.cells) - 0.5 * (window.cells - 1))
    envelope = np.exp(-(x[:, None] ** 2 + x**2) / (2 * (0.7 * length * window.spacing) ** 2))
    phase = k * (np.cos(angle) * x[:, None] + np.sin(angle) * x)
    window.level[:] = envelope * np.cos(phase)
    window.level[:] -= window.level.mean()
    window.potential[:] = G0 / omega * envelope * np.sin(phase)
    return (1.0 if waves else 0.5) * omega / k


def density(kind, level, potential):
    """Energy of a field on a periodic square."""
    window = Window(kind, cells=len(level))
    window.potential[:] = potential
    rate = np.empty_like(level)
    kernels.apply_operator(window.water, window.potential, rate)
    return 0.5 * np.sum(G0 * level**2 + potential * rate)


@pytest.mark.parametrize("angle", [0.0, math.pi / 8, math.pi / 4])
@pytest.mark.parametrize("length", [8, 12, 64 / 3])
@pytest.mark.parametrize("kind", ["waves", "deep"])
def test_less_than_a_hundredth_of_the_energy_of_waves_comes_back(kind, length, angle):
    """Against the same waves on a window three times as wide, in the middle half."""
    small, wide = Window(kind), without_layer(Window(kind, cells=192))
    speed = ring(small, length, angle)
    ring(wide, length, angle)
    edge = np.minimum(np.arange(64), np.arange(64)[::-1]) + 0.5
    inside = np.clip((edge - 16) / 3 + 0.5, 0, 1)
    inside = inside[:, None] * inside
    start, worst, dt = density(kind, small.level, small.potential), 0.0, 4e-3
    way = 1.1 * (0.64 + 2 * length * 0.01)
    for step in range(int(way / speed / dt)):
        small.step(dt)
        wide.step(dt)
        if step % 8 == 0:
            level = inside * (small.level - wide.level[64:128, 64:128])
            potential = inside * (small.potential - wide.potential[64:128, 64:128])
            worst = max(worst, density(kind, level, potential))
    assert worst < 0.01 * start


def test_the_wake_of_a_moving_pressure_is_kelvins():
    """19.5 degrees: the ridge of the wave groups behind a narrow source, 1.5 to 6 wavelengths after it."""
    speed, dt = 0.35, 2e-3
    length = 2 * np.pi * speed**2 / G0
    window = Window("deep", cells=192)
    i, x = np.arange(192), 0.0
    for step in range(3500):
        window.follow(x, 0.0)
        ahead, aside = (window.origin[0] + 0.01 * i) - x, window.origin[1] + 0.01 * i
        width = 0.15 * length
        pressure = np.exp(-0.5 * (ahead / width) ** 2)[:, None] * np.exp(-0.5 * (aside / width) ** 2)  # fmt: skip
        window.step(dt, 50.0 * min(1.0, step * dt / 0.3) * pressure)
        x += speed * dt
    height = gaussian_filter1d(np.abs(hilbert(window.level, axis=0)), 0.5 * length / 0.01, axis=0)
    behind, ridge = [], []
    for row, gap in zip(height, x - window.origin[0] - 0.01 * i, strict=True):
        if 1.5 * length < gap < 0.24 * 1.92:
            sector = (aside > gap * np.tan(np.radians(8))) & (aside < gap * np.tan(np.radians(30)))
            k = int(np.argmax(np.where(sector, row, 0.0)))
            bend = row[k - 1] - 2 * row[k] + row[k + 1]
            ridge.append(aside[k] + 0.005 * (row[k - 1] - row[k + 1]) / bend)
            behind.append(gap)
    slope = np.polyfit(behind, ridge, 1)[0]
    assert np.degrees(np.arctan(slope)) == pytest.approx(19.47, abs=1.0)
    assert abs(window.volume) < 1e-16


def test_waves_of_the_papers_equation_all_run_at_one_speed():
    window = without_layer(Window("waves", cells=128, wave_speed=1.3))
    x = 0.01 * (np.arange(128) - 40)
    window.level[:] = 1e-3 * np.exp(-((x / 0.08) ** 2))[:, None]
    line = window.level[:, 0].copy()
    for _ in range(400):
        window.step(1e-3)
    apart = round(1.3 * 0.4 / 0.01)
    expected = 0.5 * (np.roll(line, apart) + np.roll(line, -apart))
    assert window.level[:, 7] == pytest.approx(expected, abs=2e-5)


def test_damping_takes_half_of_mu_from_amplitudes():
    window = without_layer(Window("waves", damping=4.0))
    k = 2 * np.pi / 0.16
    window.level[:] = 1e-3 * np.cos(k * 0.01 * np.arange(64))[:, None]
    omega = math.sqrt(k**2 - 4.0)
    steps = round(4 * np.pi / omega / 5e-4)
    for _ in range(steps):
        window.step(5e-4)
    fell = window.level.max() / 1e-3
    assert fell == pytest.approx(np.exp(-2.0 * steps * 5e-4), rel=0.02)


def thrown(name="disc"):
    if name == "disc":
        return Stone.disc(0.05, 0.01, segments=24, density=2500), Throw(
            speed=8.0, spin=188.0, attack=0.349, descent=0.349, height=0.05
        )
    return Stone.pebble(), Throw(speed=12.0, spin=94.0, attack=0.349, descent=0.349, height=0.05)


@pytest.mark.parametrize("law", ["lee2010", "rosellini2005", "lee2010_forward"])
@pytest.mark.parametrize("kind", ["waves", "deep"])
def test_energy_of_stone_and_water_closes_over_a_whole_touch(kind, law):
    """With air and buoyancy, friction, shifts of the window and what the layer swallows: to 1e-10, and no gain."""
    stone, throw = thrown()
    window = Window(kind, damping=0.5, account=True)
    run = TwoWayIntegrator(
        [stone], [throw.state(stone)], window=window, water=Water(law=law, buoyancy=True)
    )
    first, last, start = run.imbalance, run.energy - run.worked, run.energy
    pressed = 0
    while run.time < 0.09:
        run.step()
        pressed += bool(run.loads.loads.any())
        assert run.loads.dissipation >= 0.0
        assert run.imbalance == pytest.approx(first, abs=1e-10 * start)
        assert run.energy - run.worked <= last + 1e-12 * start
        last = run.energy - run.worked
    assert pressed > 100
    assert abs(window.volume) < 1e-15
    assert run.left > 0.0


def test_over_deep_water_the_grid_no_longer_matters():
    """A first touch on cells of 2, 1 and 0.5 cm, wherever they lie: exit speed within 1% from 1 cm on."""
    stone, throw = thrown("pebble")

    def exit_speed(spacing, offset):
        window = Window("deep", cells=round(0.64 / spacing), spacing=spacing)
        start = throw.state(stone, x=offset * spacing, y=0.3 * offset * spacing)
        run = TwoWayIntegrator([stone], [start], window=window, exact=spacing > 0.0075)
        while run.time < 0.02 or run.loads.loads.any():
            run.step()
        return run.states[0, 14]

    fine = exit_speed(0.005, 0.0)
    speeds = [exit_speed(0.01, offset) for offset in (0.0, 0.5)]
    assert fine > 1.0
    assert speeds == pytest.approx([fine, fine], rel=0.01)
    assert exit_speed(0.02, 0.5) == pytest.approx(fine, rel=0.05)


def test_a_stone_that_is_not_finite_says_so():
    stone, throw = thrown()
    state = throw.state(stone)
    state.velocity[2] = np.nan
    run = TwoWayIntegrator([stone], [state], window=Window("deep"))
    with pytest.raises(DivergedError, match="no longer finite"):
        run.step()


def test_a_shift_moves_the_water_as_it_is_and_counts_what_it_leaves_behind():
    rng = np.random.default_rng(0)
    window = Window("deep", cells=32)
    window.state[kernels.STATE :] = rng.standard_normal(3 * 32 * 32)
    level, total = window.level.copy(), window.volume
    first = window.state[:2].copy()
    window.follow(0.05, -0.03)
    di, dj = (window.state[:2] - first).astype(int)
    assert di in (5, 6)
    assert dj in (-3, -2)
    assert (window.level[8 : 32 - di, -dj:-8] == level[8 + di :, : -8 + dj]).all()
    assert (window.level[32 - di :] == 0).all()
    assert window.volume == pytest.approx(total, abs=1e-12)
    window.follow(50.0, 0.0)
    assert not window.level.any()
    assert window.volume == pytest.approx(total, abs=1e-12)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"kind": "sea"}, "use one of waves, deep"),
        ({"kind": "deep", "cells": 8}, "cells is 8"),
        ({"kind": "deep", "depth": -1.0}, "depth is -1.0"),
        ({"kind": "waves", "tension": 0.07}, "neither tension nor depth"),
        ({"kind": "waves", "wave_speed": 0.0}, "wave_speed is 0.0"),
    ],
)
def test_what_is_no_water_is_refused(options, says):
    kind = options.pop("kind")
    with pytest.raises(ValueError, match=says):
        Window(kind, **options)


def test_a_step_too_long_for_the_cells_is_refused():
    window = Window("waves", spacing=0.001)
    assert window.max_timestep == pytest.approx(math.sqrt(3) / 2 * 0.001, rel=1e-9)
    with pytest.raises(ValueError, match=r"need one below 0\.000866"):
        window.step(1e-3)
