"""Commands run and demo: the whole workflow, which comes with the package, on a campaign folder."""

import ctypes
import getpass
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import resources
from pathlib import Path
from typing import Any

import psutil

from towval.commands.console import Outcome
from towval.commands.settings import nested
from towval.io.atomic import write_bytes
from towval.io.campaign import Campaign, load_campaign
from towval.io.chain import changed_sections, read_origin
from towval.io.manifest import MANIFEST, read_manifest
from towval.io.schema import check, packaged_schema
from towval.io.summary_rows import read_summary
from towval.model.conventions import STAGES_OF_RUN
from towval.model.errors import InputError
from towval.model.statement import Verdict, rounded_up

SNAKEMAKE = ("--rerun-incomplete", "--keep-going", "--show-failed-logs", "--quiet", "host", "reason")

_SET_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of Linux' prctl(2)."""

_IDLE_S = 5.0
"""How long a workflow that was asked to end may have no process at work before it is interrupted [s]."""

_NOISE = re.compile(
    r"Assuming unrestricted|Building DAG|Using shell|Provided cores|Rules claiming|Conda environments|Job stats|job  |"
    r"---|\w+ +\d+$|Select jobs|Execute \d+ jobs|\[\w{3} \w{3} +\d+ [\d:]+ \d{4}\]$|Finished jobid|localrule all|"
    r"    (input|jobid|resources|tmpdir): |Complete log|Elapsed time|Storing output|$"
)
"""Lines of Snakemake that tell a waiting user nothing; all others are shown."""

_NOTHING = re.compile(r"total +0$|Nothing to be done")
"""Lines by which Snakemake says that all it was asked for is up to date."""

_ASKS_FOR_LESS = re.compile(r"-[UO]|--(unt|omit-fr|allowe|target-j|ba)")
"""Options of Snakemake, also shortened as it allows, by which "up to date" says nothing of the report."""

_KEYS = re.compile(r"-C|--config(=|$)")
_OPTION_REFUSED = re.compile(r"[\w. -]*: error: ")
"""How Snakemake begins to say what is wrong with its options, after it printed them all."""


def run(
    campaign: Path,
    results: Path = Path("results"),
    cores: int | None = None,
    keys: Mapping[str, Any] | None = None,
    snakemake: str = "",
) -> Outcome | None:
    """Run the workflow on a campaign folder: the same as ``snakemake`` in a clone of the repository.

    A folder with the campaign's name is made in ``results``; ``cores`` are all by default; ``keys`` of config.yaml have
    dots for sections (``track.method``); ``snakemake`` holds further options, as a shell takes them. The outcome is
    None where the report is not of this call, because these asked for less.

    Raises `InputError` for faults of campaign.yaml or of the keys, before anything runs, and `SystemExit` with
    Snakemake's code when a stage fails.
    """
    if cores is not None and cores < 1:
        raise InputError("--cores asks for none", got=cores, allowed="1 or more, or leave it out for all")
    given = load_campaign(campaign)
    places = {"campaign": str(campaign), "results": str(results)}
    stated = nested(keys or {})
    for key in (*places, "campaigns"):
        if key in stated:
            raise InputError(f"{key} is no key to set here", remedy="towval run CAMPAIGN --results FOLDER")
    config = places | stated
    check(config, packaged_schema("config.schema.yaml"), "the settings")
    snakefile = str(resources.files("towval").joinpath("workflow", "Snakefile"))
    options = _options(snakemake)
    # Those of the call follow --cores, which takes one value: an option that takes several would take a target, too.
    line = [sys.executable, "-m", "snakemake", "--snakefile", snakefile, *SNAKEMAKE]
    line += ["--cores", str(cores or os.cpu_count() or 1), *options, "--config"]
    line += [f"{key}={_as_yaml(value)}" for key, value in config.items()]
    made = results / given.name
    before, nothing_to_do = _made_ns(made / "report.html"), False
    # What the stages say goes where progress goes: standard output has the outcome only.
    with _ending_with_us(line) as (workflow, ended_by):
        for text in _system_errors_reported(workflow.stderr or (), ended_by):
            nothing_to_do |= bool(_NOTHING.match(text))
            if not _NOISE.match(text):
                print(text, end="", file=sys.stderr, flush=True)
    if workflow.returncode:
        _say_if_outdated(made)
        raise SystemExit(workflow.returncode)
    if nothing_to_do:
        _check_as_stated(made, given)
    after = _made_ns(made / "report.html")
    names_target = bool(options) and not options[0].startswith("-")
    nothing_to_do &= not names_target and not any(map(_ASKS_FOR_LESS.match, options))
    if after is None or (snakemake and after == before and not nothing_to_do):
        return None
    runs = read_summary(made / "summary.csv")
    return Outcome("run", ((made / "report.html").resolve(),), "", {"runs": runs}, details=_lines(runs))


def _check_as_stated(made: Path, given: Campaign) -> None:
    """Refuse results that were made with another campaign.yaml, where Snakemake made nothing anew.

    What results were made with it keeps in the working folder: from another one it compares dates alone.
    """
    stages = (*STAGES_OF_RUN, "exchange")
    files = [made / "camera.mcap", *(made / run / f"{stage}.mcap" for run in given.runs for stage in stages)]
    for path in filter(Path.is_file, files):
        changed = changed_sections(read_origin(path), given.document)
        if changed:
            raise InputError(
                f"{path} was made with another campaign.yaml, and nothing was made anew",
                got=f"changed since: {', '.join(changed)}",
                allowed="a call from the working folder of the first, where Snakemake keeps its notes (.snakemake)",
                remedy='call from there; or make all anew: --snakemake "--forceall"',
            )


def _say_if_outdated(made: Path) -> None:
    """Say that the report is of an earlier call where results that it shows have been made anew, or could not be."""
    with suppress(InputError):  # there is no list, or a damaged one
        changed = next((row for row in read_manifest(made / MANIFEST) if row.found != row.stated), None)
        if changed is not None and (made / "report.html").is_file():
            how = "is gone" if changed.found is None else "has changed"
            told = f"report.html, summary.csv and figures in {made} are of an earlier call: {changed.name} {how} since"
            print(f"towval: {told}", file=sys.stderr, flush=True)


def _made_ns(path: Path) -> int | None:
    """When a file was made; None where there is none."""
    return path.stat().st_mtime_ns if path.is_file() else None


def _options(text: str) -> list[str]:
    try:
        options = shlex.split(text)
    except ValueError as error:
        raise InputError(
            "--snakemake cannot be taken apart into options", got=error, remedy="close the quote"
        ) from None
    for option in filter(_KEYS.match, options):
        # Of two options --config Snakemake takes the last, which is that of this call.
        remedy = "towval run CAMPAIGN --set KEY=VALUE, as --set compare.tolerance_m=0.01"
        raise InputError("--snakemake would set keys of config.yaml, which it cannot", got=option, remedy=remedy)
    return options


@contextmanager
def _ending_with_us(line: Sequence[str]) -> Iterator[tuple["subprocess.Popen[str]", list[int]]]:
    """A process that ends with this one: with nobody reading its output Snakemake would wait forever.

    SIGTERM and SIGINT are passed on as SIGTERM, so that it can clean up; `KeyboardInterrupt` is raised after SIGINT.
    If this process is killed, so is that one (Linux). Yields the process and the signals that were passed on.
    """
    ended_by: list[int] = []
    libc = ctypes.CDLL(None) if sys.platform == "linux" else None

    def die_with_parent() -> None:
        if libc is not None:
            libc.prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)

    with subprocess.Popen(  # what runs between fork and exec is one call of the system
        line,
        stdout=2,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
        env=_environment(),
        preexec_fn=die_with_parent if libc is not None else None,  # noqa: PLW1509  # it makes one call of the system
    ) as process:

        def end(number: int, _: object) -> None:
            ended_by.append(number)
            process.terminate()
            if len(ended_by) == 1:
                threading.Thread(target=_interrupt_when_idle, args=(process,), daemon=True).start()

        before = {number: signal.signal(number, end) for number in (signal.SIGTERM, signal.SIGINT)}
        try:
            yield process, ended_by
            process.wait()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        if signal.SIGINT in ended_by:
            raise KeyboardInterrupt


def _interrupt_when_idle(process: "subprocess.Popen[str]") -> None:
    """Interrupt a workflow that was asked to end and neither does so nor has a process at work, and then kill it.

    Snakemake's handler of SIGTERM takes a lock without looking whether the thread that it interrupts holds it, as it
    does while it deals with a job that ended by the same signal: then it waits for itself. An interrupt helps, unless
    it is ignored, as by all that a script starts in the background.
    """
    idle_since, interrupted = time.monotonic(), False
    while process.poll() is None:
        with suppress(psutil.Error):
            if psutil.Process(process.pid).children():
                idle_since = time.monotonic()
        if time.monotonic() - idle_since > _IDLE_S:
            if interrupted:
                process.kill()
            else:
                process.send_signal(signal.SIGINT)
            idle_since, interrupted = time.monotonic(), True
        time.sleep(0.2)


def _environment() -> dict[str, str]:
    """Variables for Snakemake, which asks for the user's name: a container may run as a user without one."""
    try:
        getpass.getuser()
    except (KeyError, OSError):
        return {**os.environ, "LOGNAME": "towval"}
    return dict(os.environ)


def run_demo(folder: Path, results: Path = Path("results"), cores: int | None = None) -> Outcome | None:
    """Copy the sample of the package to ``folder`` and run the workflow on it.

    Raises `InputError` where the folder holds something else.
    """
    with resources.as_file(resources.files("towval").joinpath("sample")) as sample:
        files = {path.relative_to(sample): path for path in sorted(sample.rglob("*.*"))}
        missing = [name for name in files if not (folder / name).is_file()]
        # What a call that was interrupted copied counts, and a campaign.yaml may have been edited.
        footage = [name for name in files.keys() - missing if name.suffix != ".yaml"]
        holds_sample = footage and all((folder / n).stat().st_size == files[n].stat().st_size for n in footage)
        if folder.exists() and any(folder.iterdir()) and not holds_sample:
            remedy = "name another one; a campaign of your own runs with towval run"
            raise InputError("the folder does not hold the sample", got=folder, remedy=remedy)
        for name in missing:
            write_bytes(folder / name, files[name].read_bytes())
        if missing:
            print(f"The sample campaign: {folder.resolve()}", file=sys.stderr)
    return run(folder, results, cores)


def _system_errors_reported(lines: Iterable[str], ended_by: Collection[int] = ()) -> Iterator[str]:
    """The lines, with one message in place of all of Snakemake's tracebacks over one error of the system.

    Its traceback over Ctrl-C is left out, also where the signals by which it was ``ended_by`` then cut it off.
    """
    held: list[str] = []
    told: set[str] = set()
    for line in _shortened(lines):
        if held or line.startswith("Traceback (most recent call last)"):
            held.append(line)
            if not _SAID.match(line):
                continue
        if _REFUSED.match(line) and (held or told):
            said = _REFUSED.sub("", line).strip()
            if said not in told:
                remedy = _REMEDY_MISSING if line.startswith("FileNotFoundError") else _REMEDY
                yield f"towval: the system refuses Snakemake something: {said}\n  what to do: {remedy}\n"
            told.add(said)
        elif held and not line.startswith("KeyboardInterrupt"):
            yield from held
        elif not held and not (told and line.startswith("During handling of the above exception")):
            yield line
        held = []
    if not ended_by:
        yield from held


def _shortened(lines: Iterable[str]) -> Iterator[str]:
    """The lines, without blocks of Snakemake's and of Python's logging that help nobody here."""
    end = before = ""
    for line in lines:
        block = next((each for each in _BLOCKS if line.startswith(each[0])), None)
        if end:
            end = "" if end in line else end
        elif block is None:
            told = "towval: Snakemake refuses its options: "
            yield _OPTION_REFUSED.sub(told, line, count=1) if before == _USAGE else line
        else:
            before, end = block[:2]
            yield from block[2:]


_USAGE = "usage: "
_BLOCKS = (
    ("Call stack:", "Arguments:"),  # of a line that could not be written to the log
    (_USAGE, "[targets ...]"),
    (
        "LockException:",
        "--unlock",
        "towval: another call is making these results, or others from this folder\n"
        "  what to do: wait until it has ended; the lock of a call that was killed is removed by the next one (on "
        'Windows: --snakemake "--unlock")\n',
    ),
)
"""First words, words of the last line, and what is told instead."""
_SAID = re.compile(r"[\w.]+(Error|Exception|Interrupt|Exit)\b")
_REFUSED = re.compile(
    r"(OSError|PermissionError|FileNotFoundError|NotADirectoryError|FileExistsError|BlockingIOError): "
)
_REMEDY_MISSING = "correct that path; what is finished stays"
_REMEDY = "make room, or choose folders that can be written (also HOME and TMPDIR); what is finished stays"


def _as_yaml(value: Any) -> str:
    """A value that Snakemake reads as it is, also a path named 1 or ``lab #2``; it strips quotes off both ends."""
    return f" {json.dumps(value, ensure_ascii=False)} "


def _lines(runs: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """One line per run: the verdict, the bound to cite beside the tolerance, the error and its uncertainty."""
    lines = []
    for name, row in runs.items():
        known = row["verdict"] != Verdict.NOT_JUDGED and math.isfinite(row["error_upper_m"])
        bound_mm, tolerance_mm = rounded_up(1e3 * row["error_upper_m"], 1), 1e3 * row["tolerance_m"]
        bound = f"off by at most {bound_mm:.1f} mm, tolerance {tolerance_mm:g} mm; " if known else ""
        lines.append(
            f"run {name}: {row['verdict']}; {bound}simulated minus measured path {1e3 * row['path_rms_m']:.1f} mm RMS, "
            f"u_val {1e3 * row['u_val_m']:.1f} mm"
        )
    return tuple(lines)
