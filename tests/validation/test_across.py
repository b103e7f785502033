"""A tether that would pass through the object is seen; one that leads away, or runs above its top, is not."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.campaign import OBJECT
from towval.model import Patch, Severity, Tether
from towval.model.geometry import transform
from towval.physics.splines import hermite_spline
from towval.validation.across import tether_across
from towval.validation.scene_model import SceneModel
from validation_case import SCENE

TIMES = np.linspace(0.0, 4.0, 101)
FEET = Patch.of([np.array([x, y]) + 0.03 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
                 for x in (-0.2, 0.2) for y in (-0.12, 0.12)])  # fmt: skip


def towed(scene, heading):
    """The motion behind a hinge that goes 0.3 m along x, of an object whose anchor begins just within reach of it."""
    hinge = hermite_spline(
        np.array([0.0, 0.5, 3.5, 4.0]),
        np.array([[0.0, 0.0], [0.025, 0.0], [0.275, 0.0], [0.3, 0.0]]),
        np.array([[0.0, 0.0], [0.083, 0.0], [0.083, 0.0], [0.0, 0.0]]),
    )
    anchor = np.array([0.01 - scene.tether.rest_length, 0.0])
    start = np.array([*(anchor - transform([0.0, 0.0, heading], scene.anchor)), heading])
    return SceneModel(scene).motion("dynamics", hinge, start, TIMES, 1e-6)


@pytest.mark.parametrize(("heading", "found"), [(0.0, []), (1.2, []), (2.9, ["tether_across"])])
def test_a_taut_tether_through_the_object_is_found(heading, found):
    assert [each.code for each in tether_across(SCENE, OBJECT, towed(SCENE, heading))] == found


def test_a_tether_above_the_top_or_fastened_within_its_outline_is_not():
    motion = towed(SCENE, 2.9)
    height = OBJECT.tracked_plane_height_m
    assert tether_across(replace(SCENE, anchor_height=height), OBJECT, motion) == []
    within = replace(SCENE, anchor=SCENE.anchor - [0.02, 0.0])
    assert tether_across(within, OBJECT, towed(within, 2.9)) == []


def test_a_slack_tether_may_lie_anywhere():
    longer = replace(SCENE, tether=Tether(1.2, SCENE.tether.stiffness))
    motion = towed(SCENE, 2.9)
    slack = replace(motion, tether_force=np.zeros_like(motion.tether_force))
    assert tether_across(longer, OBJECT, slack) == []


def test_between_the_feet_of_an_object_a_tether_may_pass():
    scene = replace(SCENE, patch=FEET)
    (found,) = tether_across(scene, OBJECT, towed(scene, 2.9))
    assert found.severity is Severity.NOTE
