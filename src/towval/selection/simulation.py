"""Model selection for the stage simulate: which model and tolerance a run needs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Body, Choice, DecimatedTrack, SimulatedMotion, TowingScene
from towval.model.results import TO_DYNAMICS
from towval.physics.ladder import DYNAMICS, rung_names
from towval.selection.margin import SHARE
from towval.validation.simulate import RunSimulation, SimulateSettings

SELECTED = ("rung_tolerance_m", "tolerance_m")
"""Settings of the stage that may be "auto"."""

TOLERANCES_M = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""Values that "auto" selects from, cheapest first."""


def simulate_selecting(
    scene: TowingScene,
    rover: DecimatedTrack,
    towed: DecimatedTrack,
    times: ArrayLike,
    settings: SimulateSettings,
    *,
    auto: Sequence[str],
    measurement_m: float,
    body: Body | None = None,
    seen: NDArray[np.bool_] | None = None,
) -> tuple[SimulateSettings, SimulatedMotion]:
    """Simulate a run with the settings that it needs; its choices state the effect of the next model and tolerance.

    ``auto`` holds the names of the settings to select, "rung_tolerance_m" and "tolerance_m", against the measurement
    uncertainty ``measurement_m`` [m]; the rest is as in :func:`towval.validation.simulate.simulate`.
    """
    limit = SHARE * measurement_m
    if "rung_tolerance_m" in auto:
        settings = replace(settings, rung_tolerance_m=float(np.clip(limit, 1e-9, 1.0)))
    tolerances = TOLERANCES_M if "tolerance_m" in auto else (settings.tolerance_m,)
    run = RunSimulation(scene, rover, towed, times, body, seen)
    for tolerance in tolerances:
        settings = replace(settings, tolerance_m=tolerance)
        motion = run.simulate(settings)
        finer = max(tolerance / 10, 1e-12)
        change = run.path_shift_m(motion.rung, tolerance, finer)
        if change <= limit:
            break
    taken, next_finer = f"{settings.tolerance_m:.0e} m", f"{finer:.0e} m"
    tolerance_choice = Choice("tolerance of a step", taken, next_finer, change, "at most over the path")
    choices = (_rung_choice(motion), tolerance_choice)
    return settings, replace(motion, choices=choices)


def _rung_choice(motion: SimulatedMotion) -> Choice:
    """The rung compared with the full dynamics or, for the dynamics, with the next simpler rung."""
    simpler = rung_names()[-2]
    following, lower = (simpler, simpler) if motion.rung == DYNAMICS else (DYNAMICS, motion.rung)
    change = motion.statistics[f"{lower}{TO_DYNAMICS}"]
    return Choice("model of the object", motion.rung, following, change, "at most over the path")
