"""Consequences of earlier stages' findings for a run: wider deviations, or no verdict."""

from collections.abc import Iterable

from towval.model import Finding, Severity
from towval.model.findings import FINDINGS

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
    first: dict[str, str] = {}
    for each in _reported(findings):
        if not FINDINGS[each.code].consequence.judged:
            first.setdefault(each.code, each.text)
    return tuple(first.values())
