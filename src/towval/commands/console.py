"""Output of commands: findings, progress, and errors of the input as one message."""

import io
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn, TextIO

from towval.io.mcap_file import json_value
from towval.io.reading import remedy_of
from towval.model import Finding, Severity
from towval.model.errors import InputError, TowvalError
from towval.model.plugins import load_plugins


@dataclass(frozen=True)
class Outcome:
    """What a command made.

    ``stage`` with the run where there is one; ``files`` written, the main one first; ``text`` how good it is, in a
    line; ``numbers`` the same for programs, units in the names; ``findings`` of the stage; ``details`` lines that
    people see before that line; ``failure`` to be raised once all is shown.
    """

    stage: str
    files: tuple[Path, ...]
    text: str
    numbers: Mapping[str, Any] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    details: tuple[str, ...] = ()
    failure: TowvalError | None = None


def show(outcome: Outcome, as_json: bool = False) -> None:
    """Print an outcome: its findings (warnings and refusals to standard error) and one line, or one JSON object.

    Raises its ``failure`` then.
    """
    if as_json:
        found = [{"code": f.code, "severity": f.severity.value, "text": f.text} for f in outcome.findings]
        files = [str(path) for path in outcome.files]
        numbers = json_value(dict(outcome.numbers))
        # In ASCII, whatever coding the terminal has: programs read it with names as they are.
        print(json.dumps({"stage": outcome.stage, "files": files, **numbers, "findings": found}))
    else:
        _print_for_people(outcome)
    sys.stdout.flush()
    if outcome.failure is not None:
        raise outcome.failure


def _print_for_people(outcome: Outcome) -> None:
    for finding in outcome.findings:
        stream = sys.stdout if finding.severity == Severity.NOTE else sys.stderr
        _print_whole(f"{outcome.stage}: {finding.severity}: {finding.text}", stream)
    files = ", ".join(map(str, outcome.files))
    for line in (*outcome.details, ": ".join(filter(None, (outcome.stage, files, outcome.text)))):
        _print_whole(line, sys.stdout)


def _print_whole(line: str, stream: TextIO) -> None:
    """Print a line with its end in one piece: unbuffered, the stages of a workflow write between the two."""
    print(f"{line}\n", end="", file=stream, flush=stream is sys.stderr)


_INTERRUPTED = "towval: interrupted; what is finished stays, and the next call goes on from there"


@contextmanager
def errors_reported(log: Path | None = None) -> Iterator[None]:
    """Load the plugins; report an error of the input or of the system as one message, with exit code 1.

    The message also goes into the file ``log``. An interruption ends with exit code 130.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ° or é must not end a stage
    try:
        load_plugins()
        yield
    except TowvalError as error:
        _end(f"towval: {error}", log)
    except BrokenPipeError:
        raise SystemExit(1) from None  # nobody reads on
    except OSError as error:
        _end(f"towval: {_of_system(error)}", log)
    except MemoryError:
        _end("towval: there is too little memory\n  what to do: close other programs, or allow more (ulimit -v)", log)
    except KeyboardInterrupt:
        _end(_INTERRUPTED, log, 130)
    except SystemError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C met compiled code on its way back
            raise
        _end(_INTERRUPTED, log, 130)


def _of_system(error: OSError) -> InputError:
    place = error.filename if error.filename is not None else "a file"
    return InputError(f"the system refuses {place}", got=error.strerror or str(error), remedy=remedy_of(error))


def _end(message: str, log: Path | None, code: int = 1) -> NoReturn:
    print(message, file=sys.stderr)
    if log is not None:
        with suppress(OSError):  # the disk may be what failed
            log.parent.mkdir(parents=True, exist_ok=True)
            log.write_text(message + "\n", encoding="utf-8")
    raise SystemExit(code)


def step(text: str) -> None:
    """Say what comes next, where it takes a while: to standard error, as progress."""
    print(text, file=sys.stderr, flush=True)


_UNTOLD_S = 20.0
"""How long work whose end is not known may go on without a line [s]."""


@contextmanager
def progress(label: str, total: int | None, unit: str = "frame") -> Iterator[Callable[[int], None]]:
    """A progress bar on a terminal, else a line every 10 % of a known total, or every 20 s where it is not known.

    Yields a function of the count done.
    """
    if sys.stderr.isatty():
        from tqdm import tqdm  # noqa: PLC0415  # not at start-up: only a terminal needs it

        with tqdm(total=total, desc=label, unit=unit) as bar:

            def advance(done: int) -> None:
                bar.update(done - bar.n)

            yield advance
        return
    next_line, told_s = 0.1, time.monotonic()

    def line(done: int) -> None:
        nonlocal next_line, told_s
        if total is None and time.monotonic() - told_s >= _UNTOLD_S:
            _print_whole(f"{label}: {done} {unit}{'s' * (done != 1)}", sys.stderr)
            told_s = time.monotonic()
        if total and done >= next_line * total:
            _print_whole(f"{label}: {done} of {total} {unit}s", sys.stderr)
            next_line += 0.1

    yield line
