"""First screen of the report: the result in a sentence, one row per run, and a line about each folded part."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from towval.model import Calibration, Comparison, Verdict
from towval.model.inputs import INPUTS
from towval.model.run_record import RunRecord
from towval.report.facts import slips, verdict_reason
from towval.report.wording import NOT_COMPUTED, NOT_JUDGED, at_most, degrees, millimetres

_OTHERWISE = {
    Verdict.DISAGREES: ("does not", "do not"),
    Verdict.CANNOT_TELL: ("leaves open whether it agrees", "leave open whether they agree"),
    Verdict.NOT_JUDGED: ("is not judged", "are not judged"),
}
_ALONE = {Verdict.DISAGREES: ("does not agree", "do not agree")}


@dataclass(frozen=True)
class ResultRow:
    """A run on the first screen; ``verdict`` as shown, ``kind`` for its colour."""

    run: str
    verdict: str
    kind: str
    error: str
    bound: str
    detectable: str
    why: str


def sentence(records: Sequence[RunRecord]) -> str:
    """The result by verdict, and what to do first: correct a slip, or measure an input better."""
    by_verdict = {v: [r.comparison for r in records if r.comparison.verdict is v] for v in Verdict}
    agree = by_verdict.pop(Verdict.AGREES)
    parts = []
    if agree:
        largest = at_most(max(c.error_upper_m for c in agree))
        parts.append(f"{_who(agree, len(records))} {'agree' if len(agree) > 1 else 'agrees'} within {largest}")
    for verdict, others in by_verdict.items():
        if others:
            phrase = (_OTHERWISE if parts else _OTHERWISE | _ALONE)[verdict][len(others) > 1]
            who = _named(others) if agree else _who(others, len(records))
            parts.append(f"{who} {phrase}{_beginning(others) if verdict is Verdict.DISAGREES else ''}")
    first = measure_first(records)
    judged = any(r.comparison.verdict is not Verdict.NOT_JUDGED for r in records)
    if any(slips(r) for r in records):
        parts.append("check campaign.yaml for a slip first")
    elif first and judged:
        parts.append(f"measure the {first} better first")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def measure_first(records: Sequence[RunRecord]) -> str:
    """The input of campaign.yaml with the largest share of the error's variance over all runs; empty where unknown."""
    labels = {row.label for row in INPUTS.values() if row.stated}
    sums: dict[str, float] = {}
    for record in records:
        for name, share in ({} if record.uncertainty is None else record.uncertainty.shares).items():
            if name in labels:
                sums[name] = sums.get(name, 0.0) + share
    return max(sums, key=lambda name: sums[name]) if any(sums.values()) else ""


def result_rows(records: Sequence[RunRecord]) -> tuple[ResultRow, ...]:
    """One row per run."""
    return tuple(_row(record.comparison) for record in records)


def _row(c: Comparison) -> ResultRow:
    # What a fault of the measurement or of the draws makes is no bound to cite.
    judged = c.verdict is not Verdict.NOT_JUDGED
    missing = NOT_COMPUTED if judged else NOT_JUDGED
    known, detectable = judged and np.isfinite(c.error_upper_m), judged and np.isfinite(c.detectable_m)
    return ResultRow(
        run=c.run,
        verdict=c.verdict.value,
        kind=c.verdict.value.replace(" ", "-"),
        error=f"{millimetres(c.path_rms_m)}, {degrees(c.heading_rms_rad)}",
        bound=f"under {at_most(c.error_upper_m)}" if known else missing,
        detectable=f"from {at_most(c.detectable_m)} on" if detectable else missing,
        why=verdict_reason(c),
    )


def legend(records: Sequence[RunRecord]) -> str:
    """Meaning of the columns, and the tolerance."""
    text = (
        "Error: simulated minus measured position and heading, RMS over the run. Bound: how far off the simulated "
        "position was at most, at the confidence that each run states; the number to cite. Detectable: half of the "
        "kinds of faults show once they move the path by that much, RMS."
    )
    tolerances = {r.comparison.tolerance_m: r.comparison.tolerance_stated for r in records}
    for tolerance_m, stated in tolerances.items():
        if np.isfinite(tolerance_m):
            default = (
                "" if stated else " (a default; state yours with towval run CAMPAIGN --set compare.tolerance_m=...)"
            )
            text += f" An error of {millimetres(tolerance_m)} matters{default}."
    return text


def gists(records: Sequence[RunRecord], calibration: Calibration | None) -> dict[str, str]:
    """A few words about each folded part, by its id."""
    tracked = [100 * float(np.mean(r.object_track.seen)) for r in records]
    spread = f"{min(tracked):.0f}" if max(tracked) - min(tracked) < 1 else f"{min(tracked):.0f} to {max(tracked):.0f}"
    first = measure_first(records)
    found = {
        "uncertainty": f"largest share: {first}" if first else "",
        "tracking": f"object seen in {spread} % of the frames",
        "simulation": ", ".join(dict.fromkeys(r.simulated.rung for r in records)),
    }
    if calibration is not None:
        used = sum(not view.dropped for view in calibration.views)
        found["calibration"] = f"{used} of {len(calibration.views)} views used"
    return found


def _beginning(runs: Sequence[Comparison]) -> str:
    """Where on the path a single run begins to differ; empty for several runs or where unknown."""
    return f", from {runs[0].begins_m:.1f} m on" if len(runs) == 1 and np.isfinite(runs[0].begins_m) else ""


def _who(runs: Sequence[Comparison], of: int) -> str:
    """The number of runs, or their names where that is shorter."""
    if len(runs) == of:
        return {1: f"run {runs[0].run}", 2: "both runs"}.get(of, f"all {of} runs")
    return f"{len(runs)} runs" if len(runs) > 2 else _named(runs)


def _named(runs: Sequence[Comparison]) -> str:
    names = [c.run for c in runs]
    return f"run {names[0]}" if len(names) == 1 else f"runs {', '.join(names[:-1])} and {names[-1]}"
