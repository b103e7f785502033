"""Faults planted in the tracker itself: what it measures of a body, what it accepts, and what it says of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from studies.evidence.planting import Planting, both, replaced
from towval.model import Array, Severity, findings
from towval.tracking.follow import Follower
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.pose import Measurement


def scattered(position_m: float, heading_rad: float) -> Planting:
    """A target's measured poses scatter by so much [m], [rad]."""

    def wrong(original: Callable[..., Measurement | None]) -> Callable[..., Measurement | None]:
        rng = np.random.default_rng(1)

        def measure(*given: Any) -> Measurement | None:
            found = original(*given)
            by = rng.normal(0, [position_m, position_m, heading_rad])
            return found and replace(found, pose=found.pose + by)

        return measure

    return replaced(PlaneTracker, "measure", wrong)


def _each_twentieth_refused(original: Callable[..., Measurement | None]) -> Callable[..., Measurement | None]:
    pictures: WeakKeyDictionary[Follower, int] = WeakKeyDictionary()

    def accepted(follower: Follower, *given: Any) -> Measurement | None:
        pictures[follower] = pictures.get(follower, 0) + 1
        found = original(follower, *given)
        return None if pictures[follower] % 20 == 10 else found

    return accepted


REFUSING: Planting = replaced(Follower, "_accepted", _each_twentieth_refused)
"""What is measured in every twentieth picture does not count."""


def _believed(original: Callable[..., Measurement | None]) -> Callable[..., Measurement | None]:
    seen: WeakKeyDictionary[Follower, Measurement] = WeakKeyDictionary()

    def accepted(follower: Follower, time_s: float, luma: Array, predicted: Array, *others: Any) -> Measurement | None:
        found = original(follower, time_s, luma, predicted, *others)
        if found is not None:
            seen[follower] = found
            return found
        last = seen.get(follower)
        return last and replace(last, pose=predicted, learn=lambda: None)

    return accepted


def _as_a_note(original: Any) -> Any:
    return lambda _severity, code, text: original(Severity.NOTE, code, text)


UNDOUBTING: Planting = both(replaced(Follower, "_accepted", _believed), replaced(findings, "Finding", _as_a_note))
UNDOUBTING_SAYS = "a body that is not found is taken to be where it was expected, and every finding is a note"
