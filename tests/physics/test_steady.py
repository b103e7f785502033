"""The quasi-static model out of the plane against closed forms, the planar model and slow dynamics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from towval.model import FloorRegion, Ground, Patch, Sliding, Tether, TimedPath, TowedObject
from towval.model.errors import RefusedError
from towval.physics.dynamics import feedback
from towval.physics.friction_laws import Coulomb
from towval.physics.quasistatic import quasistatic_plan

MASS, G, MU, HALF = 5.0, 9.81, 0.35, 0.2
SQUARE = Patch(HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))
FEET = Patch.of([np.array([x, y]) + 0.15 * SQUARE.outline for x in (-0.16, 0.16) for y in (-0.16, 0.16)])
TETHER = Tether(0.6, 1000.0)
SHARP = Coulomb(MU, 1e-9)
ALONG = TimedPath([0.0, 10.0], [[0.0, 0.0], [1.0, 0.0]])


def block(patch=SQUARE, anchor_height=0.0, height=0.0, centre=(0.0, 0.0)):
    return TowedObject(patch, MASS, centre, 0.4 / 3, (0.2, 0.0), anchor_height, height)


# Without its lift the last two would tip, and a lift of all the friction over the edge behind would tip the second.
@pytest.mark.parametrize(("anchor_height", "rise"), [(0.1, 0.2), (0.0, 0.55), (0.6, 0.3), (0.7, 0.4)])
def test_an_inclined_tether_pulls_as_by_hand(anchor_height, rise):
    """T cos = μ (m g − T sin), with L = l0 + T/κ and sin = rise/L."""
    towed = block(anchor_height=anchor_height, height=0.2)
    plan = quasistatic_plan(towed, SHARP, ALONG, TETHER, hinge_height=anchor_height + rise)

    def unbalanced(tension):
        sine = rise / (0.6 + tension / 1000)
        return tension * np.sqrt(1 - sine**2) - MU * (MASS * G - tension * sine)

    tension = brentq(unbalanced, 1.0, 40.0, xtol=1e-13)
    length = 0.6 + tension / 1000
    reach = np.sqrt(length**2 - rise**2)
    assert plan.tether_force[0] == pytest.approx([tension * reach / length, 0.0], rel=1e-9, abs=1e-9)
    assert plan.hinge.position[-1] == pytest.approx([1.2 + reach, 0.0], abs=1e-9)


@pytest.mark.parametrize("anchor_height", [0.3, 0.45, 0.55])
def test_straight_behind_a_raised_anchor_an_object_is_drawn_straight(anchor_height):
    """The moment about the anchor rises with the heading rate there: the object would balance turning either way, too.

    The load is in front of the tracked point, the more so the higher the anchor.
    """
    plan = quasistatic_plan(
        block(anchor_height=anchor_height, height=0.2), SHARP, ALONG, TETHER, hinge_height=anchor_height
    )
    assert plan.pose[:, 2] == pytest.approx(0.0, abs=1e-9)
    assert plan.tether_force == pytest.approx(np.tile([MU * MASS * G, 0.0], (len(plan.pose), 1)), abs=1e-6)
    assert not plan.findings


def test_up_a_slope_the_pull_is_friction_and_the_weight_along_it():
    slope = 0.03
    plan = quasistatic_plan(block(height=0.1), SHARP, ALONG, TETHER, ground=Ground(slope=[slope, 0.0]))
    weight = MASS * G / np.hypot(1, slope)
    assert plan.tether_force[0] == pytest.approx([weight * (MU + slope), 0.0], rel=1e-9, abs=1e-9)


def test_a_tether_with_mass_reaches_as_far_as_its_catenary():
    """Between level ends d = H/EA l0 + 2 H/w asinh(w l0 / 2H), H = μ (m g + w l0/2)."""
    chain, weight = replace(TETHER, mass_per_length=1.0), 1.0 * G
    plan = quasistatic_plan(block(anchor_height=0.05), SHARP, ALONG, chain, hinge_height=0.05)
    pull = MU * (MASS * G + weight * 0.6 / 2)
    reach = pull / 1000 + 2 * pull / weight * np.arcsinh(weight * 0.6 / (2 * pull))
    assert np.linalg.norm(plan.tether_force[-1]) == pytest.approx(pull, rel=1e-9)
    assert plan.hinge.position[-1, 0] == pytest.approx(1.2 + reach, abs=1e-9)


def curve(speed=0.05, count=201):
    time = np.linspace(0, 1.2 / speed, count)
    along = speed * time
    return TimedPath(time, np.column_stack([along, 0.15 * np.sin(3 * along)]))


def test_with_all_effects_off_the_plan_is_that_of_the_plane(makkar):
    towed = block(centre=(-0.05, 0.05))
    plane = quasistatic_plan(towed, makkar, curve(), TETHER)
    space = quasistatic_plan(towed, makkar, curve(), TETHER, ground=Ground(slope=[1e-300, 0.0]))
    assert "heading_error_rad" not in space.statistics
    assert space.pose == pytest.approx(plane.pose, abs=1e-8)
    assert space.hinge.position == pytest.approx(plane.hinge.position, abs=1e-8)
    assert space.tether_force == pytest.approx(plane.tether_force, abs=1e-6)


@pytest.mark.parametrize(
    ("tether", "sliding"),
    [
        (replace(TETHER, damping=20.0), Sliding(Coulomb(MU, 1e-4))),
        (Tether(0.6, 1000.0, 20.0, 0.2, 0.5, 20.0), Sliding(Coulomb(MU, 1e-4), 1.1, 0.9)),
    ],
    ids=["heights and slope", "all effects"],
)
def test_behind_the_planned_hinge_slow_dynamics_keep_to_the_path(tether, sliding):
    """Four feet, heights, slope, a region of the floor: the deviation falls with the speed, for inertia is left out."""
    towed = block(FEET, 0.1, 0.15, (0.02, -0.03))
    ground = Ground(slope=[0.01, -0.02])
    apart = []
    for speed in (0.02, 0.005):
        plan = quasistatic_plan(towed, sliding, curve(speed, 1201), tether, ground=ground, hinge_height=0.25)
        motion = feedback(
            towed, sliding, tether, plan.hinge, plan.pose[0], plan.time_s, start_twist=plan.twist[0], ground=ground,
            hinge_height=0.25,
        )  # fmt: skip
        apart.append(np.abs(motion.pose - plan.pose).max())
        assert motion.tether_force[600] == pytest.approx(plan.tether_force[600], rel=0.01, abs=0.05)
    assert apart[1] < 2e-4
    assert apart[1] < 0.5 * apart[0]


def test_a_region_of_the_floor_raises_the_pull_within_it():
    ground = Ground(regions=[FloorRegion([[0.9, -2], [9, -2], [9, 2], [0.9, 2]], 1.5)])
    path = TimedPath(np.linspace(0, 20, 41), np.column_stack([np.linspace(0, 2, 41), np.zeros(41)]))
    pulls = np.linalg.norm(quasistatic_plan(block(), SHARP, path, TETHER, ground=ground).tether_force, axis=1)
    assert pulls[[0, -1]] == pytest.approx(MU * MASS * G * np.array([1.0, 1.5]), rel=1e-9)


@pytest.mark.parametrize("slope", [(0.01, 0.005), (0.05, 0.02), (-0.05, -0.02)])
def test_an_object_at_rest_on_a_slope_keeps_its_heading(slope):
    """The tether holds it as it was drawn. At a creep next to no friction would, and its weight would turn it."""
    path = TimedPath([0.0, 10.0, 20.0, 30.0], [[0.0, 0.0], [1.0, 0.2], [1.0, 0.2], [2.0, 0.0]])
    times = [0.0, 5.0, 10.0, 12.0, 15.0, 19.0, 20.0, 30.0]
    plan = quasistatic_plan(block(), Coulomb(MU, 1e-3), path, TETHER, times=times, ground=Ground(slope=slope))
    # To what the integration may err by; at a creep it turned by 0.5 mrad and more.
    assert np.ptp(plan.pose[2:6, 2]) < 1e-8
    assert not plan.twist[2:6].any()


def behind_a_high_anchor(seed):
    """A plan under a rising tether whose load comes to lie before the tracked point, so that balances come and go."""
    rng = np.random.default_rng(seed)
    centre, anchor = rng.uniform(-0.08, 0.08, 2), (0.2, rng.uniform(-0.1, 0.1))
    point, bends = (rng.uniform(-0.05, 0.2), rng.uniform(-0.1, 0.1)), rng.uniform(-1, 1, 2)
    along = np.linspace(0, 1, 41)
    curved = [1.2 * along + 0.1 * bends[0] * np.sin(3 * along), 0.2 * bends[1] * np.sin(4 * along)]
    anchor_height = rng.uniform(0, 0.4)
    hinge_height, height = anchor_height + rng.uniform(-0.1, 0.5), rng.uniform(0, 0.2)
    towed = TowedObject(SQUARE, MASS, centre, 0.13, anchor, anchor_height, height)
    path, times = TimedPath(60 * along, np.column_stack(curved)), np.linspace(0, 60, 241)
    tether = replace(TETHER, damping=60.0)
    return quasistatic_plan(towed, Coulomb(MU, 1e-3), path, tether, point=point, times=times, hinge_height=hinge_height)


def test_a_root_that_jumps_between_two_reported_times_is_reported():
    """The rate at each of the times is a balance near the one before; the heading between them is none's."""
    plan = behind_a_high_anchor(10)
    assert [each.code for each in plan.findings] == ["root_jumped"]
    assert np.abs(np.gradient(plan.pose[:, 2], plan.time_s) - plan.twist[:, 2]).max() > 0.1
    assert not behind_a_high_anchor(1).findings


def test_a_path_along_which_balances_come_and_go_is_refused():
    """Where each jump leads back to where the other balance is, steps of the heading would become ever shorter."""
    with pytest.raises(RefusedError, match=r"cannot be drawn along the path steadily(.|\n)*nearer to the anchor"):
        behind_a_high_anchor(28)


def test_an_object_that_tips_on_its_way_is_refused():
    with pytest.raises(RefusedError, match="tips over"):
        quasistatic_plan(block(anchor_height=0.7, height=0.3), SHARP, ALONG, TETHER, hinge_height=0.7)
