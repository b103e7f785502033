import math

import pytest

from towval.report.wording import at_most, at_most_degrees, decimal, degrees, millimetres, named_scalar


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (21.04, "21.0"),
        (6.484, "6.48"),
        (0.645, "0.65"),
        (0.0023442, "0.0023"),
        (-0.00451, "-0.0045"),
        (0.0199999, "0.020"),
        (0.0, "0.00"),
        (-1.4e-30, "0"),
    ],
)
def test_digits_follow_the_size(value, words):
    assert decimal(value) == words


def test_what_does_not_exist_is_called_not_computed():
    assert {decimal(float("nan")), millimetres(float("nan")), degrees(float("inf"))} == {"not computed"}


def test_lengths_and_angles_carry_their_units():
    assert millimetres(0.00065) == "0.65 mm"
    assert degrees(0.0087266462) == "0.50°"


def test_bounds_of_lengths_and_angles_are_rounded_up():
    assert (at_most(0.1241e-3), at_most_degrees(math.radians(0.1241))) == ("0.13 mm", "0.13°")
    assert (at_most(3.02e-3), at_most(12.31e-3)) == ("3.1 mm", "12.4 mm")
    assert at_most_degrees(math.radians(0.13)) == "0.13°"
    assert {at_most(math.nan), at_most_degrees(math.inf)} == {"not computed"}


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("focal_length_std_px", 0.4512, ("focal length std", "0.45 px")),
        ("median_tilt_deg", 31.24, ("median tilt", "31.2°")),
        ("covered_share", 0.634, ("covered share", "63 %")),
        ("position_std_mm at 0.250 m", 0.31, ("position std at 0.250 m", "0.31 mm")),
        ("u_num_m", 2.34e-6, ("u num", "0.0023 mm")),
        ("camera_height_m", 4.0996, ("camera height", "4.10 m")),
        ("steps", 1234.0, ("steps", "1234")),
        ("condition_number", 45780.2, ("condition number", "46000")),
        ("held_out_rms_px", float("nan"), ("held out rms", "not computed")),
    ],
)
def test_names_give_up_their_units(name, value, words):
    assert named_scalar(name, value) == words
