"""The verdict on a run from its statistics, and the sentences that state it."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from towval.model import Finding, Severity
from towval.model.findings import finding
from towval.model.inputs import INPUTS
from towval.model.results import UNTESTED_LIMIT
from towval.model.statement import Bounds, Explanation, Verdict, VisibleFault, rounded_up

_LEAST_SEEN = 0.5
"""Share of the frames of the motion in which the object must have been seen."""

_LEAST_MOVED = 2.0
"""Length of the path, in tolerances, below which a run is not judged."""


@dataclass(frozen=True)
class Evidence:
    """What a verdict rests on.

    ``tolerance_m`` error that matters; ``bounds``; ``statistics`` and ``limits`` by name; ``detectable_m``;
    ``seen_share`` of the frames of the motion; ``moved_m`` length of the path; ``forbidding`` texts of findings that
    leave a run not judged, ``excusing`` of those that may explain a difference; ``explanation``; ``shares`` of the
    expected variance by the label of the input; ``where`` the difference begins and how far it goes, in words;
    ``hidden`` kinds of faults that do not show at the tolerance; ``largest_m`` distance of simulated and measured path;
    ``between_m`` by how much the error is larger between the times at which it was tested, which the bounds include;
    ``u_num_m`` and ``u_val_m`` numerical uncertainty of the simulation, and validation uncertainty with it.
    """

    tolerance_m: float
    bounds: Bounds
    statistics: Mapping[str, float]
    limits: Mapping[str, float]
    detectable_m: float
    seen_share: float
    moved_m: float
    forbidding: tuple[str, ...]
    explanation: Explanation | None
    shares: Mapping[str, float]
    where: str
    hidden: tuple[str, ...] = ()
    largest_m: float = float("nan")
    between_m: float = 0.0
    excusing: tuple[str, ...] = ()
    u_num_m: float = 0.0
    u_val_m: float = float("nan")

    @property
    def upper_m(self) -> float:
        """Upper bound of the largest position error of the simulation [m]."""
        return self.bounds.simulation["position_max"][1] if self.bounds.simulation else float("nan")

    @property
    def rejected(self) -> bool:
        """Whether "the model is right, inputs are within their deviations" is rejected."""
        return any(self.statistics[name] > limit for name, limit in self.limits.items())


def verdict_of(e: Evidence) -> tuple[Verdict, Finding]:
    """The verdict and the finding that gives its reason."""
    not_judged = _not_judged(e)
    if not_judged:
        verdict, statement = Verdict.NOT_JUDGED, f"Not judged: {not_judged}"
    elif e.rejected:
        verdict, statement = _of_rejected(e)
    else:
        verdict, statement = _of_not_rejected(e)
    severity = Severity.NOTE if verdict is Verdict.AGREES else Severity.WARNING
    return verdict, finding("verdict", severity, statement=statement)


def _of_rejected(e: Evidence) -> tuple[Verdict, str]:
    """Verdict and statement where a difference is detected."""
    tolerance, upper, tested = 1e3 * e.tolerance_m, _at_most(e.upper_m), _tested(e)
    if e.upper_m > e.tolerance_m and e.excusing:
        # One text is enough to act on; the report lists all.
        return Verdict.CANNOT_TELL, (
            f"Cannot tell whether the model is wrong: {e.where} ({tested}), which may come from this: {e.excusing[0]}"
        ).removesuffix(".")
    if e.upper_m > e.tolerance_m:
        unlike = "a right model with inputs within their deviations would not be off like this"
        return Verdict.DISAGREES, f"Disagrees: {e.where}; {unlike} ({tested})"
    guess = _wrong_guess(e)
    if guess:
        # Within the tolerance here, but a wrong assumption may do more elsewhere, and the model is untested.
        return Verdict.CANNOT_TELL, (
            f"Cannot tell whether the model is right: a difference is detected ({tested}), under {upper} where "
            f"{tolerance:g} mm matter, and {guess} would explain it, whose value is assumed: state it"
        )
    return Verdict.AGREES, (
        f"Agrees: a difference is detected ({tested}; {e.where}), but it is under {upper}, and {tolerance:g} mm matter"
    )


def _of_not_rejected(e: Evidence) -> tuple[Verdict, str]:
    """Verdict and statement where no difference is detected: is the bound small enough, and would a fault show?"""
    tolerance, upper, unsure = 1e3 * e.tolerance_m, _at_most(e.upper_m), []
    if e.upper_m > e.tolerance_m:
        best = f" (what explains it best: {_moves(e.explanation)})" if e.explanation and e.explanation.moved else ""
        between = e.upper_m - e.between_m <= e.tolerance_m
        why = "between the times that were tested" if between else f"no more than inputs may make of it{best}"
        unsure.append(f"the simulation was off by up to {upper}, {why}")
    if not e.detectable_m <= e.tolerance_m:
        unsure.append(
            f"faults show only from {_at_most(e.detectable_m)} RMS on" if np.isfinite(e.detectable_m)
            else "hardly any fault would have shown"
        )  # fmt: skip
    if unsure:
        needed = float(np.maximum(e.upper_m, e.detectable_m))
        remedy = f"It would agree if only {_at_most(needed)} mattered. " if np.isfinite(needed) else ""
        better = _worth_measuring(e)
        remedy += f"Measure better: {', '.join(better)}. " if better else ""
        remedy += _worth_simulating(e)
        statement = f"Cannot tell whether it is within {tolerance:g} mm: {'; '.join(unsure)}. {remedy}".rstrip(" .")
        return Verdict.CANNOT_TELL, statement
    statement = f"Agrees within {upper}, where {tolerance:g} mm matter ({_tested(e)})"
    if e.hidden:
        statement += f"; what would not have shown even at {tolerance:g} mm: {', '.join(e.hidden)}"
    return Verdict.AGREES, statement


def _tested(e: Evidence) -> str:
    """The tested statistics with their limits."""
    tested = ((name, limit) for name, limit in e.limits.items() if limit > UNTESTED_LIMIT)
    return ", ".join(f"{name} {e.statistics[name]:.1f} of at most {limit:.1f}" for name, limit in tested)


def _not_judged(e: Evidence) -> str:
    if e.forbidding:
        return " ".join(e.forbidding).removesuffix(".")
    if e.seen_share < _LEAST_SEEN:
        return f"the object was seen in {math.floor(100 * e.seen_share)} % of the frames of its motion"
    if e.moved_m < _LEAST_MOVED * e.tolerance_m:
        moved, least = math.floor(1e3 * e.moved_m), f"{_LEAST_MOVED:g} times the {1e3 * e.tolerance_m:g} mm that matter"
        return f"the object moved by {moved} mm, less than {least}"
    return "" if e.limits else "nothing was drawn, or too few frames were seen"


def statement_findings(e: Evidence, faults: tuple[VisibleFault, ...], confidence: float) -> Iterator[Finding]:
    """The three parts of the statement, and what would explain the error."""
    if not e.limits:
        return
    off, model = e.bounds.simulation, e.bounds.model["position_max"]
    the = "Not to be cited, since the run is not judged: the" if _not_judged(e) else "The"
    yield finding(
        "statement",
        off=(
            f"{the} simulation was within {_at_most(off['position_max'][1])} of what happened all along: "
            f"{_at_most(off['along_max'][1])} along the path, {_at_most(off['across_max'][1])} across it, "
            f"{rounded_up(np.degrees(off['heading_max'][1]), 2):.2f}° in heading, "
            f"RMS {_at_most(off['position_rms'][1])} (each with {100 * confidence:g} %)"
        ),
        model=f"The model's own error is between {-rounded_up(-1e3 * model[0], 1) + 0.0:.1f} and {_at_most(model[1])}",
        visible=f"Faults seen with 90 %: {'; '.join(map(fault_text, faults))}",
    )
    # Without a rejection no input need be off; the most probable one is still useful to know.
    if e.explanation is not None and (e.rejected or (e.upper_m > e.tolerance_m and e.explanation.moved)):
        yield finding("explanation", text=_explained(e.explanation))


def between(begins_m: float, ends_m: float) -> str:
    """Between which lengths of the path [m] something is, in words."""
    if round(ends_m, 2) == 0:
        return "before the object moves"
    return f"between {begins_m:.2f} m and {ends_m:.2f} m of the path"


def fault_text(fault: VisibleFault) -> str:
    """A fault with its size and the shift of the path that it causes, in words."""
    if not fault.searched:
        return f"{fault.kind} unknown (no run with it can be simulated)"
    if not np.isfinite(fault.size):
        return f"{fault.kind} none up to {_sized(fault.searched, fault.unit)}"
    shift = f" ({_mm(fault.shift_rms_m)} RMS)" if np.isfinite(fault.shift_rms_m) else ""
    return f"{fault.kind} {_sized(fault.size, fault.unit)}{shift}"


def _sized(size: float, unit: str) -> str:
    return f"{1e3 * size:.0f} mm" if unit == "m" else f"{100 * size:.0f} %"


def _mm(value_m: float) -> str:
    return f"{1e3 * value_m:.1f} mm"


def _at_most(value_m: float) -> str:
    """A length rounded up, as a bound is: what is cited holds, and a tolerance of that size is not exceeded."""
    return f"{rounded_up(1e3 * value_m, 1):.1f} mm"


def _explained(e: Explanation) -> str:
    remaining = f"of {_mm(e.error_rms_m)} RMS {_mm(e.remaining_rms_m)} would remain"
    where = f", beginning {between(e.begins_m, e.ends_m)}" if np.isfinite(e.begins_m) else ""
    if not e.moved:
        return "No input explains the difference: the model, or an input that is not in the table"
    inputs = _moves(e)
    if e.factor > 1:
        if e.explained:
            return f"All stated deviations {e.factor:.1f} times as large would explain it; most probably off: {inputs}"
        return (
            f"Inputs do not explain it, not even with all deviations {e.factor:.1f} times as large{where}. So the model"
        )
    if e.explained:
        return f"Inputs off by so much would explain it: {inputs}; {remaining}"
    return f"Inputs do not explain it: with {inputs} {remaining}{where}. So the model, or an input not in the table"


def _moves(e: Explanation) -> str:
    """Moved inputs, the most probable first, by how much, and those that may be off in place of the first."""
    first, *others = (_move(e, name, value) for name, value in e.moved.items())
    instead = "".join(f" or {_move(e, name, value)}" for name, value in e.instead.items())
    return ", ".join([f"{first}{instead}{', which this run cannot separate' * bool(instead)}", *others])


def _move(e: Explanation, name: str, value: float) -> str:
    return f"{_named(name)} {value:+.1f} {'assumed ' * (name in e.assumed)}deviations"


def _wrong_guess(e: Evidence) -> str:
    """The first of the inputs that explain a difference, where its value is assumed; else empty."""
    moved = list(e.explanation.moved) if e.explanation and e.explanation.explained else []
    return _named(moved[0]) if e.explanation and moved and moved[0] in e.explanation.assumed else ""


def _named(name: str) -> str:
    """An input with the key by which campaign.yaml states it."""
    row = INPUTS.get(name)
    if row is None or row.stated is None:
        return row.label if row else name
    return f"{row.label} ({row.stated.left_out.key if row.stated.left_out else row.stated.key})"


def _worth_measuring(e: Evidence) -> list[str]:
    """What makes the bound smaller, or more faults visible."""
    found = []
    if e.largest_m <= e.tolerance_m < e.upper_m:
        # The deviations of the simulation's inputs are no part of the bound (docs/validation.md).
        found.append("for the bound calibration, heights of the tops and camera.readout_s (u_D)")
        if e.detectable_m <= e.tolerance_m:
            return found
    shares, labels = e.shares, {row.label: name for name, row in INPUTS.items()}
    best = sorted((label for label in labels if shares.get(label, 0.0) > 0), key=lambda label: -shares[label])[:2]
    return [*found, *(f"{_named(labels[label])}, {100 * shares[label]:.0f} % of the variance" for label in best)]


def _worth_simulating(e: Evidence) -> str:
    """What to do where most of the variance of the error is that of a simpler model or of coarse steps."""
    if not e.u_num_m**2 > e.u_val_m**2 / 2:
        return ""
    return f"Simulate better: state a smaller simulate.rung_tolerance_m, for u_num is {_mm(e.u_num_m)}"
