"""YAML read as plain data within bounds: keys are texts, none is given twice, and aliases expand within a limit."""

import re
from pathlib import Path
from typing import Any

import yaml

from towval.io.reading import read_bytes
from towval.model.errors import InputError

SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # in C, where PyYAML was built with it

MOST_BYTES = 4 * 2**20
"""Of a document."""

MOST_VALUES = 100_000
"""Values and keys of a document, those behind aliases counted each time: a campaign of 100 runs has 3,000."""

MOST_DEPTH = 40
"""Of values within values."""

_MOST_SHOWN = 300


class _StrictLoader(SafeLoader):  # type: ignore[misc]  # either of two classes
    """PyYAML's safe loader, but every key is the text that was written, and given once."""


def _mapping(loader: _StrictLoader, node: yaml.MappingNode) -> dict[str, Any]:
    seen: set[str] = set()
    for key_node, _ in node.value:
        key = key_node.value
        if not isinstance(key_node, yaml.ScalarNode):
            raise yaml.constructor.ConstructorError(None, None, "a key is no text", key_node.start_mark)
        if key in seen:
            raise yaml.constructor.ConstructorError(None, None, f"the key {key!r} is given twice", key_node.start_mark)
        seen.add(key)
    loader.flatten_mapping(node)
    return {key_node.value: loader.construct_object(value, deep=True) for key_node, value in node.value}


# PyYAML follows YAML 1.1, in which 1e-7, without a point, is a text, 010 is eight, 1:30 ninety and 2024-13-45 a date.
_TAG = "tag:yaml.org,2002:"
_DIGITS = list("-+.0123456789")
_StrictLoader.yaml_implicit_resolvers = {
    first: [
        (tag, pattern) for tag, pattern in resolvers if tag not in (f"{_TAG}{x}" for x in ("int", "float", "timestamp"))
    ]
    for first, resolvers in SafeLoader.yaml_implicit_resolvers.items()
}
_StrictLoader.add_implicit_resolver(f"{_TAG}int", re.compile(r"[-+]?(0|[1-9][0-9_]*)$"), _DIGITS)
_StrictLoader.add_implicit_resolver(
    f"{_TAG}float",
    re.compile(r"[-+]?((\d[\d_]*\.\d*|\.\d+)([eE][-+]?\d+)?|\d+[eE][-+]?\d+|\.(inf|Inf|INF))$|\.(nan|NaN|NAN)$"),
    _DIGITS,
)
_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


def read_yaml(path: Path, missing: str = "") -> Any:
    """The content of a YAML file; ``missing`` is what to do where there is none.

    Raises `InputError` when the file is missing, no plain file, too large, not YAML, or holds a key twice.
    """
    data = read_bytes(path, MOST_BYTES, missing or f"create {path.name} or check the path")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} cannot be read as text",
            got=error,
            allowed="a UTF-8 text file",
            remedy="save it as UTF-8 in a text editor, or copy it again",
        ) from None
    return _loaded(text, f"{path} is not valid YAML", "correct that line")


def read_value(text: str, what: str = "a value") -> Any:
    """One value as YAML writes it: a number, a text, a list; raises `InputError`, with ``what`` it is, for no YAML."""
    return _loaded(text, f"{what} is not valid YAML", None)


def _loaded(text: str, what: str, remedy: str | None) -> Any:
    try:
        _check_extent(text)
        return yaml.load(text, Loader=_StrictLoader)  # a SafeLoader: builds plain data only
    # Values with an explicit tag, such as !!int x, fail as their constructors fail.
    except (yaml.YAMLError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        got = " ".join(str(error).split()).replace(' in "<unicode string>",', " at")
        if remedy and _indented_by_tab(text, error):
            remedy += "; indent with spaces, not tabs"
        if remedy and "unknown escape character" in got:
            remedy += "; write / in paths, since \\ between double quotes begins a special character"
        raise InputError(what, got=got[:_MOST_SHOWN], remedy=remedy) from None


def _indented_by_tab(text: str, error: Exception) -> bool:
    """Whether a tab is before the first word of the line of an error: the loader in C does not say so."""
    mark = getattr(error, "problem_mark", None)
    line = "".join(text.splitlines()[mark.line : mark.line + 1]) if mark else ""
    return "\t" in line[: len(line) - len(line.lstrip())]


def _check_extent(text: str) -> None:
    """Refuse a document that is too deep or too large once its aliases are unfolded; it is scanned, not built."""
    sizes: dict[str, int | None] = {}
    open_anchors: list[tuple[str | None, int]] = []
    count = 0
    for event in yaml.parse(text, Loader=SafeLoader):
        anchor = getattr(event, "anchor", None)
        if isinstance(event, yaml.AliasEvent):
            size = sizes.get(str(event.anchor), 1)
            if size is None:
                raise ValueError(f"the alias *{event.anchor} refers to what it is part of")
            count += size
        elif isinstance(event, yaml.ScalarEvent):
            count += 1
            if anchor:
                sizes[anchor] = 1
        elif isinstance(event, yaml.CollectionStartEvent):
            open_anchors.append((anchor, count))
            count += 1
            if anchor:
                sizes[anchor] = None
        elif isinstance(event, yaml.CollectionEndEvent):
            begun, before = open_anchors.pop()
            if begun:
                sizes[begun] = count - before
        if len(open_anchors) > MOST_DEPTH:
            raise ValueError(f"values within values are nested deeper than {MOST_DEPTH}")
        if count > MOST_VALUES:
            raise ValueError(f"it holds more than {MOST_VALUES} values")
