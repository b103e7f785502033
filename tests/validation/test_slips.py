"""Slips in campaign.yaml: the one that was made is named, none where something else is wrong."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from towval.model import Ground, Tether
from towval.validation.sampler import UncertaintySettings
from towval.validation.simulate import simulate
from towval.validation.slips import slip_findings, slips_of
from towval.validation.uncertainty import sample_uncertainty
from validation_case import SCENE


def found(case, scene):
    """Texts of the findings on slips where a lab states this scene of the run."""
    simulated = simulate(scene, case.rover_decimated, case.object_decimated, case.object_track.time_s)
    stated = replace(case, scene=scene, simulated=simulated)
    known = sample_uncertainty(stated, UncertaintySettings(samples=64))
    return [each.text for each in known.findings if each.code == "slip"]


LOAD = SCENE.load


@pytest.mark.parametrize(
    ("stated", "name"),
    [
        ({"load": replace(LOAD, at=LOAD.at * [1, -1])}, "the sign of y of object.load.at_m"),
        ({"load": replace(LOAD, at=LOAD.at[::-1])}, "x and y of object.load.at_m exchanged"),
        ({"tether": Tether(0.6, 8.0)}, "tether.stiffness_N_per_m in newtons per cm"),
    ],
)
def test_a_slip_is_named(case, stated, name):
    """Such numbers are a hundred deviations off: other inputs were named, twenty deviations off, or none."""
    (text,) = found(case, replace(SCENE, **stated))
    assert f": {name} (" in text


@pytest.mark.parametrize(
    "stated", [{}, {"tether": Tether(0.66, 800.0)}, {"anchor": SCENE.anchor + np.array([0.0, 0.04])}]
)
def test_what_is_no_slip_is_not_called_one(case, stated):
    assert found(case, replace(SCENE, **stated)) == []


@pytest.mark.parametrize(
    ("error_m", "left_m", "named"), [(0.02, 0.001, True), (0.004, 0.001, False), (0.02, 0.03, False)]
)
def test_a_slip_explains_an_error_beyond_the_measurement_by_a_smaller_one(error_m, left_m, named):
    """Right models whose start was seen too seldom to know were told of slips that left four times the error."""
    right, shape = SimpleNamespace(rejects=lambda error: False), np.ones((50, 3)) * [1, 0, 0]
    path = SimpleNamespace(error=error_m * shape, off=0.005 * np.stack([shape, -shape]))
    found = slip_findings(SCENE, path, right, lambda acts: np.stack([left_m * shape] * len(acts)))
    assert bool(found) == named


def test_each_slip_is_undone_by_the_same_slip_or_its_unit():
    sloping = replace(SCENE, ground=Ground(slope=np.array([0.01, -0.02])), hinge_height=0.2)
    undone = {slip.name: slip.undone(sloping) for slip in slips_of(sloping)}
    np.testing.assert_allclose(undone["the sign of x of floor.slope_mm_per_m"].ground.slope, [-0.01, -0.02])
    np.testing.assert_allclose(undone["x and y of floor.slope_mm_per_m exchanged"].ground.slope, [-0.02, 0.01])
    heights = undone["rover.tether_hinge_height_m and object.tether_anchor_height_m exchanged"]
    assert (heights.hinge_height, heights.anchor_height) == (0.0, 0.2)
    assert undone["both masses in pounds"].mass == pytest.approx(0.45359237 * sloping.mass)
    assert undone["the load weighed with the object in object.mass_kg"].mass == pytest.approx(sloping.body_mass)
    assert undone["tether.stiffness_N_per_m in newtons per mm"].tether.stiffness == 8e5


def test_a_number_that_is_zero_has_no_sign():
    named = {slip.name for slip in slips_of(replace(SCENE, anchor=np.array([0.25, 0.0])))}
    assert "the sign of x of object.tether_anchor_m" in named
    assert not {name for name in named if "slope" in name or "sign of y of object.tether_anchor_m" in name}
    assert not {name for name in named if "both numbers of object.tether_anchor_m" in name}
