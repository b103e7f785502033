"""A tether with mass against closed forms, shooting along its length, a chain of links and differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares, root

from oracles import LAP_FINAL_POSE
from towval.model import Ground, Patch, Sliding, Tether, TimedPath, TowedObject
from towval.model.errors import InputError
from towval.physics.dynamics import Accuracy, Outcome, feedback
from towval.physics.friction_laws import Coulomb, risen_law
from towval.physics.spatial.hanging import damped, following_forces, hanging_forces, hanging_pull, reach_under
from towval.physics.spatial.problem import tether_numbers
from towval.physics.spatial.tow import Sticking
from towval.physics.tether import lowest_point

G, REST, KAPPA, FULL = 9.81, 0.6, 925.0, 20.0
SQUARE = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
MASS, MU = 5.0, 0.35


def forces(tether, distance, rise):
    """Pull and upward force at the anchor."""
    return np.array(hanging_forces(tether_numbers(tether, rise, G), distance)[:2])


def shot(tether, distance, rise, near):
    """The same by integrating along the tether from the anchor and correcting the two forces until it ends right."""
    weight, modulus = tether.mass_per_length * G, tether.stiffness * tether.rest_length

    def strain(tension):
        s = tether.stiffening
        if s == 0:
            return tension / modulus

        def missing(e):
            return modulus * e * (1 - s + s * modulus * e / (tether.full_load or 1.0)) - tension

        return brentq(missing, 0, 10 * tension / modulus / (1 - s), xtol=1e-18, rtol=1e-14)

    def along(s, _, guess):
        pull, up = guess[0], guess[1] + weight * s
        tension = np.hypot(pull, up)
        return (1 + strain(tension)) * np.array([pull, up]) / tension

    def missed(guess):
        ends = solve_ivp(along, (0, REST), [0.0, 0.0], args=(guess,), method="DOP853", rtol=1e-13, atol=1e-15)
        return ends.y[:, -1] - (distance, rise)

    found = root(missed, near * (1.0 + 1e-3), tol=1e-13)
    return found.x


def test_a_level_inextensible_tether_is_the_catenary():
    """sinh q / q = l / d; H = w d / 2q; it sags by H/w (cosh q − 1)."""
    distance, mass = 0.5, 0.8
    tether = Tether(REST, 1e12, mass_per_length=mass)
    q = brentq(lambda q: np.sinh(q) / q - REST / distance, 0.1, 5, xtol=1e-15)
    pull = mass * G * distance / (2 * q)
    assert forces(tether, distance, 0.0) == pytest.approx([pull, -mass * G * REST / 2], rel=1e-9)
    assert lowest_point(tether, distance, 0.0) == pytest.approx(distance / (2 * q) * (np.cosh(q) - 1), rel=1e-9)


@pytest.mark.parametrize("mass", [1e-2, 1e-4, 1e-6])
def test_a_light_taut_tether_sags_by_its_parabola(mass):
    """w l0 d / 8 T, however light: below some mg/m all digits had cancelled, and what the stretch adds was left."""
    tension, distance = 200.0, 0.62
    expected = mass * G * REST * distance / (8 * tension)
    assert lowest_point(Tether(REST, 1e4, mass_per_length=mass), distance, 0.0) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("rise", [0.0, 0.2])
def test_a_tether_straight_below_its_hinge_hangs_by_what_is_left_of_it(rise):
    """Two parts side by side, (l0 − rise) / 2 long; it was NaN."""
    tether = Tether(REST, 1e9, mass_per_length=1.0)
    assert lowest_point(tether, 0.0, rise) == pytest.approx((REST - rise) / 2, abs=1e-6)


def test_a_slack_tether_without_mass_hangs_anywhere():
    with pytest.raises(InputError, match=r"Tether\.mass_per_length is out of range"):
        lowest_point(Tether(0.6, 1e4), 0.5, 0.0)


def test_ends_at_two_heights_hang_on_one_catenary():
    """The closed form between two heights: √(l² − z²) = 2 a sinh(d / 2a), and the forces are those of its slopes."""
    distance, rise, mass = 0.4, 0.3, 1.3
    a = brentq(lambda a: 2 * a * np.sinh(distance / (2 * a)) - np.sqrt(REST**2 - rise**2), 0.02, 10, xtol=1e-16)
    middle = np.arctanh(rise / REST)
    expected = mass * G * a * np.array([1.0, np.sinh(middle - distance / (2 * a))])
    assert forces(Tether(REST, 1e12, mass_per_length=mass), distance, rise) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("stiffening", [0.0, 0.4])
@pytest.mark.parametrize(("distance", "rise"), [(0.58, 0.13), (0.6, -0.1), (0.35, 0.13), (0.615, 0.05), (0.05, 0.4)])
@pytest.mark.parametrize("mass", [0.003, 0.045, 0.1, 2.0])
def test_forces_are_those_of_shooting_along_the_tether(mass, distance, rise, stiffening):
    tether = Tether(REST, KAPPA, 0.0, stiffening, mass, FULL)
    found = forces(tether, distance, rise)
    assert found == pytest.approx(shot(tether, distance, rise, found), rel=1e-9, abs=1e-9 * mass * G)


def test_forces_are_those_of_a_chain_of_links():
    """Links with lumped masses, whose energy is least: the error falls with the square of their number."""
    tether, distance, rise = Tether(REST, KAPPA, mass_per_length=1.0), 0.58, 0.1
    found, apart = forces(tether, distance, rise), []
    for links in (16, 32):
        length, spring, weight = REST / links, KAPPA * links, 1.0 * G * REST / links

        def pushed(inner, links=links, length=length, spring=spring, weight=weight):
            nodes = np.vstack([[0, 0], inner.reshape(-1, 2), [distance, rise]])
            parts = np.diff(nodes, axis=0)
            lengths = np.linalg.norm(parts, axis=1, keepdims=True)
            pulls = spring * (lengths - length) * parts / lengths
            return ((pulls[1:] - pulls[:-1]) - (0, weight)).ravel(), pulls[0] - (0, weight / 2)

        share = np.linspace(0, 1, links + 1)[1:-1]
        start = np.column_stack([distance * share, rise * share - 0.4 * REST * share * (1 - share)]).ravel()
        shape = least_squares(lambda inner: pushed(inner)[0], start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(shape.fun).max() < 1e-7
        apart.append(np.linalg.norm(pushed(shape.x)[1] - found))
    assert apart[1] < 2e-3 * np.linalg.norm(found)
    assert apart[1] == pytest.approx(apart[0] / 4, rel=0.1)


def test_forces_reach_the_hinge_whatever_the_tether():
    """From threads to chains, from steel to rubber, slack or taut: a stationary point of the energy, by differences."""
    rng, checked = np.random.default_rng(4), 0
    for _ in range(300):
        rest, rise = 10 ** rng.uniform(-3, 1), rng.uniform(-0.9, 0.9)
        chord = rng.uniform(abs(rise) + 0.05, max(1.3, abs(rise) + 0.1))
        distance = rest * np.sqrt(chord**2 - rise**2)
        modulus, weight = 10 ** rng.uniform(1, 7), 10 ** rng.uniform(-6, 2)
        tether = Tether(rest, modulus / rest, 0.0, rng.choice([0.0, 0.8]), weight / G, 5.0)
        numbers = tether_numbers(tether, rise * rest, G)
        pull, lift, by_d, lift_by_d, _, _ = hanging_forces(numbers, distance)
        apart = 1e-6 * rest
        ends = [np.array(hanging_forces(numbers, distance + s * apart)[:2]) for s in (1, -1)]
        assert pull > 0
        assert np.isfinite(lift)
        slopes = (ends[0] - ends[1]) / (2 * apart)
        if np.ptp([end[0] for end in ends]) < 1e-3 * pull:  # else the differences are too coarse
            assert (by_d, lift_by_d) == pytest.approx(slopes, rel=1e-4, abs=1e-4 * abs(by_d))
            checked += 1
    assert checked > 200


@pytest.mark.parametrize("stiffening", [0.0, 0.8])
def test_forces_followed_from_place_to_place_are_those_found_afresh(stiffening):
    """Small steps and large ones, from slack to taut and back."""
    numbers, last = tether_numbers(Tether(REST, KAPPA, 0.0, stiffening, 0.5, 20.0), 0.1, G), np.zeros(5)
    reach = np.sqrt(REST**2 - 0.1**2)
    steps = np.concatenate([np.linspace(0.8, 1.02, 200), [0.5, 1.01, 1.0100001, 0.3], np.linspace(1.02, 0.7, 50)])
    for distance in reach * steps:
        assert following_forces(numbers, distance, last) == pytest.approx(hanging_forces(numbers, distance), rel=1e-11)


def test_without_mass_it_is_the_straight_tether():
    distance, rise = 0.61, 0.13
    length = np.hypot(distance, rise)
    tension = KAPPA * (length - REST)
    for mass in (1e-3, 1e-6, 1e-9):
        found = forces(Tether(REST, KAPPA, mass_per_length=mass), distance, rise)
        assert found == pytest.approx(tension * np.array([distance, rise]) / length, rel=1e-9 + 2 * mass * G / tension)


@pytest.mark.parametrize("stiffening", [0.0, 0.4])
@pytest.mark.parametrize("stiffness", [50.0, 1e3, 1e5])
def test_without_mass_the_reach_is_where_the_straight_tether_pulls_as_much(stiffness, stiffening):
    """By the distance at which the stretched tether's pull along the floor is the one given; rises up to beyond l0."""
    tether = Tether(REST, stiffness, 0.0, stiffening, 0.0, FULL if stiffening else 0.0)

    def forces_at(distance, rise):
        length = np.hypot(distance, rise)
        stretch = length - REST
        share = stiffening * (stretch * stiffness / FULL - 1)
        return stiffness * stretch * (1 + share) * np.array([distance, rise]) / length

    for rise in (0.0, 0.3, -0.55, 0.599, REST, 0.62, 0.7):
        nearest = np.sqrt(max(REST**2 - rise**2, 0.0))
        for pull in (0.1, 5.0, 100.0):
            right = brentq(lambda d, rise=rise, pull=pull: forces_at(d, rise)[0] - pull, nearest, 9, xtol=1e-15)
            distance, upward = reach_under(tether_numbers(tether, rise, G), pull)
            assert distance == pytest.approx(right, abs=1e-10)
            assert upward == pytest.approx(forces_at(right, rise)[1], rel=1e-8, abs=1e-9)
        assert reach_under(tether_numbers(tether, rise, G), 0.0)[0] == nearest


def test_damping_takes_up_energy_alone_and_never_pushes():
    numbers = tether_numbers(Tether(REST, KAPPA, 30.0, 0.0, 0.5), 0.1, G)
    taut = hanging_forces(numbers, 0.62)
    for rate in (-0.02, 0.02):
        assert (damped(numbers, taut, rate)[0] - taut[0]) * rate > 0
    assert damped(numbers, taut, -100.0)[0] == 0
    # Slack, it sags rather than stretches: a hundredth of what a taut one takes.
    slack = hanging_forces(numbers, 0.5)
    assert damped(numbers, slack, 0.1)[0] - slack[0] < 0.01 * (damped(numbers, taut, 0.1)[0] - taut[0])
    straight = 30.0 * 0.1 * (0.62 / np.hypot(0.62, 0.1)) ** 2
    thread = tether_numbers(Tether(REST, KAPPA, 30.0, 0.0, 1e-6), 0.1, G)
    of_thread = hanging_forces(thread, 0.62)
    assert damped(thread, of_thread, 0.1)[0] - of_thread[0] == pytest.approx(straight, rel=1e-6)
    step = 1e-6
    for distance in (0.59, 0.599, 0.602):
        found = hanging_pull(numbers, distance, 0.05, np.zeros(5))
        ends = [hanging_pull(numbers, distance + s * step, 0.05, np.zeros(5))[:2] for s in (1, -1)]
        assert found[2:4] == pytest.approx((np.array(ends[0]) - ends[1]) / (2 * step), rel=1e-5)


def towed(height=0.1):
    return TowedObject(SQUARE, MASS, (0.0, 0.0), 0.13, (0.2, 0.0), height, 0.1)


def test_a_block_drawn_steadily_trails_where_the_pull_is_that_of_friction():
    """H(d) = μ (m g − lift(d)), d by shooting."""
    tether, speed, rise = Tether(REST, KAPPA, 30.0, 0.0, 1.0), 0.05, 0.1
    hinge = TimedPath([0.0, 20.0], [[0.79, 0.0], [0.79 + 20 * speed, 0.0]])
    motion = feedback(towed(), Coulomb(MU, 1e-4), tether, hinge, (0, 0, 0), [0.0, 20.0], hinge_height=0.2,
                      accuracy=Accuracy(1e-10))  # fmt: skip
    distance = hinge.position[-1, 0] - 0.2 - motion.pose[-1, 0]

    def unbalanced(d):
        pull, lift = shot(tether, d, rise, np.array([17.0, 0.1]))
        return pull - MU * (MASS * G - lift)

    assert distance == pytest.approx(brentq(unbalanced, 0.58, 0.64, xtol=1e-12), abs=1e-8)
    assert motion.tether_force[-1, 0] == pytest.approx(shot(tether, distance, rise, np.array([17.0, 0.1]))[0], rel=1e-6)


def test_a_slack_chain_lets_go_where_it_pulls_as_much_as_friction_holds():
    """1 kg/m pulls with 9 N at 10 mm of slack; a light object slides before the chain is taut."""
    light, chain = TowedObject(SQUARE, 1.5, (0.0, 0.0), 0.04, (0.2, 0.0), 0.1, 0.1), Tether(REST, KAPPA, 0.0, 0.0, 1.0)
    static, times = 0.4, np.linspace(0, 40, 4001)
    hinge = TimedPath([0.0, 40.0], [[0.7, 0.0], [0.8, 0.0]])
    motion = feedback(light, risen_law(static, MU, 1e-5, 0.01), chain, hinge, (0, 0, 0), times, hinge_height=0.1,
                      sticking=Sticking(static, 2e-5))  # fmt: skip
    moving = np.flatnonzero(motion.pose[:, 0] > 0)[0]
    distance = 0.5 + 0.1 * times[moving] / 40
    pull, lift = shot(chain, distance, 0.0, np.array([6.0, -3.0]))
    assert pull == pytest.approx(static * (1.5 * G - lift), rel=2e-3)
    assert distance < REST - 0.005
    assert motion.statistics["break_aways"] >= 1


def test_a_thread_tows_as_a_massless_tether_does(cube, lap):
    """The lap of the oracles, slack and taut, with a tether of 1e-7 kg/m."""
    law, tether, hinge, start = lap
    thread = Tether(tether.rest_length, tether.stiffness, tether.damping, mass_per_length=1e-7)
    motion = feedback(cube, law, thread, hinge, start, [0.0, 200.0, 400.0])
    assert motion.outcome == Outcome.CONVERGED
    assert motion.pose[-1] == pytest.approx(LAP_FINAL_POSE, abs=2e-6)


@pytest.mark.parametrize("damping", [0.0, 50.0])
def test_a_chain_from_a_hinge_straight_above_the_anchor_lifts_nothing(damping):
    """It pulls in no direction along the floor there, until the hinge goes on."""
    tether = Tether(0.6, 1000.0, damping, mass_per_length=0.05)
    hinge = TimedPath([0.0, 10.0], [[0.2, 0.0], [1.2, 0.0]])
    motion = feedback(towed(), Coulomb(0.35, 1e-3), tether, hinge, (0, 0, 0), [0.0, 10.0], hinge_height=0.3)
    beside = TimedPath([0.0, 10.0], [[0.2 + 1e-6, 0.0], [1.2, 0.0]])
    close = feedback(towed(), Coulomb(0.35, 1e-3), tether, beside, (0, 0, 0), [0.0, 10.0], hinge_height=0.3)
    assert motion.outcome == close.outcome == Outcome.CONVERGED
    assert motion.pose[-1] == pytest.approx(close.pose[-1], abs=1e-5)


def test_a_run_with_a_chain_converges_with_its_tolerance():
    """All effects on, slack at times, sticking and released some times, which multiplies errors."""
    t = np.linspace(0, 20, 201)
    hinge = TimedPath(t, np.column_stack([0.84 + 0.05 * t - 0.1 * np.sin(0.5 * t), 0.3 * np.sin(0.2 * t)]))
    scene = (
        towed(), Sliding(risen_law(0.4, MU, 1e-4, 0.01), 1.04, 0.9), Tether(REST, KAPPA, 10.0, 0.2, 0.8, FULL), hinge,
        (0, 0, 0.1), t,
    )  # fmt: skip
    given = {"ground": Ground(slope=[0.003, -0.002]), "hinge_height": 0.2, "sticking": Sticking(0.4, 2e-4)}
    coarse, fine, finest = (feedback(*scene, **given, accuracy=Accuracy(each)) for each in (1e-7, 1e-9, 1e-11))
    assert coarse.outcome == fine.outcome == Outcome.CONVERGED
    apart = [np.abs(each.pose - finest.pose).max() for each in (coarse, fine)]
    assert apart[0] < 3e-5
    assert apart[1] < apart[0] / 3
    assert coarse.tether_length.min() < REST < coarse.tether_length.max()
