"""Which tuned constants the tests notice: each is halved and doubled, and the tests of its module run.

    python -m studies.tables.mutants [MODULE ...] [--jobs 2]

Integers stay integers. A constant counts as noticed when one test fails. The tests of a module are those of the file
that bears its name and of ``test_ROOM_limits.py`` of its room; :data:`FURTHER` names others. Each mutant runs in a
process forked from one that has imported and compiled everything.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import multiprocessing
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from towval.model.constants import constants_of

ROOMS = ("towval.tracking", "towval.calibration")
TESTS = Path(__file__).resolve().parents[2] / "tests"
FURTHER = {
    "camera_motion": ["tracking/test_track.py::test_a_camera_that_moved_is_noticed"],
    "light": ["tracking/test_alignment.py"],
    "markers": ["tracking/test_start.py"],
    "plane_tracker": ["tracking/test_track.py::test_few_points_are_flagged"],
    "proposals": ["tracking/test_start.py"],
    "template": ["tracking/test_alignment.py"],
}
"""Tests by module, slowest last: they stop at the first that fails."""


@dataclasses.dataclass(frozen=True)
class Mutant:
    """A constant ``name`` of a ``module`` of a ``room``, times ``factor``."""

    room: str
    module: str
    name: str
    factor: float

    @property
    def tests(self) -> list[str]:
        """The tests that should notice it."""
        folder = self.room.rpartition(".")[2]
        own = [f"{folder}/test_{folder}_limits.py", f"{folder}/test_{self.module}.py"]
        return [
            str(TESTS / name)
            for name in (*own, *FURTHER.get(self.module, []))
            if (TESTS / name.split("::")[0]).exists()
        ]


class _FirstFailure:
    """A plugin of pytest that keeps the name of the first test that fails."""

    name = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.name:
            self.name = report.nodeid.rpartition("::")[2]


def first_failure(tests: list[str]) -> str:
    """Name of the first of some tests that fails, empty where none does."""
    first = _FirstFailure()
    options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--rootdir", str(TESTS.parent)]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        code = pytest.main([*options, *tests], plugins=[first])
    return first.name or ("" if code == pytest.ExitCode.OK else f"exit code {int(code)}")


def mutants(modules: list[str]) -> Iterator[Mutant]:
    """Every constant of the named modules, or of all, halved and doubled."""
    for room in ROOMS:
        for module, constants in constants_of(room).items():
            if not modules or module in modules:
                for field in dataclasses.fields(constants):
                    yield from (Mutant(room, module, field.name, factor) for factor in (0.5, 2.0))


def noticed_by(mutant: Mutant) -> tuple[Mutant, str]:
    """The first test that fails with a mutant, empty where it survives; to be run in a process of its own."""
    constants = constants_of(mutant.room)[mutant.module]
    value = getattr(constants, mutant.name)
    changed = value * mutant.factor
    object.__setattr__(constants, mutant.name, round(changed) if isinstance(value, int) else changed)
    return mutant, first_failure(mutant.tests)


def main() -> None:
    """Print the table, and the share that the tests notice."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="*")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    os.chdir(TESTS.parent)
    everything = list(mutants(given.modules))
    # Also compiles what the forked processes then share.
    broken = first_failure(sorted({test for mutant in everything for test in mutant.tests}))
    if broken:
        parser.error(f"{broken} fails without any mutant")
    with multiprocessing.get_context("fork").Pool(given.jobs, maxtasksperchild=1) as pool:
        survived = 0
        for mutant, test in pool.imap(noticed_by, everything, chunksize=1):
            survived += not test
            verdict = f"noticed by {test}" if test else "survived"
            print(f"{mutant.module}.{mutant.name} x {mutant.factor:g}: {verdict}", flush=True)
    print(f"{len(everything) - survived} of {len(everything)} noticed")


if __name__ == "__main__":
    main()
