"""A throw leaves the hand with the angles, spin and height that it says."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from conftest import rotation, stones
from hypothesis import assume, given
from hypothesis import strategies as st

from mjskip import Stone, Throw
from mjskip.cli.run import run
from mjskip.rigid.attitude import angles, difference, matrices, quaternions
from mjskip.sweeps import design
from mjskip.throws.throw import PARAMETERS

PEBBLE = Stone.pebble()
tilts = st.floats(-1.3, 1.3)


@given(stones, tilts, tilts, st.floats(-1.5, 1.5), st.floats(-500, 500), st.floats(0, 2))
def test_a_stone_is_released_as_the_throw_says(stone, attack, bank, descent, spin, height):
    assume(math.sin(attack) ** 2 + math.sin(bank) ** 2 < 0.99)
    throw = Throw(speed=7.0, attack=attack, bank=bank, descent=descent, spin=spin, height=height)
    state = throw.state(stone, x=1.0, y=2.0)
    turn = matrices(state.q)
    found = angles(turn @ stone.disc_normal, state.velocity, state.omega)
    # arcsin loses half the digits only next to 90 degrees, which is left out
    assert found.attack == pytest.approx(attack, abs=1e-9)
    assert found.bank == pytest.approx(bank, abs=1e-9)
    assert found.spin == pytest.approx(spin, abs=1e-9)
    assert (stone.vertices @ turn[2]).min() + state.position[2] == pytest.approx(height, abs=1e-12)
    np.testing.assert_allclose(state.position[:2], [1, 2])
    assert np.linalg.norm(state.velocity) == pytest.approx(7.0)
    assert math.atan2(-state.velocity[2], state.velocity[0]) == pytest.approx(descent, abs=1e-12)


def test_nose_up_lifts_the_front():
    turn = matrices(Throw.from_degrees(attack=20, bank=0).state(PEBBLE).q)
    np.testing.assert_allclose(
        turn[:, 2], [-math.sin(math.radians(20)), 0, math.cos(math.radians(20))]
    )
    assert (turn @ [1.0, 0, 0])[2] > 0.0


def test_bank_leans_the_upper_normal_to_the_left():
    turn = matrices(Throw.from_degrees(attack=0, bank=15).state(PEBBLE).q)
    np.testing.assert_allclose(
        turn[:, 2], [0, math.sin(math.radians(15)), math.cos(math.radians(15))], atol=1e-15
    )


def test_wobble_is_across_the_axis_and_negative_wobble_raises_the_nose():
    throw = Throw.from_degrees(attack=20, spin=10, wobble=-2)
    state = throw.state(PEBBLE)
    normal = matrices(state.q)[:, 2]
    assert state.omega @ normal == pytest.approx(20 * math.pi)
    across = state.omega - (state.omega @ normal) * normal
    assert np.linalg.norm(across) == pytest.approx(4 * math.pi)
    nose = matrices(state.q) @ [1.0, 0, 0]
    assert np.cross(across, nose)[2] > 0.0


def test_degrees_and_revolutions_are_radians():
    throw = Throw.from_degrees(
        speed=8, spin=10, attack=30, descent=5, bank=-4, wobble=1, height=0.1
    )
    assert throw == Throw(
        speed=8,
        spin=20 * math.pi,
        attack=math.pi / 6,
        descent=math.radians(5),
        bank=math.radians(-4),
        wobble=2 * math.pi,
        height=0.1,
    )
    assert Throw() == Throw.from_degrees()


BAD = {
    "speed": ([-1, 1001, math.nan, math.inf], "between 0 and 1000 m/s"),
    "spin": ([-1e9, 1e9, math.nan], "between -10000 and 10000 rev/s"),
    "attack": ([1.6, -1.6, math.nan], "between -90 and 90 degrees"),
    "descent": ([1.6, -1.6, math.inf], "between -90 and 90 degrees"),
    "bank": ([1.6, math.nan], "between -90 and 90 degrees"),
    "wobble": ([1e9, math.nan], "between -10000 and 10000 rev/s"),
    "height": ([-0.1, 1e4, math.nan], "between 0 and 1000 m"),
}


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, (vs, _) in BAD.items() for v in vs])
def test_a_throw_that_nobody_can_make_is_refused(name, value):
    with pytest.raises(ValueError, match=f"^{name} is .*{BAD[name][1]}$"):
        Throw(**{name: value})


def test_angles_that_exclude_each_other_are_refused():
    with pytest.raises(ValueError, match="attack 60 and bank 60 degrees cannot both hold"):
        Throw.from_degrees(attack=60, bank=60)


def test_angles_are_taken_against_the_heading_of_the_moment():
    n = np.array([-math.sin(0.3), 0, math.cos(0.3)])
    assert angles(n, [3.0, 0, -1], [0, 0, 5.0]).attack == pytest.approx(0.3)
    # seen across, the same tilt is a bank; from behind, nose down
    assert angles(n, [0, 3.0, 0], [0, 0, 5.0]).bank == pytest.approx(0.3)
    assert angles(n, [-3.0, 0, 0], [0, 0, 5.0]).attack == pytest.approx(-0.3)
    # a stone that has turned over shows its other face
    turned = angles(-n, [3.0, 0, -1], [0, 0, 5.0])
    assert turned.attack == pytest.approx(0.3)
    assert turned.spin == pytest.approx(5.0 * math.cos(0.3))


rotations = st.integers(0, 10**6).map(lambda seed: np.random.default_rng(seed).normal(size=4))


@given(rotations)
def test_a_quaternion_and_its_matrix_say_the_same(q):
    q = q / np.linalg.norm(q)
    w, v = q[0], q[1:]
    p = np.array([0.3, -0.5, 0.7])
    direct = p + 2 * np.cross(v, np.cross(v, p) + w * p)
    np.testing.assert_allclose(matrices(q) @ p, direct, atol=1e-14)
    np.testing.assert_allclose(matrices(q), rotation(q), atol=1e-15)
    back = quaternions(matrices(q)[None])[0]
    assert abs(back @ q) == pytest.approx(1.0, abs=1e-14)


def test_quaternions_of_a_turning_stone_do_not_jump():
    turn = np.linspace(0, 20, 500)
    q = np.column_stack([np.cos(turn / 2), 0 * turn, np.sin(turn / 2), 0 * turn])
    found = quaternions(matrices(q))
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 0.03


@given(rotations, st.floats(1e-9, math.pi))
def test_the_difference_of_two_attitudes_is_the_angle_between_them(q, angle):
    q = q / np.linalg.norm(q)
    axis = np.array([0.6, 0.0, 0.8])
    w, x, y, z = math.cos(angle / 2), *(math.sin(angle / 2) * axis)
    a, b, c, d = q
    product = [a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
               a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w]  # fmt: skip
    assert float(difference(q, product)) == pytest.approx(angle, abs=1e-14, rel=1e-6)
    assert float(difference(q, -q)) == pytest.approx(0.0, abs=1e-15)


def test_the_page_about_sweeps_has_the_table_of_parameters():
    page = (Path(__file__).parents[1] / "docs" / "sweeps.md").read_text()
    for name, parameter in PARAMETERS.items():
        default = parameter.to_shown(getattr(Throw(), name))
        assert (
            f"| {name} | {parameter.shown_unit} | {parameter.low:g} to {parameter.high:g} | {default:g} | "
            f"{parameter.unit} |\n"
        ) in page


def test_every_parameter_is_the_same_at_the_command_line_and_in_sweeps():
    assert list(PARAMETERS) == [field.name for field in dataclasses.fields(Throw)]
    options = {option.name: option for option in run.params}
    for name, parameter in PARAMETERS.items():
        assert options[name].metavar == parameter.shown_unit.upper()
        assert design.PARAMETERS[name] == parameter.unit
        assert parameter.to_shown(parameter.to_si(0.5)) == pytest.approx(0.5)
        with pytest.raises(ValueError, match=f"between {parameter.low:g} and {parameter.high:g}"):
            parameter.to_si(1.01 * parameter.high)
