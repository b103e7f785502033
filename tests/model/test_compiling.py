"""Compiled code is kept, and never outlives an edit of the sources it came from."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import TypingError

from towval.model.compiling import _cache_folder, _compiling_files, compiled

CALLER = """
from towval.model.compiling import compiled
from helper import scale


@compiled()
def twice(x):
    return 2.0 * scale(x)
"""

HELPER = """
from towval.model.compiling import compiled


@compiled()
def scale(x):
    return {factor} * x
"""


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    folder = tmp_path / "kernels"
    folder.mkdir()
    (folder / "caller.py").write_text(CALLER)
    (folder / "helper.py").write_text(HELPER.format(factor=1.0))
    return folder


def call(sources: Path, **environment: str) -> tuple[float, bool]:
    """What ``twice(3)`` gives in a process of its own, and whether the machine code came from the disk."""
    program = "from caller import twice; print(twice(3.0), sum(twice.stats.cache_hits.values()))"
    # Python tells an edit from its own bytecode by size and whole seconds, which two edits here may share.
    kept = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=sources,
        env={**kept, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits = done.stdout.split()
    return float(value), hits == "1"


def test_an_edit_of_a_called_function_reaches_its_caller(sources: Path) -> None:
    assert call(sources) == (6.0, False)
    assert call(sources) == (6.0, True)
    (sources / "helper.py").write_text(HELPER.format(factor=5.0))
    assert call(sources) == (30.0, False)


def test_an_edit_in_a_subfolder_reaches_what_calls_it(sources: Path) -> None:
    (sources / "deeper").mkdir()
    (sources / "deeper" / "inner.py").write_text(HELPER.format(factor=2.0))
    (sources / "helper.py").write_text("from deeper.inner import scale as scale\n")
    assert call(sources) == (12.0, False)
    assert call(sources) == (12.0, True)
    (sources / "deeper" / "inner.py").write_text(HELPER.format(factor=7.0))
    assert call(sources) == (42.0, False)


def test_an_edit_of_compiled_code_elsewhere_in_the_package_is_noticed() -> None:
    files = {path.name for path in _compiling_files()}
    assert {"wrench.py", "projection.py", "light.py"} <= files
    assert "campaign.py" not in files


PRODUCT = """
from towval.model.compiling import compiled


@compiled()
def product(x):
    return x * x
"""

SUM = """
import numpy as np
from factors import product
from towval.model.compiling import compiled


@compiled()
def sums(x, out):
    for i in range(len(x)):
        out[i] = product(x[i]) - x[i] * 0.3


x = np.random.default_rng(0).normal(size=2000)
out = np.empty_like(x)
sums(x, out)
print(out.view(np.int64).sum(), np.array_equal(out, x * x - x * 0.3))
"""


def test_products_and_sums_are_rounded_one_by_one(sources: Path) -> None:
    """Else the digits would depend on what is inlined; and so on whether code was compiled just now or kept."""
    (sources / "factors.py").write_text(PRODUCT)
    (sources / "summing.py").write_text(SUM)
    kept = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    command = [sys.executable, "-c", "import summing"]
    runs = [
        subprocess.run(command, cwd=sources, env=kept, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert runs[0].split()[1] == "True"


def test_old_caches_do_not_pile_up(sources: Path) -> None:
    for factor in range(1, 7):
        (sources / "helper.py").write_text(HELPER.format(factor=float(factor)))
        assert call(sources)[0] == pytest.approx(6.0 * factor)
    assert len(list((sources / "__pycache__").glob("compiled-*"))) == 3


def test_processes_that_start_together_may_remove_the_same_caches(sources: Path, tmp_path: Path, monkeypatch) -> None:
    """One looked at the age of a folder that another had just removed: its import ended with a traceback."""
    for number in range(5):
        (tmp_path / "kept" / f"compiled-kernels-{number}").mkdir(parents=True)
    listing = Path.glob

    def removed_meanwhile(folder: Path, pattern: str) -> list[Path]:
        found = list(listing(folder, pattern))
        found[0].rmdir()
        return found

    monkeypatch.setattr(Path, "glob", removed_meanwhile)
    assert _cache_folder(sources, str(tmp_path / "kept")).parent == tmp_path / "kept"


def test_the_users_choice_of_place_is_kept(sources: Path, tmp_path: Path) -> None:
    place = tmp_path / "elsewhere"
    call(sources, NUMBA_CACHE_DIR=str(place))
    assert list(place.glob("compiled-kernels-*"))
    assert not list((sources / "__pycache__").glob("compiled-*"))


def test_functions_said_to_make_no_arrays_cannot():
    @compiled(allocates=False, cache=False)
    def makes_one(n):
        return np.zeros(n)

    with pytest.raises(TypingError, match="zeros"):
        makes_one(3)


def test_numba_is_there_without_scipy_and_scipy_works_after_it():
    program = (
        "import sys, numpy as np, towval.model.compiling\n"
        "@towval.model.compiling.compiled(cache=False)\n"
        "def solved(a, b): return np.linalg.solve(a, b)\n"
        "print('scipy.linalg' in sys.modules)\n"
        "print(solved(2 * np.eye(2), np.ones(2)))\n"
        "print('scipy.linalg' in sys.modules)\n"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.split("\n")[:3] == ["False", "[0.5 0.5]", "True"]


def test_files_that_tell_numba_how_to_compile_count_for_all_folders():
    """Their code is inlined wherever it is used: by the spatial tow, too, which is in another folder."""
    assert {"lanes.py", "contact.py"} <= {path.name for path in _compiling_files()}


SCALING = """
from numba.extending import overload


def scaled(factor):
    def scale(x):
        "Only ever compiled."

    @overload(scale)
    def compile_scale(x):
        def scale(x):
            total = 0.0
            for k in range(int(x)):  # One line would be inlined, and no symbol be left of it.
                total += factor * (x + total) / (k + 1)
            return total

        return scale

    return scale
"""

SCALED = """
from scaling import scaled
from towval.model.compiling import compiled

scale = scaled({factor})


@compiled()
def {name}(x):
    return scale(x) + scale(x + 1.0) + scale(2.0 * x)
"""

CALLS = """
import importlib
import os
import sys

forks = sys.argv[1] == "forked"
for name in sys.argv[2:]:
    if not forks or not os.fork():
        function = getattr(importlib.import_module(name), name)
        print(function(3.0), sum(function.stats.cache_hits.values()), flush=True)
        if forks:
            os._exit(0)
    else:
        os.wait()
"""


@pytest.mark.parametrize(
    "forks",
    [False, pytest.param(True, marks=pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork"))],
)
def test_functions_of_one_name_are_told_apart_in_the_caches_of_two_processes(tmp_path: Path, forks: bool) -> None:
    """Numba counts the functions of each process from one: the cached code of two would have a symbol in common."""
    (tmp_path / "scaling.py").write_text(SCALING)
    for name, factor in (("doubled", 2.0), ("fivefold", 5.0)):
        (tmp_path / f"{name}.py").write_text(SCALED.format(name=name, factor=factor))
    # Settings of the compiler are in the symbols, too, in the order of a set of strings.
    kept = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONHASHSEED": "0"}

    def run(*arguments: str) -> list[str]:
        command = [sys.executable, "-c", CALLS, *arguments]
        return subprocess.run(
            command, cwd=tmp_path, env=kept, capture_output=True, text=True, check=True
        ).stdout.split()

    apart = run("forked", "doubled", "fivefold") if forks else [*run("", "doubled"), *run("", "fivefold")]
    (doubled, _), (fivefold, _) = apart[:2], apart[2:]
    assert apart[1::2] == ["0", "0"]
    assert float(fivefold) > 2 * float(doubled)
    assert run("", "doubled", "fivefold") == [doubled, "1", fivefold, "1"]
