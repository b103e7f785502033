"""Checks of what the documents state of the charts of error against cost: parts of their tables, computed anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from studies.charts import medians
from studies.comparators import lab_tow_models
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, repeated, replaced, result_of
from studies.frame import Part, Settings, Study, default_point
from studies.maps import carry_over
from studies.tradeoff import calibration, decimation, dynamics, effects, friction, tracking
from towval.model import Ground
from towval.physics.dynamics import Accuracy
from towval.physics.friction_laws import Coulomb
from towval.tracking.klt import KltTracker
from towval.tracking.plane_tracker import PlaneTracker
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


def _over(default: str, measure: Callable[[], Values]) -> Callable[[], Values]:
    """Costs over that of one of the points, in the same run, beside all else."""

    def with_ratios() -> Values:
        found = dict(measure())
        unit = float(found[f"{default}: cost"])
        costs = {name: float(cost) for name, cost in found.items() if name.endswith(": cost")}
        found |= {f"{name} over the default's": cost / unit for name, cost in costs.items()}
        return found

    return with_ratios


def _works_thrice(name: str) -> Callable[[Any], Any]:
    """Turns in which one of the calls does its work three times."""
    return lambda original: lambda calls, rounds: original(calls | {name: repeated(3)(calls[name])}, rounds)


FRICTION = Check(
    _over(
        "boundary integral, edges whole",
        points(friction.STUDY, [{"element_sizes_m": [0.01], "parts": [64], "rounds": 3}]),
    ),
    {
        "friction is 1 % too large": replaced(
            friction, "Coulomb", lambda _: lambda coefficient, stiction: Coulomb(1.01 * coefficient, stiction)
        ),
        "the boundary integral is computed three times": replaced(friction, "take_turns", _works_thrice("0")),
    },
)


def _tethered_longer(original: Any) -> Any:
    return lambda box, hinge, tether, *rest, **kwargs: original(
        box, hinge, (tether[0] + 0.05, tether[1]), *rest, **kwargs
    )


DYNAMICS = Check(
    _over(
        "towval, dynamics, 1e-7",
        points(
            dynamics.STUDY,
            [
                {
                    "period_s": 40.0,
                    "panels": 12,
                    "scipy": {"Radau": [1e-4], "LSODA": [1e-6]},
                    "steps_s": [5e-4],
                    "mujoco_steps_s": [0.002],
                    "rounds": 3,
                }
            ],
        ),
    ),
    {
        "the tolerance counts a thousand-fold": replaced(
            dynamics, "Accuracy", lambda _: lambda tolerance: Accuracy(1000 * tolerance)
        ),
        "the truth's tether is 5 cm longer": replaced(dynamics, "towed_box", _tethered_longer),
        "the default simulates three times": replaced(dynamics, "take_turns", _works_thrice("towval, dynamics|1e-7")),
    },
    needs=("mujoco",),
)


def _carried_over() -> Values:
    """Median of simulated − measured over the arcs, and how far the quartiles are from it, by fault and size."""
    rows = [row for part in carry_over.STUDY.parts(Settings()).values() for row in carry_over.STUDY.rows(**part)]
    found: dict[str, float] = {}
    apart: dict[str, float] = {}
    for (fault, size), arcs in pd.DataFrame(rows).query("series == 'simulated - measured'").groupby(["panel", "cost"]):
        low, middle, high = np.percentile(arcs.error, [25, 50, 75])
        found[f"{fault} {size:g}"] = float(middle)
        kind = {"rover's frame off by [mm]": "rover's frame"}.get(fault, "most")
        kind = "1 frame per second" if (fault, size) == ("frame rate [Hz]", 1) else kind
        apart[kind] = max(apart.get(kind, 0.0), 100 * float(max(middle - low, high - middle) / middle))
    return found | {f"quartiles from the median, {kind}": most for kind, most in apart.items()}


def _half_as_large(faults: dict[str, Any]) -> dict[str, Any]:
    """Faults of half the size that is said; another frame rate is as it is said."""
    halved = {name: lambda run, size, fault=fault: fault(run, size / 2) for name, fault in faults.items()}
    return halved | {"frame rate [Hz]": faults["frame rate [Hz]"]}


ERRORS_OF_INPUT = Check(
    _carried_over,
    {
        "errors are half as large as they are said to be": replaced(carry_over, "FAULTS", _half_as_large),
        "poses scatter by three times as much": replaced(carry_over, "NOISE", lambda noise: 3 * noise),
    },
)


def _spreads(study: Study) -> Callable[[], Values]:
    """All points of a chart, with the quartiles of their errors."""

    def measure() -> Values:
        found: dict[str, float] = {}
        rows = [row for part in study.parts(Settings()).values() for row in study.rows(**part)]
        for row in medians(pd.DataFrame(rows)).to_dict("records"):
            name = ", ".join(str(row[key]) for key in ("panel", "series", "setting") if row[key])
            found |= {f"{name}: error": row["error"], f"{name}: cost": row["cost"]}
            found |= {f"{name}: lower quartile": row["low"], f"{name}: upper quartile": row["high"]}
        return found

    return measure


LENSES = Check(
    _spreads(calibration.STUDY),
    {
        "corners are three times as noisy, the clock counts tenfold": both(
            replaced(calibration, "calibration_set", given(noise_px=0.45)),
            replaced(calibration, "take_turns", _TENFOLD),
        ),
        "every lens model is taken for k1": replaced(
            calibration, "_calibrated", lambda original: lambda scene, _: original(scene, "k1")
        ),
    },
)


def _larger_and_slower(times: int) -> Callable[[Any], Any]:
    """A tracker's ``measure`` that does its work several times, and takes the floor to be 0.3 % larger."""
    larger = result_of(lambda found: found and replace(found, pose=found.pose * [1.003, 1.003, 1.0]))
    return lambda original: larger(repeated(times)(original))


TRACKERS = Check(
    _spreads(tracking.STUDY),
    {
        "trackers take the floor to be 0.3 % larger; KLT measures four times, the others a hundred times": both(
            replaced(PlaneTracker, "measure", _larger_and_slower(100)),
            replaced(KltTracker, "measure", _larger_and_slower(4)),
        )
    },
)


def _on_the_floor(original: Any) -> Any:
    """The model leaves out all heights."""
    return lambda body, *rest, **keys: original(
        replace(body, anchor_height=0.0, centre_of_mass_height=0.0), *rest, **{**keys, "hinge_height": 0.0}
    )


def _isotropic(original: Any) -> Any:
    return lambda body, law, *rest, **keys: original(body, replace(law, across_over_along=1.0), *rest, **keys)


def _linear(original: Any) -> Any:
    return lambda body, law, rope, *rest, **keys: original(
        body, law, replace(rope, stiffening=0.0, full_load=0.0), *rest, **keys
    )


EFFECTS = Check(
    points(effects.STUDY, [{"tow": tow, "rounds": 2} for tow in ("paper", "level tow", "four feet")]),
    {
        "the model leaves heights out": replaced(lab_tow_models, "feedback", _on_the_floor),
        "the model's floor is level": replaced(lab_tow_models, "feedback", given(ground=Ground())),
        "the model's friction is isotropic": replaced(lab_tow_models, "feedback", _isotropic),
        "the model's tether does not stiffen": replaced(lab_tow_models, "feedback", _linear),
        "friction does not hold an object at rest, the law is that of sticking": replaced(
            lab_tow_models, "feedback", given(sticking=None)
        ),
        "the law that holds rises over 0.3 mm/s": replaced(
            lab_tow_models, "risen_law", lambda law: lambda static, kinetic, _, speed: law(static, kinetic, 3e-4, speed)
        ),
        "the tether is 5 mm too long": replaced(
            lab_tow_models, "Tether", lambda tether: lambda length, *rest: tether(length + 0.005, *rest)
        ),
    },
)


def _decimated() -> Values:
    """What the rules of decimation keep, how far the rover's and the simulated path are off then [mm], and the cost.

    Costs are those over that of the default in the same run.
    """
    found: dict[str, float] = {}
    points_of_all = medians(
        pd.DataFrame([row for seed in range(27501, 27513) for row in decimation.STUDY.rows(seed=seed)])
    )
    unit = default_point(points_of_all, decimation.SIMULATED).cost
    for row in points_of_all.to_dict("records"):
        rule, simulated = f"{row['series']} {row['setting']}", row["panel"] == decimation.SIMULATED
        name = f"{'simulated path' if simulated else 'path of the rover'}, {rule}: RMS error"
        found |= {name: row["error"], f"{name}, lower quartile": row["low"], f"{name}, upper quartile": row["high"]}
        if simulated:
            found[f"{rule}: CPU over the default's"] = row["cost"] / unit
        else:
            found[f"{rule}: points kept"] = row["cost"]
    return found


def _looser(settings: DecimateSettings) -> DecimateSettings:
    return replace(settings, excess=100 * settings.excess)


def _default_thrice(original: Any) -> Any:
    """A track is decimated three times by the default rule."""
    thrice = repeated(3)(original)
    return lambda track, settings: (thrice if settings == DecimateSettings() else original)(track, settings)


DECIMATION = Check(
    _decimated,
    {
        "segments may be off by more": replaced(
            decimation, "decimate", lambda original: lambda track, given: original(track, _looser(given))
        ),
        "the noise is twice as large": replaced(decimation, "NOISE", lambda noise: 2 * noise),
        "films are half as long": replaced(decimation, "DURATION_S", lambda duration: duration / 2),
        "the default works three times": replaced(decimation, "decimate", _default_thrice),
    },
)
