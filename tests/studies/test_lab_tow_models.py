"""The model with all effects of a lab against the truth on bristles, which shares no code with it."""

from dataclasses import replace

import numpy as np
import pytest

from studies.comparators.lab_tow_models import distances_m, modelled, present_effects
from studies.maps.lab_tows import tow_rows
from studies.worlds.lab_tows import four_feet


def test_with_all_effects_the_path_is_right_and_without_heights_it_is_not():
    tow = replace(four_feet(4), duration=14.0)
    times, truth = tow.truth()
    present = present_effects(tow)
    assert present == ("heights", "slope", "anisotropy", "stiffening", "sticking")
    assert distances_m(modelled(tow, present, times), truth).max() < 2e-4
    assert distances_m(modelled(tow, present[1:], times), truth).max() > 5e-3


def test_a_tow_that_tips_is_flagged():
    (row,) = tow_rows("heights", 0.5, [0.0])
    assert row["judgement"] == "flagged"
    assert row["error"] == np.inf or np.isnan(row["error"])


@pytest.mark.parametrize(("over", "x", "y"), [("tether", 1e3, 10.0)])
def test_a_cell_is_right(over, x, y):
    (row,) = tow_rows(over, x, [y])
    assert row["judgement"] == "right"
