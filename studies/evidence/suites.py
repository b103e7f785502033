"""Checks whose numbers are bounds that tests assert: the tests run here, with the program as it is and with a fault."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from studies.evidence.compute import REPOSITORY
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced, result_of
from studies.worlds import bristles
from towval.model.errors import TowvalError
from towval.physics.spatial import problem
from towval.validation import statistics


class _Counted:
    """A plugin of pytest that counts tests that pass, that fail an assertion, and what stops with another error."""

    def __init__(self) -> None:
        self.passed, self.failed, self.stopped = 0, 0, ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count the tests' own calls."""
        self.passed += report.when == "call" and report.passed

    def pytest_exception_interact(self, node: pytest.Item, call: pytest.CallInfo[None]) -> None:
        """Tell a test that fails from one that cannot run."""
        if call.excinfo is not None and call.excinfo.errisinstance((AssertionError, TowvalError)):
            self.failed += 1
        else:
            self.stopped = f"{node.nodeid}: {call.excinfo}"


def passed(*files: str) -> Callable[[], Values]:
    """How many tests of files below ``tests`` pass and fail, in this process, so that what is planted counts."""

    def measure() -> Values:
        counted = _Counted()
        paths = [str(REPOSITORY / "tests" / file) for file in files]
        options = [
            "-q",
            "--no-header",
            "--tb=no",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:xdist",
            f"--rootdir={REPOSITORY}",
        ]
        pytest.main([*options, *paths], plugins=[counted])
        if counted.stopped:
            raise RuntimeError(counted.stopped)
        return {"tests that pass": float(counted.passed), "tests that fail": float(counted.failed)}

    return measure


def _higher(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda towed, *args, **kwargs: original(
        replace(towed, anchor_height=1.01 * towed.anchor_height), *args, **kwargs
    )


SPATIAL = Check(
    passed("physics/test_spatial.py", "physics/test_hanging.py"),
    {"the tow is taken 1 % too high": replaced(problem, "tow_problem", _higher)},
)

BOUNDS = Check(
    passed("validation/test_statistics.py"),
    {
        "the bounds are a third too small": replaced(
            statistics, "bounds", result_of(lambda found: found * [[1.0], [0.67]])
        )
    },
)


def _lighter(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda body, *args, **kwargs: original(replace(body, mass=0.99 * body.mass), *args, **kwargs)


BRISTLES = Check(
    passed("studies/worlds/test_bristles.py"),
    {"the object is 1 % too light": replaced(bristles, "bristle_tow", _lighter)},
)
