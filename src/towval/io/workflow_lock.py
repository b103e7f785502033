"""Removes the locks that a killed workflow leaves behind, and keeps those of one that is still running."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from towval.model.errors import InputError

try:
    import fcntl
except ImportError:  # not on Windows, where a stale lock stays and Snakemake says what to do
    fcntl = None  # type: ignore[assignment]

_held: list[int] = []
"""Open while this process lives; the system releases it however the process ends."""


def clear_stale_locks(folder: Path, results: Path) -> None:
    """Remove Snakemake's locks on ``results`` where no other call of this workflow is alive in ``folder``.

    Every call holds a shared lock of the system on ``.snakemake/towval.lock``. A call that gets it exclusively is the
    only one: a lock of Snakemake's that is there nevertheless was left by a killed call, or by a power cut. Locks on
    other files may be those of another workflow and stay.

    Raises `InputError` when the folder cannot be written.
    """
    if fcntl is None or _held:
        return
    try:
        (folder / ".snakemake").mkdir(exist_ok=True)
        handle = os.open(folder / ".snakemake" / "towval.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise InputError(
            f"the folder {folder} cannot be written",
            got=error.strerror,
            allowed="a working folder in which Snakemake keeps its notes",
            remedy="make room or change its rights, or call from another folder",
        ) from None
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pass
        else:
            for lock in _locks_on(folder / ".snakemake" / "locks", results):
                lock.unlink(missing_ok=True)
                print(f"towval: the last call was killed; its lock {lock.name} is removed", file=sys.stderr)
        fcntl.flock(handle, fcntl.LOCK_SH)
        _held.append(handle)
    except OSError:
        os.close(handle)  # a file system without such locks


def _locks_on(folder: Path, results: Path) -> Iterator[Path]:
    """Snakemake's locks of a call that makes ``results``, and of what it reads."""
    outputs = sorted(folder.glob("*.output.lock"))
    for lock in outputs:
        files = lock.read_text(encoding="utf-8", errors="replace").splitlines()
        if files and all(Path(file).is_relative_to(results) for file in files):
            yield lock
            yield lock.with_name(lock.name.replace("output", "input"))
    if not outputs:  # killed between the two: nothing is made yet, and inputs alone protect nothing
        yield from folder.glob("*.input.lock")
