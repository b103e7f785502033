"""Commands of the ledger: run one check as the program is, or with one of its faults planted, and keep the outcome."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Sequence
from contextlib import nullcontext
from datetime import UTC, datetime
from pathlib import Path

from studies.costs import children_cpu_seconds
from studies.evidence.ledger import ROWS, Check
from studies.frame import loaded, module_of
from studies.machine import machine
from towval.io.atomic import write_text
from towval.io.provenance import module_files
from towval.model.errors import TowvalError

REPOSITORY = Path(__file__).resolve().parents[2]


def shared_folder() -> Path:
    """Footage and data of others, which are not part of the repository: beside it, or where TOWVAL_SHARED says."""
    return Path(os.environ.get("TOWVAL_SHARED", REPOSITORY.parent / "shared"))


def run_check(check: str, fault: str, output: Path) -> None:
    """Measure the numbers of a group and write them with date, commit and cost.

    Parameters
    ----------
    check : str
        Reference ``module:NAME`` of a :class:`studies.evidence.ledger.Check`.
    fault : str
        Description of the fault to plant, empty for the program as it is. With a fault the program may refuse its
        input, which notices it as well; any other error is one of the fault itself.
    output : Path
        JSON to write.
    """
    found: Check = loaded(check)
    start = time.process_time() + children_cpu_seconds()
    with found.faults[fault]() if fault else nullcontext():
        try:
            values = dict(found.measure())
        except TowvalError as error:
            if not fault:
                raise
            values = {"stopped": f"refused: {error}".splitlines()[0]}
    outcome = {
        "values": values,
        "fault": fault,
        "date": datetime.now(UTC).date().isoformat(),
        "commit": commit(),
        "machine": machine(),
        "cpu_s": round(time.process_time() + children_cpu_seconds() - start, 1),
    }
    write_text(output, json.dumps(outcome, indent=2, ensure_ascii=False) + "\n")


def commit() -> str:
    """The commit that is checked out, with a plus where files differ from it; a dash outside a repository."""

    head = _git("rev-parse", "--short=7", "HEAD")
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", "src", "studies")
    return f"{head}{'+' if changed else ''}" if head else "–"


def changed_since(made_at: str, check: str, runs: Sequence[str] = ()) -> int | None:
    """How many files of a check's module and of all it imports differ from those of the commit it was made at.

    With ``runs``, folders of the repository, the files in them count as well.

    The rows do not count: what is stated is no part of how it is measured. None where that cannot be told: the commit
    is not in this clone, or this is none.
    """
    base = made_at.rstrip("+")
    if not _git("rev-parse", "--verify", "--quiet", f"{base}^{{commit}}"):
        return None
    method = set(module_files(module_of(check))) - {ROWS}
    files = [str(path) for path in sorted(method) if path.is_relative_to(REPOSITORY)]
    return len((_git("diff", "--name-only", base, "--", *files, *runs) or "").splitlines())


def _git(*words: str) -> str | None:
    """What git prints in this repository; None where it fails."""
    done = subprocess.run(["git", "-C", str(REPOSITORY), *words], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
