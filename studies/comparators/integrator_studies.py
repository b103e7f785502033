"""Work-precision curves: what accuracy costs with our integrator and with others, on the same right-hand side.

Two scenes: the lap of a cube along a lemniscate, its tether slack for a while, and stick-slip behind a soft tether. All
solvers integrate the same compiled rates; those with a Jacobian are given ours. Others than ours know nothing of slack
and taut: they see a right-hand side with a kink, and take no step longer than a share of the time, or they would step
over the tightening (and some report success). Their calls come from Python: ``call_s`` is the time of one such call
of the right-hand side, most of it the passage, ``rate_calls`` how many there were.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from towval.model import Array, FrictionLaw, Patch, Tether, TimedPath, TowedObject
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.physics.contact import resting_pressure
from towval.physics.dynamics import Accuracy, centre_state, feedback, motion_scene
from towval.physics.friction_laws import Coulomb, Makkar
from towval.physics.motion import MotionProblem, acceleration_slopes, accelerations, natural_mode
from towval.physics.splines import piece_at, spline_covering
from towval.physics.wrench import SlidingPatch, sliding_patch

ROSENBROCK, CVODE, RADAU, LSODA = "Rodas5P", "CVODE BDF", "Radau", "LSODA"
METHODS = (ROSENBROCK, CVODE, RADAU, LSODA)
"""Ours first, then scikit-sundae's and SciPy's."""

REFERENCE_TOLERANCE_M = 1e-12
_LONGEST_STEP = 1 / 400  # of the time, for solvers without events
_STEP_LIMIT = 1_000_000
_VELOCITY_RATE = 10.0  # 1/s; a velocity may be wrong by the tolerance times this, as with our integrator
_QUICK_S, _REPEATS = 1.0, 3  # what takes less is timed so often, and the least counts

Row = dict[str, Any]


@dataclass(frozen=True)
class TowScene:
    """A motion to be integrated: who is towed, on what, by what, from where, reported when."""

    towed: TowedObject
    patch: SlidingPatch
    tether: Tether
    hinge: TimedPath
    start_pose: tuple[float, float, float]
    times: Array


def lap_scene(duration: float = 400.0) -> TowScene:
    """A cube towed slowly along Bernoulli's lemniscate, 2 m wide, from rest; the tether goes slack on the way."""
    return _cube_scene(Coulomb(0.35, 1e-3), 1000.0, lemniscate(duration), (1.0, -0.8, np.pi / 2), 201)


def lemniscate(duration: float, points: int = 4001) -> TimedPath:
    """Once around Bernoulli's lemniscate, 2 m wide, in a time [s]."""
    t = np.linspace(0, duration, points)
    tau = 2 * np.pi * t / duration
    return TimedPath(t, np.column_stack([np.cos(tau), np.sin(tau) * np.cos(tau)]) / (1 + np.sin(tau) ** 2)[:, None])


def stick_slip_scene(duration: float = 20.0) -> TowScene:
    """A cube that sticks and slips behind a soft tether whose end creeps, under a law that falls by a third."""
    t = np.linspace(0, duration, 201)
    path = np.column_stack([0.8 + 0.01 * t, 0.02 * (1 - np.cos(0.3 * t))])
    return _cube_scene(Makkar(0.15, 800.0, 50.0, 0.3, 1600.0, 0.0), 200.0, TimedPath(t, path), (0.0, 0.0, 0.0), 401)


SCENES: dict[str, Callable[[], TowScene]] = {"lap": lap_scene, "stick-slip": stick_slip_scene}


def _cube_scene(
    law: FrictionLaw, stiffness: float, hinge: TimedPath, start: tuple[float, float, float], reports: int
) -> TowScene:
    square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    cube = TowedObject(square, 5.0, [0, 0], 0.4 / 3, [0.2, 0])
    times = np.linspace(hinge.time_s[0], hinge.time_s[-1], reports)
    return TowScene(cube, sliding_patch(resting_pressure(cube), law), Tether(0.6, stiffness), hinge, start, times)


def work_precision_rows(
    scene: TowScene, tolerances: Iterable[float] = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8), methods: Iterable[str] = METHODS
) -> list[Row]:
    """CPU time against error of integrators on a scene.

    Parameters
    ----------
    scene : TowScene
    tolerances : iterable of float, optional
        Errors of a step that are accepted [m].
    methods : iterable of str, optional
        Out of :data:`METHODS`.

    Returns
    -------
    list of dict
        For each method and tolerance: ``method``, ``tolerance_m``, ``cpu_s``, ``error_m`` (largest distance of the
        object's centre from the reference, at any of the scene's times), ``rate_calls``, ``call_s`` and ``outcome``:
        "converged", what the solver says, or why it was skipped; then the numbers are NaN. The reference is our
        integrator at :data:`REFERENCE_TOLERANCE_M`.
    """
    methods, tolerances = tuple(methods), tuple(tolerances)
    unknown = set(methods) - set(METHODS)
    if unknown:
        raise InputError("there is no such integrator", got=", ".join(sorted(unknown)), allowed=", ".join(METHODS))
    exact = reference_places(scene, REFERENCE_TOLERANCE_M)
    return [_row(scene, exact, method, tolerance) for method in methods for tolerance in tolerances]


def reference_places(scene: TowScene, tolerance: float) -> Array:
    """The object's centre (n, 2) [m] at the scene's times, by our integrator at a tolerance [m]."""
    return _ours(scene, tolerance).places


@dataclass(frozen=True)
class _Solution:
    """``places`` (n, 2) of the object's centre [m], as far as the solver came; calls of the rates; how it ended."""

    places: Array
    rate_calls: float
    outcome: str
    call_s: float = 0.0


def _row(scene: TowScene, exact: Array, method: str, tolerance: float) -> Row:
    row: Row = {"method": method, "tolerance_m": tolerance}
    if method == CVODE and importlib.util.find_spec("sksundae") is None:
        nothing = dict.fromkeys(("cpu_s", "error_m", "rate_calls", "call_s"), np.nan)
        return row | nothing | {"outcome": "skipped: scikit-sundae is not installed"}
    solve = _SOLVERS[method]
    spent: list[float] = []
    while len(spent) < (_REPEATS if min(spent, default=0.0) < _QUICK_S else 1):
        start = time.process_time()
        solution = solve(scene, tolerance)
        spent.append(time.process_time() - start)
    complete = len(solution.places) == len(exact)
    error = np.linalg.norm(solution.places - exact, axis=1).max() if complete else np.nan
    return row | {
        "cpu_s": min(spent),
        "error_m": float(error),
        "rate_calls": solution.rate_calls,
        "call_s": solution.call_s,
        "outcome": solution.outcome,
    }


def _ours(scene: TowScene, tolerance: float) -> _Solution:
    motion = feedback(
        scene.towed,
        scene.patch,
        scene.tether,
        scene.hinge,
        scene.start_pose,
        scene.times,
        accuracy=Accuracy(tolerance, _STEP_LIMIT),
    )
    stages = 8 * (motion.statistics["steps"] + motion.statistics["rejections"] + motion.statistics["mode_changes"])
    return _Solution(motion.pose[:, :2], stages, str(motion.outcome))


class _Problem:
    """The right-hand side and its Jacobian as the other solvers call them; the centre of mass is the body's origin."""

    def __init__(self, scene: TowScene) -> None:
        drive = spline_covering(scene.hinge, scene.times, "the way of the hinge")
        self.compiled: MotionProblem = motion_scene(scene.towed, scene.patch, scene.tether, drive)
        self.start = centre_state(scene.towed, scene.start_pose, (0.0, 0.0, 0.0))
        self.span = float(scene.times[-1] - scene.times[0])
        self.calls = 0

    def rates(self, t: float, y: Array, out: Array) -> Array:
        self.calls += 1
        _natural_rates(self.compiled, t, y, out)
        return out

    def jacobian(self, t: float, y: Array, out: Array) -> Array:
        _natural_jacobian(self.compiled, t, y, out)
        return out

    def seconds_a_call(self, times: int = 2000) -> float:
        """CPU time of a call of the right-hand side from Python [s]."""
        out, start = np.empty(6), time.process_time()
        for _ in range(times):
            _natural_rates(self.compiled, 0.0, self.start, out)
        return (time.process_time() - start) / times

    @staticmethod
    def allowed(tolerance: float) -> Array:
        """Absolute tolerances of the state (6,), weighed as our integrator does."""
        return tolerance * np.array([1.0, 1.0, 1.0, *(_VELOCITY_RATE,) * 3])


def _scipy(method: str, scene: TowScene, tolerance: float) -> _Solution:
    from scipy.integrate import solve_ivp  # noqa: PLC0415 — takes as long to import as all the rest

    problem = _Problem(scene)
    solution = solve_ivp(
        lambda t, y: problem.rates(t, np.ascontiguousarray(y), np.empty(6)),
        (scene.times[0], scene.times[-1]),
        problem.start,
        method=method,
        t_eval=scene.times,
        jac=lambda t, y: problem.jacobian(t, np.ascontiguousarray(y), np.empty((6, 6))),
        rtol=max(tolerance, 1e-13),
        atol=problem.allowed(tolerance),
        max_step=problem.span * _LONGEST_STEP,
    )
    outcome = "converged" if solution.success else str(solution.message)
    return _Solution(solution.y[:2].T, problem.calls, outcome, problem.seconds_a_call())


def _cvode(scene: TowScene, tolerance: float) -> _Solution:
    from sksundae.cvode import CVODE as Solver  # noqa: PLC0415 — an extra: not everybody has it

    problem = _Problem(scene)

    def rates(t: float, y: Array, out: Array) -> None:
        problem.rates(t, y.copy(), out)

    def jacobian(t: float, y: Array, yp: Array, out: Array) -> None:
        out[:] = problem.jacobian(t, y.copy(), np.empty((6, 6)))

    solver = Solver(
        rates,
        jacfn=jacobian,
        rtol=max(tolerance, 1e-13),
        atol=problem.allowed(tolerance),
        max_step=problem.span * _LONGEST_STEP,
        max_num_steps=_STEP_LIMIT,
    )
    solution = solver.solve(scene.times, problem.start)
    outcome = "converged" if solution.success else str(solution.message)
    return _Solution(solution.y[:, :2], problem.calls, outcome, problem.seconds_a_call())


_SOLVERS: dict[str, Callable[[TowScene, float], _Solution]] = {
    ROSENBROCK: _ours,
    CVODE: _cvode,
    RADAU: lambda scene, tolerance: _scipy("Radau", scene, tolerance),
    LSODA: lambda scene, tolerance: _scipy("LSODA", scene, tolerance),
}


@compiled(allocates=False)
def _natural_rates(scene: MotionProblem, time: float, y: Array, out: Array) -> None:
    """Time derivative of the state (6,), slack or taut as the state says."""
    accelerations(scene, natural_mode(scene, time, y), time, piece_at(scene.drive.knots, time, 0), y, out)


@compiled()
def _natural_jacobian(scene: MotionProblem, time: float, y: Array, out: Array) -> None:
    """Derivative of the rates by the state (6, 6)."""
    rates, slopes, time_slope = np.empty(6), np.empty((3, 6)), np.empty(3)
    piece = piece_at(scene.drive.knots, time, 0)
    acceleration_slopes(scene, natural_mode(scene, time, y), time, piece, y, rates, slopes, time_slope)
    out[:] = 0.0
    for i in range(3):
        out[i, 3 + i] = 1.0
        for j in range(6):
            out[3 + i, j] = slopes[i, j]
