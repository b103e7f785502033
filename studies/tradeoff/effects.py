"""Error against cost for each effect of a lab that the model of the tow takes or leaves out.

The truth is :mod:`studies.worlds.bristles`: objects that stick, one of them towed at height over a slope.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from studies.comparators.lab_tow_models import EFFECTS, distances_m, modelled, present_effects
from studies.costs import take_turns
from studies.frame import Part, Row, Scatter, Settings, Study, default_point, point
from studies.worlds.lab_tows import TOWS
from towval.model import SimulatedMotion
from towval.physics.dynamics import Outcome

_RISES = {"rise 0.1 mm/s": 1e-4, "rise 0.01 mm/s": 1e-5}
"""Coarser rises of friction at rest, for the effect of the regularisation that is left."""


def effect_rows(tow: str, rounds: int) -> list[Row]:
    """A row a choice of effects: CPU time and RMS error of the path [mm], all taken, one left out, one taken, none."""
    scene = TOWS[tow]()
    times, truth = scene.truth()
    present = present_effects(scene)
    choices: dict[str, Callable[[], SimulatedMotion]] = {"all": partial(modelled, scene, present, times)}
    series = dict.fromkeys(("all", *_RISES), "all taken") | {"none": "planar, regularised"}
    for name, rise in _RISES.items():
        choices[name] = partial(modelled, scene, present, times, rise=rise)
    choices["none"] = partial(modelled, scene, (), times)
    if len(present) > 1:
        for effect in present:
            left = tuple(name for name in EFFECTS if name in present and name != effect)
            choices[f"no {effect}"] = partial(modelled, scene, left, times)
            choices[f"{effect} alone"] = partial(modelled, scene, (effect,), times)
            series |= {f"no {effect}": "one left out", f"{effect} alone": "one taken"}
    rows: list[Row] = []
    for setting, timed in take_turns(choices, rounds).items():
        motion = timed.result
        apart = 1e3 * distances_m(motion, truth)
        complete = motion.outcome == Outcome.CONVERGED
        rows.append(
            {
                "panel": tow,
                "series": series[setting],
                "setting": setting,
                "cost": timed.cpu_s,
                "cost_most": timed.cpu_most_s,
                "error": float(np.sqrt(np.mean(apart**2))) if complete else np.nan,
                "error_most": float(apart.max()) if complete else np.nan,
                "outcome": str(motion.outcome),
                "default": setting == "all",
            }
        )
    return rows


def _parts(settings: Settings) -> dict[str, Part]:
    names = ["four feet"] if settings.quick else list(TOWS)
    return {name.replace(" ", "_"): {"tow": name, "rounds": 2 if settings.quick else 5} for name in names}


def _why(rows: pd.DataFrame) -> str:
    tow = rows[rows["panel"] == "four feet"]
    all_taken, coarse = default_point(rows, "four feet"), point(rows, "all taken", "rise 0.01 mm/s", "four feet")
    left = tow[tow["series"] == "one left out"]
    times = left["cost"] / all_taken.cost
    return (
        f"The tow on four feet is then {all_taken.error:.1g} mm off; without one of them {left['error'].min():.1g} to "
        f"{left['error'].max():.2g} mm, in {times.min():.0%} to {times.max():.0%} of the time. A rise of friction over "
        f"0.01 mm/s ({coarse.error:.1g} mm, {coarse.cost / all_taken.cost:.0%} of the time) is not the default's, "
        "1 µm/s, which stays for friction that falls faster."
    )


STUDY = Study(
    parts=_parts,
    rows=effect_rows,
    chart=Scatter(
        title="Effects of a lab, taken or left out",
        cost="CPU time [s]",
        error="RMS error of the path [mm]",
        take="Take every effect that is known, the default.",
        why=_why,
        truth="Truth: elasto-plastic bristles, no code of the package; accurate to 0.01 mm (paper, four feet) and "
        "0.05 mm (level tow).",
        note="Stop-and-go tows of 21 s. Left out: heights zero, floor level, friction isotropic, tether "
        "linear, and in place of sticking a law regularised over 1 mm/s.",
    ),
)
