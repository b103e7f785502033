"""Checks of what the documents state of the charts of error against cost: parts of their tables, computed anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pandas as pd

from studies.charts import medians
from studies.comparators import lab_tow_models
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, replaced, result_of
from studies.frame import Part, Study
from studies.tradeoff import decimation, dynamics, effects, friction
from towval.model import Ground
from towval.physics.dynamics import Accuracy
from towval.physics.friction_laws import Coulomb
from towval.validation.decimate import DecimateSettings


def points(study: Study, parts: Iterable[Part]) -> Callable[[], Values]:
    """Median error and cost of the points that some parts of a study give, by panel, series and setting."""

    def measure() -> Values:
        found: dict[str, float] = {}
        for row in medians(pd.DataFrame([row for part in parts for row in study.rows(**part)])).to_dict("records"):
            name = ", ".join(str(row[key]) for key in ("panel", "series", "setting") if row[key])
            found |= {f"{name}: error": row["error"], f"{name}: cost": row["cost"]}
            found[f"{name}: quartiles apart"] = row["high"] - row["low"]
        return found

    return measure


_TENFOLD = result_of(lambda timed: {name: replace(each, cpu_s=10 * each.cpu_s) for name, each in timed.items()})


FRICTION = Check(
    points(friction.STUDY, [{"element_sizes_m": [0.01], "parts": [64], "rounds": 2}]),
    {
        "friction is 1 % too large": replaced(
            friction, "Coulomb", lambda _: lambda coefficient, stiction: Coulomb(1.01 * coefficient, stiction)
        ),
        "the clock counts tenfold": replaced(friction, "take_turns", _TENFOLD),
    },
)


def _tethered_longer(original: Any) -> Any:
    return lambda box, hinge, tether, *rest, **kwargs: original(
        box, hinge, (tether[0] + 0.05, tether[1]), *rest, **kwargs
    )


DYNAMICS = Check(
    points(
        dynamics.STUDY,
        [
            {
                "period_s": 40.0,
                "panels": 12,
                "scipy": {"Radau": [1e-4], "LSODA": [1e-6]},
                "steps_s": [5e-4],
                "mujoco_steps_s": [0.002],
                "rounds": 2,
            }
        ],
    ),
    {
        "the tolerance counts a thousand-fold": replaced(
            dynamics, "Accuracy", lambda _: lambda tolerance: Accuracy(1000 * tolerance)
        ),
        "the truth's tether is 5 cm longer, and the clock counts tenfold": both(
            replaced(dynamics, "towed_box", _tethered_longer), replaced(dynamics, "take_turns", _TENFOLD)
        ),
    },
    needs=("mujoco",),
)

EFFECTS = Check(
    points(effects.STUDY, [{"tow": tow, "rounds": 2} for tow in ("paper", "level tow", "four feet")]),
    {
        "the floor's slope is left out": replaced(lab_tow_models, "feedback", given(ground=Ground())),
        "nothing sticks": replaced(lab_tow_models, "feedback", given(sticking=None)),
        "the tether is 5 mm too long": replaced(
            lab_tow_models, "Tether", lambda tether: lambda length, *rest: tether(length + 0.005, *rest)
        ),
    },
)

DECIMATION = Check(
    points(decimation.STUDY, [{"seed": seed} for seed in range(1, 13)]),
    {
        "segments may be off by more": replaced(
            decimation, "DecimateSettings", lambda _: lambda excess=3.0: DecimateSettings(excess=100 * excess)
        ),
        "the noise is twice as large": replaced(decimation, "NOISE", lambda noise: 2 * noise),
        "films are half as long, and the clock counts tenfold": both(
            replaced(decimation, "DURATION_S", lambda duration: duration / 2),
            replaced(decimation, "time", lambda clock: SimpleNamespace(process_time=lambda: 10 * clock.process_time())),
        ),
    },
)
