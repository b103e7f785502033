"""What every command does alike: settings from keys, provenance, progress, and errors told without a traceback."""

from __future__ import annotations

import dataclasses
import difflib
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from tqdm import tqdm

from towval.io.provenance import file_hash, versions
from towval.model import Finding, Severity
from towval.model.errors import InputError, TowvalError
from towval.model.plugins import load_plugins

Settings = TypeVar("Settings")


def settings_from(kind: type[Settings], keys: Mapping[str, Any] | None, section: str) -> Settings:
    """A stage's settings from the keys of its section of the configuration.

    Raises
    ------
    InputError
        For a key that the stage does not know, or a value that it refuses.
    """
    keys = dict(keys or {})
    known = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
    for name in keys:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            raise InputError(
                f"unknown key {section}.{name}",
                allowed=", ".join(known) or "none",
                remedy=f"did you mean {section}.{close[0]}?" if close else "remove it",
            )
    try:
        return kind(**keys)
    except TypeError as error:
        raise InputError(f"a value of {section} has the wrong type", got=error) from None


def without_auto(keys: Mapping[str, Any] | None, *choosable: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """A section's keys without those that say "auto", and the names of these; only some can be chosen by a probe."""
    keys = dict(keys or {})
    chosen = tuple(name for name in choosable if keys.get(name) == "auto")
    return {name: value for name, value in keys.items() if name not in chosen}, chosen


def provenance(settings: Any, inputs: Mapping[str, Path]) -> dict[str, str]:
    """What a result was made of: versions, settings, and the SHA-256 of each input file and plugin."""
    configuration = dataclasses.asdict(settings) if dataclasses.is_dataclass(settings) else dict(settings or {})
    plugins = {path.name: path for path in load_plugins()}
    hashes = {name: file_hash(path) for name, path in sorted({**plugins, **inputs}.items())}
    return {
        "versions": json.dumps(versions(), sort_keys=True),
        "settings": json.dumps(configuration, sort_keys=True),
        "inputs_sha256": json.dumps(hashes, sort_keys=True),
    }


def print_findings(findings: tuple[Finding, ...], stage: str) -> None:
    """Print a stage's findings: warnings and refusals to the error output, notes to the plain one."""
    for finding in findings:
        stream = sys.stdout if finding.severity == Severity.NOTE else sys.stderr
        print(f"{stage}: {finding.severity}: {finding.text}", file=stream)


@contextmanager
def errors_reported(log: Path | None = None) -> Iterator[None]:
    """Load the plugins, and turn an error of the input into one message and exit code 1.

    Parameters
    ----------
    log : Path, optional
        A file that gets the message, too.
    """
    try:
        load_plugins()
        yield
    except TowvalError as error:
        message = f"towval: {error}"
        print(message, file=sys.stderr)
        if log is not None:
            log.parent.mkdir(parents=True, exist_ok=True)
            log.write_text(message + "\n", encoding="utf-8")
        raise SystemExit(1) from None


@contextmanager
def progress(label: str, total: int | None, unit: str = "frame") -> Iterator[Callable[[int], None]]:
    """A progress bar on a terminal, a line every tenth part elsewhere; yields a function of the count done."""
    if sys.stderr.isatty():
        with tqdm(total=total, desc=label, unit=unit) as bar:
            yield lambda done: bar.update(done - bar.n)
        return
    next_line = 0.1

    def line(done: int) -> None:
        nonlocal next_line
        if total and done >= next_line * total:
            print(f"{label}: {done} of {total} {unit}s", file=sys.stderr, flush=True)
            next_line += 0.1

    yield line
