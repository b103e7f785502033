"""Work-precision curves: what accuracy costs with our integrator and with others, on the same right-hand side.

All solvers integrate the same compiled rates; those that take a Jacobian are given ours. The others do not distinguish
slack and taut: they see a right-hand side with a kink, and their steps are limited to a share of the time, or they
would step over the tightening (and some report success). They call the right-hand side from Python: ``call_s`` is the
time of one such call, most of it the passage into compiled code, ``rate_calls`` the number of calls.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from studies.comparators.integrators import natural_jacobian, natural_rates, state_at_rest, tethered_scene
from studies.comparators.tow_scenes import TowScene
from studies.frame import Row
from towval.model import Array
from towval.model.errors import InputError
from towval.physics.dynamics import Accuracy, feedback

ROSENBROCK, CVODE, RADAU, LSODA = "Rodas5P", "CVODE BDF", "Radau", "LSODA"
METHODS = (ROSENBROCK, CVODE, RADAU, LSODA)
"""Ours first, then scikit-sundae's and SciPy's."""

REFERENCE_TOLERANCE_M = 1e-12
_LONGEST_STEP = 1 / 400  # of the time, for solvers without events
_STEP_LIMIT = 1_000_000
_VELOCITY_RATE = 10.0  # 1/s; a velocity may be wrong by the tolerance times this, as with our integrator
_QUICK_S, _REPEATS = 1.0, 3  # what takes less time than this is timed several times; the least counts


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
    """The right-hand side and its Jacobian for the other solvers; the centre of mass is the body's origin."""

    def __init__(self, scene: TowScene) -> None:
        self.compiled = tethered_scene(scene.towed, scene.patch, scene.tether, scene.hinge)
        self.start = state_at_rest(scene.towed, scene.start_pose)
        self.span = float(scene.times[-1] - scene.times[0])
        self.calls = 0

    def rates(self, t: float, y: Array, out: Array) -> Array:
        self.calls += 1
        natural_rates(self.compiled, t, y, out)
        return out

    def jacobian(self, t: float, y: Array, out: Array) -> Array:
        natural_jacobian(self.compiled, t, y, out)
        return out

    def seconds_a_call(self, times: int = 2000) -> float:
        """CPU time of a call of the right-hand side from Python [s]."""
        out, start = np.empty(6), time.process_time()
        for _ in range(times):
            natural_rates(self.compiled, 0.0, self.start, out)
        return (time.process_time() - start) / times

    @staticmethod
    def allowed(tolerance: float) -> Array:
        """Absolute tolerances of the state (6,), weighted as in our integrator."""
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
