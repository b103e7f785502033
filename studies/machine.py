"""What a result was computed on: processor, cores and versions, and other programs, as found at run time."""

from __future__ import annotations

import os
import platform
import shutil
from pathlib import Path

from towval.io.provenance import versions

_SHOWN = ("towval", "python", "numpy", "scipy", "numba", "opencv-python-headless", "snakemake")


def machine() -> str:
    """Model of the processor and number of cores."""
    return f"{_processor()}, {os.cpu_count()} cores"


def version_line() -> str:
    """Versions that speed depends on, in one line."""
    found = versions()
    return ", ".join(f"{name} {found[name]}" for name in _SHOWN if name in found)


def program_path(name: str) -> str | None:
    """Where a program of others is, in the folder that ``TOWVAL_VIEWERS`` names or on the path, if anywhere."""
    return shutil.which(name, path=os.pathsep.join([os.environ.get("TOWVAL_VIEWERS", ""), os.environ["PATH"]]))


def _processor() -> str:
    """The model's name where the system reports it, else its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith(("model name", "Model"))]
    return names[0] if names else platform.processor() or platform.machine()
