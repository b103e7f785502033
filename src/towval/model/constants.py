"""The tuned constants of a room, by module: what a result is recorded with and what their sensitivity is tested on."""

import dataclasses
import importlib
import pkgutil
from typing import Any


def constants_of(room: str) -> dict[str, Any]:
    """What the modules of a room (``towval.tracking``) hold as ``CONSTANTS``, by the module's name within the room."""
    folders = importlib.import_module(room).__path__
    modules = {info.name: importlib.import_module(f"{room}.{info.name}") for info in pkgutil.iter_modules(folders)}
    held = {name: getattr(module, "CONSTANTS", None) for name, module in modules.items()}
    # Those of another module, which some import, are that module's.
    return {name: one for name, one in held.items() if type(one).__module__ == f"{room}.{name}"}


def constants_record(room: str) -> dict[str, dict[str, float]]:
    """Values of the tuned constants of a room, by module and name."""
    return {module: dataclasses.asdict(constants) for module, constants in constants_of(room).items()}
