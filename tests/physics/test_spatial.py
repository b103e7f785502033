"""The tow in three dimensions against closed forms, differences, quadrature and the planar model."""

import numpy as np
import pytest

from oracles import LAP_FINAL_POSE, SQUARE_SPIN_M
from studies.tables.lap_effects import LAP, tows
from towval.model import FloorRegion, Ground, Patch, Sliding, Tether, TimedPath, TowedObject
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import transform
from towval.physics.dynamics import Accuracy, Outcome, feedback, feedforward
from towval.physics.friction_laws import Coulomb, Makkar, risen_law
from towval.physics.motion import FORCED, SLACK, TAUT
from towval.physics.spatial.holding import holding_margin
from towval.physics.spatial.pressure import BALANCED, LIFTED, TIPS
from towval.physics.spatial.problem import tow_problem
from towval.physics.spatial.rates import acceleration_slopes, accelerations, tautness
from towval.physics.spatial.soles import MOMENTS, work_for
from towval.physics.spatial.tow import Sticking
from towval.physics.spatial.unit_wrenches import W, unit_wrenches
from towval.physics.splines import hermite_spline, piece_at, spline_through

MASS, GRAVITY, MU, HALF = 5.0, 9.81, 0.35, 0.2
WEIGHT = MASS * GRAVITY
SHARP = Coulomb(MU, 1e-9)
TETHER = Tether(0.6, 1000.0, 10.0)
LEVEL = Ground()
SLANTED = FloorRegion([[0.01, -9], [9, -8], [9, 9], [-0.03, 9]], 1.4)  # its edge passes under the object at 0
SQUARE = Patch(HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))
FEET = Patch.of([np.array([x, y]) + 0.15 * SQUARE.outline for x in (-0.16, 0.16) for y in (-0.16, 0.16)])


def block(patch=SQUARE, anchor_height=0.0, height=0.0, centre=(0.0, 0.0), anchor=(0.2, 0.0)):
    return TowedObject(patch, MASS, centre, 0.4 / 3, anchor, anchor_height, height)


def constant(force):
    return spline_through(TimedPath([0.0, 1000.0], np.tile(force, (2, 1))))


def forced(towed, force, law=SHARP, ground=LEVEL, hold=(0.0, 0.0)):
    sliding = law if isinstance(law, Sliding) else Sliding(law)
    problem = tow_problem(towed, sliding, TETHER, ground, towed.anchor_height, constant(force), hold)
    return problem, work_for(problem.soles, problem.regions)


def rates(problem, work, state, mode=FORCED, time=1.0):
    out = np.zeros(6)
    balance = accelerations(problem, mode, time, piece_at(problem.drive.knots, time, 0), np.array(state), work, out)
    return balance, out


def resultant(problem, work):
    """Normal force and its place about G."""
    m, x = work.moments, work.pressure
    force = m[:3] @ x
    return force, np.array([m[[1, 3, 4]] @ x, m[[2, 4, 5]] @ x]) / force


SLIDING_ALONG = (0.0, 0.0, 0.0, 0.1, 0.0, 0.0)


@pytest.mark.parametrize("height", [0.0, 0.2, 0.5])
def test_a_block_towed_at_a_height_stands_further_ahead_by_mu_h(height):
    problem, work = forced(block(anchor_height=0.1, height=height), (MU * WEIGHT, 0.0))
    balance, out = rates(problem, work, SLIDING_ALONG)
    force, place = resultant(problem, work)
    assert balance == BALANCED
    assert force == pytest.approx(WEIGHT, rel=1e-12)
    assert place == pytest.approx([MU * 0.1, 0.0], abs=1e-12)
    assert out[3:] == pytest.approx(np.zeros(3), abs=1e-10)


def test_a_block_tips_where_the_tow_point_is_at_a_over_mu():
    tipping = HALF / MU
    for share, expected in ((0.9, BALANCED), (0.99, BALANCED), (1.001, TIPS), (1.5, TIPS)):
        problem, work = forced(block(anchor_height=share * tipping, height=0.3), (MU * WEIGHT, 0.0))
        assert rates(problem, work, SLIDING_ALONG)[0] == expected


def test_a_part_that_lifts_off_leaves_the_pressure_of_the_closed_form():
    """Load at e beyond the kern: a wedge over 3 (a − e), p_max = 2 N / (3 b (a − e))."""
    problem, work = forced(block(anchor_height=0.4, height=0.3), (MU * WEIGHT, 0.0))
    assert rates(problem, work, SLIDING_ALONG)[0] == BALANCED
    remaining = HALF - MU * 0.4
    assert work.pressure[0] + HALF * work.pressure[1] == pytest.approx(2 * WEIGHT / (1.2 * remaining), rel=1e-9)
    assert work.moments[0] == pytest.approx(0.4 * 3 * remaining, rel=1e-9)


@pytest.mark.parametrize("behind", [0.08, 0.14, 0.18])
def test_a_block_jerked_forward_at_the_floor_stands_on_its_rear(behind):
    """Jerk T at the floor, G at h: the load is h (T / N − μ) behind G, a wedge over 3 (a − e) as above."""
    height = 0.1
    for turn in (0.0, 2.0):
        ahead = np.array([np.cos(turn), np.sin(turn)])
        problem, work = forced(block(height=height), (MU + behind / height) * WEIGHT * ahead)
        balance, _ = rates(problem, work, (0.0, 0.0, turn, *(0.1 * ahead), 0.0))
        force, place = resultant(problem, work)
        assert balance == BALANCED
        assert force == pytest.approx(WEIGHT, rel=1e-10)
        assert place == pytest.approx([-behind, 0.0], abs=1e-10)
        assert work.moments[0] == pytest.approx(0.4 * 3 * (HALF - behind), rel=1e-8)


def test_an_inclined_tether_takes_its_vertical_part_off_the_load():
    rise, distance = 0.3, 0.55
    hinge = spline_through(TimedPath([0.0, 10.0], [[HALF + distance, 0.0]] * 2))
    problem = tow_problem(block(), Sliding(SHARP), Tether(0.6, 1000.0), LEVEL, rise, hinge)
    work, state = work_for(problem.soles, problem.regions), np.array(SLIDING_ALONG)
    balance, out = rates(problem, work, state, TAUT)
    length, _, tension = tautness(problem, 1.0, 0, state)
    assert length == pytest.approx(np.hypot(rise, distance), rel=1e-14)
    force, _ = resultant(problem, work)
    assert balance == BALANCED
    assert force == pytest.approx(WEIGHT - tension * rise / length, rel=1e-12)
    assert out[3] == pytest.approx((tension * distance / length - MU * force) / MASS, rel=1e-12)


def test_a_block_slides_down_a_slope_from_the_angle_of_friction_on():
    static = 0.4
    for steeper, holds in ((-1e-9, True), (1e-9, False)):
        ground = Ground(slope=[static * (1 + steeper), 0.0])
        problem, work = forced(block(height=0.2), (0.0, 0.0), ground=ground, hold=(static, 1e-4))
        margin = holding_margin(problem, True, 1.0, 0, np.zeros(6), work, np.zeros(3))
        assert (margin > 0) == holds
        assert abs(margin) < 2e-9
    slope = 0.5
    problem, work = forced(block(height=0.1), (0.0, 0.0), ground=Ground(slope=[slope, 0.0]))
    _, out = rates(problem, work, (0, 0, 0, -0.1, 0, 0))
    angle = np.arctan(slope)
    assert out[3] == pytest.approx(-GRAVITY * (np.sin(angle) - MU * np.cos(angle)), rel=1e-12)


def test_on_a_slope_a_path_across_it_turns_downhill_as_by_hand():
    """Point friction: ẍ = −g sin − μ g cos v_x/|v| downhill, ÿ = −μ g cos v_y/|v| across."""
    slope, speed, law = 0.1, 0.4, Coulomb(MU, 1e-4)
    point = Patch(1e-5 * SQUARE.outline)
    towed = TowedObject(point, MASS, (0, 0), 1.0, (0, 0))
    ground, times = Ground(slope=[slope, 0.0]), np.linspace(0, 0.1, 11)
    none = TimedPath([0.0, 1.0], np.zeros((2, 2)))
    motion = feedforward(
        towed, law, none, (0, 0, 0), times, start_twist=(0, speed, 0), ground=ground, accuracy=Accuracy(1e-11)
    )
    v, x, h = np.array([0.0, speed]), np.zeros(2), 1e-6
    along, normal = GRAVITY * slope / np.hypot(1, slope), GRAVITY / np.hypot(1, slope)
    for _ in range(100_000):
        middle = v + h / 2 * (-MU * normal * v / np.hypot(*v) - [along, 0])
        v, x = v + h * (-MU * normal * middle / np.hypot(*middle) - [along, 0]), x + h * middle
    assert motion.pose[-1, :2] == pytest.approx(x, abs=1e-8)


def test_four_feet_carry_their_moments():
    """A plane over four feet: each carries N/4 (1 + x_i G_x/k² + y_i G_y/k²), k² = 0.16² + b²/12."""
    centre, side = np.array([0.03, -0.02]), 0.06
    problem, work = forced(block(FEET, centre=centre), (0.0, 0.0))
    _, _ = rates(problem, work, SLIDING_ALONG, SLACK)
    k2 = 0.16**2 + side**2 / 12
    for foot in FEET.outlines:
        middle = foot.mean(axis=0)
        load = side**2 * (work.pressure[0] + work.pressure[1:] @ (middle - centre))
        assert load == pytest.approx(WEIGHT / 4 * (1 + middle @ centre / k2), rel=1e-9)


def test_what_friction_holds_is_the_limit_surface():
    problem, work = forced(block(anchor=(0.2, 0.0)), (0.0, 0.0), hold=(MU, 1e-4))
    rng, twist = np.random.default_rng(3), np.zeros(3)
    # A pure pull through G: μN. A pull at the anchor, against a search over all twists.
    for pull in ((0.999999999 * MU * WEIGHT, True), (1.000000001 * MU * WEIGHT, False)):
        problem, work = forced(block(anchor=(0.0, 0.0)), (pull[0], 0.0), hold=(MU, 1e-4))
        assert (holding_margin(problem, True, 1.0, 0, np.zeros(6), work, twist) > 0) == pull[1]
    problem, work = forced(block(anchor=(0.2, 0.1)), (6.0, 8.0), hold=(MU, 1e-4))
    margin = holding_margin(problem, True, 1.0, 0, np.zeros(6), work, np.zeros(3))
    wrench, least = np.array([6.0, 8.0, 0.2 * 8 - 0.1 * 6]), np.inf
    twists = rng.normal(size=(4000, 3)) * (1, 1, 5)
    for xi in twists * np.sign(twists @ wrench)[:, None]:
        unit_wrenches(problem.soles, problem.holding, *xi, work)
        least = min(least, -(work.matrices[W] @ work.pressure) @ xi / (xi @ wrench) - 1)
    assert margin <= least
    assert margin == pytest.approx(least, abs=0.01)


def test_a_pure_moment_is_held_up_to_that_of_the_square():
    far = 1e6  # A force this far away is a moment.
    moment = MU * WEIGHT * SQUARE_SPIN_M
    problem, work = forced(block(anchor=(0.0, -far)), (moment / far, 0.0), hold=(MU, 1e-4))
    assert holding_margin(problem, True, 1.0, 0, np.zeros(6), work, np.zeros(3)) == pytest.approx(0, abs=1e-6)


def test_half_the_limit_for_ten_minutes_moves_nothing():
    towed, times = block(anchor_height=0.1, height=0.15), [0.0, 300.0, 600.0]
    law, sticking = risen_law(0.4, MU, 1e-4, 0.01), Sticking(0.4, 2e-4)
    pull = TimedPath([0.0, 600.0], [[0.5 * 0.4 * WEIGHT, 0.0]] * 2)
    motion = feedforward(towed, law, pull, (0.1, 0.2, 0.3), times, sticking=sticking, ground=Ground(slope=[1e-3, 0]))
    assert (motion.pose == motion.pose[0]).all()
    hinge = TimedPath([0.0, 600.0], [[0.8 + 0.5 * 0.4 * WEIGHT / 1000, 0.0]] * 2)
    motion = feedback(block(), law, TETHER, hinge, (0, 0, 0), times, sticking=sticking)
    assert motion.outcome == Outcome.CONVERGED
    assert (motion.pose == 0).all()
    # The same without sticking creeps.
    assert feedforward(towed, law, pull, (0, 0, 0), times).pose[-1, 0] > 1e-3


def test_friction_lets_go_at_its_limit():
    """A hinge that drives off at 0.5 mm/s: in a straight line through G the pull grows to μ_s N, and hardly above."""
    static, times = 0.4, np.linspace(0, 4, 4001)
    hinge = TimedPath([0.0, 4.0], [[0.8185, 0.0], [0.8205, 0.0]])
    law = risen_law(static, MU, 1e-5, 0.01)
    motion = feedback(block(), law, Tether(0.6, 1000.0), hinge, (0, 0, 0), times, sticking=Sticking(static, 2e-5))
    assert motion.statistics["break_aways"] >= 1
    pulls = np.linalg.norm(motion.tether_force, axis=1)
    assert pulls.max() == pytest.approx(static * WEIGHT, rel=2e-3)
    moving = np.flatnonzero(motion.pose[:, 0] > 0)[0]
    assert pulls[moving - 1] <= static * WEIGHT * (1 + 1e-9)
    assert pulls[moving] == pytest.approx(static * WEIGHT, rel=1e-4)


@pytest.mark.parametrize("patch", [SQUARE, FEET], ids=["sole", "feet"])
@pytest.mark.parametrize(
    "regions", [(), (FloorRegion([[0.01, -9], [9, -8], [9, 9], [-0.03, 9]], 1.4),)], ids=["", "region"]
)
@pytest.mark.parametrize(("across", "lever", "mass"), [(1.0, 1.0, 0.0), (1.04, 0.8, 0.0), (1.04, 0.8, 1.0)])
def test_slopes_are_those_of_differences(patch, across, lever, mass, regions):
    rng, time = np.random.default_rng(1), np.linspace(0, 40, 401)
    drive = spline_through(TimedPath(time, np.column_stack([0.7 + 0.05 * time, 0.1 * np.sin(0.2 * time)])))
    towed = TowedObject(patch, MASS, [0.03, -0.02], 0.13, [0.2, 0.01], 0.1, 0.12)
    law = Sliding(Makkar(0.06, 400, 40, 0.35, 800, 0), across, lever)
    tether = Tether(0.6, 1000, 10, 0.2, mass, 20.0)
    problem = tow_problem(towed, law, tether, Ground(slope=[0.003, 0.01], regions=regions), 0.15, drive)
    work, checked = work_for(problem.soles, problem.regions), 0
    for state in rng.normal(size=(40, 6)) * (0.01, 0.01, 0.3, 0.02, 0.02, 0.3) + (0, 0, 0, 0.05, 0, 0):
        for mode in (TAUT, SLACK, FORCED):
            out, slopes, at = np.zeros(6), np.zeros((4, 6)), 2.2
            piece = piece_at(drive.knots, at, 0)
            if acceleration_slopes(problem, mode, at, piece, state, work, out, slopes[:3], slopes[3, :3]) != BALANCED:
                continue
            found = np.column_stack([slopes[:3], slopes[3, :3]])
            different = np.zeros((3, 7))
            for j in range(7):
                step = 1e-6 * np.eye(7)[j] * (1.0 if j in (0, 1, 2, 6) else 0.1)
                ends = [rates(problem, work, state + s * step[:6], mode, at + s * step[6])[1] for s in (1, -1)]
                different[:, j] = (ends[0] - ends[1])[3:] / (2 * step[j])
            assert found == pytest.approx(different, abs=1e-6 * np.abs(found).max())
            checked += 1
    assert checked > 60


def grid(patch, n=300):
    """Nodes and areas over rectangles."""
    x, w = np.polynomial.legendre.leggauss(n)
    for ring in patch.outlines:
        low, high = ring.min(axis=0), ring.max(axis=0)
        u, v = np.meshgrid(x, x)
        places = np.stack([u, v], -1) * (high - low) / 2 + (high + low) / 2
        yield places.reshape(-1, 2), (np.outer(w, w) * np.prod(high - low) / 4).ravel()


@pytest.mark.parametrize("across", [1.0, 0.8, 1.3])
def test_friction_of_all_effects_is_that_of_quadrature(across):
    """Anisotropy, four feet, and a region of the floor that crosses them, at a given pressure."""
    region, factor = np.array([[0.05, -1.0], [1.0, -1.0], [1.0, 1.0], [-0.3, 1.0]]), 1.4
    law, place = Coulomb(MU, 0.02), (0.3, -0.2, 0.7)
    floor = Ground(regions=[FloorRegion(transform(place, region), factor)])
    towed = TowedObject(FEET, MASS, (0.02, 0.01), 0.13, (0.2, 0.0))
    problem, work = forced(towed, (0.0, 0.0), Sliding(law, across), floor)
    x0, y0 = transform(place, towed.centre_of_mass)
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    for twist in ([0.1, 0.02, 0.3], [0.02, -0.05, -1.0], [0.0, 0.1, 0.001]):
        state = np.array([x0, y0, 0.7, *(turn @ twist[:2]), twist[2]])
        rates(problem, work, state, SLACK)
        found = work.matrices[W] @ work.pressure
        expected = np.zeros(3)
        for places, areas in grid(FEET, 400):
            inside = np.ones(len(places), bool)
            for start, end in zip(region, np.roll(region, -1, axis=0), strict=True):
                inside &= (end - start)[0] * (places - start)[:, 1] - (end - start)[1] * (places - start)[:, 0] > 0
            x, y = (places - towed.centre_of_mass).T
            pressure = work.pressure[0] + work.pressure[1] * x + work.pressure[2] * y
            vx, vy = twist[0] - twist[2] * y, twist[1] + twist[2] * x
            speed = np.sqrt(vx**2 + across**2 * vy**2)
            share = -pressure * areas * law.coefficient(speed) / speed * np.where(inside, factor, 1.0)
            fx, fy = share * vx, share * across**2 * vy
            expected += [fx.sum(), fy.sum(), (x * fy - y * fx).sum()]
        # The grid does not follow the region's edge: that is its error.
        assert found == pytest.approx(expected, abs=2e-3 * MU * WEIGHT)


def test_the_edge_of_a_region_costs_hardly_a_step():
    tows_of = tows(LAP.towed)
    steps = [
        tows_of[name].run().statistics["steps"] for name in ("and a damping of 5 N s/m", "and a region of the floor")
    ]
    assert steps[1] < 1.1 * steps[0]


def test_at_rest_under_a_slack_tether_with_mass_few_looks_are_enough():
    """Its pull grows slowly until it is taut: the step at rest is from the pull itself, not from the stiffness."""
    looks = [tows(LAP.towed)[name].run().statistics["looks"] for name in ("and a damping of 5 N s/m", "and sticking")]
    assert max(looks) < 150


@pytest.mark.parametrize(("arm", "factor", "peak"), [(0.0, 0.1, 2.3), (2.0, 1.0, 1.7)])
def test_a_break_away_is_not_passed_over_where_little_pull_suffices(arm, factor, peak):
    """At most f μ N is borne, and f μ N times a square's mean radius, 0.765 a, about G; the pull comes and goes."""
    static, stiffness, base = 0.4, 100.0, 0.3
    ground = Ground(regions=[FloorRegion([[-9, -9], [9, -9], [9, 9], [-9, 9]], factor)])
    assert peak > min(1.0, 0.7652 * HALF / arm if arm > 0 else 1.0) * factor * static * WEIGHT
    time = np.linspace(0, 40, 161)
    pull = base + (peak - base) * np.where((time > 8) & (time < 32), np.sin(np.pi * (time - 8) / 24) ** 2, 0)
    hinge = TimedPath(time, np.column_stack([np.full(161, arm), 0.6 + pull / stiffness]))
    motion = feedback(
        block(anchor=(arm, 0.0)), risen_law(static, MU, 1e-4, 0.01), Tether(0.6, stiffness), hinge, (0, 0, 0),
        np.linspace(0, 40, 41), sticking=Sticking(static, 2e-4), ground=ground,
    )  # fmt: skip
    assert motion.statistics["break_aways"] >= 1


@pytest.mark.parametrize("begins", [0.0, 0.3, 0.7, 1.0])
def test_a_break_away_in_the_middle_of_a_piece_is_not_passed_over(begins):
    """A hinge that comes and goes back evenly in 8 s, which one cubic describes; it pulls in the middle for 1.5 s."""
    static, stiffness, over = 0.4, 3000.0, 0.01
    nearest = HALF + 0.6 + static * WEIGHT / stiffness + over
    found = []
    for pieces in (1, 64):
        time = np.linspace(0, 8, pieces + 1)
        place, speed = nearest - 0.3 * (time / 4 - 1) ** 2, -0.15 * (time / 4 - 1)
        hinge = hermite_spline(time, np.column_stack([place, 0 * place]), np.column_stack([speed, 0 * speed]))
        motion = feedback(
            block(anchor=(HALF, 0.0)), risen_law(static, MU, 1e-6, 0.01), Tether(0.6, stiffness), hinge, (0, 0, 0),
            np.linspace(begins, 8, 20), sticking=Sticking(static, 2e-6),
        )  # fmt: skip
        found.append(motion.pose[-1])
    assert found[0][0] > over
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)


def test_a_region_everywhere_is_another_coefficient():
    everywhere = [FloorRegion([[-9, -9], [9, -9], [9, 9], [-9, 9]], 1.2)]
    times, hinge = np.linspace(0, 10, 11), TimedPath([0.0, 10.0], [[0.81, 0.0], [1.3, 0.4]])
    law = Coulomb(MU, 1e-3)
    mapped = feedback(block(height=0.1), law, TETHER, hinge, (0, 0, 0), times, ground=Ground(regions=everywhere))
    scaled = feedback(block(height=0.1), Coulomb(1.2 * MU, 1e-3), TETHER, hinge, (0, 0, 0), times)
    assert mapped.pose == pytest.approx(scaled.pose, abs=1e-9)
    # A region that the tow crosses: the same to the integrator's tolerance, at a tighter one.
    crossing = Ground(regions=[FloorRegion([[0.1, -9], [9, -9], [9, 9], [0.1, 9]], 1.2)])
    scene = (block(height=0.1), law, TETHER, hinge, (0, 0, 0), times)
    default, finer = feedback(*scene, ground=crossing), feedback(*scene, ground=crossing, accuracy=Accuracy(1e-9))
    assert default.pose == pytest.approx(finer.pose, abs=2e-6)
    assert np.abs(default.pose - mapped.pose).max() > 1e-3


def test_with_all_effects_off_the_motion_is_that_of_the_planar_model(cube, lap):
    law, tether, hinge, start = lap
    nothing = Ground(slope=[1e-300, 0.0])  # enough to take the other way
    scene = (cube, law, tether, hinge, start, [0.0, 200.0, 400.0])
    planar, spatial = feedback(*scene), feedback(*scene, ground=nothing)
    assert "break_aways" in spatial.statistics
    assert spatial.pose == pytest.approx(planar.pose, abs=1e-9)
    assert spatial.pose[-1] == pytest.approx(LAP_FINAL_POSE, abs=1e-6)


EVERYTHING = {"hinge_height": 0.15, "sticking": Sticking(0.4, 2e-4)}
TALL = TowedObject(FEET, 5.8, (-0.02, 0.03), 0.2, (0.25, 0.02), 0.1, 0.15)
LAW = Sliding(risen_law(0.4, MU, 1e-4, 0.01), 1.04, 0.9)


def tow(ground, hinge, start, towed=TALL, law=LAW, tolerance=1e-9, **options):
    options = EVERYTHING | options
    times = np.linspace(hinge.time_s[0], hinge.time_s[-1], 41)
    return feedback(towed, law, TETHER, hinge, start, times, ground=ground, accuracy=Accuracy(tolerance), **options)


def curve():
    t = np.linspace(0, 20, 201)
    return t, np.column_stack([0.86 + 0.05 * t, 0.3 * np.sin(0.2 * t)])


def test_moved_and_turned_scene_gives_the_moved_and_turned_motion():
    frame, (t, path) = np.array([2.0, -3.0, 1.1]), curve()
    slope, region = np.array([0.004, -0.002]), np.array([[0.3, -1], [0.9, -1], [0.9, 1], [0.3, 1]])
    here = tow(Ground(9.81, slope, [FloorRegion(region, 1.1)]), TimedPath(t, path), (0, 0, 0.1))
    turned = Ground(9.81, transform([0, 0, frame[2]], slope), [FloorRegion(transform(frame, region), 1.1)])
    start = (*transform(frame, np.zeros(2)), 0.1 + frame[2])
    there = tow(turned, TimedPath(t, transform(frame, path)), start)
    assert here.outcome == Outcome.CONVERGED
    assert there.pose[:, :2] == pytest.approx(transform(frame, here.pose[:, :2]), abs=2e-7)
    assert there.pose[:, 2] == pytest.approx(here.pose[:, 2] + frame[2], abs=2e-6)


def test_mirrored_scene_gives_the_mirrored_motion():
    t, path = curve()
    across = np.array([1, -1])
    here = tow(Ground(slope=[0.004, -0.002]), TimedPath(t, path), (0, 0, 0.1))
    towed = TowedObject(FEET, 5.8, TALL.centre_of_mass * across, 0.2, TALL.anchor * across, 0.1, 0.15)
    there = tow(Ground(slope=[0.004, 0.002]), TimedPath(t, path * across), (0, 0, -0.1), towed)
    assert there.pose == pytest.approx(here.pose * (1, -1, -1), abs=2e-7)


@pytest.mark.parametrize("scale", [2.5e-3, 25.0])
def test_a_scene_of_another_size_gives_the_motion_of_that_size(scale):
    """Froude's similarity: lengths by s, times by √s, masses by s³, from 1 mm to 10 m and 1e-7 to 9e4 kg."""
    t, path = curve()
    here = tow(Ground(slope=[0.004, -0.002]), TimedPath(t, path), (0, 0, 0.1))
    root = np.sqrt(scale)
    feet = Patch.of([scale * ring for ring in FEET.outlines])
    towed = TowedObject(
        feet,
        scale**3 * 5.8,
        scale * TALL.centre_of_mass,
        scale**5 * 0.2,
        scale * TALL.anchor,
        scale * 0.1,
        scale * 0.15,
    )
    law = Sliding(risen_law(0.4, MU, 1e-4 * root, 0.01 * root), 1.04, 0.9)
    hinge, ground = TimedPath(root * t, scale * path), Ground(slope=[0.004, -0.002])
    tether = Tether(0.6 * scale, 1000 * scale**2, 10 * scale**2.5)
    there = feedback(
        towed, law, tether, hinge, (0, 0, 0.1), root * np.linspace(0, 20, 41), ground=ground,
        hinge_height=0.15 * scale, sticking=Sticking(0.4, 2e-4 * root), accuracy=Accuracy(1e-9 * min(1, scale)),
    )  # fmt: skip
    assert there.outcome == Outcome.CONVERGED
    assert there.pose / (scale, scale, 1) == pytest.approx(here.pose, abs=1e-5)


def test_energy_never_grows_in_free_sliding():
    none, times = TimedPath([0.0, 10.0], np.zeros((2, 2))), np.linspace(0, 1, 201)
    law = Sliding(Makkar(0.06, 400, 40, 0.35, 800, 0), 1.1, 0.9)
    towed = block(FEET, height=0.2)
    for twist in np.random.default_rng(2).normal(size=(5, 3)) * (0.3, 0.3, 1.0):
        motion = feedforward(towed, law, none, (0, 0, 0), times, start_twist=twist)
        energy = MASS * (motion.twist[:, :2] ** 2).sum(1) / 2 + towed.inertia * motion.twist[:, 2] ** 2 / 2
        assert (np.diff(energy) <= 1e-9).all()
        assert energy[-1] < 1e-8


def test_tipping_and_lifting_end_a_motion_with_a_name():
    hinge = TimedPath([0.0, 10.0], [[0.8, 0.0], [1.5, 0.0]])
    tips = feedback(block(anchor_height=0.6, height=0.3), Coulomb(MU, 1e-3), TETHER, hinge, (0, 0, 0),
                    [0.0, 10.0], hinge_height=0.6)  # fmt: skip
    assert tips.outcome == Outcome.TIPS
    assert [found.code for found in tips.findings] == ["tips_over"]
    assert len(tips.time_s) < 2 or tips.time_s[-1] < 10
    above = TimedPath([0.0, 10.0], [[0.2, 0.0], [0.2001, 0.0]])
    lifted = feedback(block(), Coulomb(MU, 1e-3), TETHER, above, (0, 0, 0), [0.0, 10.0], hinge_height=0.7)
    assert lifted.outcome == Outcome.LIFTED
    assert [found.code for found in lifted.findings] == ["lifted"]
    problem, work = forced(block(), (0.0, 0.0))
    assert rates(problem, work, SLIDING_ALONG)[0] == BALANCED
    assert LIFTED not in (BALANCED, TIPS)
    assert problem.soles.numbers[MOMENTS] == pytest.approx(0.16)


def test_what_the_model_cannot_take_is_refused(cube, lap, makkar):
    law, tether, hinge, start = lap
    with pytest.raises(InputError, match="below the floor"):
        feedback(cube, law, tether, hinge, start, [0.0, 1.0], hinge_height=-0.1)
    with pytest.raises(RefusedError, match="tips over"):
        feedback(block(centre=(0.3, 0.0), height=0.1), law, tether, hinge, start, [0.0, 1.0])
    with pytest.raises(InputError, match="static friction is below"):
        risen_law(0.3, 0.35, 1e-4, 0.01)
