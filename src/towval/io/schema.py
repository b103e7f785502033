"""Checks YAML documents against a schema: collects their faults and reports them in the user's words."""

import difflib
import importlib
import itertools
import re
from collections.abc import Iterator
from functools import lru_cache
from importlib import resources
from typing import Any

import yaml
from jsonschema import Draft202012Validator, validators
from jsonschema.exceptions import ValidationError

from towval.io.yaml_text import SafeLoader, read_value
from towval.model.errors import Faults, InputError, shortened
from towval.model.plugins import Registry


def with_plain_values(value: Any) -> Any:
    """A value that another program read from YAML, with numbers and booleans that it left as texts converted."""
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
    schema: dict[str, Any] = yaml.load(text, Loader=SafeLoader)
    return schema


def without_defaults(section: str, keys: dict[str, Any]) -> dict[str, Any]:
    """The keys of a section of config.yaml that have another value than the default."""
    known = packaged_schema("config.schema.yaml")["properties"][section]["properties"]
    return {key: value for key, value in keys.items() if key not in known or value != known[key].get("default")}


def _registry(reference: str) -> Registry[Any]:
    module, _, name = reference.partition(":")
    registry: Registry[Any] = getattr(importlib.import_module(module), name)
    return registry


def _registered(_validator: Any, reference: str, instance: Any, schema: Any) -> Iterator[ValidationError]:
    """The keyword ``registered: module:REGISTRY``: the value must be a name of that registry, plugins included.

    The keyword ``known`` lists values that are allowed without a look into it, which imports half the package.
    """
    if isinstance(instance, str) and instance not in schema.get("known", ()) and instance not in _registry(reference):
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


def _is_finite(_checker: Any, value: Any) -> bool:
    """Whether a value is a finite number: NaN would pass all limits, infinity those on one side."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


_LARGEST = 1e300
_Validator: Any = validators.extend(  # type: ignore[no-untyped-call]  # the stubs leave it untyped
    Draft202012Validator,
    {"registered": _registered, "rings": _rings},
    type_checker=Draft202012Validator.TYPE_CHECKER.redefine("number", _is_finite),
)


def check(document: Any, schema: dict[str, Any], where: str) -> None:
    """Raise one `InputError` that lists the faults of a document: key, value, what is allowed, what the key means."""
    Faults(faults_of(document, schema, where).values()).raise_any(where)


_MOST_FAULTS = 50
"""Errors of the schema that are listed."""


def faults_of(document: Any, schema: dict[str, Any], where: str) -> dict[str, InputError]:
    """Faults of a document by key (``runs.a.video``), in its order, each once: those of at most 50 schema errors."""
    errors = list(itertools.islice(_Validator(schema).iter_errors(document), _MOST_FAULTS))
    errors.sort(key=lambda error: _place(document, error))
    faults: dict[str, InputError] = {}
    for error in errors:
        for key, text, got, allowed in _faults(error, schema):
            fault = faults.setdefault(key, InputError(f"{where}: {text}"))
            # In one line the parts are easier to read than one below the other.
            fault.key, fault.got, fault.allowed = key, got, allowed
    return faults


def key_lines(text: str) -> dict[str, int]:
    """The line, from one, of each key of a YAML text by its full name (``runs.a.video``, ``floor.marks[2]``)."""
    lines: dict[str, int] = {}
    waiting: list[tuple[list[Any], Any]] = [([], yaml.compose(text, Loader=SafeLoader))]
    while waiting:
        path, node = waiting.pop()
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                lines[_name([*path, key.value])] = key.start_mark.line + 1
                waiting.append(([*path, key.value], value))
        elif isinstance(node, yaml.SequenceNode):
            for i, value in enumerate(node.value):
                lines[_name([*path, i])] = value.start_mark.line + 1
                waiting.append(([*path, i], value))
    return lines


def _place(document: Any, error: ValidationError) -> list[int]:
    """Where a fault is in a document: the position of each key on the way to it."""
    place = []
    for part in error.absolute_path:
        place.append(part if isinstance(part, int) else [*document].index(part))
        document = document[part]
    return place


def _name(parts: Any) -> str:
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _short_name(parts: Any) -> str:
    """A name from the document as it is printed: in one line, shortened."""
    text = _name(parts)
    return shortened(text if text.isprintable() else repr(text))


def _faults(error: ValidationError, whole: dict[str, Any]) -> Iterator[tuple[str, str, Any, str]]:
    """Key, text, value received and what is allowed, for each fault behind an error.

    A number in a list counts with the list: in another unit all its numbers are wrong alike.
    """
    path = list(error.absolute_path)
    key = _short_name(path) or "the document"
    rule, wanted, schema = _rule(error)
    instance: Any = error.instance
    if rule == "additionalProperties":
        known = list(schema.get("properties", {}))
        for name in itertools.islice((name for name in instance if name not in known), _MOST_FAULTS):
            full = _short_name([*path, name])
            hint = _elsewhere(full, schema) or _suggestion(str(name), known)
            yield full, f"unknown key {full}{hint}", name, ", ".join(known)
    elif rule == "required":
        for name in (name for name in wanted if name not in instance):
            full = _name([*path, name])
            meaning = _meaning(schema["properties"][name])
            yield full, f"the key {full} is missing{meaning}", None, meaning.strip(" ()")
    else:
        allowed = _allowed(error)
        while isinstance(instance, int | float) and path and isinstance(path[-1], int):
            path.pop()
        shown = "empty" if instance is None else shortened(repr(instance))
        yield (
            _short_name(path) or key,
            f"{key} is {shown}; allowed: {allowed}{_meaning(_described(error, whole))}",
            instance,
            allowed,
        )


def _rule(error: ValidationError) -> tuple[str, Any, dict[str, Any]]:
    """The rule that is broken, its value, and the schema that states it, which is never a plain true or false."""
    schema: Any = error.schema
    return str(error.validator), error.validator_value, schema


def _described(error: ValidationError, whole: dict[str, Any]) -> dict[str, Any]:
    """The innermost schema on the way from the ``whole`` one to the fault that says what it is about."""
    found: dict[str, Any] = {}
    schema: Any = whole
    for step in error.absolute_schema_path:  # jsonschema leaves "$ref" out of it
        if isinstance(schema, dict) and step not in schema:
            schema = whole["$defs"][schema["$ref"].rpartition("/")[2]]
        schema = schema[step]
        if isinstance(schema, dict) and "description" in schema:
            found = schema
    return found


_COMPARISONS = {
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "above {}",
    "exclusiveMaximum": "below {}",
    "minItems": "at least {} entries",
    "maxItems": "at most {} entries",
    "minProperties": "at least {} entries",
    "uniqueItems": "each entry once",
    "minLength": "a text of at least {} character",
    "maxLength": "a text of at most {} characters",
    "pattern": "a text that matches {}",
}


_DECIMAL_COMMA = re.compile(r"[-+]?\d{1,9},\d{1,9}")


def _list_in_place_of(value: Any) -> str:
    return f"a list, as [{value}]" if isinstance(value, str) and value.isidentifier() else "a list"


def _number_in_place_of(value: Any) -> str:
    if isinstance(value, str) and _DECIMAL_COMMA.fullmatch(value):
        return f"a number, with a point: {value.replace(',', '.')}"
    return "a finite number" if isinstance(value, float) else "a number"


def _allowed(error: ValidationError) -> str:
    rule, wanted, schema = _rule(error)
    or_auto = " or auto" if schema.get("pattern") == "^auto$" else ""
    if "enum" in schema:
        return "one of " + ", ".join(str(each).lower() if isinstance(each, bool) else each for each in schema["enum"])
    if rule == "type" or (rule == "pattern" and or_auto):
        names = {
            "number": _number_in_place_of(error.instance),
            "integer": "a whole number",
            "array": _list_in_place_of(error.instance),
            "object": "keys with values",
            "string": "a text",
            "boolean": "true or false",
        }
        kind = schema["type"][0] if or_auto else wanted
        return names.get(kind, str(kind)) + or_auto
    if rule == "registered":
        return "one of " + ", ".join(dict.fromkeys((*schema.get("known", ()), *_registry(wanted))))
    if rule in ("minItems", "maxItems") and schema.get("minItems") == schema.get("maxItems"):
        return f"exactly {schema['minItems']} entries"
    bounds = [
        _COMPARISONS[name].format(schema[name])
        for name in ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")
        if name in schema
    ]
    if rule in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"):
        return " and ".join(bounds) + or_auto
    text = _COMPARISONS[rule].format(wanted) if rule in _COMPARISONS else str(error.message)
    return text.replace("least 1 entries", "least one entry")


def _meaning(schema: dict[str, Any]) -> str:
    unit = f" [{schema['unit']}]" if "unit" in schema else ""
    return f" ({schema['description'].rstrip('.')}{unit})" if "description" in schema else unit


def _elsewhere(key: str, schema: dict[str, Any]) -> str:
    """Where a section belongs that stands in campaign.yaml though it is one of config.yaml, or the other way round."""
    title = schema.get("title")
    if title == "campaign.yaml" and key in packaged_schema("config.schema.yaml")["properties"]:
        return f": it belongs to the settings; give it as towval run CAMPAIGN --set {key}.KEY=VALUE, or in config.yaml"
    if title == "config.yaml" and key in packaged_schema("campaign.schema.yaml")["properties"]:
        return ": it belongs in campaign.yaml of the campaign folder"
    return ""


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name[:80], known, n=1)
    return f"; did you mean {close[0]}?" if close else f"; known keys here: {', '.join(known)}"
