"""Light at the water: laws first, then pictures without any OpenGL."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mjskip.draw import _optics_kernels as kernels
from mjskip.draw.optics import EMPTY, INDEX, Ellipsoid, Eye, Lake, fresnel, pack_stones, refract

UP = (0.0, 0.0, 1.0)


def downwards(angle):
    return (math.sin(angle), 0.0, -math.cos(angle))


# Laws


def test_water_reflects_two_percent_of_light_that_falls_straight_in():
    expected = ((INDEX - 1.0) / (INDEX + 1.0)) ** 2
    assert fresnel(1.0, 1.0 / INDEX) == pytest.approx(expected, rel=1e-12)
    assert fresnel(1.0, INDEX) == pytest.approx(expected, rel=1e-12)  # from either side


def test_at_grazing_incidence_everything_is_reflected():
    assert fresnel(0.0, 1.0 / INDEX) == pytest.approx(1.0, abs=1e-12)


def test_beyond_the_critical_angle_nothing_leaves_the_water():
    critical = math.asin(1.0 / INDEX)
    assert fresnel(math.cos(critical - 1e-3), INDEX) < 1.0
    assert fresnel(math.cos(critical + 1e-9), INDEX) == 1.0
    assert refract(downwards(critical + 1e-6), UP, INDEX) == (0.0, 0.0, 0.0)


def test_at_brewsters_angle_only_light_across_the_plane_of_incidence_is_reflected():
    brewster = math.atan(INDEX)
    beyond = math.pi / 2 - brewster  # the two rays are square to each other
    across = math.sin(brewster - beyond) / math.sin(brewster + beyond)
    assert fresnel(math.cos(brewster), 1.0 / INDEX) == pytest.approx(0.5 * across**2, rel=1e-12)


@given(st.floats(0.0, math.pi / 2 - 1e-6))
def test_light_bends_by_snells_law_and_back_again(angle):
    into = refract(downwards(angle), UP, 1.0 / INDEX)
    assert INDEX * math.hypot(into[0], into[1]) == pytest.approx(math.sin(angle), abs=1e-12)
    assert np.linalg.norm(into) == pytest.approx(1.0, rel=1e-12)
    back = refract(tuple(-v for v in into), (0.0, 0.0, -1.0), INDEX)
    # a square root near the critical angle takes half of the digits
    np.testing.assert_allclose(back, [-v for v in downwards(angle)], atol=2e-8)


@given(st.floats(0.0, math.pi / 2 - 1e-3))
def test_as_much_is_reflected_from_below_as_from_above_along_the_same_path(angle):
    inside = math.asin(math.sin(angle) / INDEX)
    above = fresnel(math.cos(angle), 1.0 / INDEX)
    # cancellation of the refracted cosine near grazing
    assert fresnel(math.cos(inside), INDEX) == pytest.approx(above, abs=1e-9)


def test_crests_gather_light_and_troughs_spread_it():
    # rays of Snell's law down from a gentle wave z = a cos(k x), against the first-order density
    a, k, depth, h = 1e-4, 20.0, 0.5, 1e-4

    def lands(x):
        slope = -a * k * math.sin(k * x)
        scale = 1.0 / math.hypot(1.0, slope)
        d = refract((0.0, 0.0, -1.0), (-slope * scale, 0.0, scale), 1.0 / INDEX)
        return x + d[0] / -d[2] * depth

    for x in (0.0, math.pi / k):
        density = 2.0 * h / (lands(x + h) - lands(x - h))
        curvature = -a * k * k * math.cos(k * x)
        # the model blunts the focus: a tenth of a contrast of 0.5 %
        assert kernels.caustic(depth, curvature) - 1.0 == pytest.approx(density - 1.0, rel=0.15)
    assert kernels.caustic(depth, 0.0) == 1.0


def test_gentle_caustics_move_light_about_and_make_none():
    x = np.linspace(0.0, 2.0 * math.pi, 400, endpoint=False)
    light = [kernels.caustic(1.0, 0.2 * math.sin(v)) for v in x]  # a twentieth of what focuses
    assert np.mean(light) == pytest.approx(1.0, abs=5e-3)  # second order: 0.05^2


def test_rougher_water_spreads_the_same_sunlight_wider():
    def total(variance):
        angle = np.linspace(0.0, 1.2, 40000)
        shine = [kernels.glint(math.cos(v), variance) for v in angle]
        return np.sum(shine * np.sin(angle)) * (angle[1] - angle[0])

    assert total(4e-4) == pytest.approx(total(4e-3), rel=0.02)  # the sphere is not flat at 0.1 rad
    assert kernels.glint(1.0, 4e-4) > 5.0 * kernels.glint(1.0, 4e-3)


# Ellipsoids


def stone(centre=(0.0, 0.0, 0.0), axes=(0.3, 0.2, 0.1), turn=0.0):
    c, s = math.cos(turn), math.sin(turn)
    return Ellipsoid(
        centre=np.array(centre),
        rotation=np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
        semi_axes=np.array(axes),
        colour=np.array([0.5, 0.4, 0.3]),
    )


def test_a_ray_meets_an_ellipsoid_at_its_semi_axes():
    rows = pack_stones([stone(), stone(turn=math.pi / 2)])
    for k, expected in ((0, 0.7), (1, 0.8)):
        t, near = kernels.ellipsoid(rows, k, (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        assert t == pytest.approx(expected, rel=1e-12)
        assert near == pytest.approx(0.0, abs=1e-12)
    missed, _ = kernels.ellipsoid(rows, 0, (-1.0, 0.0, 0.11), (1.0, 0.0, 0.0))
    behind, _ = kernels.ellipsoid(rows, 0, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert missed == behind == kernels.AWAY


# The surface between its cells


def flat(z):
    grid = np.asarray(z, np.float32)
    return grid.ravel(), 0, *grid.shape


@settings(deadline=None)
@given(st.floats(20.0, 43.0), st.floats(20.0, 43.0))
def test_splines_follow_a_parabola_and_its_curvature(x, y):
    i, j = np.indices((64, 64)) - 32.0
    z = 0.01 * i * i + 0.02 * i * j + 0.5 * j
    height, sx, sy, bend = kernels.spline(*flat(z), x, y)
    u, v = x - 32.0, y - 32.0
    # a cubic B-spline raises a parabola by a third of its second difference / 2; single precision
    expected = 0.01 * u * u + 0.02 * u * v + 0.5 * v + 0.02 / 6.0
    assert height == pytest.approx(expected, abs=2e-5)
    assert sx == pytest.approx(0.02 * u + 0.02 * v, abs=2e-5)
    assert sy == pytest.approx(0.02 * u + 0.5, abs=2e-5)
    assert bend == pytest.approx(0.02, abs=2e-5)


def test_reflections_have_no_creases_where_cells_meet():
    z = np.random.default_rng(0).normal(size=(64, 64)).astype(np.float32)
    edge, h = 30.0, 1e-6
    before = np.array(kernels.spline(*flat(z), edge - h, 30.3))
    after = np.array(kernels.spline(*flat(z), edge + h, 30.3))
    np.testing.assert_allclose(before, after, atol=1e-4)  # slopes and curvature change by order h


# Pictures


def lake(**settings):
    return Lake(
        sun=np.array([0.0, 0.6, 0.8]),
        sky=np.linspace([0.9, 0.9, 0.9], [0.2, 0.4, 0.8], 16),
        bottom=np.full((8, 8), -1.0, np.float32),
        place=np.array([-10.0, -10.0, 3.0]),
        **settings,
    )


def looking(pitch=-30.0, height=0.6):
    a = math.radians(pitch)
    return Eye(
        position=np.array([0.0, -1.0, height]),
        forward=np.array([0.0, math.cos(a), math.sin(a)]),
        up=np.array([0.0, -math.sin(a), math.cos(a)]),
        half_height=0.4,
        aspect=4 / 3,
    )


def drawn(elevation=None, *, stones=(), eye=None, distances=1e9, **settings):
    settings.setdefault("wind", 0.0)
    z = np.zeros((100, 100), np.float32) if elevation is None else elevation
    return (
        lake(**settings)
        .draw(
            eye or looking(),
            np.full((60, 80, 3), 7, np.uint8),
            np.full((60, 80), distances, np.float32),
            elevation=z,
            spacing=0.02,
            centre=(0.0, 0.0),
            stones=stones,
        )
        .astype(int)
    )


def bump(x, y, height=0.01):
    i, j = np.indices((100, 100)) * 0.02 - 0.99
    return (height * np.exp(-((i - x) ** 2 + (j - y) ** 2) / 0.05**2)).astype(np.float32)


def test_what_is_nearer_than_the_water_hides_it():
    assert (drawn(distances=0.1) == 7).all()
    assert (drawn() != 7).any(axis=2).all()


def test_water_that_mirrors_itself_across_the_view_looks_so():
    # the bottom's pebbles do not, so there is none: deep, absorbing water
    settings = {"absorption": (50.0, 50.0, 50.0)}
    left, right = (drawn(bump(x, 0.0, 0.02), **settings) for x in (0.3, -0.3))
    np.testing.assert_allclose(left, right[:, ::-1], atol=1)  # rounding to a byte
    assert np.abs(left - drawn(**settings)).max() > 10


def test_more_is_reflected_the_flatter_one_looks():
    dark = {"absorption": (50.0, 50.0, 50.0), "deep": (0.0, 0.0, 0.0), "sunlight": (0.0, 0.0, 0.0)}
    brightness = drawn(**dark).sum(axis=2).mean(axis=1)
    assert (np.diff(brightness) <= 1.0).all()  # rows go down; rounding to a byte
    assert brightness[0] > 3.0 * brightness[-1]


def test_absorption_darkens_and_red_goes_first():
    clear, murky = drawn(absorption=(0.0, 0.0, 0.0)), drawn(absorption=(2.0, 0.5, 0.5))
    assert murky[30:].mean() < clear[30:].mean()
    assert murky[30:, :, 0].mean() < 0.7 * clear[30:, :, 0].mean()


def test_a_stone_above_water_is_mirrored_and_casts_its_shadow():
    flat_stone = stone(centre=(0.0, 0.0, 0.15), axes=(0.15, 0.15, 0.03))
    change = np.abs(drawn(stones=[flat_stone]) - drawn()).max(axis=2) > 8
    assert change.sum() > 20
    # away from the eye and the sun there is neither
    behind = stone(centre=(0.0, -30.0, 0.15), axes=(0.15, 0.15, 0.03))
    np.testing.assert_array_equal(drawn(stones=[behind]), drawn())


def test_a_sunken_stone_is_seen_where_refraction_lifts_it():
    sunken = stone(centre=(0.0, 0.4, -0.5), axes=(0.08, 0.08, 0.08))
    rows = np.flatnonzero((np.abs(drawn(stones=[sunken]) - drawn()).max(axis=2) > 8).any(axis=1))
    place, _ = looking().project(np.array([[0.0, 0.4, -0.5]]))
    straight = 0.5 * (1.0 - place[0, 1]) * 60
    assert rows.min() < straight - 3.0  # higher up than the straight line to it


def test_still_water_without_wind_is_the_same_at_any_time():
    assert EMPTY.colours.size == 0
    np.testing.assert_array_equal(drawn(), drawn(np.zeros((300, 40), np.float32)))


def test_an_eye_under_water_sees_the_sky_through_snells_window_only():
    up = looking(pitch=60.0, height=-0.5)
    low = looking(pitch=20.0, height=-0.5)
    bright = drawn(eye=up, absorption=(0.0, 0.0, 0.0))[30, 40].sum()
    reflected = drawn(eye=low, absorption=(9.0, 9.0, 9.0), deep=(0.0, 0.0, 0.0))[30, 40].sum()
    assert bright > 200
    assert reflected < 30


@pytest.mark.parametrize("sun", [(0.0, 0.0, -1.0), (0.0, 0.0, 2.0)])
def test_a_sun_that_cannot_be_is_refused(sun):
    with pytest.raises(ValueError, match="sun is"):
        Lake(
            sun=np.array(sun),
            sky=np.ones((2, 3)),
            bottom=np.full((2, 2), -1.0, np.float32),
            place=np.zeros(3),
        )
