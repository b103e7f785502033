"""Sampling: closed forms of the shares, sensitivities against finite differences, coverage, reproducibility."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from studies.worlds.campaign import OBJECT, ROVER
from towval.model import Camera, CameraTrack, Floor, Tether, Verdict
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import pose_difference, rigid_fit, transform
from towval.model.presets import PRESETS, settings_of
from towval.model.results import UNEXPLAINED
from towval.optics.projection import project, to_plane
from towval.physics.dynamics import Outcome
from towval.selection.draws import sample_selecting
from towval.validation import scene_model, uncertainty
from towval.validation.compare import compare
from towval.validation.path_frame import OnPath
from towval.validation.sampler import Sampler, UncertaintySettings, _motions
from towval.validation.shares import variance_shares
from towval.validation.simulate import SimulateSettings, simulate
from towval.validation.simulate_many import Drawn
from towval.validation.uncertainty import BOUND_ERROR, DRAWS, UncertaintySampling, _main_input, sample_uncertainty
from validation_case import DEVIATIONS, PARAMETER_STD, SCENE


def test_shares_of_a_polynomial_are_those_of_its_coefficients():
    draws = np.random.default_rng(0).standard_normal((4000, 4))
    outputs = np.column_stack([3 * draws[:, 0] + draws[:, 1], (draws[:, 2] ** 2 - 1) / np.sqrt(2)])
    shares = variance_shares(draws, outputs, {"first": 1, "pair": 2, "idle": 1})
    # Variances 9, 1 and 1 of eleven; 4,000 draws leave a scatter of about 1/60.
    assert shares["first"] == pytest.approx(9 / 11, abs=0.03)
    assert shares["pair"] == pytest.approx(2 / 11, abs=0.03)
    assert shares["idle"] == pytest.approx(0, abs=0.01)
    assert sum(shares.values()) == pytest.approx(1, abs=1e-9)


def test_shares_of_few_draws_are_those_of_many():
    """128 draws for 101 coefficients: what the regression makes of noise is no input's."""
    names = {"first": 1, "second": 1, "idle": 30, "camera": 18}
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        draws, noise = rng.standard_normal((128, 50)), rng.standard_normal((128, 40))
        sizes = np.array([2.0, 1.0])[:, None] * np.ones((2, 40))
        found.append(variance_shares(draws, draws[:, :2] @ sizes + np.sqrt(5) * noise, names))
    mean = {name: np.mean([shares[name] for shares in found]) for name in found[0]}
    # Variances 4, 1 and 5 of ten; what is negative by chance counts as zero, so idle inputs keep a little.
    assert mean["first"] == pytest.approx(0.4, abs=0.05)
    assert mean["second"] == pytest.approx(0.1, abs=0.03)
    assert mean[UNEXPLAINED] == pytest.approx(0.5, abs=0.06)


def test_of_no_more_draws_than_coefficients_nothing_is_an_inputs():
    draws = np.random.default_rng(0).standard_normal((64, 40))
    shares = variance_shares(draws, 3 * draws[:, :1], {"first": 1, "idle": 39})
    assert shares == {"first": 0.0, "idle": 0.0, UNEXPLAINED: 1.0}
    assert list(_main_input(shares)) == []


def test_the_object_starts_as_far_off_as_its_track_is_noisy(case):
    """The start is measured like all poses: with 1.5 mm of noise a fifth of right models were rejected without this."""
    known, shares = np.diag([1e-3, 2e-3, 4e-3]) ** 2, np.diag([0.5, 0.25, 0.1]) ** 2
    # Of few frames a second the curve takes motion for noise: what counts is its share of the noise that is stated.
    curve = {
        "noise": np.full(3, 0.02),
        "covariance": np.tile(0.02**2 * shares, (len(case.object_decimated.time_s), 1, 1)),
    }
    noisy = replace(case.object_decimated, **curve)
    calm = replace(case.object_track, start_covariance=np.zeros((3, 3)), covariance=np.tile(known, (100, 1, 1)))
    exact = replace(case.calibration, covariance=np.zeros((18, 18)))
    towed = replace(case.towed, height_std_m=0.0)
    alone = replace(case, object_decimated=noisy, object_track=calm, calibration=exact, towed=towed, deviations={})
    sampler = Sampler(alone, UncertaintySettings(samples=64))
    starts = np.array([sampler.lay_out(i, np.zeros(sum(sampler.widths.values())))[0].start for i in range(600)])
    np.testing.assert_allclose(np.cov(starts.T), shares @ known, rtol=0.2, atol=3e-8)
    np.testing.assert_allclose(starts.mean(axis=0), sampler.start.pose[0], atol=1e-4)


def test_what_the_video_adds_to_the_calibration_is_drawn(case):
    """A camera that moved before the video is known as its correction is; tracks of other programs have no camera."""
    n, covariance = len(case.rover_track.time_s), case.calibration.covariance
    unknown, stamps = np.zeros((n, 4)), np.zeros(n, dtype=np.uint8)
    camera = CameraTrack(
        case.calibration.camera,
        case.calibration.floor,
        np.zeros((n, 9)),
        unknown,
        unknown,
        stamps,
        added=3 * covariance,
    )
    wider = replace(case, rover_track=replace(case.rover_track, camera=camera))
    roots = [Sampler(each, UncertaintySettings(samples=64)).roots["camera"] for each in (case, wider)]
    np.testing.assert_allclose(roots[0] @ roots[0].T, covariance, atol=1e-15)
    np.testing.assert_allclose(roots[1] @ roots[1].T, 4 * covariance, atol=1e-15)


def test_a_simulated_object_that_leaves_the_camera_s_sight_is_refused(case):
    """A hinge in millimetres takes it tens of metres away, where no pixel says what a pose depends on."""
    away = replace(case.simulated, pose=case.simulated.pose + np.array([4e4, 0.0, 0.0]))
    with pytest.raises(RefusedError, match="leaves what the camera can see") as error:
        Sampler(replace(case, simulated=away), UncertaintySettings(samples=64))
    assert "metres" in error.value.remedy
    assert error.value.got.startswith("4e+04 m")


def test_a_readout_moves_rover_and_object_as_their_corners_are_seen_late(case):
    """Each corner placed at the time of its own row, then the rigid fit: 20 ms more than stated."""
    readout_s = 0.02
    sampler = Sampler(replace(case, deviations={"readout": readout_s}), UncertaintySettings(samples=64))
    draw = np.zeros(sum(sampler.widths.values()))
    at = list(sampler.drawn).index("readout")
    draw[sum(list(sampler.widths.values())[:at])] = 1.0
    (drawn, measured), (still, unmoved) = (sampler.moved(each) for each in (draw, 0 * draw))

    def seen(body, pose, rate):
        corners = transform(pose, body.top_corners_m)
        points = np.column_stack([corners, np.full(len(corners), body.tracked_plane_height_m)])
        rows = project(case.calibration.camera, case.calibration.floor, points)[:, 1]
        late = (rows / (case.calibration.camera.resolution_px[1] - 1) - 0.5) * readout_s
        at_once = [transform(pose + rate * t, top[None])[0] for t, top in zip(late, body.top_corners_m, strict=True)]
        return rigid_fit(body.top_corners_m, np.array(at_once)) - pose

    twist = case.simulated.twist
    expected = [seen(OBJECT, *each) for each in zip(unmoved, twist, strict=True)]
    assert np.abs(expected).max() > 2e-4
    np.testing.assert_allclose(measured - unmoved, expected, atol=1e-6)
    poses, rates = np.split(still.rover, 2, axis=1)
    expected = [seen(ROVER, *each) for each in zip(poses, rates, strict=True)]
    np.testing.assert_allclose(drawn.rover[:, :3] - poses, expected, atol=1e-6)
    # The rates are those of what is seen.
    inner, times = slice(1, -1), sampler.nodes
    slopes = np.gradient(drawn.rover[:, :2] - poses[:, :2], times, axis=0)[inner]
    assert np.median(np.abs((drawn.rover[:, 3:5] - rates[:, :2])[inner] - slopes)) < 2e-4


def test_an_interaction_is_named_as_such():
    draws = np.random.default_rng(1).standard_normal((4000, 2))
    shares = variance_shares(draws, (draws[:, 0] * draws[:, 1])[:, None], {"a": 1, "b": 1})
    assert shares["noise and interactions"] > 0.95


def test_pose_sensitivities_are_those_of_a_changed_camera(calibration):
    """The tops seen at the same pixels, placed by a camera with each parameter changed in turn."""
    pose = np.array([[0.4, -0.3, 0.7], [-1.0, 0.5, -2.0]])
    motions = _motions(calibration, OBJECT, np.column_stack([pose, np.zeros((2, 3))]))
    corners = transform(pose[:, None, :], OBJECT.top_corners_m)
    height = OBJECT.tracked_plane_height_m
    points = np.concatenate([corners, np.full((*corners.shape[:2], 1), height)], axis=-1)
    pixels = project(calibration.camera, calibration.floor, points)
    T = calibration.floor.T_camera_floor
    for k, step in enumerate(PARAMETER_STD):
        if step == 0:
            continue
        change = np.zeros(18)
        change[k] = step
        matrix = calibration.camera.matrix + np.array([[change[0], 0, change[2]], [0, change[1], change[3]], [0, 0, 0]])
        moved = np.array(T)
        moved[:3, :3] = Rotation.from_rotvec(Rotation.from_matrix(T[:3, :3]).as_rotvec() + change[12:15]).as_matrix()
        moved[:3, 3] += change[15:]
        camera = Camera(calibration.camera.resolution_px, matrix, calibration.camera.distortion + change[4:12], "test")
        seen = to_plane(camera, Floor(moved), pixels, height)
        expected = np.array([rigid_fit(OBJECT.top_corners_m, s) for s in seen]) - pose
        np.testing.assert_allclose(motions.by_camera @ change, expected, atol=2e-6)


def test_a_right_model_agrees_and_the_same_seed_gives_the_same(case):
    settings = UncertaintySettings(samples=64)
    uncertainty = sample_uncertainty(case, settings)
    comparison = compare("a", case.simulated, case.object_track, uncertainty)
    assert comparison.verdict == Verdict.AGREES
    assert 0 < comparison.u_measurement_m < comparison.u_val_m < 0.01
    again = sample_uncertainty(case, replace(settings, processes=2))
    np.testing.assert_array_equal(again.validation, uncertainty.validation)
    np.testing.assert_array_equal(again.draws.error, uncertainty.draws.error)
    assert again.faults == uncertainty.faults


def test_more_draws_keep_those_that_were_made(case):
    sampling = UncertaintySampling(case, UncertaintySettings(samples=64), (counts := []).append)
    sampling.describe(64)
    twice = sampling.describe(128)
    assert counts == list(range(1, 129))
    whole = sample_uncertainty(case, UncertaintySettings(samples=128))
    np.testing.assert_array_equal(twice.validation, whole.validation)
    with pytest.raises(InputError, match="cannot be taken back"):
        sampling.describe(64)


def test_without_deviations_nothing_is_uncertain(case):
    exact = replace(
        case,
        deviations=dict.fromkeys(DEVIATIONS, 0.0),
        calibration=replace(case.calibration, covariance=np.zeros((18, 18))),
        rover=replace(ROVER, height_std_m=0.0),
        towed=replace(OBJECT, height_std_m=0.0),
        rover_track=replace(case.rover_track, start_covariance=np.zeros((3, 3))),
        object_track=replace(case.object_track, start_covariance=np.zeros((3, 3)), covariance=np.zeros((100, 3, 3))),
        rover_decimated=replace(case.rover_decimated, noise=np.full(3, 1e-12)),
        object_decimated=replace(case.object_decimated, covariance=np.zeros_like(case.object_decimated.covariance)),
    )
    uncertainty = sample_uncertainty(exact, UncertaintySettings(samples=64))
    # What is left is the integration, with a tolerance of 1e-6 m a step for the draws and 1e-7 m for the nominal run.
    assert np.sqrt(np.trace(uncertainty.validation[:, :2, :2], axis1=1, axis2=2)).max() < 1e-5
    assert np.sqrt(uncertainty.validation[:, 2, 2].max()) < 1e-4
    assert not any(share for name, share in uncertainty.shares.items() if name != UNEXPLAINED)


def test_a_longer_tether_is_found(case):
    """The tether is 10 % longer than campaign.yaml says: 60 mm, sixty deviations."""
    wrong = replace(case, scene=replace(case.scene, tether=Tether(0.66, 800.0)))
    simulated = simulate(wrong.scene, case.rover_decimated, case.object_decimated, case.object_track.time_s)
    wrong = replace(wrong, simulated=simulated)
    comparison = compare("a", simulated, case.object_track, sample_uncertainty(wrong, UncertaintySettings(samples=64)))
    assert comparison.verdict == Verdict.DISAGREES
    assert comparison.model_error_lower_m > 0.02


def test_a_huge_uncertainty_is_no_agreement(case):
    vague = replace(case, deviations=DEVIATIONS | {"hinge": 0.05, "anchor": 0.05})
    comparison = compare(
        "a", case.simulated, case.object_track, sample_uncertainty(vague, UncertaintySettings(samples=128))
    )
    assert comparison.verdict == Verdict.CANNOT_TELL
    assert "hinge (rover.tether_hinge_std_m)" in next(f.text for f in comparison.findings if f.code == "verdict")


@pytest.mark.parametrize(
    "bad",
    [
        {"samples": 100},
        {"samples": "many"},
        {"samples": 64.0},
        {"confidence": 1.0},
        {"tolerance_m": 1.0},
        {"processes": 0},
    ],
)
def test_settings_out_of_range_are_refused(bad):
    with pytest.raises(InputError, match=f"uncertainty.{next(iter(bad))}"):
        UncertaintySettings(**bad)


def test_the_numerical_uncertainty_is_in_u_val_wherever_it_is_used(case):
    """Ten millimetres of it move table, ratio and test of a run of three."""

    def sampled(u_tolerance_m):
        statistics = {**case.simulated.statistics, "u_tolerance_m": u_tolerance_m}
        given = replace(case, simulated=replace(case.simulated, statistics=statistics))
        return sample_uncertainty(given, UncertaintySettings(samples=64))

    with_it, without = sampled(0.01), sampled(0.0)
    results = [compare("a", case.simulated, case.object_track, each) for each in (with_it, without)]
    assert results[0].u_val_m == pytest.approx(np.hypot(results[1].u_val_m, 0.01), rel=1e-9)
    assert results[0].u_input_m == results[1].u_input_m
    assert results[0].ratio_max < results[1].ratio_max
    grown = with_it.draws.error - without.draws.error
    assert np.std(grown[:, 0, :2], axis=0) == pytest.approx(0.01 / np.sqrt(2), rel=0.3)
    assert not grown[..., 2].any()
    assert np.ptp(grown, axis=1).max() < 1e-15


@pytest.mark.parametrize("known", [True, False])
def test_a_right_model_on_a_simpler_rung_does_not_disagree(case, known, monkeypatch):
    """Its error has the shape of its difference from the dynamics. The control knows nothing of that: it disagrees."""
    settings = SimulateSettings(rung="quasi-static patch", rung_tolerance_m=0.5)
    simpler = simulate(SCENE, case.rover_decimated, case.object_decimated, case.simulated.time_s, settings)
    assert case.simulated.rung == "dynamics"
    assert simpler.statistics["u_num_m"] > 0.005
    if not known:
        monkeypatch.setattr(UncertaintySampling, "_shift_by_dynamics", lambda self: np.zeros_like(simpler.pose))
    found = sample_uncertainty(replace(case, simulated=simpler), UncertaintySettings(samples=256))
    result = compare("a", simpler, case.object_track, found)
    assert (result.verdict == Verdict.DISAGREES) != known
    if known:
        moved = pose_difference(case.simulated.pose, simpler.pose)
        parts = np.einsum("ni,nij,nj->n", moved, np.linalg.inv(found.validation), moved)
        assert (parts <= 1).all()


def test_where_the_dynamics_cannot_go_on_a_simpler_rung_has_no_uncertainty(case, monkeypatch):
    simpler = replace(case.simulated, rung="quasi-static patch")
    whole = scene_model.simulate_rung

    def ends_early(rung, *arguments, **named):
        motion = whole(rung, *arguments, **named)
        return replace(motion, outcome=Outcome.TIPS) if rung == "dynamics" else motion

    monkeypatch.setattr(scene_model, "simulate_rung", ends_early)
    with pytest.raises(RefusedError, match="the dynamics cannot be simulated to the end"):
        sample_uncertainty(replace(case, simulated=simpler), UncertaintySettings(samples=64))


def test_a_motion_that_is_not_of_a_run_is_an_input_error(case):
    """As that of `towval tow`, which has no tolerance and no other model to be compared with."""
    towed = replace(case, simulated=replace(case.simulated, statistics={}))
    with pytest.raises(InputError, match="not of a run"):
        sample_uncertainty(towed, UncertaintySettings(samples=64))


def test_the_main_input_is_named():
    (found,) = _main_input({"friction": 0.6, "stiffness": 0.1, UNEXPLAINED: 0.3})
    assert found.code == "main_input"
    assert found.text.startswith("60 %")
    assert found.text.endswith("friction.")
    assert list(_main_input({"friction": 0.0, UNEXPLAINED: 0.0})) == []


def test_few_draws_that_fail_are_left_out_and_counted(case):
    unsure = replace(case, deviations={**case.deviations, "load_at": 0.26})
    found = sample_uncertainty(unsure, UncertaintySettings(samples=128))
    (said,) = [one for one in found.findings if one.code == "draws_left_out"]
    assert said.text.startswith(f"{128 - found.samples} draws")
    assert "outside" in said.text, "the reason"


def test_a_draw_that_is_no_number_is_left_out_with_its_reason(case):
    sampler = Sampler(case, UncertaintySettings(samples=64))
    whole, start = sampler.rover_moves, sampler.start.pose[0]
    lost = Drawn(case.scene, np.where(np.arange(len(whole))[:, None] > 5, np.nan, whole), start)
    first, second = sampler.batch.simulate([Drawn(case.scene, whole, start), lost])
    assert np.isfinite(first).all()
    assert np.isnan(second).all()
    assert "not finite" in sampler.batch.failure(lost)


def test_a_run_of_which_a_part_of_the_draws_fails_is_not_judged(case):
    """A load of 1.5 kg on 4 kg tips it where both have their centre beyond the edge: at 917 mm in x, 642 mm in y."""
    unsure = replace(case, deviations={**case.deviations, "load_at": 0.4})
    found = sample_uncertainty(unsure, UncertaintySettings(samples=128))
    edge, at = np.array([0.25, 0.175]) * 5.5 / 1.5, case.scene.load.at
    stands = np.prod(norm.cdf((edge - at) / 0.4) - norm.cdf((-edge - at) / 0.4))
    failed, expected = 128 - found.samples, 128 * (1 - stands)
    assert 12 < expected < 30
    assert failed == pytest.approx(expected, abs=2 * np.sqrt(expected))
    (said,) = [one for one in found.findings if one.code == "draws_fail"]
    assert said.text.startswith(f"{failed} of 128 draws could not be simulated")
    assert "outside" in said.text, "the reason"
    result = compare("a", case.simulated, case.object_track, found)
    assert result.verdict == Verdict.NOT_JUDGED
    assert said.text in result.findings[0].text
    assert np.isfinite(result.error_upper_m)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_draft_is_not_judged_and_says_what_to_do(case, preset):
    """The run agrees under every other preset, by as few draws."""
    settings = UncertaintySettings(**settings_of(preset, "uncertainty", {"samples": 64}))
    found = sample_uncertainty(case, settings)
    result = compare("a", case.simulated, case.object_track, found)
    said = [one.text for one in found.findings if one.code == "draft_settings"]
    assert len(said) == (preset == "draft")
    assert result.verdict == (Verdict.NOT_JUDGED if said else Verdict.AGREES)
    for text in said:
        assert text in result.findings[0].text
        assert "0.01 mm a step" in text
        assert "preset standard" in text
        assert "draft_settings" in result.warnings
    assert np.isfinite(result.error_upper_m)


def test_a_spread_of_the_few_draws_that_can_be_simulated_is_refused(case):
    unsure = replace(case, deviations={**case.deviations, "load_at": 3.0})
    with pytest.raises(RefusedError, match=r"(?s)cannot be sampled.*: \d+ of 64 draws.*less than 50 %"):
        sample_uncertainty(unsure, UncertaintySettings(samples=64))


def test_draws_are_added_until_the_bounds_are_known_well_enough(case):
    found = sample_selecting(case, UncertaintySettings(), measurement_m=1e-3)
    path = OnPath.of(case.object_track, case.simulated, found.draws)
    left_open = path.bound_error(0.95)
    assert left_open <= BOUND_ERROR
    count = next(each for each in DRAWS if each >= found.samples)  # a few draws cannot be simulated
    assert found.choices[0].chosen == f"{count}: bounds known to {100 * left_open:.1f} % (one standard error)"
    fewest = UncertaintySampling(case, UncertaintySettings()).describe(DRAWS[0])
    known = OnPath.of(case.object_track, case.simulated, fewest.draws).bound_error(0.95)
    assert count == DRAWS[0] or known > BOUND_ERROR


def test_of_long_runs_paths_are_kept_at_some_times_and_covariances_at_all(case, monkeypatch):
    """The paths of 512 draws of 20 minutes at all times would take a gigabyte."""
    settings = UncertaintySettings(samples=64)
    short = UncertaintySampling(case, settings).describe(64)
    monkeypatch.setattr(uncertainty, "_KEPT_TIMES", 25)
    sampling = UncertaintySampling(case, settings)
    long = sampling.describe(64)
    for name in ("measurement", "simulation", "validation"):
        np.testing.assert_array_equal(getattr(long, name), getattr(short, name))
    kept = short.draws.rows[::4]
    np.testing.assert_array_equal(long.draws.rows, kept)
    np.testing.assert_array_equal(long.draws.measurement, short.draws.measurement[:, kept])
    assert {len(path) for path in (*sampling._made.simulated, *sampling._made.measured)} == {25}
    off = short.draws.measurement
    mean_square = np.einsum("kni,knj->nij", off, off) / len(off)
    np.testing.assert_allclose(short.measurement, mean_square, rtol=1e-12)
