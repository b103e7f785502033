"""Tuned constants of a subpackage, by module: results record them, and their sensitivity is tested on them."""

import dataclasses
import importlib
import pkgutil
from typing import Any


def constants_of(package: str) -> dict[str, Any]:
    """What the modules of a subpackage (``towval.tracking``) hold as ``CONSTANTS``, by the module's name."""
    folders = importlib.import_module(package).__path__
    modules = {info.name: importlib.import_module(f"{package}.{info.name}") for info in pkgutil.iter_modules(folders)}
    held = {name: getattr(module, "CONSTANTS", None) for name, module in modules.items()}
    # Constants imported from another module belong to that module.
    return {name: one for name, one in held.items() if type(one).__module__ == f"{package}.{name}"}


def constants_record(package: str) -> dict[str, dict[str, float]]:
    """Values of the tuned constants of a subpackage, by module and name."""
    return {module: dataclasses.asdict(constants) for module, constants in constants_of(package).items()}
