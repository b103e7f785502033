from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.lab_tows import StopAndGo, four_feet


def test_the_hinge_moves_with_its_velocity_and_rests():
    hinge, times = StopAndGo((0.3, -0.1)), np.linspace(0, 20, 100_001)
    places, velocities = hinge(times)
    np.testing.assert_allclose(np.gradient(places, times, axis=0)[2:-2], velocities[2:-2], atol=1e-7)
    resting = (times > 5.3) & (times < 7.1)
    assert np.abs(velocities[resting]).max() == 0.0
    np.testing.assert_allclose(places[0], [0.3, -0.1], atol=1e-15)


def test_effects_of_a_lab_move_the_object_by_millimetres():
    """About what an independent program found for campaign lab_c: heights 13.8, slope 2.2, anisotropy 3.4 mm RMS."""
    tow = replace(four_feet(3), duration=14.0)
    truth = tow.truth()[1]
    level = replace(tow, slope=(0.0, 0.0))
    isotropic = replace(tow, towed=replace(tow.towed, across_over_along=1.0))
    on_floor = replace(tow, tether=replace(tow.tether, hinge_height=0.0, anchor_height=0.0))
    flat = replace(on_floor, towed=replace(tow.towed, centre_height=0.0))
    moved = [np.linalg.norm((w.truth()[1] - truth)[:, :2], axis=1).max() for w in (level, isotropic, flat)]
    assert moved[0] == pytest.approx(2.5e-3, rel=0.8)
    assert moved[1] == pytest.approx(4e-3, rel=0.8)
    assert moved[2] == pytest.approx(15e-3, rel=0.8)


def test_the_truth_has_converged():
    tow = replace(four_feet(3), duration=7.0)
    finer = replace(four_feet(4), duration=7.0)
    finer = replace(finer, towed=replace(finer.towed, deflection=5e-6))
    gap = np.linalg.norm((tow.truth()[1] - finer.truth(5e-5)[1])[:, :2], axis=1)
    assert gap.max() < 1e-4
