"""Table "Model selection" of the report: each stage's choice, and the effect of the next one."""

from dataclasses import dataclass

import numpy as np

from towval.model import Calibration, Choice
from towval.model.run_record import RunRecord
from towval.report.wording import NOT_COMPUTED


@dataclass(frozen=True)
class NeededRow:
    """A choice as text: where, what, chosen, next, effect [mm], how that was measured, and its share of u_D."""

    where: str
    what: str
    chosen: str
    next: str
    change_mm: str
    measure: str
    share: str


def needed_rows(calibration: Calibration | None, records: tuple[RunRecord, ...]) -> tuple[NeededRow, ...]:
    """The choices of a campaign: those of the calibration, then by run those of tracking, simulation and uncertainty.

    ``share`` is the change over the measurement uncertainty of the run; for the calibration, over the smallest of all.
    """
    measured = {record.name: record.comparison.u_measurement_m for record in records}
    least = np.nanmin(list(measured.values())) if any(np.isfinite(list(measured.values()))) else np.nan
    rows = [_row("all runs", choice, least) for choice in (() if calibration is None else calibration.choices)]
    for record in records:
        for body in (record.rover_track, record.object_track):
            rows += [_row(f"run {record.name}, {body.body}", choice, measured[record.name]) for choice in body.choices]
        others = (*record.simulated.choices, *(() if record.uncertainty is None else record.uncertainty.choices))
        rows += [_row(f"run {record.name}", choice, measured[record.name]) for choice in others]
    return tuple(rows)


def _row(where: str, choice: Choice, measured_m: float) -> NeededRow:
    known = bool(np.isfinite(choice.change_m))
    share = choice.change_m / measured_m if known and measured_m > 0 else np.nan
    return NeededRow(
        where=where,
        what=choice.what,
        chosen=choice.chosen,
        next=choice.next,
        change_mm=_significant(1e3 * choice.change_m) if known else NOT_COMPUTED,
        measure=choice.measure,
        share=f"{_significant(100 * share)} %" if np.isfinite(share) else NOT_COMPUTED,
    )


def _significant(value: float) -> str:
    """Two significant digits without exponent."""
    if value < 0.001:
        return "below 0.001"
    return np.format_float_positional(value, precision=2, fractional=False, trim="-", min_digits=2)
