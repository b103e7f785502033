"""How this package compiles its inner loops.

Compiled code is kept on disk, so that only the first call after installing compiles. Numba knows a function's machine
code by the file the function stands in; but that code holds what other files contributed as well, and would outlive an
edit there. So each folder of sources has a cache named after the content of all files that may contribute: its own,
those of its subfolders, and all files of this package that compile anything. After an edit of other files what is
compiled stays.

Divisions follow IEEE 754 instead of raising, for a check at each would cost more than the division. Products and sums
are rounded one by one: where the compiler may contract them, the digits depend on what it inlines, and that on whether
a function was compiled just now or read from the disk. A function that takes liberties with arithmetic says so.
"""

import atexit
import hashlib
import importlib
import inspect
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit

_CONFIG: Any = numba.config  # Its attributes are set at run time.
_KEPT = 3  # Caches of a folder: a branch and the one it came from, and one to spare.


def _import_numba_without_scipy() -> None:
    """Import what numba imports at the first compiled call, without scipy.linalg.

    Numba imports that only to see whether its np.correlate can use BLAS, and it takes as long as a whole simulation.
    """
    name = "scipy.linalg.cython_blas"
    if name not in sys.modules:
        sys.modules[name] = None  # type: ignore[assignment]  # Python documents None as "not to be found".
        try:
            importlib.import_module("numba.np.arraymath")
        finally:
            del sys.modules[name]


_import_numba_without_scipy()

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(allocates: bool = True, **options: Any) -> Callable[[Function], Function]:
    """Decorator factory for a function in a numerical inner loop: use as ``@compiled()``.

    ``allocates``: whether the function makes arrays. One that does not is spared the counting of references to arrays
    that it is handed, a locked instruction each, which takes longer than much that is done with them. ``options`` are
    those of ``numba.njit``, where a function needs something else than the defaults above.
    """
    settings: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False}
    # No way in from C either: nobody calls by one, and it takes a sixth of the time of compiling.
    settings |= {"_nrt": allocates, "no_cfunc_wrapper": True, "nogil": True} | options

    def compile_later(function: Function) -> Function:
        users_choice = _CONFIG.CACHE_DIR
        _CONFIG.CACHE_DIR = str(_cache_folder(Path(inspect.getfile(function)).resolve().parent, users_choice))
        try:
            dispatcher: Function = njit(**settings)(function)
            return dispatcher
        finally:
            _CONFIG.CACHE_DIR = users_choice

    return compile_later


@cache
def _compiling_files() -> tuple[Path, ...]:
    """Files of this package that compile functions, which others may inline."""
    files = sorted(Path(__file__).resolve().parents[1].rglob("*.py"))
    return tuple(path for path in files if b"towval.model.compiling import" in path.read_bytes())


@cache
def _private_folder() -> Path:
    """A folder of the user's own for compiled code; one of this process where there is no home to write to."""
    try:
        folder = Path.home() / ".cache" / "towval"
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except (OSError, RuntimeError):
        pass
    # Never one that others could have made before: compiled code is run.
    kept = tempfile.TemporaryDirectory(prefix="towval-")
    atexit.register(kept.cleanup)
    return Path(kept.name)


@cache
def _cache_folder(sources: Path, users_choice: str) -> Path:
    digest = hashlib.sha256()
    for path in (*sorted(sources.rglob("*.py")), *_compiling_files()):
        digest.update(path.read_bytes())
    if users_choice:
        base = Path(users_choice)
    elif os.access(sources, os.W_OK):
        base = sources / "__pycache__"
    else:
        base = _private_folder()
    folder = base / f"compiled-{sources.name}-{digest.hexdigest()[:16]}"
    if not folder.exists():
        older = sorted(base.glob(f"compiled-{sources.name}-*"), key=lambda p: p.stat().st_mtime, reverse=True)
        for outlived in older[_KEPT - 1 :]:
            shutil.rmtree(outlived, ignore_errors=True)
    return folder
