"""Which tuned constants the tests notice: each is halved and doubled, and the tests that read it run.

    python -m studies.tables.mutants [MODULE ...] [--jobs 2] [--seconds 30] [--tests 'test_*.py'] [--sample 20 --seed 1]

A first pass runs the tests of both rooms without a change and keeps which test reads which constant, and how long it
takes. Then each mutant runs in a forked process up to the first test that fails: those of limits and of its module
first, each the quickest first. Integers stay integers. ``MODULE`` is all constants of a module, or one: ``klt`` or
``klt.points``.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import multiprocessing
import os
import random
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from towval.commands.console import errors_reported
from towval.model.constants import constants_of
from towval.model.errors import InputError

ROOMS = ("towval.tracking", "towval.calibration")
REPOSITORY = Path(__file__).resolve().parents[2]
SLOW = ("test_real_clips.py",)
"""Files of tests that are left out: footage that is not everybody's."""

FACTORS = (0.5, 2.0)


@dataclasses.dataclass(frozen=True)
class Asked:
    """What to try: ``modules``, or all for none; files of ``tests``; a sample of ``size`` constants by ``seed``.

    Zero for all of them. Tests that take more processor time than ``seconds`` are left out; ``jobs`` run at once.
    """

    modules: tuple[str, ...] = ()
    tests: str = "test_*.py"
    size: int = 0
    seed: int = 1
    jobs: int = 2
    seconds: float = 30.0


Place = tuple[str, str]
"""A room and a module of it."""


@dataclasses.dataclass(frozen=True)
class Mutant:
    """A constant ``name`` of a ``module`` of a ``room``, times ``factor``."""

    room: str
    module: str
    name: str
    factor: float


class Watch:
    """A plugin of pytest: the first failure, the time of each test, and the constants that each reads."""

    def __init__(self) -> None:
        self.failed = ""
        self.now, self.begun = "", 0.0
        self.seconds: dict[str, float] = defaultdict(float)
        self.readers: dict[tuple[str, str], set[str]] = defaultdict(set)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """A test begins."""
        self.now, self.begun = nodeid, time.process_time()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """A test has ended: processor time, since a busy machine stretches the other."""
        self.seconds[nodeid] = time.process_time() - self.begun

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A phase of a test has ended."""
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def observe(self, module: str, constants: Any) -> None:
        """Keep from now on which test reads which field of a module's constants."""

        def read(instance: Any, name: str) -> Any:
            self.readers[module, name].add(self.now)
            return object.__getattribute__(instance, name)

        type.__setattr__(type(constants), "__getattribute__", read)


def run(tests: list[str], watch: Watch, *options: str) -> None:
    """Run tests in this process, silently."""
    fixed = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--rootdir", str(REPOSITORY)]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        pytest.main([*fixed, *options, *tests], plugins=[watch])


def _scaled(value: Any, factor: float) -> Any:
    """A number, or each of a tuple, times a factor; integers stay integers."""
    if isinstance(value, tuple):
        return tuple(_scaled(each, factor) for each in value)
    return round(value * factor) if isinstance(value, int) else value * factor


def noticed_by(work: tuple[Mutant, list[str]]) -> tuple[Mutant, str]:
    """The first test that fails with a mutant, empty where it survives; to be run in a process of its own."""
    mutant, tests = work
    constants = constants_of(mutant.room)[mutant.module]
    object.__setattr__(constants, mutant.name, _scaled(getattr(constants, mutant.name), mutant.factor))
    watch = Watch()
    if tests:
        run(tests, watch, "-x")
    return mutant, watch.failed.rpartition("::")[2]


def stratified(names: dict[Place, list[str]], size: int, seed: int) -> list[tuple[Place, str]]:
    """So many names at random, from as many modules as there are; all of them for a size of zero."""
    rng = random.Random(seed)
    ranked = [
        (rank, (place, name))
        for place in names
        for rank, name in enumerate(rng.sample(names[place], k=len(names[place])))
    ]
    rng.shuffle(ranked)
    return [named for _, named in sorted(ranked, key=lambda pair: pair[0])][: size or None]


def first_pass(asked: Asked) -> tuple[list[Mutant], Watch]:
    """The mutants, and what the tests of both rooms read; compiles what is compiled.

    Raises
    ------
    InputError
        A test fails without any mutant.
    """
    watch, names = Watch(), {}
    for room in ROOMS:
        for module, constants in constants_of(room).items():
            own = [field.name for field in dataclasses.fields(constants)]
            chosen = [name for name in own if not asked.modules or {module, f"{module}.{name}"} & {*asked.modules}]
            if chosen:
                names[room, module] = chosen
                watch.observe(module, constants)
    mutants = [
        Mutant(room, module, name, factor)
        for (room, module), name in stratified(names, asked.size, asked.seed)
        for factor in FACTORS
    ]
    folders = [REPOSITORY / "tests" / room.rpartition(".")[2] for room in dict.fromkeys(room for room, _ in names)]
    run([str(f) for folder in folders for f in sorted(folder.glob(asked.tests)) if f.name not in SLOW], watch)
    if watch.failed:
        raise InputError("a test fails without any mutant", got=watch.failed, remedy="mend it first")
    return mutants, watch


def outcomes(asked: Asked) -> Iterator[tuple[Mutant, str]]:
    """Each mutant with the first test that notices it; empty where none does."""
    os.chdir(REPOSITORY)
    mutants, watch = first_pass(asked)
    work = []
    for mutant in mutants:
        readers = watch.readers[mutant.module, mutant.name]
        ranked = sorted(readers, key=lambda test: (not _likely(test, mutant.module), watch.seconds[test]))
        work.append((mutant, [test for test in ranked if test and watch.seconds[test] <= asked.seconds]))
    with multiprocessing.get_context("fork").Pool(asked.jobs, maxtasksperchild=1) as pool:
        yield from pool.imap(noticed_by, work, chunksize=1)


def _likely(test: str, module: str) -> bool:
    """Whether a test was written for limits, or for a module."""
    file = test.partition("::")[0]
    return file.endswith(("_limits.py", f"test_{module}.py"))


@errors_reported()
def main() -> None:
    """Print the table, and the share that the tests notice."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="*")
    usual = Asked()
    parser.add_argument("--jobs", type=int, default=usual.jobs)
    parser.add_argument("--seconds", type=float, default=usual.seconds, help="of processor time that a test may take")
    parser.add_argument("--tests", default=usual.tests, help="files of tests, as test_*_limits.py for a quick look")
    parser.add_argument("--sample", type=int, default=0, help="so many constants instead of all, from all modules")
    parser.add_argument("--seed", type=int, default=usual.seed, help="of that sample")
    given = parser.parse_args()
    asked = Asked(tuple(given.modules), given.tests, given.sample, given.seed, given.jobs, given.seconds)
    survived = tried = 0
    for mutant, test in outcomes(asked):
        tried, survived = tried + 1, survived + (not test)
        verdict = f"noticed by {test}" if test else "survived"
        print(f"{mutant.module}.{mutant.name} x {mutant.factor:g}: {verdict}", flush=True)
    print(f"{tried - survived} of {tried} noticed")


if __name__ == "__main__":
    main()
