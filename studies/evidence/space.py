"""Check of the tow in three dimensions against closed forms, shooting, differences and symmetries."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import Planting, both, given, replaced, result_of
from studies.tables.lap_effects import LAP, LAW
from towval.model import Array, FrictionLaw, Ground, Patch, Sliding, Tether, TimedPath, TowedObject
from towval.physics import dynamics
from towval.physics.dynamics import Accuracy, Outcome, feedback, feedforward
from towval.physics.friction_laws import Coulomb, Makkar, risen_law
from towval.physics.motion import FORCED, SLACK, TAUT
from towval.physics.spatial import problem as layout
from towval.physics.spatial.hanging import hanging_forces
from towval.physics.spatial.holding import holding_margin
from towval.physics.spatial.pressure import BALANCED
from towval.physics.spatial.problem import DAMPING, GRAVITY_X, TowProblem, tether_numbers, tow_problem
from towval.physics.spatial.rates import acceleration_slopes, accelerations
from towval.physics.spatial.soles import Work, work_for
from towval.physics.spatial.tow import Sticking
from towval.physics.splines import Spline, piece_at, spline_through

_HERE = sys.modules[__name__]

MASS, GRAVITY, FRICTION, STATIC, HALF = 5.0, 9.81, 0.35, 0.4, 0.2
WEIGHT = MASS * GRAVITY
_SHARP = Coulomb(FRICTION, 1e-9)
_SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
SOLE = Patch(HALF * _SQUARE)
_FOOT_AT, _FOOT = 0.16, 0.06
FEET = Patch.of([_FOOT_AT * sign + _FOOT / 2 * _SQUARE for sign in _SQUARE])
_ALONG = np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0])
_REST, _STIFFNESS, _FULL = 0.6, 925.0, 20.0


def _block(patch: Patch = SOLE, anchor_height: float = 0.0, height: float = 0.0, centre: Any = (0, 0)) -> TowedObject:
    return TowedObject(patch, MASS, np.array(centre, float), 0.4 / 3, np.array([HALF, 0.0]), anchor_height, height)


def _constant(value: Any) -> Spline:
    return spline_through(TimedPath(np.array([0.0, 1000.0]), np.tile(value, (2, 1))))


def _drawn(towed: TowedObject, force: Any, mode: int = FORCED, state: Array = _ALONG) -> tuple[Work, Array]:
    """What the program makes of a force at the anchor: its work with pressure and contact, and the rates."""
    problem = tow_problem(
        towed, Sliding(_SHARP), Tether(_REST, 1000.0), Ground(), towed.anchor_height, _constant(force)
    )
    work, rates = work_for(problem.soles, problem.regions), np.zeros(6)
    if accelerations(problem, mode, 1.0, 0, state, work, rates) != BALANCED:
        return work, np.full(6, np.nan)
    return work, rates


def _resultant(work: Work) -> tuple[float, Array]:
    """Normal force [N], and where it acts about the centre of mass [m]."""
    m, x = work.moments, work.pressure
    force = float(m[:3] @ x)
    return force, np.array([m[[1, 3, 4]] @ x, m[[2, 4, 5]] @ x]) / force


def _by_hand() -> Values:
    """Loads of blocks by closed forms: how far ahead, feet, what lifts."""
    ahead = [
        _resultant(_drawn(_block(anchor_height=0.1, height=high), (FRICTION * WEIGHT, 0.0))[0])[1][0]
        for high in (0.0, 0.2, 0.5)
    ]
    lifted, _ = _drawn(_block(anchor_height=0.4, height=0.3), (FRICTION * WEIGHT, 0.0))
    left = HALF - FRICTION * 0.4
    highest = float(lifted.pressure[0] + HALF * lifted.pressure[1])
    jerked = []
    for behind in (0.08, 0.14, 0.18):
        work, _ = _drawn(_block(height=0.1), ((FRICTION + behind / 0.1) * WEIGHT, 0.0))
        jerked.append(_off(float(work.moments[0]), 0.4 * 3 * (HALF - behind)))
    centre = np.array([0.03, -0.02])
    stood, _ = _drawn(_block(FEET, centre=centre), (0.0, 0.0), SLACK)
    second = _FOOT_AT**2 + _FOOT**2 / 12
    middles = _FOOT_AT * _SQUARE
    loads = _FOOT**2 * (stood.pressure[0] + (middles - centre) @ stood.pressure[1:])
    expected = WEIGHT / 4 * (1 + middles @ centre / second)
    return {
        "load ahead by μ h": 1e3 * float(np.abs(np.array(ahead) - FRICTION * 0.1).max()),
        "part that lifts: highest pressure": _off(highest, 2 * WEIGHT / (1.2 * left)),
        "part that lifts: area in contact": max(_off(float(lifted.moments[0]), 0.4 * 3 * left), *jerked),
        "four feet": float(np.abs(loads / expected - 1).max()),
    }


def _off(found: float, expected: float) -> float:
    return abs(found / expected - 1)


def _inclined() -> Values:
    """Normal force under a rising tether, N − T sin, and the slope on which a block lets go, over μ_s."""
    rise, distance = 0.3, 0.55
    problem = tow_problem(
        _block(), Sliding(_SHARP), Tether(_REST, 1000.0), Ground(), rise, _constant((HALF + distance, 0.0))
    )
    work = work_for(problem.soles, problem.regions)
    accelerations(problem, TAUT, 1.0, 0, _ALONG, work, np.zeros(6))
    length = float(np.hypot(rise, distance))
    lifted = 1000.0 * (length - _REST) * rise / length

    def margin(slope: float) -> float:
        ground = Ground(slope=np.array([slope, 0.0]))
        none = _constant((0.0, 0.0))
        leaning = tow_problem(_block(height=0.2), Sliding(_SHARP), Tether(1, 1), ground, 0.0, none, (STATIC, 1e-4))
        at_rest = work_for(leaning.soles, leaning.regions)
        return holding_margin(leaning, True, 1.0, 0, np.zeros(6), at_rest, np.zeros(3))

    return {
        "N − T sin": _off(_resultant(work)[0], WEIGHT - lifted),
        "slope on which it lets go": _off(float(brentq(margin, 0.2, 0.8, xtol=1e-14)), STATIC),
    }


def _catenaries() -> Values:
    """Forces of hanging tethers: inextensible ones in closed form, elastic and stiffening ones by shooting."""
    distance, mass = 0.5, 0.8
    q = brentq(lambda q: np.sinh(q) / q - _REST / distance, 0.1, 5, xtol=1e-15)
    level = np.array([mass * GRAVITY * distance / (2 * q), -mass * GRAVITY * _REST / 2])
    apart = [np.abs(_hanging(Tether(_REST, 1e12, mass_per_length=mass), distance, 0.0) / level - 1).max()]
    distance, rise, mass = 0.4, 0.3, 1.3
    a = brentq(lambda a: 2 * a * np.sinh(distance / (2 * a)) - np.sqrt(_REST**2 - rise**2), 0.02, 10, xtol=1e-16)
    raised = mass * GRAVITY * a * np.array([1.0, np.sinh(np.arctanh(rise / _REST) - distance / (2 * a))])
    apart.append(np.abs(_hanging(Tether(_REST, 1e12, mass_per_length=mass), distance, rise) / raised - 1).max())
    shot = []
    for mass in (0.045, 2.0):
        for stiffening in (0.0, 0.4):
            for distance, rise in ((0.58, 0.13), (0.35, 0.13), (0.615, 0.05)):
                tether = Tether(_REST, _STIFFNESS, 0.0, stiffening, mass, _FULL)
                found = _hanging(tether, distance, rise)
                size = float(np.linalg.norm(found))
                shot.append(float(np.abs(found - _shot(tether, distance, rise, found)).max()) / size)
    return {"catenary, closed forms": float(max(apart)), "hanging tether, by shooting": max(shot)}


def _hanging(tether: Tether, distance: float, rise: float) -> Array:
    """Pull and upward force at the anchor (2,) [N], by the program."""
    return np.array(hanging_forces(tether_numbers(tether, rise, GRAVITY), distance)[:2])


def _shot(tether: Tether, distance: float, rise: float, near: Array) -> Array:
    """The same by integrating along the tether from the anchor, both forces corrected until it ends at the hinge."""
    weight, modulus, share = tether.mass_per_length * GRAVITY, tether.stiffness * _REST, tether.stiffening

    def strain(tension: float) -> float:
        def missing(e: float) -> float:
            return modulus * e * (1 - share + share * modulus * e / _FULL) - tension

        return float(brentq(missing, 0, 10 * tension / modulus / (1 - share), xtol=1e-18, rtol=1e-14))

    def along(s: float, _: Array, guess: Array) -> Array:
        pull, up = guess[0], guess[1] + weight * s
        tension = float(np.hypot(pull, up))
        return (1 + strain(tension)) * np.array([pull, up]) / tension

    def missed(guess: Array) -> Array:
        ends = solve_ivp(along, (0, _REST), [0.0, 0.0], args=(guess,), method="DOP853", rtol=1e-13, atol=1e-15)
        return np.asarray(ends.y[:, -1] - (distance, rise))

    return np.asarray(root(missed, near * 1.001, tol=1e-13).x)


def _slopes() -> float:
    """Slopes of the accelerations against central differences, all effects on, over the largest slope."""
    rng, time, worst = np.random.default_rng(1), np.linspace(0, 40, 401), 0.0
    drive = spline_through(TimedPath(time, np.column_stack([0.7 + 0.05 * time, 0.1 * np.sin(0.2 * time)])))
    towed = TowedObject(FEET, MASS, np.array([0.03, -0.02]), 0.13, np.array([0.2, 0.01]), 0.1, 0.12)
    sliding = Sliding(Makkar(0.06, 400, 40, 0.35, 800, 0), 1.04, 0.8)
    tether = Tether(_REST, 1000, 10, 0.2, 1.0, _FULL)
    problem = tow_problem(towed, sliding, tether, Ground(slope=np.array([0.003, 0.01])), 0.15, drive)
    work, at, steps = work_for(problem.soles, problem.regions), 2.2, 1e-6 * np.array([1, 1, 1, 0.1, 0.1, 0.1])
    piece = piece_at(drive.knots, at, 0)
    for state in rng.normal(size=(40, 6)) * (0.01, 0.01, 0.3, 0.02, 0.02, 0.3) + (0, 0, 0, 0.05, 0, 0):
        out, found, ends = np.zeros(6), np.zeros((3, 6)), np.zeros((2, 6))
        if acceleration_slopes(problem, TAUT, at, piece, state, work, out, found, np.zeros(3)) != BALANCED:
            continue
        different = np.zeros((3, 6))
        for j, step in enumerate(steps):
            for end, sign in zip(ends, (1, -1), strict=True):
                accelerations(problem, TAUT, at, piece, state + sign * step * np.eye(6)[j], work, end)
            different[:, j] = (ends[0] - ends[1])[3:] / (2 * step)
        worst = max(worst, float(np.abs(found - different).max() / np.abs(found).max()))
    return worst


def _off_all() -> float:
    """The lap with a slope of 1e-300, which takes the way of three dimensions, from that of the planar model [m]."""
    scene = LAP.towed, LAW, LAP.tether, LAP.hinge, LAP.start_pose, LAP.times
    planar, spatial = feedback(*scene), feedback(*scene, ground=Ground(slope=np.array([1e-300, 0.0])))
    return float(np.linalg.norm((planar.pose - spatial.pose)[:, :2], axis=1).max())


def _resting() -> float:
    """How far half the limit of friction moves a block in ten minutes [m]: it sticks, on a slope, pulled at height."""
    pull = TimedPath(np.array([0.0, 600.0]), np.array([[0.5 * STATIC * WEIGHT, 0.0]] * 2))
    motion = feedforward(
        _block(anchor_height=0.1, height=0.15), risen_law(STATIC, FRICTION, 1e-4, 0.01), pull, (0.1, 0.2, 0.3),
        [0.0, 300.0, 600.0], sticking=Sticking(STATIC, 2e-4), ground=Ground(slope=np.array([1e-3, 0.0])),
    )  # fmt: skip
    return float(np.abs(motion.pose - motion.pose[0]).max())


def _similar() -> float:
    """Froude: a scene of 1 mm and one of 10 m against that of 0.4 m, lengths over the scene's, headings [1, rad]."""
    here = _sized(1.0)
    return float(np.max([np.abs(_sized(scale) / (scale, scale, 1) - here) for scale in (2.5e-3, 25.0)]))


def _sized(scale: float) -> Array:
    """Poses of a tow with all but regions, NaN if it ends early; lengths go by s, times by √s, masses by s³."""
    t, slower = np.linspace(0, 20, 201), float(np.sqrt(scale))
    path = np.column_stack([0.86 + 0.05 * t, 0.3 * np.sin(0.2 * t)])
    towed = TowedObject(
        Patch.of([scale * ring for ring in FEET.outlines]), scale**3 * 5.8, scale * np.array([-0.02, 0.03]),
        scale**5 * 0.2, scale * np.array([0.25, 0.02]), scale * 0.1, scale * 0.15,
    )  # fmt: skip
    law: FrictionLaw = risen_law(STATIC, FRICTION, 1e-4 * slower, 0.01 * slower)
    motion = feedback(
        towed, Sliding(law, 1.04, 0.9), Tether(_REST * scale, 1000 * scale**2, 10 * scale**2.5),
        TimedPath(slower * t, scale * path), (0, 0, 0.1), slower * np.linspace(0, 20, 41),
        ground=Ground(slope=np.array([0.004, -0.002])), hinge_height=0.15 * scale,
        sticking=Sticking(STATIC, 2e-4 * slower), accuracy=Accuracy(1e-9 * min(1, scale)),
    )  # fmt: skip
    return motion.pose if motion.outcome == Outcome.CONVERGED else np.full((41, 3), np.nan)


def _space() -> Values:
    return {
        **_by_hand(),
        **_inclined(),
        **_catenaries(),
        "slopes against differences": _slopes(),
        "all effects off, lap, from the planar model": _off_all(),
        "half the limit for ten minutes moves": _resting(),
        "Froude's similarity": _similar(),
    }


def _laid_out(change: Callable[[TowProblem], TowProblem]) -> Planting:
    """Every tow is laid out otherwise, those simulated, too."""
    return both(*(replaced(where, "tow_problem", result_of(change)) for where in (_HERE, dynamics)))


def _numbers(entry: int, change: Callable[[float], float]) -> Callable[[TowProblem], TowProblem]:
    def changed(problem: TowProblem) -> TowProblem:
        numbers = problem.numbers.copy()
        numbers[entry] = change(numbers[entry])
        return problem._replace(numbers=numbers)

    return changed


def _higher(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda towed, *args, **kwargs: original(
        replace(towed, anchor_height=1.01 * towed.anchor_height), *args, **kwargs
    )


def _beside(original: Callable[..., Any]) -> Callable[..., Any]:
    """Soles are laid out about a point 1 mm off the centre of mass."""
    return lambda patch, centre, *rest: original(patch, centre + np.array([1e-3, 0.0]), *rest)


def _lighter(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda tether, *rest: original(replace(tether, mass_per_length=0.999 * tether.mass_per_length), *rest)


def _steeper(original: Callable[..., Any]) -> Callable[..., Any]:
    """Slopes by the state are 1e-5 too large."""

    def slopes(problem: TowProblem, *given: Any) -> int:
        balance: int = original(problem, *given)
        given[6][:] *= 1.00001
        return balance

    return slopes


SPACE = Check(
    _space,
    {
        "the tow is taken 1 % too high": both(
            *(replaced(where, "tow_problem", _higher) for where in (_HERE, dynamics))
        ),
        "soles are laid out 1 mm beside the centre of mass": replaced(layout, "soles", _beside),
        "the tether rises by 1 % less": _laid_out(_numbers(layout.RISE, lambda rise: 0.99 * rise)),
        "gravity along the floor is 1e-6 too large": _laid_out(_numbers(GRAVITY_X, lambda along: 1.000001 * along)),
        "the tether's metre weighs a thousandth less": replaced(_HERE, "tether_numbers", _lighter),
        "slopes are 1e-5 too large": replaced(_HERE, "acceleration_slopes", _steeper),
        "a damping of 1e-4 N s/m is added": _laid_out(_numbers(DAMPING, lambda damping: damping + 1e-4)),
        "nothing holds at rest": both(
            replaced(_HERE, "feedforward", given(sticking=None)), replaced(_HERE, "feedback", given(sticking=None))
        ),
    },
)
