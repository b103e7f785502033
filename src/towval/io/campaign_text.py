"""campaign.yaml as a text with a comment for each key: what it means, and where its value is only a guess."""

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import yaml

from towval.io.campaign import campaign_schema

GUESS = "GUESS"
"""Mark of a value that nobody measured."""

_WIDTH = 112
_CLICKS = "first_frame_clicks_px"


def campaign_text(document: Mapping[str, Any], marks: Mapping[str, str]) -> str:
    """The text of campaign.yaml, keys in the order of the schema.

    Parameters
    ----------
    document : mapping
        Sections with keys and values, as the schema describes them.
    marks : mapping
        By full key (``friction.kinetic``) what is added to its comment: where the value comes from, or ``GUESS``.
    """
    head = [
        "# Written by towval new. SI units; lengths of bodies in the body's own frame, which is that of top_corners_m.",
        f"# Values marked {GUESS} were not measured: replace them, remove the mark, call towval check.",
    ]
    return "\n".join([*head, *_section(document, campaign_schema(), "", "", marks), ""])


def _section(
    keys: Mapping[str, Any], schema: Mapping[str, Any], path: str, indent: str, marks: Mapping[str, str]
) -> Iterator[str]:
    known = schema.get("properties", {})
    for name in sorted(keys, key=lambda name: [*known].index(name) if name in known else len(known)):
        found = known.get(name, schema.get("additionalProperties"))
        described, full, value = found if isinstance(found, dict) else {}, f"{path}{name}", keys[name]
        unit = f" [{described['unit']}]" if described.get("unit", "1") != "1" else ""
        yield from _comment(f"{described.get('description', '').rstrip('.')}{unit}".strip(), indent)
        yield from _comment(marks.get(full, ""), indent)
        if isinstance(value, Mapping) and ("properties" in described or described.get("additionalProperties")):
            yield f"{indent}{name}:"
            yield from _section(value, described, f"{full}.", indent + "  ", marks)
        else:
            written = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10_000, sort_keys=False)
            yield f"{indent}{name}: {written.removesuffix('...' + chr(10)).strip()}"


def _comment(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ") if text else []


def text_without_clicks(text: str) -> list[str | tuple[str, str]]:
    """The text of a campaign.yaml cut where the clicks of each run belong; all else stays as it is written.

    Returns
    -------
    list of str or (str, str)
        Pieces of the text; between them the run's name, and what has to stand before its clicks in flow style.
    """
    runs = _value(yaml.compose(text, Loader=yaml.SafeLoader), "runs")
    cuts = sorted((_cut(text, entry), str(name.value)) for name, entry in runs.value)
    pieces: list[str | tuple[str, str]] = []
    done = 0
    for (start, end, before), name in cuts:
        pieces += [text[done:start], (name, before)]
        done = end
    return [*pieces, text[done:]]


def _value(mapping: Any, key: str) -> Any:
    return next((value for name, value in mapping.value if name.value == key), None)


def _cut(text: str, entry: Any) -> tuple[int, int, str]:
    """From where to where the clicks of a run stand, or would stand, in the text, and what belongs before them."""
    clicks = _value(entry, _CLICKS)
    if clicks is not None:
        end = clicks.end_mark.index
        if not clicks.flow_style:  # A block ends where the next key begins.
            end = len(text[:end].rstrip())
        return clicks.start_mark.index, end, ""
    if entry.flow_style:
        end = text.rindex("}", 0, entry.end_mark.index)
        return end, end, f", {_CLICKS}: "
    end = len(text[: entry.end_mark.index].rstrip())
    return end, end, f"\n{' ' * entry.start_mark.column}{_CLICKS}: "
