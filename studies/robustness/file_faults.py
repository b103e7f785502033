"""Damaged files of every kind, read as the program reads them: refused, read as before, or wrong without a word."""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from studies.robustness.trial import attempt
from towval.commands.run_folder import files as run_files
from towval.io.chain import check_together
from towval.io.exchange import LAYOUTS
from towval.io.manifest import MANIFEST, read_manifest, unlisted
from towval.io.mcap_file import read_mcap
from towval.io.provenance import file_hash
from towval.model.errors import InputError

_RUNS = ("a", "b")


def read_trials(results: Path, count: int, seed: int, corpus: Path) -> Counter[str]:
    """Outcomes of reading damaged results: "refused", "same" (read as before), "wrong", or what a trial may be else.

    Every file of two runs is damaged in turn: bits, bytes, its end, a digit, or all of it swapped for another's.
    """
    rng = np.random.default_rng(seed)
    kinds = [path for path in sorted(results.rglob("*")) if path.is_file() and not _is_log(path, results)]
    outcomes: Counter[str] = Counter()
    for i in range(count):
        path = kinds[i % len(kinds)]
        whole = path.read_bytes()
        how, data = _damaged(whole, path, results, rng)
        if data == whole:
            outcomes["same"] += 1
            continue
        try:
            path.write_bytes(data)
            outcome = attempt(_reader(path, results))
        finally:
            path.write_bytes(whole)
        name = "wrong" if outcome.kind == "returned" else outcome.kind
        outcomes[name] += 1
        if name != "refused":
            corpus.mkdir(parents=True, exist_ok=True)
            where = path.relative_to(results)
            (corpus / f"read_{seed}_{i}.txt").write_text(f"{where}: {how}\n{name}\n{outcome.text}\n", encoding="utf-8")
    return outcomes


def _is_log(path: Path, results: Path) -> bool:
    return bool({"logs", "benchmarks"} & set(path.relative_to(results).parts)) or path.name.startswith(".")


def _reader(path: Path, results: Path) -> Callable[[], Any]:
    """How the program meets a file: results by their stages' readers, all else by the list of files."""

    def as_result() -> None:
        read_mcap(path)
        if path.parent.name in _RUNS and path.stem != "exchange":
            together = {file.name: file for file in run_files(path.parent).values()}
            check_together({**together, "camera.mcap": results / "camera.mcap"}, run=path.parent.name)
        elif path.name == "camera.mcap":
            for run in _RUNS:
                check_together({"camera.mcap": path, "track.mcap": results / run / "track.mcap"}, run=run)

    def as_listed() -> None:
        rows = read_manifest(results / MANIFEST)
        wrong = [row.name for row in rows if row.found != row.stated] + list(unlisted(results, rows))
        if wrong:
            raise InputError(f"{wrong[0]} is not what {MANIFEST} lists")

    def as_layout() -> None:
        other = results / next(run for run in _RUNS if run != path.parent.name) / path.name
        if file_hash(path) != file_hash(other):
            raise InputError(f"{path.name} is not the layout")

    if path.name in LAYOUTS:
        return as_layout
    return as_result if path.suffix == ".mcap" else as_listed


def _damaged(whole: bytes, path: Path, results: Path, rng: np.random.Generator) -> tuple[str, bytes]:
    at = int(rng.integers(max(len(whole), 1)))
    until = at + int(rng.integers(1, 64))
    digits = [match.start() for match in re.finditer(rb"[0-9]", whole[:200_000])] or [at]
    digit = digits[rng.integers(len(digits))]
    other = results / ("b" if path.parent.name == "a" else "a") / path.name
    faults = {
        "bit": whole[:at] + bytes([whole[at] ^ 1 << int(rng.integers(8))]) + whole[at + 1 :],
        "bytes": whole[:at] + rng.bytes(until - at) + whole[until:],
        "cut": whole[:at],
        "digit": whole[:digit] + b"%d" % ((whole[digit] - 47) % 10) + whole[digit + 1 :],
        "swap": other.read_bytes() if path.parent.name in _RUNS else whole[::-1],
        "append": whole + rng.bytes(8),
        "zeros": whole[:at] + bytes(until - at) + whole[until:],
        "hole": whole[:at] + whole[until:],
    }
    kind = list(faults)[rng.integers(len(faults))]
    return f"{kind} at {digit if kind == 'digit' else at}", faults[kind]
