"""campaign.yaml as a text with a comment for each key: what it means, and where its value is only a guess."""

import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import yaml

from towval.io.campaign import campaign_schema
from towval.io.yaml_text import SafeLoader

GUESS = "GUESS"
"""Mark of a value that nobody measured."""

_FURTHER = (
    "Add what applies to your set-up; what is not stated is assumed: object.load (a box on the object's top: mass_kg, "
    "at_m, size_m), floor.board_thickness_m, rover.tether_hinge_height_m, object.tether_anchor_height_m, "
    "object.centre_of_mass_height_m, floor.slope_mm_per_m, tether.damping_Ns_per_m, camera.readout_s, and standard "
    "deviations (object.mass_std_kg and the like)."
)
"""Keys that towval new cannot guess and that a campaign may go without."""

_WIDTH = 112
_CLICKS = "first_frame_clicks_px"


def campaign_text(document: Mapping[str, Any], marks: Mapping[str, str]) -> str:
    """The text of campaign.yaml from its sections, keys in the order of the schema.

    ``marks``: by full key (``friction.kinetic``) what else its comment says: where the value is from, or ``GUESS``.
    """
    head = [
        "# Written by towval new. SI units; lengths of bodies in the body's own frame, which is that of top_corners_m.",
        f"# Values marked {GUESS} were not measured: replace them, remove the mark, call towval check.",
        *_comment(_FURTHER, ""),
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


class RunClicks(NamedTuple):
    """Where the clicks of a run belong in the text, as they are written now (empty where they are not).

    ``before`` is to be written before clicks in flow style.
    """

    run: str
    stated: str
    before: str


class FloorCorner(NamedTuple):
    """Where a corner of the floor board stands in the text: "origin" or "end" of the x axis, as it is written now.

    ``before`` is to be written before a new value in flow style.
    """

    floor: str
    stated: str
    before: str


def text_in_parts(text: str) -> list[str | RunClicks | FloorCorner]:
    """The text of a campaign.yaml cut where clicks and floor corners belong; all else stays as it is written."""
    document = yaml.compose(text, Loader=SafeLoader)
    # Of runs that are one by an alias the first one's clicks are those of all.
    runs = {id(entry): (name, entry) for name, entry in reversed(_pair(document, "runs")[1].value)}
    cuts: list[tuple[int, int, RunClicks | FloorCorner]] = [
        _clicks_cut(text, str(name.value), entry) for name, entry in runs.values()
    ]
    floor = _pair(document, "floor")
    for name, key in (("origin", "origin_corner_px"), ("end", "x_axis_end_corner_px")):
        pair = floor and _pair(floor[1], key)
        if pair:
            start, end = _span(text, *pair)
            # In block style the list may be no deeper than its key, where a list in flow style would end the mapping.
            cuts.append((start, end, FloorCorner(name, text[start:end], "" if pair[1].flow_style else "  ")))
    pieces: list[str | RunClicks | FloorCorner] = []
    done = 0
    for start, end, part in sorted(cuts, key=lambda cut: cut[:2]):
        pieces += [text[done:start], part]
        done = end
    return [*pieces, text[done:]]


def _pair(mapping: Any, key: str) -> Any:
    return next((pair for pair in mapping.value if pair[0].value == key), None)


def _clicks_cut(text: str, run: str, entry: Any) -> tuple[int, int, RunClicks]:
    """From where to where the clicks of a run stand, or would stand, in the text."""
    clicks = _pair(entry, _CLICKS)
    if clicks is not None:
        start, end = _span(text, *clicks)
        return start, end, RunClicks(run, text[start:end], "")
    if entry.flow_style:
        end = text.rindex("}", 0, entry.end_mark.index)
        comma = " " if text[:end].rstrip().endswith(",") else ", "
        return end, end, RunClicks(run, "", f"{comma}{_CLICKS}: ")
    end = _end(text, entry)
    comment = _COMMENT.match(text, end)
    end = comment.end() if comment else end
    # Where an anchor precedes the keys the entry begins there.
    first_key, _ = entry.value[0]
    line_end = "\r\n" if "\r\n" in text else "\n"
    return end, end, RunClicks(run, "", f"{line_end}{' ' * first_key.start_mark.column}{_CLICKS}: ")


_COMMENT = re.compile(r"[ \t]+#[^\r\n]*")
_ALIAS, _ANCHOR = re.compile(r"\s*:\s+(\*[^\s,\]}]+)"), re.compile(r"&\S+\s+")


def _span(text: str, key: Any, value: Any) -> tuple[int, int]:
    """From where to where the value of a key stands in the text: its alias, or what follows an anchor."""
    alias, anchor = _ALIAS.match(text, key.end_mark.index), _ANCHOR.match(text, value.start_mark.index)
    if alias:  # its node stands where the anchor does
        return alias.span(1)
    return anchor.end() if anchor else value.start_mark.index, _end(text, value)


def _end(text: str, value: Any) -> int:
    """Where a value ends in the text; what yaml takes for the end in block style includes comments after it."""
    last = value.value[-1] if value.value and not getattr(value, "flow_style", True) else None
    if isinstance(last, tuple):
        return _span(text, *last)[1]
    if last is not None and last.start_mark.index > value.start_mark.index:
        return _end(text, last)
    return len(text[: value.end_mark.index].rstrip())
