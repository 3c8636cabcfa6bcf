"""A wrong argument gives one line that names it, what came, and what to give instead."""

import math
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from mjskip import checks


@pytest.mark.parametrize("value", [3, 3.0, np.float32(3), np.int8(3), np.array(3.0), Decimal(3)])
def test_every_kind_of_number_is_a_number(value):
    number = checks.check_number("speed", value)
    assert type(number) is float
    assert number == 3.0
    assert checks.check_count("steps", value) == 3


@pytest.mark.parametrize(
    "value", ["3", b"3", True, None, {}, [3], np.ones(2), 3j, math.nan, math.inf, 10**400]
)
def test_what_is_no_finite_number_is_refused_in_one_line(value):
    for check in (checks.check_number, checks.check_count):
        with pytest.raises(
            ValueError, match=r"^speed is .*: give a (finite|whole) number"
        ) as error:
            check("speed", value)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"^speed is .*: give a finite number greater than 0"):
        checks.check_positive(speed=value)


def test_limits_and_their_unit_are_in_the_line():
    assert checks.check_number("speed", 2, low=2, high=3, unit="m/s") == 2.0
    with pytest.raises(ValueError, match=r"^speed is 4: give a finite number between 2 and 3 m/s$"):
        checks.check_number("speed", 4, low=2, high=3, unit="m/s")
    with pytest.raises(ValueError, match=r"of at least 0 kg/m\^3$"):
        checks.check_number("density", -1, low=0, unit="kg/m^3")
    with pytest.raises(ValueError, match=r"of at most 3$"):
        checks.check_number("n", 4, high=3)
    with pytest.raises(ValueError, match="whole number of at least 1"):
        checks.check_count("chunk", 0)
    with pytest.raises(ValueError, match="whole number"):
        checks.check_count("chunk", 1.5)


def test_a_long_value_is_cut():
    with pytest.raises(ValueError, match=r"\.\.\.: give a finite number$") as error:
        checks.check_number("speed", np.zeros((100, 100)))
    assert len(str(error.value)) < 120


def test_a_switch_is_true_or_false_and_not_a_word():
    assert checks.check_switch("buoyancy", np.True_) is True
    for value in ("no", 0, None):
        with pytest.raises(ValueError, match=r"^buoyancy is .*: give True or False$"):
            checks.check_switch("buoyancy", value)


def test_choices_are_listed():
    assert checks.check_choice("gate", "local", ("centre", "local")) == "local"
    for value in ("front", None, ["local"]):
        with pytest.raises(ValueError, match=r"^gate is .*: use one of centre, local$"):
            checks.check_choice("gate", value, ("centre", "local"))


def test_a_class_is_named():
    assert checks.check_type("path", Path("a"), Path) == Path("a")
    with pytest.raises(ValueError, match=r"^path is \{\}: give a mjskip\.Path$"):
        checks.check_type("path", {}, Path)


def test_vectors_have_their_size():
    np.testing.assert_array_equal(checks.check_vector("gravity", (0, 0, -9), 3), [0, 0, -9])
    for value in ("abc", 3, [1, 2], [1, 2, math.nan], None, {"x": 1}):
        with pytest.raises(ValueError, match=r"^gravity is .*: give 3 finite numbers$"):
            checks.check_vector("gravity", value, 3)


def test_one_name_is_not_its_letters():
    assert checks.check_names("bodies", "boat") == ("boat",)
    assert checks.check_names("bodies", ["a", "b"]) == ("a", "b")
    for value in (None, [1], 1):
        with pytest.raises(ValueError, match=r"^bodies is .*: give names"):
            checks.check_names("bodies", value)


def test_paths_are_text_or_paths():
    assert checks.check_path("path", "a/b") == Path("a/b")
    for value in (None, 1, "", {}):
        with pytest.raises(ValueError, match=r"^path is .*: give a path"):
            checks.check_path("path", value)


def test_mappings_have_names():
    assert checks.check_mapping("vary", {"speed": [1]}, "") == {"speed": [1]}
    for value in (None, [1], {1: 2}):
        with pytest.raises(ValueError, match=r"^vary is .*: give values by parameter$"):
            checks.check_mapping("vary", value, "give values by parameter")
