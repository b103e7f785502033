"""Output of commands: findings, progress, and errors of the input as one message."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from towval.model import Finding, Severity
from towval.model.errors import TowvalError
from towval.model.plugins import load_plugins


def print_findings(findings: tuple[Finding, ...], stage: str) -> None:
    """Print the findings of a stage: notes to standard output, warnings and refusals to standard error."""
    for finding in findings:
        stream = sys.stdout if finding.severity == Severity.NOTE else sys.stderr
        print(f"{stage}: {finding.severity}: {finding.text}", file=stream)


@contextmanager
def errors_reported(log: Path | None = None) -> Iterator[None]:
    """Load the plugins; report an error of the input as one message, also in the file ``log``, with exit code 1."""
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
    """A progress bar on a terminal, a line every 10 % elsewhere; yields a function of the count done."""
    if sys.stderr.isatty():
        from tqdm import tqdm  # noqa: PLC0415  # not at start-up: only a terminal needs it

        with tqdm(total=total, desc=label, unit=unit) as bar:

            def advance(done: int) -> None:
                bar.update(done - bar.n)

            yield advance
        return
    next_line = 0.1

    def line(done: int) -> None:
        nonlocal next_line
        if total and done >= next_line * total:
            print(f"{label}: {done} of {total} {unit}s", file=sys.stderr, flush=True)
            next_line += 0.1

    yield line
