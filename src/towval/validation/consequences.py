"""Consequences of earlier stages' findings for a run: wider deviations, no verdict, or no "disagrees"."""

from collections.abc import Callable, Iterable

from towval.model import Finding, Severity
from towval.model.findings import FINDINGS, Consequence

WIDER = 3.0
"""Factor on deviations that a finding calls too small: on two real sets of boards they were too small by 1.6 to 3.6."""


def _reported(findings: Iterable[Finding]) -> Iterable[Finding]:
    return (each for each in findings if each.severity is not Severity.NOTE and each.code in FINDINGS)


def widened(findings: Iterable[Finding]) -> dict[str, tuple[str, ...]]:
    """Inputs whose deviations are multiplied by :data:`WIDER`, each with the codes of the findings that cause it."""
    inputs: dict[str, dict[str, None]] = {}
    for each in _reported(findings):
        for name in FINDINGS[each.code].consequence.widens:
            inputs.setdefault(name, {})[each.code] = None
    return {name: tuple(codes) for name, codes in inputs.items()}


def forbidding(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Texts of the findings that leave a run not judged, one for each code."""
    return _texts(findings, lambda consequence: not consequence.judged)


def excusing(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Texts of the findings that may explain a difference in place of the model, one for each code."""
    return _texts(findings, lambda consequence: consequence.excuses)


def excused(codes: Iterable[str]) -> bool:
    """Whether one of the codes of a run's warnings may explain a difference in place of the model."""
    return any(FINDINGS[code].consequence.excuses for code in codes if code in FINDINGS)


def _texts(findings: Iterable[Finding], chosen: Callable[[Consequence], bool]) -> tuple[str, ...]:
    first: dict[str, str] = {}
    for each in _reported(findings):
        if chosen(FINDINGS[each.code].consequence):
            first.setdefault(each.code, each.text)
    return tuple(first.values())
