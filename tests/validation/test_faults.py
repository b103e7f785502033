"""Faults put into a run: what they are, and that nine in ten of the smallest show."""

from dataclasses import replace

import numpy as np
import pytest

from towval.model import Finding, Severity
from towval.model.geometry import pose_difference, transform, wrapped
from towval.physics.ladder import DYNAMICS
from towval.physics.mass import towed_object
from towval.validation import uncertainty
from towval.validation.consequences import WIDER, excusing, forbidding, widened
from towval.validation.faults import Drawing, fault_kinds, visible_faults
from towval.validation.sampler import UncertaintySettings
from towval.validation.simulate import SimulateSettings, simulate
from towval.validation.simulate_many import Drawn
from towval.validation.statistics import RightModel
from towval.validation.uncertainty import UncertaintySampling
from towval.validation.verdict import fault_text


def warning(code, severity=Severity.WARNING):
    return Finding(severity, code, f"{code}.")


def test_kinds_change_the_scene_by_their_size(case):
    kinds = {kind.name: kind for kind in fault_kinds(case.simulated)}
    scene = case.scene
    assert kinds["rest length"].acts(scene, 0.01).tether.rest_length == pytest.approx(0.61)
    raised = kinds["tow height"].acts(scene, 0.1)
    assert (raised.hinge_height, raised.anchor_height) == (0.1, 0.1)
    moved = towed_object(kinds["centre of mass, sideways"].acts(scene, 0.02))
    np.testing.assert_allclose(moved.centre_of_mass - towed_object(scene).centre_of_mass, [0, 0.02], atol=1e-12)
    assert moved.inertia == pytest.approx(towed_object(scene).inertia, rel=0.1)
    stripe = kinds["friction over 0.3 m of floor"].acts(scene, 0.5).ground.regions[0]
    assert stripe.factor == 1.5
    # It lies before the object half-way along, across its path.
    ends = np.linalg.norm(stripe.outline[1] - stripe.outline[0])
    assert ends == pytest.approx(0.3)


def test_nine_in_ten_of_the_smallest_visible_faults_show(case):
    """In draws that the search has not seen, each simulated with the fault in it, to either side where it has two."""
    sampling = UncertaintySampling(case, UncertaintySettings(samples=256))
    known = sampling.completed(sampling.describe(256))
    path, kinds = sampling.on_path(known), fault_kinds(case.simulated)
    right = RightModel.of(path.drawn, known.draws.inputs, 0.99)
    assert [fault.kind for fault in known.faults] == [kind.name for kind in kinds]
    visible = [(kind, fault) for kind, fault in zip(kinds, known.faults, strict=True) if np.isfinite(fault.size)]
    assert len(visible) >= 2
    unseen = range(256, 512)
    sampling.describe(512)
    laid_out = [sampling._sampler.lay_out(i, sampling._draws[i]) for i in unseen]
    for kind, fault in visible:
        signs = np.resize([1.0, -1.0] if kind.both else [1.0], len(laid_out))
        wrong = [
            drawn._replace(scene=kind.of(sign * fault.size)(drawn.scene))
            for sign, (drawn, _) in zip(signs, laid_out, strict=True)
        ]
        error = np.array(list(sampling._sampler.batch.simulate(wrong))) - [measured for _, measured in laid_out]
        error[..., 2] = wrapped(error[..., 2])
        seen = right.rejects(path.frame.along_across(error)[:, path.frame.seen]).mean()
        assert seen == pytest.approx(0.9, abs=0.09), kind.name  # 0.02 of it the standard error of 256 draws
        distance = fault.size * np.linalg.norm(moved_by(case, sampling, kind, 1e-3)[:, :2], axis=1) / 1e-3
        if kind.both:  # the others are not linear
            assert fault.shift_rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=0.3)


def test_the_nominal_run_starts_where_the_draws_do(case, monkeypatch):
    """Behind a stiff tether that is stated too short the object starts nearer; behind a longer one it does not."""
    hinge = transform(case.rover_decimated.poses_at(0.0), case.scene.hinge)
    start = case.object_decimated.poses_at(0.0)
    apart = float(np.linalg.norm(hinge - transform(start, case.scene.anchor)))
    stiff = replace(case.scene, tether=replace(case.scene.tether, rest_length=apart - 0.01, stiffness=5e4))
    longer = replace(stiff, tether=replace(stiff.tether, rest_length=apart + 0.01))
    tracks = case.rover_decimated, case.object_decimated, case.simulated.time_s
    nominal, moved = (simulate(scene, *tracks, SimulateSettings(rung=DYNAMICS)) for scene in (stiff, longer))
    assert np.linalg.norm(nominal.pose[0, :2] - start[:2]) > 5e-3
    drawings = []
    monkeypatch.setattr(uncertainty, "visible_faults", lambda _, drawing: drawings.append(drawing) or ())
    sampling = UncertaintySampling(replace(case, scene=stiff, simulated=nominal), UncertaintySettings(samples=64))
    known = sampling.describe(64)
    sampling.with_faults(known)
    longer_by = next(kind for kind in fault_kinds(nominal) if kind.name == "rest length").of(0.02)
    (shift,) = drawings[0].shifts([longer_by], None)
    frame = sampling.on_path(known).frame
    expected = frame.along_across(pose_difference(moved.pose, nominal.pose))[frame.seen]
    np.testing.assert_allclose(shift[:, :2], expected[:, :2], atol=5e-4)


def test_a_fault_larger_than_what_it_acts_on_is_not_tried(case):
    """Faults of up to 0.3 m are put into a tether of 0.1 m, and into draws that make it shorter still."""
    short = replace(case, scene=replace(case.scene, tether=replace(case.scene.tether, rest_length=0.1)))
    unsure = replace(short, deviations={**case.deviations, "rest_length": 0.05})
    sampling = UncertaintySampling(unsure, UncertaintySettings(samples=64))
    (fault, *_) = sampling.with_faults(sampling.describe(64)).faults
    assert fault.kind == "rest length"
    assert not fault.size >= 0.1


def test_a_fault_that_no_draw_can_be_simulated_with_is_not_visible(case):
    rng = np.random.default_rng(4)
    error, inputs = 1e-3 * rng.standard_normal((64, 100, 3)), rng.standard_normal((64, 2))

    def shifts(acts, rows):
        return np.full((len(acts), 100, 3), 0.01 if rows is None else np.nan)

    faults = visible_faults(case.simulated, Drawing(error, inputs, 0.99, shifts))
    assert np.isnan([fault.size for fault in faults]).all()
    assert fault_text(faults[0]) == "rest length unknown (no run with it can be simulated)"


def longer_tether_shifts(case, error, factor, nominal=1.0):
    """Shifts of a made drawing: a longer tether moves all along by its length times a factor that is asked for."""
    rest = case.scene.tether.rest_length

    def shifts(acts, rows):
        sizes = np.array([act(case.scene).tether.rest_length - rest for act in acts])
        moved = np.zeros((len(acts), *error.shape[1:]))
        moved[..., 0] = (sizes * (nominal if rows is None else factor()))[:, None]
        return moved

    return shifts


def test_a_fault_that_the_nominal_run_cannot_have_is_told_by_all_draws(case):
    """With nothing to order the draws by, each counts: the first of them show a fault late."""
    rng = np.random.default_rng(5)
    error, inputs = 1e-3 * rng.standard_normal((256, 100, 3)), np.empty((256, 0))
    error[:24] *= 0.2  # well within the limits
    right, along = RightModel.of(error, inputs, 0.99), np.zeros((256, 100, 3))
    along[..., 0] = np.resize([1.0, -1.0], 256)[:, None]  # the signs are dealt in turn
    wanted = np.quantile(right.thresholds(along, error), 0.9)
    shifts = longer_tether_shifts(case, error, lambda: 1.0, nominal=np.nan)
    found = visible_faults(case.simulated, Drawing(error, inputs, 0.99, shifts))[0]
    assert found.kind == "rest length"
    assert found.size == pytest.approx(wanted, rel=0.05)
    assert fault_text(found) == f"rest length {1000 * found.size:.0f} mm"


def test_the_shift_is_that_of_the_sign_with_which_the_nominal_run_can_be_simulated(case):
    rng = np.random.default_rng(7)
    error, inputs = 1e-3 * rng.standard_normal((256, 100, 3)), np.empty((256, 0))
    both = longer_tether_shifts(case, error, lambda: 1.0)

    def shifts(acts, rows):
        moved = both(acts, rows)
        if rows is None:
            moved[moved[:, 0, 0] > 0] = np.nan  # it tips behind a longer tether
        return moved

    found = visible_faults(case.simulated, Drawing(error, inputs, 0.99, shifts))[0]
    assert found.shift_rms_m == pytest.approx(found.size)


def test_the_largest_counts_where_the_rounds_of_the_search_do_not_agree(case):
    rng = np.random.default_rng(6)
    error, inputs = 1e-3 * rng.standard_normal((256, 100, 3)), np.empty((256, 0))

    def found_with(factor):
        drawing = Drawing(error, inputs, 0.99, longer_tether_shifts(case, error, factor))
        return visible_faults(case.simulated, drawing)[0].size

    # The rounds find 3, 1/2, 2 and 1/4 of what the nominal run says, at sizes that none of the others found.
    rounds = iter([1 / 3, 2.0, 1 / 2, 4.0])
    assert found_with(lambda: next(rounds, 1.0)) == pytest.approx(3 * found_with(lambda: 1.0), rel=0.05)


def moved_by(case, sampling, kind, size):
    """By how much a fault moves the nominal path (n, 3)."""
    sampler = sampling._sampler
    scenes = (case.scene, kind.of(size)(case.scene))
    plain, moved = sampler.batch.simulate(
        [Drawn(scene, sampler.rover_moves, case.simulated.pose[0]) for scene in scenes]
    )
    return moved - plain


def test_findings_widen_deviations_or_forbid_a_verdict():
    found = [warning("halves-disagree"), warning("mark-misfit"), warning("few_points"), warning("rung", Severity.NOTE)]
    assert widened(found) == {"camera": ("halves-disagree", "mark-misfit"), "tracking": ("few_points",)}
    assert forbidding([*found, warning("edges_not_found"), warning("edges_not_found")]) == ("edges_not_found.",)
    assert forbidding([warning("edges_not_found", Severity.NOTE)]) == ()
    assert excusing([*found, warning("rate_unconfirmed"), warning("rate_unconfirmed")]) == ("rate_unconfirmed.",)
    assert excusing([warning("rate_unconfirmed", Severity.NOTE)]) == ()
    # The clicks of a body may be half a turn off, or its end of the tether on the wrong side: then its poses are.
    assert excusing([warning("clicks_turned")]) == ("clicks_turned.",)


def test_a_widened_input_is_drawn_wider_and_said(case):
    wide = replace(case, calibration=replace(case.calibration, findings=(warning("halves-disagree"),)))
    settings = UncertaintySettings(samples=64)
    plain, wider = (UncertaintySampling(each, settings) for each in (case, wide))
    np.testing.assert_allclose(wider._sampler.roots["camera"], WIDER * plain._sampler.roots["camera"])
    found = [each for each in wider.describe(64).findings if each.code == "widened"]
    assert "camera is taken to be 3 times as large" in found[0].text
    noisy = replace(case, object_track=replace(case.object_track, findings=(warning("few_points"),)))
    sampler = UncertaintySampling(noisy, settings)._sampler
    np.testing.assert_allclose(sampler.noise_std, WIDER * plain._sampler.noise_std)


def test_runs_share_the_draws_of_what_they_share_only(case):
    settings = UncertaintySettings(samples=64)
    a, again, b = (
        UncertaintySampling(replace(case, run=name), settings).describe(64).draws for name in ("a", "a", "b")
    )
    own = np.array(["registration" in name for name in a.column_names])
    np.testing.assert_array_equal(a.inputs, again.inputs)
    np.testing.assert_array_equal(a.inputs[:, ~own], b.inputs[:, ~own])
    assert own.sum() == 6
    assert abs(np.corrcoef(a.inputs[:, own].ravel(), b.inputs[:, own].ravel())[0, 1]) < 0.2
