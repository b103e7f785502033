"""How this package compiles its inner loops.

Compiled code is cached on disk, so only the first call after installation compiles. Numba identifies cached code by the
file that defines the function, but inlined code from other files would then survive an edit of those files. Each source
folder therefore has a cache named after the contents of all files that may contribute: its own, those of its subfolders
and every file of this package that compiles anything or tells numba how. Edits of other files leave the cache valid.

Division by zero follows IEEE 754 instead of raising, because a check would cost more than the division. Products and
sums are rounded separately: if the compiler were free to fuse them, the last digits would depend on what it inlines,
and that on whether a function was just compiled or read from the cache. Exceptions are marked where they are made.

Numba tells functions of one name apart by a number that it counts up in each process, and takes it into the symbols of
the machine code. What two processes have cached may then hold two functions under one symbol, of which a third process
runs one for both: wrong numbers, or none at all (numba's issue 10486). Each process counts from a random number here.
"""

import atexit
import hashlib
import importlib
import inspect
import itertools
import os
import secrets
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import Cache
from numba.core.runtime import rtsys

_CONFIG: Any = numba.config  # Its attributes are set at run time.
_KEPT = 3  # Caches kept per folder: those of two branches and one spare.


def _import_numba_without_scipy() -> None:
    """Import the modules that numba loads at the first compiled call, except scipy.linalg.

    Numba imports it only to check whether np.correlate can use BLAS, and the import takes as long as a simulation.
    """
    name = "scipy.linalg.cython_blas"
    if name not in sys.modules:
        sys.modules[name] = None  # type: ignore[assignment]  # Python documents None as "not to be found".
        try:
            importlib.import_module("numba.np.arraymath")
        finally:
            del sys.modules[name]


_import_numba_without_scipy()


def _number_functions_apart() -> None:
    """Let this process number what it compiles from where no other does: 2**48 starts leave each 2**15 numbers."""
    FunctionIdentity._unique_ids = itertools.count(secrets.randbits(48) << 15)


_number_functions_apart()
if hasattr(os, "register_at_fork"):  # Not where processes cannot fork.
    os.register_at_fork(after_in_child=_number_functions_apart)


def _load_without_compiler() -> None:
    """Load what is cached without all that compiling needs, which takes longer than the loads of a stage together.

    Numba sets that up before it looks into a cache, and again before it compiles; cached code needs the memory system.
    """

    def load_overload(cache: Any, signature: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with cache._guard_against_spurious_io_errors():
            return cache._load_overload(signature, target_context)

    Cache.load_overload = load_overload  # type: ignore[method-assign]  # That is the point.


_load_without_compiler()

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(allocates: bool = True, **options: Any) -> Callable[[Function], Function]:
    """Decorator factory for a function in a numerical inner loop: use as ``@compiled()``.

    ``allocates``: whether the function creates arrays. If not, reference counting of its array arguments is switched
    off: each count is a locked instruction, which often takes longer than the work on the array. ``options`` are those
    of ``numba.njit``, for a function that needs other settings than the defaults: ``forceinline`` where a short one
    takes many arrays, each of which is passed as ten numbers.
    """
    settings: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False}
    # No C wrapper: nothing calls it, and it takes a sixth of the compile time.
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
    """Files of this package that compile functions, which other files may inline."""
    files = sorted(Path(__file__).resolve().parents[1].rglob("*.py"))
    marks = b"towval.model.compiling import", b"numba.extending import"
    return tuple(path for path in files if any(mark in path.read_bytes() for mark in marks))


@cache
def _private_folder() -> Path:
    """The user's own folder for compiled code; a temporary one for this process if the home is not writable."""
    try:
        folder = Path.home() / ".cache" / "towval"
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except (OSError, RuntimeError):
        pass
    # Never a folder that another user could have created before: its code is executed.
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
        with suppress(FileNotFoundError):  # another process, started at the same time, removes the same
            older = sorted(base.glob(f"compiled-{sources.name}-*"), key=lambda p: p.stat().st_mtime, reverse=True)
            for outlived in older[_KEPT - 1 :]:
                shutil.rmtree(outlived, ignore_errors=True)
    return folder
