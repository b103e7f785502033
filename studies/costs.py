"""CPU and wall times: of methods side by side, taken in turns in one run, and of single calls."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class Timed(Generic[Result]):
    """The result of a call with its least and its greatest CPU time [s] over all rounds."""

    result: Result
    cpu_s: float
    cpu_most_s: float


def take_turns(calls: Mapping[str, Callable[[], Result]], rounds: int) -> dict[str, Timed[Result]]:
    """Run all calls in turns, in one order and then in the other, and keep the least CPU time of each.

    Whatever else the machine does touches all of them alike. The least of two rounds or more is free of compiling and
    of first reads.

    Parameters
    ----------
    calls : mapping
        What to time, by name.
    rounds : int
        How often each is called, two or more.
    """
    spent: dict[str, list[float]] = {name: [] for name in calls}
    results: dict[str, Result] = {}
    for turn in range(rounds):
        for name in list(calls) if turn % 2 == 0 else list(calls)[::-1]:
            start = time.process_time()
            results[name] = calls[name]()
            spent[name].append(time.process_time() - start)
    return {name: Timed(results[name], min(spent[name]), max(spent[name])) for name in calls}


@dataclass(frozen=True)
class Cost:
    """CPU and wall time [s] of a call."""

    cpu_s: float
    wall_s: float


def measured_cost(run: Callable[[], Result]) -> tuple[Result, Cost]:
    """The result of a call and what it cost in this process."""
    cpu, wall = time.process_time(), time.perf_counter()
    result = run()
    return result, Cost(time.process_time() - cpu, time.perf_counter() - wall)


def cpu_seconds(run: Callable[[], object]) -> float:
    """CPU time of a call, all threads [s]."""
    start = time.process_time()
    run()
    return time.process_time() - start


def least_cpu_seconds(run: Callable[[], object], repeats: int = 5) -> float:
    """Least CPU time of several calls [s], after one that is not counted because it may compile."""
    run()
    return min(cpu_seconds(run) for _ in range(repeats))


def wall_and_cpu_seconds(run: Callable[[], object]) -> tuple[float, float]:
    """Wall time and CPU time of a call, its child processes included [s]."""
    wall, own, children = time.perf_counter(), time.process_time(), children_cpu_seconds()
    run()
    return time.perf_counter() - wall, time.process_time() - own + children_cpu_seconds() - children


def children_cpu_seconds() -> float:
    """CPU time of all child processes that have ended [s]."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
