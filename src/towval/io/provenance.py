"""What a result was made of: versions, configuration, and a fingerprint of the code and the input."""

import dataclasses
import hashlib
import importlib.util
import json
import platform
import re
import sysconfig
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import towval
from towval.io.atomic import write_text
from towval.model.constants import constants_record
from towval.model.plugins import load_plugins

_PACKAGE = Path(towval.__file__).resolve().parent
_LIBRARIES = (
    "av", "matplotlib", "mcap", "numba", "numpy", "opencv-python-headless", "pandas", "rosbags", "scipy", "shapely",
    "snakemake",
)  # fmt: skip


def versions() -> dict[str, str]:
    """Versions of towval, Python and the libraries that results depend on."""
    found = {"towval": towval.__version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def provenance(
    stage: str,
    settings: Any,
    inputs: Mapping[str, Path],
    *,
    run: str = "",
    document: Mapping[str, Any] | None = None,
    simulating: bool = False,
    constants: bool = False,
) -> dict[str, str]:
    """Provenance of a result as JSON texts: versions, settings, the run, and what it was made of.

    Recorded are the SHA-256 of each of the ``inputs`` (files by name), of each plugin, and of each part of
    campaign.yaml, the ``document``, that the stage reads (:func:`read_sections`, also on ``simulating``); with
    ``constants`` the tuned ones of its subpackage.
    """
    configuration = (
        dataclasses.asdict(settings)
        if dataclasses.is_dataclass(settings) and not isinstance(settings, type)
        else dict(settings or {})
    )
    hashes = {name: file_hash(path) for name, path in sorted({**_by_name(load_plugins()), **inputs}.items())}
    parts = {} if document is None else read_sections(stage, document, run, simulating=simulating)
    sections = {name: text_hash(canonical(part)) for name, part in parts.items()}
    return {
        "stage": stage,
        "run": run,
        "versions": json.dumps(versions(), sort_keys=True),
        "settings": json.dumps(configuration, sort_keys=True),
        "inputs_sha256": json.dumps(hashes, sort_keys=True),
        "campaign_sha256": json.dumps(sections, sort_keys=True),
        **({"constants": json.dumps(constants_record(_SUBPACKAGES[stage]))} if constants else {}),
    }


def _by_name(paths: Sequence[Path]) -> dict[str, Path]:
    """Files by their names, preceded by as much of their folders as tells them apart."""
    named: dict[str, Path] = {}
    for path in paths:
        ends = ["/".join(path.parts[-count:]) for count in range(1, len(path.parts) + 1)]
        alone = (end for end in ends if sum(other.as_posix().endswith(f"/{end}") for other in paths) <= 1)
        named[next(alone, path.as_posix())] = path
    return named


_SUBPACKAGES = {"calibrate": "towval.calibration", "track": "towval.tracking"}


def canonical(keys: Any) -> str:
    """Keys as one text that does not depend on the order in which they are written."""
    return json.dumps(keys, sort_keys=True, default=str)


def text_hash(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def read_sections(
    stage: str, document: Mapping[str, Any], run: str = "", *, simulating: bool = False
) -> dict[str, Any]:
    """The parts of campaign.yaml that a stage reads, by name: an edit there, and only there, makes its result stale.

    ``simulating``: whether the stage track simulates the run, to choose how many points it follows.
    """
    if stage == "calibrate":
        heights = [document[body]["tracked_plane_height_m"] for body in ("rover", "object") if body in document]
        return {**{name: document[name] for name in ("camera", "floor")}, "heights": heights}
    if stage != "track":
        return {name: part for name, part in document.items() if name not in ("runs", "repeats")}
    names = ("camera", "floor", "rover", "object", "tether", *(("friction", "gravity_m_per_s2") if simulating else ()))
    return {**{name: document.get(name) for name in names}, f"runs.{run}": document["runs"][run]}


def content_hashes(paths: Sequence[Path], cache: Path) -> list[str]:
    """:func:`file_hash` of each file, kept in the file ``cache`` as long as its size, times and inode stay the same.

    Even a copy with an older date and the same size changes the change time of the inode.
    """
    known = _read_cache(cache)
    kept = dict(known)
    found = [_content_hash(path, kept) for path in paths]
    if kept != known:
        with suppress(OSError):  # a cache that cannot be written costs time only
            write_text(cache, json.dumps(kept, sort_keys=True))
    return found


def _read_cache(cache: Path) -> dict[str, Any]:
    try:
        known = json.loads(cache.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _content_hash(path: Path, known: dict[str, Any]) -> str:
    status = path.stat()
    key, mark = str(path.resolve()), [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]
    try:
        if known[key][0] == mark:
            return str(known[key][1])
    except (LookupError, TypeError):
        pass
    digest = file_hash(path)
    # A file changed a moment ago may change again within the same tick of the file system's clock.
    if time.time_ns() - status.st_ctime_ns > _SETTLED_NS:
        known[key] = [mark, digest]
    return digest


_SETTLED_NS = 2_000_000_000


def module_hash(name: str, without: Collection[Path] = ()) -> str:
    """Fingerprint of a module and of all it imports, directly or not, but installed libraries.

    Workflow rules carry it as a parameter: an edit in a module then reruns the rules that use it, and no others. Data
    files that lie beside a module (schemas, templates, styles) count where the module names them.

    ``name``: a module as one imports it, of this package or of another that stands beside it as source. ``without``:
    files that do not count though a module names them.
    """
    digest = hashlib.sha256()
    for path in module_files(name):
        if path in without:
            continue
        digest.update(_file_digest(path, path.stat().st_mtime_ns))
    return digest.hexdigest()[:16]


def module_files(name: str) -> list[Path]:
    """The files that count for :func:`module_hash`, in order."""
    return sorted(_closure(_module_files(name)[-1]))


@cache
def _file_digest(path: Path, _mtime_ns: int) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def _closure(module: Path) -> set[Path]:
    found: set[Path] = set()
    waiting = [module]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting.extend(_imported(path, path.stat().st_mtime_ns))
    return found


@cache
def _imported(path: Path, _mtime_ns: int) -> tuple[Path, ...]:
    """Source files that one file imports, installed libraries apart, and the data files it names by a literal."""
    if path.suffix not in (".py", _TEMPLATE):
        return ()
    text = path.read_text(encoding="utf-8")
    modules: set[str] = set()
    code = "" if path.suffix == _TEMPLATE else _COMMENT.sub("", text).replace("\\\n", " ")
    for start, names, plain in _IMPORT.findall(code):
        listed = [name.split()[0] for name in (names or plain).strip("()\n \t").split(",") if name.strip()]
        modules |= {start, *(f"{start}.{name}" for name in listed)} if start else {*listed}
    found = [file for module in sorted(modules) for file in _module_files(module)]
    return (*found, *(file for literal in set(_FILE_NAME.findall(text)) for file in _data_file(path.parent, literal)))


_TEMPLATE = ".j2"
"""A template names others."""

# Matched by pattern: parsing every module would take a second at each call of the workflow. A text that looks like an
# import counts, too, which costs at most a rerun.
_COMMENT = re.compile(r"#[^\n]*")
_IMPORT = re.compile(r"^\s*(?:from[ \t]+([\w.]+)[ \t]+import\b[ \t]*(\([^)]*\)|[^\n;]*)|import[ \t]+([^\n;]*))", re.M)
_FILE_NAME = re.compile(r"""["']([^"'\n]{1,100}\.\w+)["']""")


def _module_files(name: str) -> list[Path]:
    top, *parts = name.split(".")
    folder = _source_folder(top)
    if folder is None:
        return [] if parts else _single_file(top)
    return _files_below(folder, tuple(parts))


@cache
def _files_below(folder: Path, parts: tuple[str, ...]) -> list[Path]:
    found = [folder / "__init__.py"]
    for part in parts:
        if (folder / f"{part}.py").is_file():
            return [*found, folder / f"{part}.py"]
        folder = folder / part
        if not (folder / "__init__.py").is_file():
            break
        found.append(folder / "__init__.py")
    return found


@cache
def _single_file(module: str) -> list[Path]:
    """The source of a module that is one file beside the package, such as a plugin; none for an installed one."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.submodule_search_locations or not spec.origin or not spec.has_location:
        return []
    path = Path(spec.origin).resolve()
    return [path] if path.suffix == ".py" and not _is_installed(path) else []


@cache
def _source_folder(package: str) -> Path | None:
    """Where a package's source is; none for an installed library, whose version says what it is."""
    if package == "towval":
        return _PACKAGE
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        return None
    folder = Path(spec.submodule_search_locations[0]).resolve()
    return None if _is_installed(folder) or not (folder / "__init__.py").is_file() else folder


def _is_installed(path: Path) -> bool:
    """Whether a file or folder belongs to Python or to an installed library, of this environment or of one below it."""
    return Path(sysconfig.get_path("stdlib")).resolve() in path.parents or not _LIBRARY_FOLDERS.isdisjoint(path.parts)


_LIBRARY_FOLDERS = {"site-packages", "dist-packages"}
"""The second is that of packages of Debian."""


def _data_file(folder: Path, text: str) -> list[Path]:
    if len(text) > 100 or "/" in text.strip("/.") or not Path(text).suffix:
        return []
    places = (folder / text, folder / "templates" / text, folder / "layouts" / text)
    return [place for place in places if place.is_file() and place.suffix != ".py"]
