"""Checks of the sizes of what people open: the report of a campaign, and the index of many runs with its page."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from studies.browser import Browser
from studies.costs import least_cpu_seconds
from studies.evidence.compute import REPOSITORY, shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, repeated, replaced
from studies.tables import index_scale
from studies.tables.validation_rendered import judged
from towval.commands import report
from towval.io import results_index
from towval.report import facts, film, index_page, inline

_RUNS, _MANY = 250, 10_000
_NUMBERS, _PARSED = 810, 300


def page_of_report(campaign: Path, runs: str) -> Values:
    """Size of the report on a campaign [MB], with its films and without, and the words of its text."""
    with TemporaryDirectory() as folder:
        results = Path(folder) / "results"
        for name in runs:
            judged(campaign, results, name)
        report.run(campaign, results)
        page = (results / "report.html").read_text(encoding="utf-8")
    films = sum((campaign / f"{name}.mp4").stat().st_size for name in runs)
    text = re.sub(r"(?s)<(script|style|svg)\b.*?</\1>|<[^>]*>", " ", page)
    size = len(page.encode("utf-8"))
    return {
        "page": size / 1e6,
        "page without films": (size - 7 / 6 * films) / 1e6,
        "words, with those that are folded": len(text.split()),
    }


def index_of_runs() -> Values:
    """Costs over those of parsing, sizes [kB] a run, and how many findings the index of synthetic runs has."""
    with TemporaryDirectory() as folder:
        found = index_scale.measured(_RUNS, Path(folder))
    costs = {f"{what} over parsing": found[f"{what}, CPU"] / (_RUNS * parsing_s()) for what in ("read", "written")}
    sizes = {name: 1e3 * found[name] / _RUNS for name in ("index.sqlite", "index.html")}
    return costs | sizes | {"findings": found["findings"]}


def index_of_many() -> Values:
    """Costs [s] and sizes [MB] of the index of ten thousand synthetic runs."""
    with TemporaryDirectory() as folder:
        return index_scale.measured(_MANY, Path(folder))


def parsing_s() -> float:
    """CPU time [s] of reading 810 numbers, a run's signature of the error, as JSON: with it costs carry over."""
    text = json.dumps(np.random.default_rng(1).normal(size=_NUMBERS).tolist())
    return least_cpu_seconds(lambda: [json.loads(text) for _ in range(_PARSED)]) / _PARSED


def _base64(_: Any) -> Any:
    return lambda content: Markup(base64.b64encode(content).decode("ascii"))


def _counted_twice(original: Any) -> Any:
    """Findings of a stage, those that stand by body once more."""

    def wrong(notes: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
        yield from original(notes)
        for part in notes.values():
            if isinstance(part, dict):
                yield from original(part)

    return wrong


def _twelve_digits(original: Any) -> Any:
    """What runs were made of, with fingerprints of twelve digits in place of eight."""

    def wrong(index: Any) -> tuple[pd.DataFrame, pd.Series]:
        keys, labels = original(index)
        return keys, labels.str.replace(r"(\t[0-9a-f]{8})$", r"\g<1>0000", regex=True)

    return wrong


_AS_BASE64 = replaced(film, "packed", _base64)
_ALL_DIGITS = replaced(inline, "_shortened", lambda _: lambda found: found[0])

REPORT = Check(
    lambda: page_of_report(REPOSITORY / "data_samples" / "lab_small", "ab"),
    {
        "films are written as base64, the verdict's reasons stand among the findings once more": both(
            _AS_BASE64, replaced(facts, "VERDICT_CODES", lambda _: ())
        ),
        "places in the figures keep all digits": _ALL_DIGITS,
    },
)

LARGE_REPORT = Check(
    lambda: page_of_report(shared_folder() / "footage" / "lab_c", "gh"),
    {"films are written as base64, places in the figures keep all digits": both(_AS_BASE64, _ALL_DIGITS)},
    needs=("footage/lab_c",),
)

INDEX = Check(
    index_of_runs,
    {
        "each table reads the files anew": replaced(results_index, "read_details", repeated(5)),
        "each table writes the files anew": both(
            replaced(index_scale, "write_index", repeated(4)), replaced(index_scale, "write_index_page", repeated(4))
        ),
        "findings of a body count twice": replaced(results_index, "_findings", _counted_twice),
        "fingerprints on the page have twelve digits": replaced(index_page, "_made_of", _twelve_digits),
    },
)

INDEX_OF_MANY = Check(
    index_of_many,
    {
        "each table reads and writes files anew, a body's findings count twice, fingerprints have twelve digits": both(
            replaced(results_index, "read_details", repeated(5)),
            replaced(index_scale, "write_index", repeated(4)),
            replaced(index_scale, "write_index_page", repeated(4)),
            replaced(results_index, "_findings", _counted_twice),
            replaced(index_page, "_made_of", _twelve_digits),
        )
    },
)


_FILTERS = (
    "document.getElementById('search').value = 'LAB_12'",
    "document.getElementById('search').value = ''",
    "document.getElementById('least').value = 5",
    "document.querySelector('[value=agrees]').checked = false",
)
"""Changes of the page's filters, as scripts."""


def _filtering() -> Values:
    """How long [s] the page with all runs takes from a change of its filters to the next picture."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        index_scale.measured(_MANY, place)
        with Browser(place / "profile") as browser:
            browser.open((place / "index.html").as_uri())
            taken = [browser.run(_TIMED % change) / 1e3 for _ in range(5) for change in _FILTERS]
            shown = browser.run("document.getElementById('counts').textContent")
    return {"a filter, usually": float(np.median(taken)), "a filter, longest": max(taken), "shown": shown.split(":")[0]}


_TIMED = """new Promise((done) => {
  const begun = performance.now();
  %s;
  document.getElementById('filters').dispatchEvent(new Event('input'));
  requestAnimationFrame(() => setTimeout(() => done(performance.now() - begun)));
})"""


def _filtered_often(original: Any) -> Any:
    """The page's own script, in which a change filters thirty times, by another limit than the one chosen."""
    often = "() => { byId('least').value = 9; for (let k = 0; k < 30; k++) filter(); }"
    return lambda name: Markup(str(original(name)).replace('"input", filter)', f'"input", {often})'))


FILTERING = Check(
    _filtering,
    {"a change filters thirty times, by another limit": replaced(index_page, "template_asset", _filtered_often)},
    needs=("chromium",),
)
