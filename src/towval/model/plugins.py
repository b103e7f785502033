"""Extension points: registries by name, and the modules of users that add to them.

A module is loaded when the entry-point group ``towval.plugins`` of an installed package names it, or when the
environment variable ``TOWVAL_PLUGINS`` lists it: import names or paths of ``.py`` files, separated by commas. The
command line and the workflow load them once, before any configuration is checked.
"""

import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from towval.model.errors import InputError

GROUP = "towval.plugins"
"""Entry-point group of installed plugins."""

VARIABLE = "TOWVAL_PLUGINS"
"""Environment variable that lists further plugins."""

Value = TypeVar("Value")


class Registry(Mapping[str, Value]):
    """Named implementations of one extension point, in the order in which they were registered.

    ``kind``: what is registered, for messages ("tracker").

    Examples
    --------
    >>> laws = Registry("friction law")
    >>> laws.register("none", 0.0)
    0.0
    >>> list(laws), "coulomb" in laws
    (['none'], False)
    """

    def __init__(self, kind: str):
        self.kind = kind
        self._values: dict[str, Value] = {}

    def register(self, name: str, value: Value) -> Value:
        """Add an implementation and return it; raises `InputError` where the name is taken."""
        if name in self._values:
            raise InputError(f"the {self.kind} {name!r} is registered twice", remedy="choose another name")
        self._values[name] = value
        return value

    def require(self, name: str, key: str) -> Value:
        """The implementation that a configuration ``key`` names; raises `InputError` where there is none."""
        if not isinstance(name, str) or name not in self._values:
            raise InputError(
                f"{key} names an unknown {self.kind}",
                got=name,
                allowed=", ".join(self._values),
                remedy=f"check the spelling, or list the module that registers it in {VARIABLE}",
            )
        return self._values[name]

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)


@cache
def load_plugins() -> tuple[Path, ...]:
    """Import all plugins, once a process; returns their source files, which belong to the provenance of each result.

    Of a module in a package these are all that the package holds. `InputError` where a plugin cannot be imported.
    """
    listed = [name.strip() for name in os.environ.get(VARIABLE, "").split(",")]
    names = [*(point.module for point in entry_points(group=GROUP)), *filter(None, listed)]
    modules = [_imported(name) for name in dict.fromkeys(names)]
    return tuple(dict.fromkeys(path for module in modules for path in _sources(module)))


def _imported(name: str) -> ModuleType:
    try:
        return _from_file(Path(name)) if name.endswith(".py") else importlib.import_module(name)
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"the plugin {name} cannot be imported",
            got=f"{type(error).__name__}: {error}",
            allowed="import names or paths of .py files, separated by commas",
            remedy=f"correct the module, or {VARIABLE}",
        ) from error


def _sources(module: ModuleType) -> list[Path]:
    if not module.__file__:
        return []
    file = Path(module.__file__)
    return sorted(file.parent.rglob("*.py")) if module.__package__ else [file]


def _from_file(path: Path) -> ModuleType:
    known = importlib.util.find_spec(path.stem) if path.stem.isidentifier() else None
    if known is not None and known.origin and Path(known.origin).resolve() != path.resolve():
        raise ImportError(f"another module is named {path.stem}: rename the file")  # it would take that one's place
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
