"""Settings of a stage from the keys of its section of the configuration."""

import dataclasses
import difflib
from collections.abc import Mapping
from copy import deepcopy
from typing import Any, TypeVar

from towval.model.errors import InputError

Settings = TypeVar("Settings")


def settings_from(kind: type[Settings], keys: Mapping[str, Any] | None, section: str) -> Settings:
    """Settings of a stage from the keys of its section of config.yaml.

    Raises `InputError` for unknown keys, and for values that the schema of config.yaml does not allow.
    """
    keys = dict(keys or {})
    known = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]  # any settings dataclass
    for name in keys:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            raise InputError(
                f"unknown key {section}.{name}",
                allowed=", ".join(known) or "none",
                remedy=f"did you mean {section}.{close[0]}?" if close else "remove it",
            )
    if keys:
        # Not at start-up: a stage with its defaults needs no schema.
        from towval.io.schema import check, packaged_schema  # noqa: PLC0415

        schema = packaged_schema("config.schema.yaml")["properties"][section]
        check(keys, schema, section)
        for name, value in keys.items():
            # 6.0 is whole, too; but what counts with it wants an integer.
            if isinstance(value, float) and "integer" in schema["properties"][name].get("type", ""):
                keys[name] = int(value)
    return kind(**keys)


def without_auto(keys: Mapping[str, Any] | None, *choosable: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The keys of a section without those of ``choosable`` that are "auto", and the names of the latter."""
    keys = dict(keys or {})
    chosen = tuple(name for name in choosable if keys.get(name) == "auto")
    return {name: value for name, value in keys.items() if name not in chosen}, chosen


def nested(keys: Mapping[str, Any], document: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """A document with sections from keys with dots (``object.mass_kg``), over a copy of ``document``."""
    result: dict[str, Any] = deepcopy(dict(document or {}))
    for key, value in keys.items():
        *names, last = key.split(".")
        section = result
        for name in names:
            section = section.setdefault(name, {})
            if not isinstance(section, dict):
                raise InputError(f"{key} is below a key that has a value", got=section, allowed=f"{name} with keys")
        section[last] = value
    return result
