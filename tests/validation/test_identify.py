"""Identification: planted values come back within their deviations, predictions improve, what is not known is said."""

from dataclasses import replace

import numpy as np
import pytest

import validation_case
from studies.worlds.scenes import drive
from towval.model import Load, Tether, TrackStatus
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding
from towval.model.inputs import Realisation
from towval.validation.decimate import decimate
from towval.validation.identify import IdentifySettings, MeasuredRun, _Fit, _identifiability, identify
from towval.validation.seen_otherwise import SeenOtherwise
from towval.validation.simulate import SimulateSettings, simulate

DEVIATIONS = validation_case.DEVIATIONS | {"stiffness": 16.0}
STARTS = ((0.1, 0.5, 0.15), (-0.2, -0.6, -0.2), (0.0, 0.2, 0.5))
"""Heading and turn of the rover's drive, and heading of the object, a run each."""


@pytest.fixture(scope="module")
def scene():
    return validation_case.SCENE


@pytest.fixture(scope="module")
def measure(make_track):
    """A function that measures runs of a scene: simulated with full dynamics, seen with noise."""

    def runs_of(true, count=3):
        times, runs = np.arange(150) / 25, []
        for k, (heading, turn, start) in enumerate(STARTS[:count]):
            path = drive((-0.15, 0.05, heading), speed=0.25, turn=turn, rest_s=0.3)
            rover = make_track(lambda t, path=path: np.array([path(x) for x in t]), duration_s=6.0, seed=k)
            resting = make_track(
                lambda t, start=start: np.tile([-1.2, 0.0, start], (len(t), 1)), body="object", duration_s=6.0
            )
            thin, settings = decimate(rover), SimulateSettings(rung="dynamics")
            motion = simulate(true, thin, decimate(resting), times, settings)
            track = make_track(lambda _, m=motion: m.pose, body="object", duration_s=6.0, seed=10 + k)
            covariance = np.tile(np.diag([1e-3, 1e-3, 1e-3]) ** 2, (len(times), 1, 1))
            runs.append(MeasuredRun(f"r{k}", thin, decimate(track), track, times, covariance, "dynamics"))
        return runs

    return runs_of


def test_planted_values_come_back_and_predict_the_run_left_out(scene, measure):
    true = replace(scene, tether=Tether(0.63, 800.0), load=Load(1.5, np.array([-0.12, 0.05]), scene.load.size))
    names = ("rest_length", "load_x", "load_y")
    found = identify(scene, DEVIATIONS, measure(true), IdentifySettings(names))
    std = np.sqrt(np.diag(found.covariance))
    np.testing.assert_array_less(np.abs(found.values - [0.63, -0.12, 0.05]), 3 * std)
    # The measurement is a millimetre: the length is known that well, the load's place through a fourth of the mass.
    assert std[0] < 2e-3
    assert (std[1:] < 0.02).all()
    assert found.identifiable == (True, True, True)
    assert [p.run for p in found.predictions] == ["r0", "r1", "r2"]
    for prediction in found.predictions:
        assert prediction.given_rms_m > 0.02
        assert prediction.predicted_rms_m < 0.1 * prediction.given_rms_m


def test_a_wrong_input_that_is_not_fitted_is_told_from_the_value(scene, measure):
    """A load stated 0.3 kg too heavy is found nearer to the middle where that mass counts as exact."""
    runs, settings = measure(scene, 2), IdentifySettings(("load_x",))
    heavier = replace(scene, load=replace(scene.load, mass=scene.load.mass + 0.3))
    nothing = dict.fromkeys(DEVIATIONS, 0.0)
    sure, unsure = (identify(heavier, nothing | more, runs, settings) for more in ({}, {"load_mass": 0.3}))
    true, std = scene.load.at[0], np.sqrt(unsure.covariance[0, 0])
    assert abs(sure.values[0] - true) > 3 * std
    assert abs(unsure.values[0] - true) < 2 * std


@pytest.mark.parametrize("seed", range(3))
def test_inputs_that_turn_the_object_are_not_mistaken_for_friction(scene, measure, seed):
    """Anchor and load a deviation or two aside turn it by many deviations of its measured heading, and friction hardly:
    plain least squares knew it to 0.034 only."""
    aside, load = np.random.default_rng(seed).normal(scale=0.002, size=(2, 2))
    friction = replace(scene.friction, kinetic=0.32, static=0.32)
    true = replace(
        scene, friction=friction, anchor=scene.anchor + aside, load=replace(scene.load, at=scene.load.at + load)
    )
    known = DEVIATIONS | {"anchor": 0.002, "load_at": 0.002}
    precise = [
        replace(run, measurement=np.tile(np.diag([3e-4, 3e-4, 6e-4]) ** 2, (len(run.time_s), 1, 1)))
        for run in measure(true, 2)
    ]
    found = identify(scene, known, precise, IdentifySettings(("friction",)))
    std = np.sqrt(found.covariance[0, 0])
    assert abs(found.values[0] - 0.32) < 2.5 * std
    assert std < 0.008


def test_an_error_that_all_runs_share_is_not_averaged_away(scene, measure):
    """Lengths on the floor half a percent too long in all runs: the length was found three deviations and more off."""

    def longer(thin):
        stretch = np.array([1.005, 1.005, 1.0])
        return replace(thin, pose=thin.pose * stretch, rate=thin.rate * stretch)

    def stretched(run):
        track = replace(run.object_track, pose=run.object_track.pose * [1.005, 1.005, 1.0])
        return SeenOtherwise(longer(run.rover), longer(run.towed), track)

    seen = [replace(run, **vars(stretched(run))) for run in measure(scene)]
    nothing, settings = dict.fromkeys(DEVIATIONS, 0.0), IdentifySettings(("rest_length",))
    off = []
    for runs in (seen, [replace(run, otherwise=(stretched(run),)) for run in seen]):
        found = identify(scene, nothing, runs, settings)
        off.append(abs(found.values[0] - scene.tether.rest_length) / np.sqrt(found.covariance[0, 0]))
    assert off[0] > 3
    assert off[1] < 1.5


def test_a_run_that_cannot_be_judged_has_no_say(scene, measure):
    """Were its poses at the times of another motion, no value would fit both."""
    right, other = measure(replace(scene, tether=Tether(0.63, 800.0)), 2)
    slower = replace(other.object_track, time_s=1.2 * other.object_track.time_s)
    wrong = finding("stamps_contradicted", count=3, first_s=1.0, last_s=2.0)
    other = replace(other, object_track=slower, findings=(wrong,))
    settings = IdentifySettings(("rest_length",))
    found, alone_found = (identify(scene, DEVIATIONS, runs, settings) for runs in ((right, other), (right,)))
    assert found.runs == ("r0",)
    np.testing.assert_array_equal(found.values, alone_found.values)
    left = next(each for each in found.findings if each.code == "identify_left_out")
    assert "Run r1" in left.text
    assert wrong.text in left.text
    with pytest.raises(RefusedError, match="r1: "):
        identify(scene, DEVIATIONS, [other], settings)


def alone(runs):
    """What inputs that are not fitted change where there are none."""
    return np.empty((72 * len(runs), 0))


def fit_of(scene, names, deviations=()):
    return _Fit(Realisation.nominal(scene), dict(deviations), IdentifySettings(names))


@pytest.mark.parametrize("names", [("friction", "static_friction"), ("static_friction", "friction")])
def test_the_order_of_the_parameters_does_not_matter(scene, measure, names):
    """With the planted values the fit simulates the run that was measured, to the noise of 0.1 mm."""
    planted = {"friction": 0.32, "static_friction": 0.42}
    (run,) = measure(replace(scene, friction=replace(scene.friction, kinetic=0.32, static=0.42)), 1)
    pose = fit_of(scene, names).simulated(run, np.array([planted[name] for name in names]))
    assert np.abs(pose - run.object_track.pose)[:, :2].max() < 5e-4


def test_what_cannot_be_negative_is_not_found_so(scene, measure):
    """Heights act by their size: both signs fit as well, and a search about zero may end on the wrong side."""
    runs = measure(replace(scene, hinge_height=0.2), 1)
    fit = fit_of(scene, ("hinge_height",))
    found = fit.values(runs, [np.array([-0.2])], alone(runs))
    assert found.values[0] == pytest.approx(0.2, abs=0.01)
    step = 1e-3
    above, below = (fit._residuals(runs, fit.nominal, found.values + off) for off in (step, -step))
    slope = (above - below) / (2 * step) * fit.scale
    np.testing.assert_allclose(found.jacobian[:, 0] @ slope, slope @ slope, rtol=0.1)


def test_an_input_that_is_zero_and_cannot_be_below_counts(scene, measure):
    """A hinge that is 0.1 m high shortens the tether along the floor; the effect of a height is that of its size."""
    runs = measure(replace(scene, hinge_height=0.1), 1)
    sure, unsure = (fit_of(scene, ("rest_length",), known) for known in ({}, {"hinge_height": 0.1}))
    on_floor, _ = sure.fitted(runs)
    found, by_others = unsure.fitted(runs)
    assert by_others.shape[1] == 2
    std = np.sqrt(unsure.covariance(runs, found, by_others)[0, 0])
    assert abs(on_floor.values[0] - 0.6) > 0.005
    assert abs(found.values[0] - 0.6) < 2 * std


@pytest.mark.parametrize(("std", "severity"), [(0.005, "note"), (0.0, "warning")])
def test_a_misfit_that_other_inputs_may_explain_is_a_note(scene, measure, std, severity):
    """The tether is 8 mm longer than stated, and the place of the load is fitted: it cannot make up for it."""
    runs = measure(replace(scene, tether=replace(scene.tether, rest_length=scene.tether.rest_length + 0.008)), 2)
    known = dict.fromkeys(DEVIATIONS, 0.0) | {"rest_length": std}
    found = identify(scene, known, runs, IdentifySettings(("load_y",)))
    (misfit,) = (each for each in found.findings if each.code == "identify_misfit")
    assert misfit.severity == severity


def test_what_no_input_explains_is_a_misfit_of_the_model(scene, measure):
    """A place off to the side: all inputs are as unsure as stated, and none of them moves all of the path there."""
    runs = [
        replace(run, object_track=replace(run.object_track, pose=run.object_track.pose + np.array([0.0, 0.01, 0.0])))
        for run in measure(scene, 2)
    ]
    found = identify(scene, DEVIATIONS, runs, IdentifySettings(("rest_length",)))
    (misfit,) = (each for each in found.findings if each.code == "identify_misfit")
    assert misfit.severity == "warning"


def test_blocks_in_which_the_object_was_not_seen_are_no_data(scene, measure):
    """A place 3 mm off, which no length explains, in units of 1 mm; of two thirds of the run nothing is seen."""
    (run,) = measure(scene, 1)
    track = replace(run.object_track, pose=run.object_track.pose + np.array([0.0, 3e-3, 0.0]))
    fit, gone = fit_of(scene, ("rest_length",)), np.arange(len(track.pose)) >= 50
    half_seen = replace(
        track,
        pose=np.where(gone[:, None], np.nan, track.pose),
        status=np.where(gone, TrackStatus.LOST, track.status).astype(np.uint8),
    )
    runs = [[replace(run, object_track=each)] for each in (track, half_seen)]
    whole, part = (fit.values(each, [fit.given], alone(each)) for each in runs)
    assert whole.misfit == pytest.approx(3 / np.sqrt(3), rel=0.1)
    assert part.misfit == pytest.approx(whole.misfit, rel=0.1)
    assert (whole.measured, part.measured) == (72, 24)


def test_a_run_of_fewer_times_than_blocks_is_fitted(scene, measure):
    (run,) = measure(scene, 1)
    few = replace(run, time_s=run.time_s[::10], measurement=run.measurement[::10])
    fit = fit_of(scene, ("rest_length",))
    found, by_others = fit.fitted([few])
    std = np.sqrt(fit.covariance([few], found, by_others)[0, 0])
    assert found.measured == 3 * len(few.time_s)
    assert found.values[0] == pytest.approx(scene.tether.rest_length, abs=3 * std)


def test_a_start_far_off_does_not_end_in_another_valley(scene, measure):
    """Between the stiffness told here and the true one the sum of squares has another minimum, near 1080 N/m."""
    stated = replace(scene, tether=replace(scene.tether, stiffness=1160.0))
    found = identify(stated, DEVIATIONS, measure(scene, 2), IdentifySettings(("stiffness",)))
    assert found.values[0] == pytest.approx(800.0, abs=3 * np.sqrt(found.covariance[0, 0]))
    assert found.identifiable == (True,)


def test_a_value_beyond_the_searched_range_is_not_called_identified(scene, measure):
    stated = replace(scene, load=replace(scene.load, at=np.array([-0.15, -0.05])))
    found = identify(stated, DEVIATIONS, measure(scene, 2), IdentifySettings(("load_y",)))
    assert found.identifiable == (False,)
    assert {finding.code for finding in found.findings} == {"not_identifiable", "identify_misfit"}
    assert any("end of the searched range" in finding.text for finding in found.findings)


def test_a_length_that_never_pulled_is_not_identifiable(scene, measure):
    slack = replace(scene, tether=Tether(4.0, 800.0))
    found = identify(slack, DEVIATIONS, measure(slack, 2), IdentifySettings(("rest_length",)))
    assert found.identifiable == (False,)
    assert found.values[0] == 4.0
    assert "not_identifiable" in {finding.code for finding in found.findings}


def test_values_known_together_only_are_reported_so():
    covariance = np.array([[4e-6, 0.99 * 2e-3 * 8], [0.99 * 2e-3 * 8, 64.0]])
    identifiable, findings = _identifiability(("friction", "stiffness"), covariance, np.array([0.2, 400.0]))
    assert identifiable == (False, False)
    assert "friction and stiffness [N/m]; only a combination" in findings[0].text


def test_a_vague_value_is_reported_so():
    identifiable, findings = _identifiability(("friction", "stiffness"), np.diag([4e-6, 2e4]), np.array([0.2, 400.0]))
    assert identifiable == (True, False)
    assert "Not identifiable: stiffness [N/m]" in findings[0].text


def test_one_run_predicts_nothing(scene, measure):
    found = identify(scene, DEVIATIONS, measure(scene, 1), IdentifySettings(("rest_length",)))
    assert found.predictions == ()
    assert "identify_one_run" in {finding.code for finding in found.findings}
    assert found.values[0] == pytest.approx(0.6, abs=3 * np.sqrt(found.covariance[0, 0]))


@pytest.mark.parametrize("names", [("mass",), ("friction", "friction")])
def test_unknown_parameters_are_refused(names):
    with pytest.raises(InputError, match=r"identify\.parameters"):
        IdentifySettings(names)


def test_a_load_that_is_not_there_has_no_place(scene, measure):
    empty = replace(scene, load=Load(0.0, np.zeros(2), np.zeros(3)))
    with pytest.raises(InputError, match="does not have"):
        identify(empty, DEVIATIONS, measure(empty, 1), IdentifySettings(("load_x",)))
