"""The reference motion against closed forms."""

import numpy as np
import pytest

from studies.worlds.reference import Box, towed_box
from towval.model.errors import RefusedError

BOX = Box((0.4, 0.4), 5.0, (0.0, 0.0), 0.4 / 3, (0.2, 0.0), 0.35, 1e-3)


def test_nodes_carry_the_load_at_its_place():
    box = Box((0.5, 0.3), 4.0, (0.03, -0.02), 0.1, (0.25, 0.0), 0.3, 1e-3)
    places, force = box.nodes((3, 2), 4)
    assert force.sum() == pytest.approx(4.0 * 9.81, rel=1e-13)
    np.testing.assert_allclose(force @ places / force.sum(), box.centre, atol=1e-14)


def test_a_base_that_is_not_pressed_all_over_is_refused():
    box = Box((0.4, 0.4), 4.0, (0.1, 0.0), 0.1, (0.2, 0.0), 0.3, 1e-3)
    with pytest.raises(RefusedError, match="not pressed all over"):
        box.nodes((2, 2), 4)


def test_a_straight_tow_ends_with_the_stretch_that_friction_asks_for():
    """At a steady speed v the tension is μ N tanh(v / v_s), the tether longer by it over κ; 40 s forget the start."""
    speed, friction = 2e-3, 0.35 * 5.0 * 9.81 * np.tanh(2.0)
    poses = towed_box(BOX, lambda t: np.array([0.81 + speed * t, 0.0]), (0.6, 1000.0), (0, 0, 0), [0.0, 40.0])
    assert poses[-1, 0] == pytest.approx(0.81 + 40 * speed - 0.6 - friction / 1000 - 0.2, abs=1e-9)
    np.testing.assert_allclose(poses[-1, 1:], 0, atol=1e-12)


def test_a_hinge_within_reach_moves_nothing():
    poses = towed_box(BOX, lambda t: np.array([0.5 + 0.01 * t, 0.0]), (0.6, 1000.0), (0, 0, 0.3), [0.0, 2.0])
    np.testing.assert_allclose(poses[-1], (0, 0, 0.3), atol=1e-15)
