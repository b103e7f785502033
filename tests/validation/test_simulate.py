"""Findings of the stage simulate: each with a run that has the fault."""

import re
from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.measured import measured_track
from studies.worlds.scenes import drive
from studies.worlds.towed_runs import FRAME_STD, synthetic_run, true_motion
from towval.model import FloorRegion, Ground, Tether
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import transform
from towval.physics.dynamics import Outcome
from towval.physics.friction_laws import FittedLaw, fitted_law
from towval.physics.ladder import rung_names
from towval.validation import scene_model
from towval.validation.decimate import decimate
from towval.validation.scene_model import SceneModel
from towval.validation.simulate import RunSimulation, SimulateSettings, simulate
from validation_case import SCENE

TIMES = np.arange(100) / 25


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
    assert "slack_all_along" in found
    assert "simulate_outcome" not in found, "it says the same again"


def test_an_outcome_without_a_finding_of_its_own_is_reported(tracks):
    run = RunSimulation(SCENE, *tracks, TIMES)
    motion = replace(run.motion("dynamics", 1e-6), outcome=Outcome.STEP_LIMIT, findings=())
    assert [found.code for found in run._findings(motion)] == ["simulate_outcome"]


def test_an_object_that_moves_already_is_reported(tracks, make_track):
    """The simulation starts at rest; at 0.1 m/s on this tether that is a swing of 2 v √(m/κ)."""
    rover, _ = tracks
    moving = make_track(
        lambda t: np.column_stack([-1.2 + 0.1 * t, 0 * t, 0.15 + 0 * t]), body="object", duration_s=4.0, seed=2
    )
    found = codes((rover, decimate(moving)))["moving_start"]
    swing_mm = 1000 * 2 * 0.1 * np.sqrt(SCENE.mass / SCENE.tether.stiffness)
    assert f"up to {swing_mm:.0f} mm" in found.text


def test_a_slow_start_between_stick_and_slip_is_reported():
    """A video that begins as the object comes to rest between two slips: 2 v/ω is 2 mm, the error later 29 mm."""
    run = synthetic_run(8)
    true = true_motion(run, run.truth)
    rows = slice(10 + int(np.argmax(np.hypot(*(true[:, :2] - true[0, :2]).T) > 2e-3)), None)
    tracks = {}
    for name, pose in (("rover", np.array([run.drive(t) for t in run.time_s])), ("object", true)):
        noisy = pose + FRAME_STD * np.random.default_rng(len(name)).standard_normal(pose.shape)
        tracks[name] = [decimate(measured_track(name, run.time_s[k], noisy[k], FRAME_STD)) for k in (slice(None), rows)]
    whole, late = (simulate(run.scene, *both, run.time_s) for both in zip(*tracks.values(), strict=True))
    assert "moving_start" in {found.code for found in late.findings}
    assert late.statistics["start_off_m"] > 0.01
    assert "moving_start" not in {found.code for found in whole.findings}
    assert whole.statistics["start_off_m"] < 1e-4


def test_an_object_that_sticks_slides_by_the_law_that_is_stated(monkeypatch):
    """Coulomb's law has no peak, whether or not the object sticks; what another misses is stated."""
    friction = replace(SCENE.friction, static=0.45, law="coulomb")
    model = SceneModel(replace(SCENE, friction=friction), sticking=True)
    assert model.law.law.coefficient(np.geomspace(1e-4, 1, 99)).max() <= friction.kinetic
    assert model._hold().static == friction.kinetic
    assert model.law.residual == fitted_law(friction).residual > 0.2
    other = FittedLaw(fitted_law(replace(friction, kinetic=0.40)).law, 0.0)
    monkeypatch.setattr(scene_model, "fitted_law", lambda _: other)
    model = SceneModel(replace(SCENE, friction=replace(friction, law="another")), sticking=True)
    assert model.law.residual == pytest.approx(0.125, rel=0.05)  # 0.45 for 0.40 as it begins to slide, 0.35 later
    assert SceneModel(replace(SCENE, friction=replace(friction, law="makkar")), sticking=True).law.residual == 0


def test_a_tether_too_short_for_the_start_is_reported(tracks):
    """From hinge (-0.57, 0.01) to anchor (-0.95, 0.04) it is 0.387 m; at 800 N/m friction holds a stretch of 30 mm."""
    assert "taut_start" not in codes(tracks, replace(SCENE, tether=Tether(0.4, 800.0)))
    assert not {"taut_start", "start_nearer"} & set(codes(tracks, replace(SCENE, tether=Tether(0.365, 800.0))))
    found = codes(tracks, replace(SCENE, tether=Tether(0.3, 800.0)))["taut_start"]
    assert "57 mm longer than friction could hold" in found.text


def distance_at_start():
    """From hinge to anchor in the tracks [m]."""
    hinge = transform([-0.15, 0.05, 0.1], SCENE.hinge)
    return float(np.linalg.norm(hinge - transform([-1.2, 0.0, 0.15], SCENE.anchor)))


HELD_M = 1.25 * SCENE.friction.static * SCENE.weight / 1e5
"""Stretch of a tether of 1e5 N/m that friction holds."""


def test_an_object_at_rest_is_not_thrown_by_a_stiff_tether_that_is_stated_too_short(tracks):
    """0.39 m of a tether stated 2 mm shorter, at 1e5 N/m: 200 N, where friction holds 24 N."""
    scene = replace(SCENE, tether=Tether(distance_at_start() - 0.002, 1e5))
    motion = simulate(scene, *tracks, TIMES, SimulateSettings(rung="dynamics"))
    nearer = 0.002 - HELD_M
    assert np.linalg.norm(motion.pose[0, :2] - [-1.2, 0.0]) == pytest.approx(nearer, abs=1e-4)  # the noise of the track
    still = motion.time_s < 0.3
    assert np.linalg.norm(motion.pose[still, :2] - motion.pose[0, :2], axis=1).max() < HELD_M
    (found,) = [each for each in motion.findings if each.code == "start_nearer"]
    assert f"{1000 * nearer:.1f} mm nearer" in found.text


@pytest.mark.parametrize(
    ("shorter_m", "found"),
    [
        (0.00005, None),
        (0.0002, ("start_nearer", "note")),
        (0.0046, ("start_nearer", "note")),
        (0.0054, ("start_nearer", "warning")),
        (0.017, ("start_nearer", "warning")),
        (0.020, ("taut_start", "warning")),
    ],
)
def test_a_start_that_contradicts_the_lengths_is_told_by_how_much(tracks, shorter_m, found):
    """Noted from 0.1 mm, warned of from 5 mm, not judged from a twentieth of the rest length on, here 18 mm."""
    tether = Tether(distance_at_start() - HELD_M - shorter_m, 1e5)
    told = codes(tracks, replace(SCENE, tether=tether))
    starts = [(code, told[code].severity) for code in ("start_nearer", "taut_start") if code in told]
    assert starts == ([found] if found else [])


@pytest.mark.parametrize("heights", [(0.0, 0.0), (0.3, 0.05)])
def test_the_start_is_moved_only_as_far_as_friction_can_hold(heights):
    """The place where the stretch of the tether, in space, is that of the pull that is still held; else none."""
    hinge_height, anchor_height = heights
    scene = replace(SCENE, tether=Tether(0.6, 1e4), hinge_height=hinge_height, anchor_height=anchor_height)
    model, heading = SceneModel(scene), 0.4
    hinge, direction = np.array([0.2, -0.1]), np.array([np.cos(0.3), np.sin(0.3)])

    def pose(length):
        apart = np.sqrt(length**2 - (hinge_height - anchor_height) ** 2)
        anchor = transform([0.0, 0.0, heading], scene.anchor)
        return np.array([*(hinge - apart * direction - anchor), heading])

    held = 0.6 + 1.25 * scene.friction.static * scene.weight / 1e4
    np.testing.assert_array_equal(model.resting(hinge, pose(held - 1e-9)), pose(held - 1e-9))
    np.testing.assert_allclose(model.resting(hinge, pose(held + 0.01)), pose(held), atol=1e-12)
    slippery = SceneModel(replace(scene, ground=Ground(regions=(FloorRegion(np.eye(3)[:, :2], 0.5),))))
    np.testing.assert_allclose(slippery.resting(hinge, pose(held + 0.01)), pose(held), atol=1e-12)
    rough = SceneModel(replace(scene, ground=Ground(regions=(FloorRegion(np.eye(3)[:, :2], 2.0),))))
    np.testing.assert_allclose(rough.resting(hinge, pose(held + 0.01)), pose(2 * held - 0.6), atol=1e-12)


def test_a_tether_with_mass_that_would_hang_through_the_floor_is_reported(tracks):
    """2 kg/m over 0.6 m, slack at the start: it hangs a hand deep, and flat with the ends as low as here."""
    chain = replace(SCENE, tether=Tether(0.6, 800.0, mass_per_length=2.0))
    low, high = (replace(chain, anchor_height=h, hinge_height=h) for h in (0.02, 0.25))
    assert codes(tracks, low)["tether_on_floor"].text.startswith("For 100 % of the time")
    assert "tether_on_floor" not in codes(tracks, high)


def test_times_outside_the_rover_track_are_counted(tracks):
    found = codes(tracks, times=np.concatenate([TIMES, [4.5, 5.0]]))
    assert found["simulate_cut"].text.startswith("2 frames")


def test_friction_numbers_that_the_law_does_not_meet_are_reported(tracks, monkeypatch):
    """Makkar's fit refuses such numbers itself; another law may come close only."""
    law = fitted_law(SCENE.friction).law
    monkeypatch.setattr("towval.validation.scene_model.fitted_law", lambda _: FittedLaw(law, 0.012))
    assert "by up to 1.2 %" in codes(tracks)["friction_law"].text


def test_the_finding_on_the_rung_tells_the_distance_to_the_next_simpler_one(tracks):
    """That of the two paths, with the corners of the object, and not that of the simpler one to the full dynamics."""
    run = RunSimulation(SCENE, *tracks, TIMES)
    settings = SimulateSettings(rung="limit surface", rung_tolerance_m=0.5)
    used = run.simulate(settings)
    simpler = rung_names()[rung_names().index("limit surface") - 1]
    (found,) = [each for each in used.findings if each.code == "rung"]
    at_corners = [
        np.array([transform(pose, SCENE.patch.corners) for pose in motion.pose])
        for motion in (used, run.motion(simpler, settings.tolerance_m))
    ]
    apart = 1000 * np.linalg.norm(at_corners[0] - at_corners[1], axis=-1).max()
    stated = float(re.search(rf"{simpler} would move the path by up to ([\d.]+) mm", found.text)[1])
    # What is stated is a bound: the sum of the largest shift and turn.
    assert apart - 0.01 < stated < 1.5 * apart
    assert abs(stated - 1000 * used.statistics[f"{simpler} to dynamics, m"]) > 0.2 * stated


def test_a_coarse_tolerance_is_reported(tracks):
    assert "numerical_error" in codes(tracks, tolerance_m=1e-3, rung_tolerance_m=1e-6)


def test_creep_is_reported_where_it_moves_the_path(tracks):
    assert "creep" in codes(tracks, rung_tolerance_m=1e-5)


def test_tracks_that_do_not_overlap_are_refused(tracks):
    with pytest.raises(RefusedError, match="do not overlap"):
        simulate(SCENE, *tracks, TIMES + 10)


def parked(make_track, seconds):
    """The rover draws the tether to half the friction limit and stands."""
    taut = 0.6 + 0.5 * 0.35 * 5.5 * 9.81 / 800
    pose = np.array([-1.2 + 0.25 + taut + 0.42, 0.0, 0.0])
    rover = make_track(lambda t: np.tile(pose, (len(t), 1)), duration_s=seconds, seed=1)
    resting = make_track(lambda t: np.tile((-1.2, 0.0, 0.0), (len(t), 1)), body="object", duration_s=seconds, seed=2)
    return decimate(rover), decimate(resting)


def test_an_object_parked_under_tension_stays_where_the_law_alone_creeps(make_track):
    tracks, times = parked(make_track, 40.0), np.arange(1000) / 25
    moved = {}
    for sticking in ("auto", True, False):
        motion = simulate(SCENE, *tracks, times, SimulateSettings(rung="dynamics", sticking=sticking))
        moved[sticking] = np.linalg.norm(motion.pose[-1, :2] - motion.pose[0, :2])
        found = {one.code: one.severity for one in motion.findings}
        assert found.get("creep") == (None if sticking else "warning")
        assert motion.sticking == bool(sticking)
    assert moved[True] == moved["auto"] < 1e-5
    assert moved[False] > 5e-3


def test_heights_slope_and_anisotropy_act(tracks):
    plain = simulate(SCENE, *tracks, TIMES, SimulateSettings(rung="dynamics")).pose
    for change in (
        {"anchor_height": 0.1, "hinge_height": 0.2},
        {"ground": Ground(slope=(0.003, 0.003))},
        {"friction": replace(SCENE.friction, across_over_along=1.1)},
        {"friction": replace(SCENE.friction, radius_over_planar=1.2)},
        {"ground": Ground(regions=(FloorRegion([[-3, -3], [3, -3], [3, 0.05], [-3, 0.05]], 1.2),))},
    ):
        other = simulate(replace(SCENE, **change), *tracks, TIMES, SimulateSettings(rung="dynamics")).pose
        assert 2e-4 < np.linalg.norm(other - plain, axis=1).max() < 0.1, change


def test_a_tow_that_tips_is_refused_by_name(tracks):
    high = replace(SCENE, anchor_height=0.8, hinge_height=0.8)
    with pytest.raises(RefusedError, match="tips over"):
        simulate(high, *tracks, TIMES)


def test_a_simpler_model_of_a_tow_that_tips_is_not_called_infinitely_far(tracks):
    high = replace(SCENE, anchor_height=0.8, hinge_height=0.8)
    found = simulate(high, *tracks, TIMES, SimulateSettings(rung="tractrix")).findings
    (text,) = [each.text for each in found if each.code == "rung"]
    assert "the full dynamics cannot be compared, since one of both ends early" in text  # moved it by up to "inf mm"


def test_sticking_is_auto_true_or_false():
    with pytest.raises(InputError, match=r"simulate\.sticking"):
        SimulateSettings(sticking="sometimes")
