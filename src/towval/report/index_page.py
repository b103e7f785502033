"""The page over many runs: one HTML file with filters, trends and changes that opens offline."""

import math
from pathlib import Path
from typing import Any

import pandas as pd

from towval.io.atomic import write_text
from towval.io.results_index import UNFINISHED, ResultsIndex
from towval.report.inline import script_json
from towval.report.templating import PAGE_MARK, template_asset, template_environment

_NUMBERS = {
    "path_rms_m": 1e3,
    "path_max_m": 1e3,
    "heading_rms_rad": math.degrees(1.0),
    "u_val_m": 1e3,
    "lost_frames": 1,
    "tracked_frames": 1,
    "main_share": 100,
    "made_s": 1,
    "cpu_s": 1,
    "wall_s": 1,
}
"""Numeric columns of the page and their factors: to millimetres, degrees and percent."""

_WORDS = ("source", "campaign", "run", "state", "verdict", "version", "main_input")
_KEY = ["source", "campaign", "run"]


def write_index_page(path: Path, index: ResultsIndex) -> None:
    """Write the page: it loads nothing else, and the same index gives the same bytes.

    The page's own script filters, draws and compares; runs are embedded as columns with each distinct text once.
    """
    template = template_environment().get_template("index.html.j2")
    runs = index.runs
    text = template.render(
        count=len(runs),
        campaigns=runs[["source", "campaign"]].drop_duplicates().shape[0],
        verdicts=sorted(runs["verdict"].unique(), key=lambda verdict: (verdict == UNFINISHED, verdict)),
        data=script_json(_columns(index)),
        css=template_asset("index.css"),
        script=template_asset("index.js"),
    )
    write_text(path, text, own=PAGE_MARK)


def _columns(index: ResultsIndex) -> dict[str, Any]:
    runs = index.runs
    words: dict[str, Any] = {}
    for name in _WORDS:
        codes, texts = pd.factorize(runs[name].fillna(""), sort=True)
        words[name] = {"texts": texts.tolist(), "codes": codes.tolist()}
    numbers = {name: [_rounded(value, factor) for value in runs[name]] for name, factor in _NUMBERS.items()}
    findings = index.findings[index.findings["severity"] != "note"]
    return {
        "count": len(runs),
        "words": words,
        "numbers": numbers,
        "findings": _sets(runs, findings, findings["code"]),
        "made_of": _sets(runs, *_made_of(index)),
    }


def _made_of(index: ResultsIndex) -> tuple[pd.DataFrame, pd.Series]:
    """Origin of each run, as texts "what<tab>fingerprint": input files, settings and version, without results."""
    inputs = index.inputs[~index.inputs["input"].str.endswith(".mcap")]
    settings = index.settings
    labels = [
        inputs["input"] + "\t" + inputs["sha256"].str[:8],
        "settings of " + settings["stage"] + "\t" + settings["settings"],
        "version of towval\t" + index.runs["version"].fillna("unknown"),
    ]
    keys = pd.concat([inputs[_KEY], settings[_KEY], index.runs[_KEY]])
    return keys, pd.concat(labels)


def _sets(runs: pd.DataFrame, keys: pd.DataFrame, texts: pd.Series) -> dict[str, Any]:
    """The codes of each run's distinct texts, and the texts."""
    codes, distinct = pd.factorize(texts, sort=True)
    place = pd.Series(range(len(runs)), index=pd.MultiIndex.from_frame(runs[_KEY]))
    rows = place.reindex(pd.MultiIndex.from_frame(keys[_KEY])).to_numpy()
    sets: list[set[int]] = [set() for _ in range(len(runs))]
    for row, code in zip(rows, codes, strict=True):
        sets[int(row)].add(int(code))
    return {"texts": distinct.tolist(), "codes": [sorted(found) for found in sets]}


def _rounded(value: float | None, factor: float) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return float(f"{value * factor:.4g}") if factor != 1 else round(float(value), 1)
