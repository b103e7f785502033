"""Cost and error of the motion of a towed object: integrators, tolerances, rungs of the ladder, MuJoCo.

The scene is the cube of tests/oracles.py on its lap, driven in 40 s. The reference is
:func:`studies.worlds.reference.towed_box`. Driven in 400 s it ends where the oracle says, to 1e-8 m and 2e-7 rad; in
40 s, with 48 × 48 nodes, 96 × 96 move it by 1e-6 m.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np
import pandas as pd

from studies.comparators import mujoco_engine
from studies.comparators.integrators import (
    RUNGE_KUTTA_4,
    SEMI_IMPLICIT_EULER,
    fixed_steps,
    poses_of,
    scipy_steps,
    state_at_rest,
    tethered_scene,
)
from studies.comparators.tow_scenes import TowScene, lap_scene
from studies.costs import take_turns
from studies.frame import Part, Row, Scatter, Settings, Study, default_point, point
from studies.worlds.reference import Box, towed_box
from towval.model import Array
from towval.physics.dynamics import DEFAULT_TOLERANCE_M, Accuracy, feedback
from towval.physics.friction_laws import Coulomb
from towval.physics.trailing import TRAILING_RUNGS, trail

SIDE, MASS, INERTIA, FRICTION, STICTION = 0.4, 5.0, 0.4 / 3, 0.35, 1e-3
_AS_GOOD_MM = 0.01  # Ten times the reference's accuracy: programs nearer to it than this are compared by cost alone.

_Call = Callable[[], Array]


def lemniscate(time_s: float | Array, period_s: float) -> Array:
    """Place (..., 2) of the hinge on its lap [m]."""
    tau = 2 * np.pi * np.asarray(time_s) / period_s
    return np.stack([np.cos(tau), np.sin(tau) * np.cos(tau)], axis=-1) / (1 + np.sin(tau) ** 2)[..., None]


def dynamics_rows(
    period_s: float,
    panels: int,
    scipy: Mapping[str, list[float]],
    steps_s: list[float],
    mujoco_steps_s: list[float],
    rounds: int,
) -> list[Row]:
    """A row a method: CPU seconds of a lap, RMS and largest error of the path, and where it stopped early.

    ``scipy`` gives the tolerances of SciPy's methods by their names, ``steps_s`` the steps of the explicit rules [s].
    """
    scene = lap_scene(period_s)
    times = scene.times
    box = Box((SIDE, SIDE), MASS, (0.0, 0.0), INERTIA, (SIDE / 2, 0.0), FRICTION, STICTION)
    truth = towed_box(
        box,
        lambda t: lemniscate(t, period_s),
        (scene.tether.rest_length, scene.tether.stiffness),
        scene.start_pose,
        times,
        panels=(panels, panels),
        order=4,
        tolerance=1e-8,
        longest_step_s=0.1,
    )
    methods = {(series, setting): call for series, setting, call in _methods(scene, scipy, steps_s, mujoco_steps_s)}
    timed = take_turns({f"{series}|{setting}": call for (series, setting), call in methods.items()}, rounds)
    rows = []
    for (series, setting), result in zip(methods, timed.values(), strict=True):
        gap = np.full(len(times), np.nan)
        poses = result.result
        gap[: len(poses)] = np.linalg.norm(poses[:, :2] - truth[: len(poses), :2], axis=1)
        rows.append(
            {
                "panel": "",
                "series": series,
                "setting": setting,
                "cost": result.cpu_s,
                "cost_most": result.cpu_most_s,
                "error": 1e3 * float(np.sqrt(np.mean(gap**2))),
                "error_most": 1e3 * float(gap.max()),
                "default": series == "towval, dynamics" and setting == _power(DEFAULT_TOLERANCE_M),
            }
        )
    if not mujoco_engine.is_installed():
        rows.append({"panel": "", "series": "MuJoCo", "setting": "left out: the extra bench is not installed"})
    return rows


def _methods(
    scene: TowScene, scipy: Mapping[str, list[float]], steps_s: list[float], mujoco_steps_s: list[float]
) -> Iterator[tuple[str, str, _Call]]:
    cube, law, times = scene.towed, Coulomb(FRICTION, STICTION), scene.times
    given = (cube, law, scene.tether, scene.hinge, scene.start_pose, times)
    compiled_scene, state = tethered_scene(*given[:4]), state_at_rest(cube, scene.start_pose)

    def own(tolerance: float) -> Array:
        return feedback(*given, accuracy=Accuracy(tolerance)).pose

    def trailing(rung: str) -> Array:
        return trail(rung, *given).pose

    def by_scipy(method: str, tolerance: float) -> Array:
        return poses_of(cube, scipy_steps(method, compiled_scene, state, times, tolerance)[1])

    def by_steps(scheme: int, step_s: float) -> Array:
        return poses_of(cube, fixed_steps(scheme, compiled_scene, state, times, step_s)[1])

    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        yield "towval, dynamics", _power(tolerance), partial(own, tolerance)
    for rung in TRAILING_RUNGS:
        yield "towval, no inertia", rung, partial(trailing, rung)
    for method, tolerances in scipy.items():
        for tolerance in tolerances:
            yield f"SciPy {method}", _power(tolerance), partial(by_scipy, method, tolerance)
    for step in steps_s:
        yield "Runge-Kutta 4", f"{1e3 * step:g} ms", partial(by_steps, RUNGE_KUTTA_4, step)
        yield "semi-implicit Euler", f"{1e3 * step:g} ms", partial(by_steps, SEMI_IMPLICIT_EULER, step)
    if mujoco_engine.is_installed():
        for step in mujoco_steps_s:
            for layout, spheres in mujoco_engine.LAYOUTS.items():
                places = partial(mujoco_engine.mujoco_places, scene, step, spheres)
                yield "MuJoCo", f"{layout}, {1e3 * step:g} ms", places


def _power(tolerance: float) -> str:
    return f"1e{round(np.log10(tolerance))}"


def _parts(settings: Settings) -> dict[str, Part]:
    scipy = {method: [1e-4, 1e-6, 1e-8] for method in ("Radau", "BDF", "LSODA")}
    given = {"panels": 12, "scipy": scipy, "steps_s": [5e-4, 2.5e-4]}
    if settings.quick:
        return {"lap": {**given, "period_s": 20.0, "mujoco_steps_s": [1e-2], "rounds": 2}}
    return {"lap": {**given, "period_s": 40.0, "mujoco_steps_s": [1e-2, 5e-3, 2e-3], "rounds": 3}}


def _why(rows: pd.DataFrame) -> str:
    default, looser = default_point(rows), point(rows, "towval, dynamics", "1e-6")
    rungs = rows[rows["series"] == "towval, no inertia"]
    times, errors, looser_time = rungs["cost"] / default.cost, rungs["error"], looser.cost / default.cost
    others = rows[~rows["series"].str.startswith("towval") & (rows["error"] < _AS_GOOD_MM)]["cost"] / default.cost
    return (
        f"It takes {1e3 * default.cost:.0f} ms and is off by {default.error:.1g} mm; 1e-6 m by {looser.error:.1g} mm, "
        f"in {looser_time:.0%} of its time. The rungs without inertia take {times.min():.0%} to {times.max():.0%} of "
        f"it and are off by {errors.min():.2g} to {errors.max():.2g} mm. Of the other programs, those within "
        f"{_AS_GOOD_MM:g} mm take {others.min():.0f} times as long or longer."
    )


STUDY = Study(
    parts=_parts,
    rows=dynamics_rows,
    chart=Scatter(
        title="A lap of a towed cube",
        cost="CPU time [s]",
        error="RMS error of the path [mm]",
        note="Labels: tolerance (towval: [m] a step), time step or rung.",
        take="Take 1e-7 m a step, the default.",
        why=_why,
        truth="Truth: Gauss quadrature and SciPy's Radau, accurate to 1e-3 mm, without code of the package. One scene: "
        "nothing here is random.",
    ),
)
