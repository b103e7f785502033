"""Damaged files of every kind, read as the program reads them: refused, read as before, or wrong without a word."""

import re
from collections import Counter
from collections.abc import Callable
from importlib.resources import files as packaged
from pathlib import Path
from typing import Any

import numpy as np

from studies.robustness.trial import attempt
from towval.commands.run_folder import files as run_files
from towval.io.chain import check_together
from towval.io.exchange import LAYOUTS
from towval.io.manifest import MANIFEST, read_manifest, unlisted
from towval.io.mcap_file import read_mcap
from towval.model.errors import InputError


def read_trials(results: Path, count: int, seed: int, corpus: Path) -> Counter[str]:
    """Outcomes of reading damaged results: "refused", "same" (read as before), "wrong", or what a trial may be else.

    Every file is damaged in turn: bits, bytes, its end, a digit, or all of it swapped for that of another run.
    """
    rng = np.random.default_rng(seed)
    runs = sorted(path.parent.name for path in results.glob("*/track.mcap"))
    kinds = [path for path in sorted(results.rglob("*")) if path.is_file() and not _is_log(path, results)]
    outcomes: Counter[str] = Counter()
    for i in range(count):
        path = kinds[i % len(kinds)]
        whole = path.read_bytes()
        how, data = _damaged(whole, _swapped(path, runs), rng)
        if data == whole:
            outcomes["same"] += 1
            continue
        try:
            path.write_bytes(data)
            outcome = attempt(_reader(path, results, runs))
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


def _reader(path: Path, results: Path, runs: list[str]) -> Callable[[], Any]:
    """How the program meets a file: results by their stages' readers, all else by the list of files."""

    def as_result() -> None:
        read_mcap(path)
        if path.parent.name in runs and path.stem != "exchange":
            together = {file.name: file for file in run_files(path.parent).values()}
            check_together({**together, "camera.mcap": results / "camera.mcap"}, run=path.parent.name)
        elif path.name == "camera.mcap":
            for run in runs:
                check_together({"camera.mcap": path, "track.mcap": results / run / "track.mcap"}, run=run)

    def as_listed() -> None:
        rows = read_manifest(results / MANIFEST)
        wrong = [row.name for row in rows if row.found != row.stated] + list(unlisted(results, rows))
        if wrong:
            raise InputError(f"{wrong[0]} is not what {MANIFEST} lists")

    def as_layout() -> None:
        if path.read_bytes() != (packaged("towval.io") / "layouts" / path.name).read_bytes():
            raise InputError(f"{path.name} is not the layout")

    if path.name in LAYOUTS:
        return as_layout
    return as_result if path.suffix == ".mcap" else as_listed


def _swapped(path: Path, runs: list[str]) -> bytes:
    """The same file of another run; where there is none, the bytes of the file in the reverse order."""
    others = [run for run in runs if run != path.parent.name]
    if path.parent.name in runs and others:
        return (path.parent.parent / others[0] / path.name).read_bytes()
    return path.read_bytes()[::-1]


def _damaged(whole: bytes, swapped: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    at = int(rng.integers(max(len(whole), 1)))
    until = at + int(rng.integers(1, 64))
    digits = [match.start() for match in re.finditer(rb"[0-9]", whole[:200_000])] or [at]
    digit = digits[rng.integers(len(digits))]
    faults = {
        "bit": whole[:at] + bytes([whole[at] ^ 1 << int(rng.integers(8))]) + whole[at + 1 :],
        "bytes": whole[:at] + rng.bytes(until - at) + whole[until:],
        "cut": whole[:at],
        "digit": whole[:digit] + b"%d" % ((whole[digit] - 47) % 10) + whole[digit + 1 :],
        "swap": swapped,
        "append": whole + rng.bytes(8),
        "zeros": whole[:at] + bytes(until - at) + whole[until:],
        "hole": whole[:at] + whole[until:],
    }
    kind = list(faults)[rng.integers(len(faults))]
    return f"{kind} at {digit if kind == 'digit' else at}", faults[kind]
