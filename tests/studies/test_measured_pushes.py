"""Pushes with a known answer: Coulomb's points, their limit surface, families of pressure, and what identifies them."""

import numpy as np
import pandas as pd
import pytest

from footprints import rectangle
from oracles import SQUARE_SPIN_M
from studies.comparators.limit_surface import limit_surface_wrench
from studies.real.ellipsoid import fitted_ellipsoid, matrix, point_limit_surface, surface_pushing_wrench, surface_twist
from studies.real.feet_study import SPREAD_LIMIT_DEG, WEIGHT_N, course_errors_deg, push_rows, scale_rows
from studies.real.measured_pushes import SLOW_M
from studies.real.one_parameter import between_groups, cross_validated, identified
from studies.real.point_friction import (
    dissipation,
    facet_angle_deg,
    foot_loads,
    gauge,
    loads_while_sliding,
    pushing_wrench,
    resting_point,
    sliding_twist,
    slowest_path_m,
    wrench_spread_deg,
)
from studies.real.program_pushes import PushedBody, shrinking_feet
from studies.real.push_data import (
    MASS_KG,
    OUTLINE,
    PROGRAMMED_HEIGHT_M,
    STATED_FRICTION,
    TIP_HEIGHT_M,
    PushLog,
    angle_deg,
    read_logs,
    scaled_twist,
    scaled_wrench,
)
from studies.real.sole_pressure import (
    corner_loads,
    friction_radius,
    lobe_loads,
    push_errors_deg,
    radius_loads,
    sole,
    wrench_while_sliding,
)
from studies.tables import measured_pushes
from towval.model import Patch
from towval.model.errors import RefusedError
from towval.physics.contact import pressure_plane
from towval.physics.friction_laws import Coulomb
from towval.physics.limit_surface import limit_surface
from towval.physics.wrench import friction_wrench, sliding_patch

FEET = np.array([[-0.04, -0.04], [0.08, -0.04], [-0.04, 0.08]])
LOADS = np.array([4.0, 5.0, 6.0])


def random_twists(count, seed=3):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.normal(0, 1, (count, 2)), rng.normal(0, 20, count)])


def synthetic_log(feet, count, height=0.015, noise=0.0, seed=5):
    """Pushes that follow Coulomb's law at the feet, with wrenches turned by noise [rad] in the scaled space."""
    rng = np.random.default_rng(seed)
    twists = random_twists(count, seed) * 0.008
    wrenches = []
    for twist in twists:
        loads = loads_while_sliding(feet, WEIGHT_N, twist, height, STATED_FRICTION)
        wrench = STATED_FRICTION * pushing_wrench(feet, loads, twist)
        size = np.linalg.norm(scaled_wrench(wrench))
        wrenches.append(wrench + noise * size * rng.normal(size=3) * (1, 1, 0.05))
    return PushLog("synthetic", feet, twists, np.array(wrenches))


def test_twist_and_wrench_invert_each_other_where_all_feet_slide():
    for twist in random_twists(200):
        found = sliding_twist(FEET, LOADS, pushing_wrench(FEET, LOADS, twist))
        # the wrench fixes the twist only as well as its rounding: 1e-16 over the least curvature of the limit surface
        assert angle_deg(scaled_twist(found), scaled_twist(twist)) < 1e-4


def test_the_twist_takes_no_less_power_than_any_other():
    rng = np.random.default_rng(1)
    for _ in range(40):
        wrench = rng.normal(size=3) * (1, 1, 0.05)
        best = gauge(FEET, LOADS, wrench)
        for twist in random_twists(200, seed=int(rng.integers(1e6))):
            assert wrench @ twist / dissipation(FEET, LOADS, twist) <= best * (1 + 1e-12)


def test_pure_translation_and_a_pair_of_points_by_hand():
    centre = LOADS @ FEET / LOADS.sum()
    # A force through the centre of pressure: no rotation.
    twist = sliding_twist(FEET, LOADS, [3.0, 4.0, centre[0] * 4.0 - centre[1] * 3.0])
    np.testing.assert_allclose(25 * twist, [3.0, 4.0, 0.0], atol=1e-5)
    # A couple on 1 N at each corner of an equilateral triangle: it turns about the middle, D = 3 a ω.
    angle = np.radians([90.0, 210.0, 330.0])
    feet = 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    twist = sliding_twist(feet, np.ones(3), [0.0, 0.0, 0.5])
    np.testing.assert_allclose(twist, [0.0, 0.0, 2.0], atol=1e-6)
    assert gauge(feet, np.ones(3), [0.0, 0.0, 0.5]) == pytest.approx(0.5 / 0.3, rel=1e-9)


def test_every_wrench_of_a_facet_turns_about_its_foot_and_is_found_to():
    about = np.array([FEET[1, 1], -FEET[1, 0], 1.0])
    others = pushing_wrench(np.delete(FEET, 1, 0), np.delete(LOADS, 1), about)
    rng = np.random.default_rng(2)
    for part in (0.0, 0.5, 0.999, 1.001, 1.5):
        angle = rng.uniform(0, 2 * np.pi)
        fx, fy = part * LOADS[1] * np.array([np.cos(angle), np.sin(angle)])
        wrench = others + np.array([fx, fy, FEET[1, 0] * fy - FEET[1, 1] * fx])
        rests = resting_point(FEET, LOADS, wrench)
        twist = sliding_twist(FEET, LOADS, wrench)
        if part < 1:
            assert rests == 1
            assert slowest_path_m(FEET, twist) < 1e-12
            assert gauge(FEET, LOADS, wrench) == pytest.approx(1.0, rel=1e-12)
            assert facet_angle_deg(FEET, LOADS, wrench, 1) == 0.0
        else:
            assert rests is None
            assert 0 < facet_angle_deg(FEET, LOADS, wrench, 1) < 45


def test_wrench_is_ill_posed_near_a_foot_only():
    near = np.array([FEET[1, 1] + 0.001, -FEET[1, 0], 1.0]) * 0.1
    far = np.array([0.0, 0.01, 0.02])
    assert wrench_spread_deg(FEET, LOADS, near, 0.0008) > 10
    assert wrench_spread_deg(FEET, LOADS, far, 0.0008) < 10


def test_loads_balance_weight_and_push_and_lift_at_the_edge():
    force = np.array([3.0, -1.0])
    loads = foot_loads(FEET, WEIGHT_N, force, 0.015)
    assert loads.sum() == pytest.approx(WEIGHT_N, rel=1e-12)
    np.testing.assert_allclose(loads @ FEET, 0.015 * force, rtol=1e-9)
    twist = np.array([0.004, 0.003, 0.05])
    sliding = loads_while_sliding(FEET, WEIGHT_N, twist, 0.015, 0.3)
    np.testing.assert_allclose(sliding @ FEET, 0.015 * 0.3 * pushing_wrench(FEET, sliding, twist)[:2], rtol=1e-9)
    tipping = foot_loads(FEET, WEIGHT_N, [20.0, 20.0], 0.2)
    assert tipping.min() == 0.0
    assert tipping.sum() == pytest.approx(WEIGHT_N, rel=1e-12)


def test_the_limit_surface_is_the_one_of_the_package():
    contact = pressure_plane(Patch(OUTLINE), [(WEIGHT_N, (0.003, -0.002))])
    of = sole(OUTLINE, 0.003)
    loads = radius_loads(of, 1.0)(WEIGHT_N, contact.centre)[1]
    ours = point_limit_surface(of.places, loads)
    assert ours.radius == pytest.approx(limit_surface(sliding_patch(contact, Coulomb(1.0, 1e-9))).radius, rel=1e-3)
    twist = np.array([0.3, -0.2, 4.0])
    turned = surface_twist(ours, surface_pushing_wrench(ours, twist))
    assert angle_deg(turned, twist) < 1e-9


def test_the_limit_surface_is_exact_in_translation_and_rotation():
    law, square = Coulomb(0.35, 1e-3), rectangle(0.4, 0.4)
    off_centre, slow = sliding_patch(pressure_plane(square, [(49.05, (0.04, 0.02))]), law), (0.06, -0.08, 0.0)
    found = limit_surface_wrench(limit_surface(off_centre), slow)
    assert found == pytest.approx(friction_wrench(off_centre, slow), rel=1e-9, abs=1e-9)
    centred, spin = sliding_patch(pressure_plane(square, [(49.05, (0, 0))]), law), (0.0, 0.0, 1e3)
    found = limit_surface_wrench(limit_surface(centred), spin)
    assert found == pytest.approx(friction_wrench(centred, spin), rel=1e-6, abs=1e-6)
    assert limit_surface(centred).radius == pytest.approx(SQUARE_SPIN_M, rel=1e-9)


def test_cells_agree_with_the_boundary_integral():
    contact = pressure_plane(Patch(OUTLINE), [(WEIGHT_N, (0.003, -0.002))])
    exact = sliding_patch(contact, Coulomb(1.0, 1e-9))
    places, loads = radius_loads(sole(OUTLINE, 0.008), 1.0)(WEIGHT_N, contact.centre)
    for twist in random_twists(20):
        ours, reference = pushing_wrench(places, loads, twist), -friction_wrench(exact, twist)
        assert angle_deg(scaled_wrench(ours), scaled_wrench(reference)) < 0.3  # cells of 8 mm


def test_families_have_one_resultant_and_meet_at_the_planar_pressure():
    of, centre = sole(OUTLINE, 0.006), np.array([0.002, -0.001])
    planar = radius_loads(of, 1.0)(WEIGHT_N, centre)
    np.testing.assert_allclose(lobe_loads(of, 1.0)(WEIGHT_N, centre)[1], planar[1], rtol=1e-9)
    np.testing.assert_allclose(corner_loads(of, 0.0)(WEIGHT_N, centre)[1][: len(planar[1])], planar[1], rtol=1e-12)
    radii = []
    for loads in (radius_loads(of, 1.2), corner_loads(of, 0.3), lobe_loads(of, 0.3)):
        places, forces = loads(WEIGHT_N, centre)
        assert forces.sum() == pytest.approx(WEIGHT_N, rel=1e-12)
        np.testing.assert_allclose(forces @ places / WEIGHT_N, centre, atol=1e-12)
        radii.append(friction_radius(places, forces) / friction_radius(*planar))
    assert min(radii) > 1.15


@pytest.mark.parametrize(
    ("family", "grid", "truth"), [(radius_loads, (0.8, 1.5), 1.25), (corner_loads, (0.0, 0.5), 0.2)]
)
def test_the_pressure_that_made_the_pushes_is_identified(family, grid, truth):
    of, rng = sole(OUTLINE, 0.02), np.random.default_rng(11)
    twists = random_twists(16, seed=12)
    made = [wrench_while_sliding(family(of, truth), WEIGHT_N, t, 0.015, 0.3) * 0.3 for t in twists]
    noisy = [w + 0.05 * np.linalg.norm(scaled_wrench(w)) * rng.normal(size=3) * (1, 1, 0.05) for w in made]
    values = np.linspace(*grid, 11)
    errors = [sum(push_errors_deg(family(of, p), WEIGHT_N, (np.array(noisy), twists), 0.015, 0.3)) / 2 for p in values]
    found = identified(values, np.array(errors), draws=500)
    assert abs(found.value - truth) < 3 * found.bootstrap_std
    assert 0 < found.bootstrap_std < 0.25 * (grid[1] - grid[0])


def test_stated_intervals_cover_the_truth():
    """80 sets of pushes, scale of the feet 1: a 95 % interval of 40 pushes has to cover in about 95 % of them."""
    grid, rng, covered = np.linspace(0.7, 1.4, 29), np.random.default_rng(21), 0
    twists = np.array([t for t in random_twists(300, seed=22) if slowest_path_m(FEET, t) > 0.2][:40])
    at_rest = foot_loads(FEET, WEIGHT_N, np.zeros(2), 0.0)
    true = np.array([pushing_wrench(FEET, at_rest, t) for t in twists])
    models = np.array([[scaled_wrench(pushing_wrench(s * FEET, at_rest, t)) for t in twists] for s in grid])
    for _ in range(80):
        noise = 0.08 * np.linalg.norm(scaled_wrench(true), axis=1)[:, None] * rng.normal(size=true.shape)
        found = identified(grid, angle_deg(models, scaled_wrench(true) + noise), seed=int(rng.integers(1e6)), draws=300)
        covered += found.interval[0] <= 1.0 <= found.interval[1]
    # Binomial(80, 0.95): below 70 with a probability of 0.2 %.
    assert covered >= 70


def test_a_study_of_synthetic_pushes_finds_what_made_them():
    log = synthetic_log(FEET, 25)
    rows = push_rows(log, 0.015)
    # By the package, whose feet are 0.1 mm wide; the pushes are of points.
    assert rows.twist_deg.max() < 0.2
    assert rows.wrench_deg.max() < 0.01
    assert rows.closed_form_deg.max() < 0.2
    np.testing.assert_allclose(rows.friction_by_wrench, STATED_FRICTION, rtol=1e-4)
    np.testing.assert_allclose(rows.friction_by_power, STATED_FRICTION, rtol=1e-4)
    np.testing.assert_allclose(rows.friction_by_size, STATED_FRICTION, rtol=1e-4)
    assert push_rows(log, 0.0).twist_deg.mean() > 0.5  # the push's height is seen


def test_a_course_of_changing_wrenches_gives_the_sum_of_its_twists():
    log = synthetic_log(FEET, 2)
    course = np.column_stack([log.wrench, (log.wrench * log.twist).sum(axis=1)])
    whole = PushLog("course", FEET, log.twist.sum(axis=0)[None], log.wrench[:1], (course,))
    assert course_errors_deg(whole, 0.015)[0] < 0.1


def test_the_package_takes_a_push_that_lifts_a_foot_to_be_lower():
    wrench = np.array([20.0, 20.0, 0.3])
    loads = foot_loads(FEET, WEIGHT_N, wrench, 0.02)
    assert loads.min() == 0
    found, _ = PushedBody(shrinking_feet(FEET), MASS_KG, 0.02, STATED_FRICTION).twist(wrench)
    assert angle_deg(scaled_twist(found), scaled_twist(sliding_twist(FEET, loads, wrench))) < 2
    with pytest.raises(RefusedError, match="tips"):
        PushedBody(shrinking_feet(FEET), MASS_KG, 0.5, STATED_FRICTION).twist(wrench)


def test_scale_of_the_feet_is_one_for_pushes_that_have_it():
    logs = [synthetic_log(FEET, 15, noise=0.05, seed=seed) for seed in (31, 32)]
    table, (mean, std, _) = scale_rows(logs, 0.015)
    assert abs(mean - 1) < 3 * std
    assert (table.bootstrap_std > 0).all()


def test_a_fitted_ellipsoid_is_the_one_that_made_the_directions():
    truth = np.array([0.3, -0.2, 0.1, 0.4, -0.3])
    wrenches = np.random.default_rng(4).normal(size=(30, 3))
    found = fitted_ellipsoid(wrenches, wrenches @ matrix(truth))
    np.testing.assert_allclose(found, truth, atol=1e-6)


def test_scatter_between_groups_is_found_and_not_invented():
    rng = np.random.default_rng(8)
    stds = np.full(200, 0.01)
    mean, std, scatter = between_groups(0.3 + rng.normal(0, np.hypot(0.01, 0.02), 200), stds)
    assert abs(mean - 0.3) < 3 * std
    assert scatter == pytest.approx(0.02, rel=0.2)
    assert between_groups(0.3 + rng.normal(0, 0.01, 200), stds)[2] < 0.006


def test_cross_validation_never_judges_a_push_by_its_own_choice():
    errors = np.eye(4) * -1.0 + 1.0  # parameter i is perfect for push i alone
    assert (cross_validated(np.arange(4.0), errors, errors, folds=4) == 1.0).all()


def test_without_the_data_the_table_says_so(tmp_path, capsys):
    assert measured_pushes.main([str(tmp_path)]) == 0
    assert "skipped" in capsys.readouterr().out


@pytest.mark.shared
def test_the_measured_pushes_are_predicted_as_stated(shared_dir):
    """Medians and means that docs/evidence.md states, from the feet as stated and the tip at 15 mm."""
    folder = shared_dir / "real" / "mlab_pushes"
    if not folder.is_dir():
        pytest.skip(f"no measured pushes at {folder}")
    logs = [log for log in read_logs(folder) if len(log.feet)]
    rows = pd.concat([push_rows(log, TIP_HEIGHT_M) for log in logs])
    moving, near = rows[rows.slowest_path_m > SLOW_M], rows[rows.wrench_spread_deg > SPREAD_LIMIT_DEG]
    assert (len(rows), len(moving), len(near)) == (259, 152, 111)
    assert (rows.twist_deg.median(), rows.twist_deg.mean()) == pytest.approx((5.29, 8.77), abs=0.01)
    assert moving.wrench_deg.median() == pytest.approx(5.44, abs=0.01)
    assert near.wrench_deg.median() == pytest.approx(20.5, abs=0.1)  # near a foot the twist does not fix the wrench
    assert near.twist_deg.median() == pytest.approx(2.23, abs=0.01)  # but the wrench the twist
    courses = np.concatenate([course_errors_deg(log, PROGRAMMED_HEIGHT_M) for log in logs])
    assert (np.median(courses), courses.mean()) == pytest.approx((5.27, 8.34), abs=0.01)
