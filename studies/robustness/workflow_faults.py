"""The whole workflow killed, starved of disk, memory or files, or in odd surroundings; then called again.

What is promised: one message, nothing half, and the next call ends with the bytes of an undisturbed run.
"""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from studies.worlds.folder import write_campaign

_REPOSITORY = Path(__file__).resolve().parents[2]
_FRAMES = 24
_SETTINGS = ("preset=draft", 'uncertainty={"samples":64}')
_SECONDS = 1200
_ASIDE = ("logs", "benchmarks")


@dataclass(frozen=True)
class Workplace:
    """A working folder with a small campaign beside it, and the workflow to run there."""

    folder: Path
    campaign: Path
    checkout: Path = _REPOSITORY

    @classmethod
    def made(cls, base: Path) -> "Workplace":
        """A campaign of a second, filmed anew in ``base``, which must exist."""
        campaign = base / "small"
        if not campaign.exists():
            campaign.mkdir()
            write_campaign(campaign, frames=_FRAMES)
        return cls(base / "work", campaign)

    def fresh(self) -> None:
        """Empty the working folder."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True, exist_ok=True)

    def start(self, environment: Mapping[str, str | None] | None = None, before: Callable[[], None] | None = None,
              wrapper: tuple[str, ...] = (), by_towval: bool = False) -> "subprocess.Popen[str]":  # fmt: skip
        """Start the workflow in a session of its own, with variables changed or (None) taken away.

        By Snakemake, or by ``towval run``.
        """
        if not (self.folder / "config.yaml").exists():
            shutil.copy(self.checkout / "config.yaml", self.folder)
        variables: dict[str, str | None] = {**self.variables(), **(environment or {})}
        line = [sys.executable, "-m", "snakemake", "--cores", "2", "--snakefile", str(self.checkout / "Snakefile")]
        line += ["--directory", ".", "--config", f"campaign={self.campaign}", *_SETTINGS]
        if by_towval:
            line = [sys.executable, "-m", "towval", "run", str(self.campaign), "--cores", "2"]
            line += [word for setting in _SETTINGS for word in ("--set", setting)]
        return subprocess.Popen(
            [*wrapper, *line],
            cwd=self.folder,
            env={name: value for name, value in variables.items() if value is not None},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            preexec_fn=partial(_prepare, before),  # noqa: PLW1509  # this program has one thread
        )

    def variables(self) -> dict[str, str]:
        """The environment with the packages of the checkout first."""
        return {**os.environ, "PYTHONPATH": os.pathsep.join([str(self.checkout / "src"), str(self.checkout)])}

    def run(self, **options: object) -> tuple[int, str]:
        """Exit code and words of a whole call."""
        process = self.start(**options)  # type: ignore[arg-type]  # those of start
        text, _ = process.communicate(timeout=_SECONDS)
        return process.returncode, text

    def undisturbed(self) -> str:
        """The digest of a whole call in an empty folder; `RuntimeError` where it fails."""
        self.fresh()
        code, text = self.run()
        if code:
            raise RuntimeError(text)
        return self.digest()

    def digest(self) -> str:
        """One hash of all results with their names."""
        digest = hashlib.sha256()
        results = self.folder / "results"
        for path in sorted(results.rglob("*")):
            name = path.relative_to(results)
            if path.is_file() and not any(part.startswith(".") or part in _ASIDE for part in name.parts):
                digest.update(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
        return digest.hexdigest()


def _prepare(before: Callable[[], None] | None) -> None:
    """What a call does first: Ctrl-C reaches it also where a shell started this program in the background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if before is not None:
        before()


def fault_of(text: str) -> str:
    """What is wrong with the words of a call that failed; empty where they are messages, ours or the system's."""
    if "Traceback (most recent call last)" in text:
        return "traceback"
    known = ("towval: ", "No space left on device", "Read-only file system")
    return "" if any(words in text for words in known) else "no message"


def kill_trials(place: Workplace, count: int, seed: int) -> Iterator[tuple[str, str]]:
    """Kill all processes of a call at a random moment, and call again; what was done, and the fault.

    Every fifth is a call of ``towval run`` that gets Ctrl-C: what Python says while it loads Snakemake itself is
    not ours.
    """
    begun = time.monotonic()
    wanted = place.undisturbed()
    lasts = time.monotonic() - begun
    rng = np.random.default_rng(seed)
    for i in range(count):
        place.fresh()
        wait_s, number = rng.uniform(0.0, 1.0) * lasts, signal.SIGINT if i % 5 == 4 else signal.SIGKILL
        by_towval = number == signal.SIGINT
        process = place.start(by_towval=by_towval)
        try:
            text, _ = process.communicate(timeout=wait_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, number)
            text, _ = process.communicate()
        fault = fault_of(text) if by_towval and process.returncode > 0 else ""
        code, after = place.run(by_towval=by_towval)
        if not fault:
            fault = fault_of(after) or f"exit {code}" if code else "" if place.digest() == wanted else "other bytes"
        told = f"{number.name} after {wait_s:.1f} of {lasts:.1f} s"
        yield told, fault and f"{fault}\n{text}\n----- the next call\n{after}"


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Callable[[int], None]]:
    """A file system of a size in memory at ``folder``; yields a function that changes the size. Needs root."""
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)], check=True)
    try:
        yield lambda size: _remount(folder, size, "rw")
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def _remount(folder: Path, kilobytes: int, access: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{access},size={kilobytes}k", str(folder)], check=True)


def full_disk_trials(place: Workplace, count: int) -> Iterator[tuple[str, str]]:
    """A disk that is full at ever later points, then given room."""
    wanted = place.undisturbed()
    total = sum(path.stat().st_size for path in place.folder.rglob("*") if path.is_file()) // 1024
    for share in np.linspace(0.02, 0.95, count):
        shutil.rmtree(place.folder, ignore_errors=True)
        with small_disk(place.folder, int(share * total) + 4) as resize:
            try:
                code, text = place.run()
            except OSError as error:  # not even the configuration fits
                code, text = 1, f"towval: {error}"
            fault = fault_of(text) if code else "" if place.digest() == wanted else "exit 0 with other bytes"
            resize(4 * total + 65536)
            code, more = place.run()
            if not fault:
                fault = f"exit {code}" if code else "" if place.digest() == wanted else "other bytes"
            yield f"disk of {share:.0%} of what is needed", fault and f"{fault}\n{text}\n-----\n{more}"


def read_only_trial(place: Workplace) -> Iterator[tuple[str, str]]:
    """A disk that becomes read-only before the call, and can be written again. Needs root."""
    wanted = place.undisturbed()
    shutil.rmtree(place.folder)
    with small_disk(place.folder, 2**20):
        shutil.copy(place.checkout / "config.yaml", place.folder)
        _remount(place.folder, 2**20, "ro")
        code, text = place.run()
        fault = fault_of(text) if code else "exit 0 on a disk that cannot be written"
        _remount(place.folder, 2**20, "rw")
        code, more = place.run()
        fault = fault or (f"exit {code}" if code else "" if place.digest() == wanted else "other bytes")
        yield "read-only disk", fault and f"{fault}\n{text}\n-----\n{more}"


def _limited(kind: int, value: int) -> Callable[[], None]:
    import resource  # noqa: PLC0415  # there is none on Windows

    return lambda: resource.setrlimit(kind, (value, value))


def surroundings_trials(place: Workplace) -> Iterator[tuple[str, str]]:
    """Missing variables and folders, small limits: works with the same bytes, or says so and works afterwards."""
    import resource  # noqa: PLC0415

    wanted = place.undisturbed()
    cases: dict[str, dict[str, object]] = {
        "no HOME": {"environment": {"HOME": None, "XDG_CACHE_HOME": None}},
        "HOME that is not there": {"environment": {"HOME": "/nonexistent", "XDG_CACHE_HOME": None}},
        "TMPDIR that is not there": {"environment": {"TMPDIR": "/nonexistent"}},
        "TMPDIR in another file system": {"environment": {"TMPDIR": "/dev/shm"}},
        "LANG=C": {"environment": {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0"}},
        "256 open files": {"before": _limited(resource.RLIMIT_NOFILE, 256)},
        "4 GB of address space": {"before": _limited(resource.RLIMIT_AS, 4 * 2**30)},
        "not root": {
            "wrapper": ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"),
            "environment": {"HOME": str(place.folder)},
        },
    }
    for name, options in cases.items():
        place.fresh()
        if name == "not root":
            place.folder.chmod(0o777)
            place.folder.parent.chmod(0o755)  # a temporary folder is its owner's alone
        told, (code, text) = name, place.run(**options)
        fault = fault_of(text) if code else "" if place.digest() == wanted else "other bytes"
        if code and not fault:
            code, text = place.run()
            fault = f"exit {code}" if code else "" if place.digest() == wanted else "other bytes"
            told = f"{name}, refused with a message"
        yield told, fault and f"{fault}\n{text}"
