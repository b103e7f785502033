"""What a method costs, beside others, in one run: CPU time, taken in turns."""

from __future__ import annotations

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
