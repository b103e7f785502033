"""YAML documents checked against a schema: every fault of a document is collected and told in its user's words."""

import difflib
import importlib
import re
from collections.abc import Iterator
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator, validators
from jsonschema.exceptions import ValidationError

from towval.model.errors import InputError
from towval.model.plugins import Registry

_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # in C, where PyYAML was built with it


class _StrictLoader(_SafeLoader):  # type: ignore[misc]  # either of two classes
    """PyYAML's safe loader, but a key given twice is an error instead of a silent overwrite."""


def _mapping_without_duplicates(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node, deep=True)
        if key in seen:
            raise yaml.constructor.ConstructorError(None, None, f"the key {key!r} is given twice", key_node.start_mark)
        seen.add(key)
    mapping: dict[Any, Any] = loader.construct_mapping(node, deep=True)
    return mapping


# PyYAML follows YAML 1.1, in which 1e-7, without a point, is a text.
_EXPONENT = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+")

_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(f"^{_EXPONENT.pattern}$"), list("-+.0123456789")
)
_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_duplicates)


def read_yaml(path: Path) -> Any:
    """The content of a YAML file.

    Raises `InputError` when the file is missing, not YAML, or holds a key twice.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path} is missing", remedy=f"create {path.name} or check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as text", got=error, allowed="a UTF-8 text file") from None
    try:
        return yaml.load(text, Loader=_StrictLoader)  # a SafeLoader: builds plain data only
    except yaml.YAMLError as error:
        raise InputError(
            f"{path} is not valid YAML", got=" ".join(str(error).split()), remedy="mend that line"
        ) from None


def read_value(text: str) -> Any:
    """One value as YAML writes it: a number, a text, a list."""
    try:
        return yaml.load(text, Loader=_StrictLoader)  # a SafeLoader: builds plain data only
    except yaml.YAMLError as error:
        raise InputError("a value is not valid YAML", got=" ".join(str(error).split())) from None


def with_plain_values(value: Any) -> Any:
    """A value that another program read from YAML, in which each text that is a number or yes or no becomes one."""
    if isinstance(value, dict):
        return {key: with_plain_values(item) for key, item in value.items()}
    if isinstance(value, list):
        return [with_plain_values(item) for item in value]
    if not isinstance(value, str):
        return value
    try:
        read = read_value(value)
    except InputError:
        return value
    return read if isinstance(read, bool | int | float) else value


@lru_cache
def packaged_schema(name: str) -> dict[str, Any]:
    """The schema ``name`` that comes with the package."""
    text = resources.files("towval.io").joinpath(name).read_text(encoding="utf-8")
    schema: dict[str, Any] = yaml.load(text, Loader=_SafeLoader)
    return schema


def _registry(reference: str) -> Registry[Any]:
    module, _, name = reference.partition(":")
    registry: Registry[Any] = getattr(importlib.import_module(module), name)
    return registry


def _registered(_validator: Any, reference: str, instance: Any, schema: Any) -> Iterator[ValidationError]:
    """The keyword ``registered: module:REGISTRY``: the value must be a name of that registry, plugins included.

    The keyword ``besides`` lists further values that are allowed.
    """
    if isinstance(instance, str) and instance not in (*schema.get("besides", ()), *_registry(reference)):
        yield ValidationError(f"{instance!r} is not registered in {reference}")


_RINGS = "one ring of 3 to 200 corners [x, y] within 50 m, or a list of such rings"


def _rings(_validator: Any, _wanted: bool, instance: Any, _schema: Any) -> Iterator[ValidationError]:
    """The keyword ``rings: true``: one polygon, a list of corners, or a list of polygons."""
    if not (_is_ring(instance) or (isinstance(instance, list) and instance and all(map(_is_ring, instance)))):
        yield ValidationError(_RINGS)


def _is_ring(value: Any) -> bool:
    return isinstance(value, list) and 3 <= len(value) <= 200 and all(map(_is_point, value))


def _is_point(value: Any) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= 50 for x in value)
    )


_Validator: Any = validators.extend(  # type: ignore[no-untyped-call]  # the stubs leave it untyped
    Draft202012Validator, {"registered": _registered, "rings": _rings}
)


def check(document: Any, schema: dict[str, Any], where: str) -> None:
    """Check a document against a schema.

    Parameters
    ----------
    schema : dict
        JSON schema; ``description`` and ``unit`` of a key are quoted in the error.

    Raises
    ------
    InputError
        One error that lists every fault: key, value, what is allowed, what the key means.
    """
    validator = _Validator(schema)
    errors = sorted(validator.iter_errors(document), key=lambda error: [str(part) for part in error.absolute_path])
    faults = [fault for error in errors for fault in _faults(error)]
    if not faults:
        return
    if len(faults) == 1:
        raise InputError(f"{where}: {faults[0]}")
    raise InputError(f"{where} has {len(faults)} faults:\n  - " + "\n  - ".join(faults))


def _name(parts: Any) -> str:
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _faults(error: ValidationError) -> list[str]:
    path = list(error.absolute_path)
    key = _name(path) or "the document"
    rule, wanted, schema = _rule(error)
    instance: Any = error.instance
    if rule == "additionalProperties":
        known = list(schema.get("properties", {}))
        unknown = [name for name in instance if name not in known]
        return [f"unknown key {_name([*path, name])}{_suggestion(str(name), known)}" for name in unknown]
    if rule == "required":
        missing = [name for name in wanted if name not in instance]
        return [f"the key {_name([*path, name])} is missing{_meaning(schema['properties'][name])}" for name in missing]
    got = _short(error.instance)
    return [f"{key} is {got}; allowed: {_allowed(error)}{_meaning(_described(error))}"]


def _rule(error: ValidationError) -> tuple[str, Any, dict[str, Any]]:
    """The rule that is broken, its value, and the schema that states it, which is never a plain true or false."""
    schema: Any = error.schema
    return str(error.validator), error.validator_value, schema


def _described(error: ValidationError) -> dict[str, Any]:
    """The innermost schema on the way to the fault that says what it is about."""
    current: Any = error
    while current is not None:
        if isinstance(current.schema, dict) and "description" in current.schema:
            schema: dict[str, Any] = current.schema
            return schema
        current = current.parent
    return {}


_COMPARISONS = {
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "above {}",
    "exclusiveMaximum": "below {}",
    "minItems": "at least {} entries",
    "maxItems": "at most {} entries",
    "minProperties": "at least {} entry",
    "minLength": "a text of at least {} character",
    "pattern": "a text that matches {}",
}


def _allowed(error: ValidationError) -> str:
    rule, wanted, schema = _rule(error)
    if rule == "type":
        names = {
            "number": "a number",
            "integer": "a whole number",
            "array": "a list",
            "object": "keys with values",
            "string": "a text",
            "boolean": "true or false",
        }
        return names.get(str(wanted), str(wanted))
    if rule == "registered":
        return "one of " + ", ".join((*schema.get("besides", ()), *_registry(wanted)))
    if rule == "enum":
        return "one of " + ", ".join(map(str, wanted))
    if rule in ("minItems", "maxItems") and schema.get("minItems") == schema.get("maxItems"):
        return f"exactly {schema['minItems']} entries"
    bounds = [
        _COMPARISONS[name].format(schema[name])
        for name in ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")
        if name in schema
    ]
    if rule in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"):
        return " and ".join(bounds)
    return _COMPARISONS.get(rule, str(error.message)).format(wanted)


def _meaning(schema: dict[str, Any]) -> str:
    unit = f" [{schema['unit']}]" if "unit" in schema else ""
    return f" ({schema['description'].rstrip('.')}{unit})" if "description" in schema else unit


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {close[0]}?" if close else f"; known keys here: {', '.join(known)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
