"""Sea states: linear waves that are known at any place and time."""

import itertools
import math

import numpy as np
import pytest
from scipy import signal

from mjskip.hydro.seas import Sea, spectrum

G = 9.81


def test_a_regular_wave_has_its_height_length_and_speed():
    sea = Sea.regular(height=0.4, period=2.0)
    length = G * 4.0 / (2.0 * math.pi)
    x = np.column_stack([np.linspace(0.0, length, 400, endpoint=False), np.zeros(400)])
    assert np.ptp(sea.elevation(x, 0.3)) == pytest.approx(0.4, rel=1e-4)
    crest = x[np.argmax(sea.elevation(x, 0.0))]
    assert sea.elevation(crest + np.array([length / 4.0, 0.0]), 0.5)[0] == pytest.approx(0.2)


def test_the_water_moves_as_its_pressure_pushes_it():
    """du/dt = -grad p / rho, and div u = 0, at random points below a crossing sea."""
    sea = Sea.irregular(hs=0.2, tp=2.0, spreading=4.0, seed=5, depth=1.5, components=20)
    random = np.random.default_rng(0)
    points = random.uniform([-2, -2, -1.4], [2, 2, -0.1], (30, 3))
    h = 1e-5
    slope = np.stack(
        [
            (sea.pressure(points + h * e, 7.0) - sea.pressure(points - h * e, 7.0)) / (2.0 * h)
            for e in np.eye(3)
        ],
        axis=1,
    )
    speedup = (sea.velocity(points, 7.0 + h) - sea.velocity(points, 7.0 - h)) / (2.0 * h)
    np.testing.assert_allclose(speedup, -slope / 1000.0, atol=1e-5)
    divergence = sum(
        (sea.velocity(points + h * e, 7.0) - sea.velocity(points - h * e, 7.0))[:, i] / (2.0 * h)
        for i, e in enumerate(np.eye(3))
    )
    np.testing.assert_allclose(divergence, 0.0, atol=1e-6)


def test_the_surface_rises_as_the_water_under_it_does():
    sea = Sea.irregular(hs=0.2, tp=2.0, seed=1, components=30)
    points = np.array([[0.0, 0.0, 0.0], [1.0, -2.0, 0.0]])
    h = 1e-5
    rising = (sea.elevation(points, 3.0 + h) - sea.elevation(points, 3.0 - h)) / (2.0 * h)
    np.testing.assert_allclose(sea.velocity(points, 3.0)[:, 2], rising, atol=1e-6)


def test_nothing_flows_through_the_bottom():
    sea = Sea.regular(height=0.2, period=3.0, depth=0.8)
    assert sea.velocity([[0.4, 0.2, -0.8]], 1.1)[0, 2] == pytest.approx(0.0, abs=1e-12)


def test_a_current_carries_waves_and_water():
    still, moved = (
        Sea.regular(height=0.1, period=2.0),
        Sea.regular(height=0.1, period=2.0, current=(0.5, 0.1)),
    )
    place, time = np.array([[1.3, 0.4, -0.2]]), 5.0
    carried = place - [0.5 * time, 0.1 * time, 0.0]
    assert moved.elevation(place, time) == pytest.approx(still.elevation(carried, time))
    np.testing.assert_allclose(
        moved.velocity(place, time) - still.velocity(carried, time), [[0.5, 0.1, 0.0]]
    )


def test_a_drifting_speck_follows_the_orbit():
    """A circle of radius a exp(kz), and Stokes's drift a^2 k omega exp(2kz) along the wave."""
    sea = Sea.regular(height=0.1, period=2.0)
    k, omega = float(sea.wavenumber[0]), math.pi
    place, path, step = np.array([[0.0, 0.0, -0.3]]), [], 0.005
    for n in range(1600):
        middle = place + 0.5 * step * sea.velocity(place, n * step)
        place = place + step * sea.velocity(middle, (n + 0.5) * step)
        path.append(place[0])
    path = np.array(path)
    depth = path[:400, 2].mean()  # it began at the top of its orbit
    assert np.ptp(path[:, 2]) / 2.0 == pytest.approx(0.05 * math.exp(k * depth), rel=0.02)
    drift = (path[-1, 0] - path[399, 0]) / (1200 * step)
    assert drift == pytest.approx(0.05**2 * k * omega * math.exp(2.0 * k * depth), rel=0.1)


def test_the_spectrum_of_an_hour_is_the_one_asked_for():
    """Welch's estimate in bands with some 250 degrees of freedom: 9% is one standard deviation."""
    hs, tp = 0.3, 3.0
    sea = Sea.irregular(hs=hs, tp=tp, seed=2)
    time = np.arange(0.0, 3600.0, 0.1)
    swing = sea.amplitude * np.exp(1j * (sea.phase - np.outer(time, sea.omega)))
    record = swing.real.sum(axis=1)
    assert 4.0 * record.std() == pytest.approx(hs, rel=0.03)
    frequency, power = signal.welch(record, fs=10.0, nperseg=2048)
    omega, power = 2.0 * math.pi * frequency, power / (2.0 * math.pi)
    edges = 2.0 * math.pi / tp * np.array([0.75, 0.9, 1.0, 1.1, 1.3, 1.6, 2.2])
    for low, high in itertools.pairwise(edges):
        band = (omega >= low) & (omega < high)
        found = power[band].sum() * (omega[1] - omega[0])
        fine = np.linspace(low, high, 500)
        known = np.trapezoid(spectrum(fine, hs=hs, tp=tp), fine)
        assert found == pytest.approx(known, rel=0.2)


def test_jonswap_and_pierson_moskowitz_have_the_height_that_names_them():
    omega = np.linspace(0.2, 60.0, 60000)
    for gamma in (1.0, 3.3):
        energy = np.trapezoid(spectrum(omega, hs=1.0, tp=3.0, gamma=gamma), omega)
        assert 4.0 * math.sqrt(energy) == pytest.approx(1.0, rel=0.02)


def test_a_seed_is_a_sea():
    one, same, other = (
        Sea.irregular(hs=0.3, tp=3.0, seed=seed, spreading=8.0) for seed in (4, 4, 5)
    )
    at = [[3.0, 1.0]]
    assert one.elevation(at, 100.0) == same.elevation(at, 100.0)
    assert one.elevation(at, 100.0) != other.elevation(at, 100.0)
    assert one.significant_height == pytest.approx(0.3)


def test_directions_spread_as_asked():
    sea = Sea.irregular(hs=0.3, tp=3.0, spreading=5.0, direction=0.5, components=4000)
    turn = sea.direction - 0.5
    # mean of cos theta over cos^2s(theta / 2) is s / (s + 1)
    assert np.cos(turn).mean() == pytest.approx(5.0 / 6.0, abs=0.02)
    assert np.sin(turn).mean() == pytest.approx(0.0, abs=0.03)


def test_a_sea_is_said_in_a_line():
    sea = Sea.from_text("hs=0.3 tp=3 direction=90 seed=7 current=0.2")
    assert sea.significant_height == pytest.approx(0.3)
    np.testing.assert_allclose(sea.direction, math.pi / 2.0)
    np.testing.assert_allclose(sea.current, [0.2, 0.0])
    assert len(Sea.from_text("").omega) == 0
    assert Sea.from_text("height=0.2, period=2").amplitude == pytest.approx([0.1])


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("hs=0.3", "says too little"),
        ("hs=a tp=3", "'hs=a': give hs=NUMBER"),
        ("waves=3", "has 'waves': use height"),
        ("hs=1 tp=3 height=1 period=2", "give one pair"),
        ("hs=-1 tp=3", "hs is -1.0"),
        ("hs=1 tp=0", "tp is 0.0"),
    ],
)
def test_a_sea_that_cannot_be_is_refused_in_one_line(text, match):
    with pytest.raises(ValueError, match=match):
        Sea.from_text(text)


def test_a_grid_of_heights_is_that_of_its_points():
    sea = Sea.irregular(hs=0.3, tp=2.0, spreading=0.4, current=(0.3, -0.2), seed=3)
    x, y = np.linspace(-3.0, 2.0, 5), np.linspace(0.0, 4.0, 3)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(
        sea.grid_elevation(x, y, 7.3).ravel(), sea.elevation(points, 7.3), atol=1e-12
    )
