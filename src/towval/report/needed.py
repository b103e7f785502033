"""The report's table "what this scene needed": what each stage chose, and what its next choice would have changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from towval.model import Calibration, Choice
from towval.model.run_record import RunRecord


@dataclass(frozen=True)
class NeededRow:
    """A choice in words: where, what, chosen, next, its change [mm], what is measured, and the share of u_D."""

    where: str
    what: str
    chosen: str
    next: str
    change_mm: str
    measure: str
    share: str


def needed_rows(calibration: Calibration | None, records: tuple[RunRecord, ...]) -> tuple[NeededRow, ...]:
    """The choices of a campaign: the calibration's, then run by run those of tracking, simulation and uncertainty.

    ``share`` is the change over the measurement uncertainty of the run, or of the run that has the least for the
    calibration's.
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
        change_mm=_significant(1e3 * choice.change_m) if known else "not computed",
        measure=choice.measure,
        share=f"{_significant(100 * share)} %" if np.isfinite(share) else "not computed",
    )


def _significant(value: float) -> str:
    """Two digits, no exponent; what is too small to show is said so."""
    if value < 0.001:
        return "below 0.001"
    return np.format_float_positional(value, precision=2, fractional=False, trim="-", min_digits=2)
