"""Choices by probes: what is taken is enough, and what is said of the next choice is true."""

from dataclasses import replace

import numpy as np
import pytest

from studies.end_to_end import calibrated
from studies.maps.carry_over import NOISE, true_run
from studies.worlds.boards import calibration_set
from studies.worlds.challenges import metre
from studies.worlds.folder import write_campaign
from studies.worlds.measured import measured_track
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.io.campaign import load_campaign
from towval.io.video import Video
from towval.model import Board, TrackStatus
from towval.model.errors import RefusedError
from towval.model.geometry import lifted
from towval.optics.plane_uncertainty import pixel_grid
from towval.optics.projection import project, to_plane
from towval.physics.ladder import rung_names
from towval.selection.lens import with_lens_choice
from towval.selection.margin import measurement_std_m
from towval.selection.sample_points import track_selecting
from towval.selection.simulation import TOLERANCES_M, simulate_selecting
from towval.selection.tracking import TRACK_SAMPLES, neighbour_of_tracking
from towval.tracking.track import TrackSettings, track, track_beside
from towval.validation.decimate import decimate
from towval.validation.simulate import SimulateSettings, simulate


@pytest.fixture(scope="module")
def run():
    """The synthetic tow as the stage simulate takes it."""
    given, _ = true_run(3)
    tracks = {
        name: decimate(measured_track(name, given.time_s, getattr(given, name), NOISE)) for name in ("rover", "towed")
    }
    return given.scene, tracks["rover"], tracks["towed"], given.time_s


def test_simulation_takes_the_coarsest_tolerance_that_is_enough(run):
    settings, motion = simulate_selecting(*run, SimulateSettings(), auto=("tolerance_m",), measurement_m=3e-3)
    choice = next(choice for choice in motion.choices if choice.what == "tolerance of a step")
    assert choice.change_m <= 1e-3
    exact = simulate(*run, SimulateSettings(rung=motion.rung, tolerance_m=1e-10))
    assert np.linalg.norm(motion.pose[:, :2] - exact.pose[:, :2], axis=1).max() <= 1e-3
    sharper, _ = simulate_selecting(*run, SimulateSettings(), auto=("tolerance_m",), measurement_m=3e-8)
    assert sharper.tolerance_m < settings.tolerance_m
    assert {settings.tolerance_m, sharper.tolerance_m} <= set(TOLERANCES_M)


def test_simulation_takes_a_simpler_model_where_the_measurement_is_rough(run):
    rungs = [
        simulate_selecting(*run, SimulateSettings(), auto=("rung_tolerance_m",), measurement_m=measured)[1].rung
        for measured in (1e-6, 3.0)
    ]
    assert rungs == ["dynamics", "tractrix"]


def test_the_next_model_changes_the_path_by_what_the_choice_says(run):
    _, motion = simulate_selecting(*run, SimulateSettings(rung="limit surface"), auto=(), measurement_m=np.inf)
    choice = next(choice for choice in motion.choices if choice.what == "model of the object")
    assert (choice.chosen, choice.next) == ("limit surface", rung_names()[-1])
    full = simulate(*run, SimulateSettings(rung="dynamics"))
    apart = np.linalg.norm(motion.pose[:, :2] - full.pose[:, :2], axis=1).max()
    # The choice counts corners of the footprint, so its turn as well.
    assert apart <= choice.change_m <= 3 * apart


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """A synthetic campaign as the stage track takes it."""
    folder = tmp_path_factory.mktemp("filmed")
    write_campaign(folder, frames=40)
    given = load_campaign(folder)
    entry = given.run("a")
    calibration = calibrated(given, {"lens_models": ["k1 k2"]})
    return given, calibration, list(Video(entry.video)), entry.clicks_px


def known_as(calibration, bodies, factor):
    """The same camera and bodies, with all that is not known of them scaled."""
    return (
        replace(calibration, covariance=factor**2 * calibration.covariance),
        [replace(body, height_std_m=factor * body.height_std_m) for body in bodies],
    )


def simulated_path(given, tracks):
    thin = {name: decimate(one) for name, one in tracks.items()}
    return simulate(given.scene, thin["rover"], thin["object"], tracks["object"].time_s).pose[:, :2]


def rms(gap):
    return np.sqrt(np.mean(np.sum(gap**2, axis=1)))


@pytest.mark.parametrize(("factor", "samples"), [(10.0, TRACK_SAMPLES[0]), (1e-6, TRACK_SAMPLES[-1])])
def test_tracking_takes_more_points_only_where_they_matter(filmed, factor, samples):
    given, calibration, frames, clicks = filmed
    known = known_as(calibration, given.bodies, factor)
    settings, tracks = track_selecting(frames, *known, clicks, TrackSettings(), given.scene)
    assert settings.samples == samples
    alone = {count: track(frames, *known, clicks, TrackSettings(samples=count)) for count in TRACK_SAMPLES}
    for name, taken in tracks.items():
        np.testing.assert_array_equal(taken.pose, alone[samples][name].pose)
        gap = np.subtract(*(alone[count][name].pose[:, :2] for count in TRACK_SAMPLES))
        assert taken.choices[0].change_m == pytest.approx(rms(gap))
    carried = tracks["object"].choices[1]
    assert carried.measure == "RMS of the simulated path"
    paths = [simulated_path(given, alone[count]) for count in TRACK_SAMPLES]
    assert carried.change_m == pytest.approx(rms(np.subtract(*paths)))


def test_more_points_are_taken_where_only_the_simulated_path_needs_them(filmed, monkeypatch):
    given, calibration, frames, clicks = filmed
    known = known_as(calibration, given.bodies, 10.0)
    paths = iter((0.0, 0.1))

    asked = SimulateSettings(tolerance_m=1e-6)

    def far_apart(scene, rover, towed, times, settings):
        assert settings is asked
        motion = simulate(scene, rover, towed, times, settings)
        return replace(motion, pose=motion.pose + next(paths))

    monkeypatch.setattr("towval.selection.sample_points.simulate", far_apart)
    settings, _ = track_selecting(frames, *known, clicks, TrackSettings(), given.scene, simulation=asked)
    assert settings.samples == TRACK_SAMPLES[-1]


@pytest.mark.parametrize(("fails", "samples"), [("fewer", TRACK_SAMPLES[-1]), ("more", TRACK_SAMPLES[0])])
def test_the_number_of_points_whose_path_can_be_simulated_is_taken(filmed, monkeypatch, fails, samples):
    given, calibration, frames, clicks = filmed
    calls = iter(("more", "fewer"))

    def fails_once(*run):
        if next(calls) == fails:
            raise RefusedError("no tow")
        return simulate(*run)

    monkeypatch.setattr("towval.selection.sample_points.simulate", fails_once)
    known = known_as(calibration, given.bodies, 10.0)
    settings, _ = track_selecting(frames, *known, clicks, TrackSettings(), given.scene)
    assert settings.samples == samples


def test_points_that_lose_a_body_earlier_are_not_enough(filmed, monkeypatch):
    """As long as both saw it their paths were alike, which was all that was compared."""
    given, calibration, frames, clicks = filmed

    def lose(one):
        gone = np.arange(len(one.time_s)) >= len(one.time_s) // 2
        return replace(
            one,
            pose=np.where(gone[:, None], np.nan, one.pose),
            covariance=np.where(gone[:, None, None], np.nan, one.covariance),
            status=np.where(gone, TrackStatus.LOST, one.status),
        )

    def beside(*known):
        fewer, more = track_beside(*known)
        return [fewer | {"object": lose(fewer["object"])}, more]

    monkeypatch.setattr("towval.selection.sample_points.track_beside", beside)
    known = known_as(calibration, given.bodies, 10.0)
    settings, tracks = track_selecting(frames, *known, clicks, TrackSettings(), given.scene)
    assert settings.samples == TRACK_SAMPLES[-1]
    assert tracks["object"].seen.all()


def test_a_run_that_cannot_be_simulated_is_tracked_all_the_same(filmed):
    given, calibration, frames, clicks = filmed
    known = known_as(calibration, given.bodies, 10.0)
    settings, tracks = track_selecting(frames[:5], *known, clicks, TrackSettings(), given.scene)
    assert settings.samples == TRACK_SAMPLES[0]
    assert np.isnan(tracks["object"].choices[1].change_m)


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        (TrackSettings(), ("plane, 1024 points", "plane, 4096 points")),
        (TrackSettings(samples=4096), ("plane, 4096 points", "plane, 1024 points")),
        (TrackSettings(method="klt"), ("KLT points", "plane, 1024 points")),
    ],
)
def test_the_neighbour_of_a_tracking_is_tried_on_a_few_frames(filmed, settings, names):
    given, calibration, frames, clicks = filmed
    choices = neighbour_of_tracking(frames[:16:4], calibration, given.bodies, clicks, settings)
    assert {(choice.chosen, choice.next) for choice in choices.values()} == {names}
    assert all(0 < choice.change_m < 5e-3 for choice in choices.values())


def with_as_many_marks_as_corners(scene):
    """The set with a surveyed mark for each corner of a board, over the visible floor."""
    unit = np.stack(np.meshgrid(np.linspace(0.1, 0.9, 9), np.linspace(0.1, 0.9, 6)), axis=-1).reshape(-1, 2)
    marks_m = to_plane(scene.camera, scene.floor, unit * scene.camera.resolution_px, 0.0)
    marks_px = project(scene.camera, scene.floor, lifted(marks_m, 0.0))
    marks_px += np.random.default_rng(1).normal(0, 0.15, marks_px.shape)
    reference = replace(scene.seen.reference, marks_px=marks_px, marks_m=marks_m, mark_std_px=0.15)
    return replace(scene, seen=replace(scene.seen, reference=reference))


@pytest.mark.parametrize("surveyed", [False, True])
def test_the_next_lens_model_is_held_against_the_chosen_one(surveyed):
    scene = calibration_set(5, views=10, floor="boards")
    scene = with_as_many_marks_as_corners(scene) if surveyed else scene
    settings = CalibrateSettings(lens_models=("k1 k2",))
    calibration = calibrate_observations(scene.seen, settings, {})
    exact = Board("chessboard", (9, 6), 0.04, size_std=0.0, bow_std_m=0.0)
    reference = replace(scene.seen.reference, board_thickness_std_m=0.0)
    (choice,) = with_lens_choice(calibration, exact, reference, settings, 0.3).choices
    assert (choice.chosen, choice.next) == ("k1 k2", "k1 k2 p1 p2")
    larger = calibrate_observations(scene.seen, CalibrateSettings(lens_models=("k1 k2 p1 p2",)), {})
    pixels = pixel_grid(calibration.camera.resolution_px, 16).reshape(-1, 2)
    one, other = (to_plane(each.camera, each.floor, pixels, 0.3) for each in (calibration, larger))
    assert choice.change_m == pytest.approx(np.sqrt(np.mean(np.sum((one - other) ** 2, axis=1))), rel=1e-3)


def test_pixels_that_do_not_see_the_plane_count_for_no_lens(monkeypatch):
    scene = calibration_set(5, views=10, floor="boards")
    settings = CalibrateSettings(lens_models=("k1 k2",))
    calibration = calibrate_observations(scene.seen, settings, {})

    def below_the_horizon(*given):
        places = to_plane(*given)
        places[:16] = np.nan
        return places

    board = Board("chessboard", (9, 6), 0.04)
    everywhere = with_lens_choice(calibration, board, scene.seen.reference, settings, 0.3).choices[0].change_m
    monkeypatch.setattr("towval.selection.lens.to_plane", below_the_horizon)
    below = with_lens_choice(calibration, board, scene.seen.reference, settings, 0.3).choices[0].change_m
    assert below == pytest.approx(everywhere, rel=0.5)


def test_the_measurement_uncertainty_grows_with_the_height_that_is_not_known():
    scene = calibration_set(5, views=10, floor="boards")
    calibration = calibrate_observations(scene.seen, CalibrateSettings(), {})
    body = metre(1).scene.bodies[0]
    places = [[1.0, 0.5], [-1.0, 0.2]]
    known, unknown = (measurement_std_m(calibration, replace(body, height_std_m=std), places) for std in (1e-6, 0.01))
    assert 0 < known < unknown
    # A centimetre of height moves a place at about 1.1 m from the nadir, 3.6 m below the camera, by some 3 mm.
    assert np.sqrt(unknown**2 - known**2) == pytest.approx(0.01 * 1.1 / 3.6, rel=0.4)
