"""Findings of the stage simulate: each with a run that has the fault."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.campaign import ANCHOR, HINGE, OBJECT
from studies.worlds.scenes import drive
from towval.model import FrictionSpecification, Load, Patch, Tether, TowingScene
from towval.model.errors import RefusedError
from towval.physics.friction_laws import FittedLaw, fitted_law
from towval.validation.decimate import decimate
from towval.validation.simulate import SimulateSettings, simulate

TIMES = np.arange(100) / 25
SCENE = TowingScene(
    Patch(OBJECT.top_corners_m),
    4.0,
    Load(1.5, np.array([-0.15, 0.08]), np.array([0.1, 0.1, 0.0])),
    ANCHOR,
    HINGE,
    Tether(0.6, 800.0),
    FrictionSpecification(0.35, 0.35, 0.005, 0.05),
)


@pytest.fixture(scope="module")
def tracks(make_track):
    """The rover drives off after 0.3 s; the object rests behind it, its tether a little slack."""
    rover = drive((-0.15, 0.05, 0.1), speed=0.25, turn=0.5, rest_s=0.3)
    start = np.array([-1.2, 0.0, 0.15])
    measured = make_track(lambda t: np.array([rover(x) for x in t]), duration_s=4.0, seed=1)
    resting = make_track(lambda t: np.tile(start, (len(t), 1)), body="object", duration_s=4.0, seed=2)
    return decimate(measured), decimate(resting)


def codes(tracks, scene=SCENE, times=TIMES, **settings):
    motion = simulate(scene, *tracks, times, SimulateSettings(rung="dynamics", **settings))
    return {found.code: found for found in motion.findings}


def test_a_sound_run_has_notes_alone(tracks):
    assert {found.severity for found in codes(tracks).values()} == {"note"}


def test_a_tether_that_never_pulls_is_reported(tracks):
    found = codes(tracks, replace(SCENE, tether=Tether(5.0, 800.0)))
    assert {"slack_all_along", "simulate_outcome"} <= set(found)


def test_a_tether_stretched_at_the_start_is_reported(tracks):
    found = codes(tracks, replace(SCENE, tether=Tether(0.4, 800.0)))
    # From hinge (-0.57, 0.01) to anchor (-0.95, 0.04) it is 0.38 m: 5 % of 0.4 m are not reached, of 0.3 m they are.
    assert "taut_start" not in found
    assert "taut_start" in codes(tracks, replace(SCENE, tether=Tether(0.3, 800.0)))


def test_times_outside_the_rover_track_are_counted(tracks):
    found = codes(tracks, times=np.concatenate([TIMES, [4.5, 5.0]]))
    assert found["simulate_cut"].text.startswith("2 frames")


def test_friction_numbers_that_the_law_does_not_meet_are_reported(tracks, monkeypatch):
    """Makkar's fit refuses such numbers itself; another law may come close only."""
    law = fitted_law(SCENE.friction).law
    monkeypatch.setattr("towval.validation.scene_model.fitted_law", lambda _: FittedLaw(law, 0.012))
    assert "by up to 0.0120" in codes(tracks)["friction_law"].text


def test_a_coarse_tolerance_is_reported(tracks):
    assert "numerical_error" in codes(tracks, tolerance_m=1e-3, rung_tolerance_m=1e-6)


def test_creep_is_reported_where_it_moves_the_path(tracks):
    assert "creep" in codes(tracks, rung_tolerance_m=1e-5)


def test_tracks_that_do_not_overlap_are_refused(tracks):
    with pytest.raises(RefusedError, match="do not overlap"):
        simulate(SCENE, *tracks, TIMES + 10)
