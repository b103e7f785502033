"""The world of bristles against closed forms and the other reference, none of them from the physics."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.bristles import BristledObject, TetherAtHeight, bristle_tow, cells_of
from studies.worlds.reference import Box, towed_box
from towval.model.errors import RefusedError

SQUARE = 0.2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
WEIGHT = 5.0 * 9.81


def block(count=6, **keys):
    given = {"centre": (0.0, 0.0), "centre_height": 0.15, "inertia": 0.4 / 3, "anchor": (0.2, 0.0)}
    given |= {"mass": 5.0, "static": 0.4, "kinetic": 0.35, "friction_velocity": 0.01}
    return BristledObject(*cells_of([SQUARE], count), **(given | keys))


def straight(speed, reach, delay=0.0):
    """A hinge that starts at rest a given reach ahead, and ends up at a speed within a second."""

    def hinge(t):
        since = np.clip(t - delay, 0, None)
        ramp = np.minimum(since, 1.0)
        moved = speed * (ramp**3 - ramp**4 / 2 + np.maximum(since - 1, 0))
        velocity = speed * (3 * ramp**2 - 2 * ramp**3)
        return np.column_stack([reach + moved, 0 * t]), np.column_stack([velocity, 0 * t])

    return hinge


def test_an_inclined_tether_slides_a_block_by_the_closed_form():
    """T cos = μ (m g − T sin), at the static limit to break away and at the kinetic one to slide."""
    tether, reach = TetherAtHeight(0.6, 1000.0, 50.0, 0.0, 1.0, 0.3, 0.1), 0.2 + np.sqrt(0.6**2 - 0.2**2)

    def closed_form(friction, place):
        rise = np.arctan2(0.2, place - 0.2)
        return friction * WEIGHT / (np.cos(rise) + friction * np.sin(rise))

    times, poses, pull = bristle_tow(block(), tether, straight(0.05, reach), (0, 0, 0), 6.0, report_s=0.01)
    place = straight(0.05, reach)(times[-1:])[0][0, 0]
    assert pull[-1] == pytest.approx(closed_form(0.35, place - poses[-1, 0]), rel=1e-4)
    times, poses, pull = bristle_tow(block(), tether, straight(0.01, reach), (0, 0, 0), 5.0, report_s=0.01)
    hinge = straight(0.01, reach)(times)[0][:, 0]
    bent = int(np.argmax(poses[:, 0] > 0.995e-5))  # all bristles, to their limit of 10 µm
    assert pull[bent] == pytest.approx(closed_form(0.4, hinge[bent]), rel=5e-3)
    assert pull[bent - 50] < 0.99 * pull[bent]


def test_below_the_limit_it_stays_and_on_a_slope_too():
    """Half of the limit of friction: bristles bend by micrometres at once, and not by a nanometre more."""
    reach = 0.8 + 0.5 * 0.4 * WEIGHT / 1000.0
    hinge = straight(0.0, reach)
    _, poses, _ = bristle_tow(block(), TetherAtHeight(0.6, 1000.0), hinge, (0, 0, 0), 20.0, slope=(0.003, 0.001))
    assert np.abs(poses[-1, :2]).max() < 1e-5
    np.testing.assert_allclose(poses[-1], poses[len(poses) // 2], atol=1e-9)


def test_it_slides_down_a_slope_above_the_static_limit_only():
    """Put on the slope at once its bristles ring to nearly twice their bend, so 0.2 is as much as holds for sure."""
    hinge, slack = straight(0.0, 0.3), TetherAtHeight(5.0, 1000.0)
    below, above = (
        bristle_tow(block(), slack, hinge, (0, 0, 0), 1.0, slope=(-tangent, 0.0))[1][-1, 0] for tangent in (0.2, 0.41)
    )
    assert abs(below) < 2e-5
    angle = np.arctan(0.41)
    expected = 0.5 * 9.81 * (np.sin(angle) - 0.35 * np.cos(angle))
    assert above == pytest.approx(expected, rel=0.02)  # the peak delays it


def test_it_agrees_with_the_other_reference_where_nothing_sticks():
    """A curved tow in the plane, slid all along; the other reference's friction is rounded off over 0.02 mm/s."""

    def hinge(t):
        t = np.atleast_1d(t)
        place = np.column_stack([0.805 + 0.08 * t, 0.03 * t**2])
        return place, np.column_stack([np.full(len(t), 0.08), 0.06 * t])

    flat = block(24, static=0.35, kinetic=0.35, centre=(0.03, 0.02), inertia=0.15, centre_height=0.0)
    tether = TetherAtHeight(0.6, 1000.0)
    times, poses, _ = bristle_tow(flat, tether, hinge, (0, 0, 0), 3.0, report_s=0.1, step_s=2.5e-5)
    box = Box((0.4, 0.4), 5.0, (0.03, 0.02), 0.15, (0.2, 0.0), 0.35, 2e-5)
    keys = {"panels": (8, 8), "order": 4, "tolerance": 1e-6}
    truth = towed_box(box, lambda t: hinge(t)[0][0], (0.6, 1000.0), (0, 0, 0), times, **keys)
    assert np.abs(poses - truth)[:, :2].max() < 2e-4
    assert np.abs(poses - truth)[:, 2].max() < 5e-4


def test_halving_step_and_deflection_moves_it_little():
    def hinge(t):
        turn = 0.1 * (1 - np.cos(t))
        return np.column_stack([0.8 + 0.03 * t, turn]), np.column_stack([np.full(len(t), 0.03), 0.1 * np.sin(t)])

    tether = TetherAtHeight(0.6, 1000.0, 10.0, hinge_height=0.15, anchor_height=0.1)
    feet = [0.16 * sign + 0.2 * SQUARE for sign in np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])]
    places, areas = cells_of(feet, 4)
    towed = replace(block(), places=places, areas=areas, across_over_along=1.04)
    _, poses, _ = bristle_tow(towed, tether, hinge, (0, 0, 0), 6.0)
    _, finer, _ = bristle_tow(replace(towed, deflection=5e-6), tether, hinge, (0, 0, 0), 6.0, step_s=5e-5)
    assert np.linalg.norm(poses - finer, axis=1).max() < 2e-4


def test_a_lifted_edge_loads_the_rest_by_statics():
    """An eccentric block that stands on part of its base turns about where it presses, not about its middle."""
    # The centre of mass half-way to the edge: pressed on 3/4 of the side, the pull there is that of the whole weight.
    towed = block(16, centre=(-0.1, 0.0), centre_height=0.0, static=0.35, kinetic=0.35)
    tether = TetherAtHeight(0.6, 1000.0, 50.0)
    _, poses, pull = bristle_tow(towed, tether, straight(0.05, 0.8), (0, 0, 0), 4.0)
    assert pull[-1] == pytest.approx(0.35 * WEIGHT, rel=1e-4)
    assert np.abs(poses[-1, 1:]).max() < 1e-9


def test_a_tow_that_tips_is_refused():
    tether = TetherAtHeight(0.6, 1000.0, hinge_height=0.6, anchor_height=0.6)
    with pytest.raises(RefusedError, match="tips"):
        bristle_tow(block(), tether, straight(0.05, 0.8), (0, 0, 0), 5.0)
