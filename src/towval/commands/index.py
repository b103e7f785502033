"""Command index: results of many campaigns → index.sqlite and index.html, one row per run."""

from collections.abc import Sequence
from pathlib import Path

from towval.commands.console import Outcome
from towval.io.atomic import check_own, check_plain
from towval.io.results_index import INDEX_MARK, UNFINISHED, ResultsIndex, read_results, write_index
from towval.model import Verdict
from towval.model.errors import InputError, TowvalError
from towval.report.index_page import write_index_page
from towval.report.templating import PAGE_MARK


def run(results: Sequence[Path], output: Path, fail_on: Sequence[str] = ()) -> Outcome:
    """Write the index of all runs below some folders: ``output`` for programs, and beside it a page for people.

    Runs that are still being made count as unfinished; call again when they are done. ``results`` are folders of one
    campaign each or of many; the page has the name of ``output`` with the ending ``.html``. Where there are verdicts
    ``fail_on``, and a run has one of them or is unfinished, the command fails after both files are written: for
    continuous integration on new footage.
    """
    known = (*(str(verdict) for verdict in Verdict), UNFINISHED)
    asked = [word.strip().replace("-", " ") for text in fail_on for word in text.split(",")]
    for word in asked:
        if word not in known:
            raise InputError("--fail-on names no verdict", got=word, allowed=", ".join(known))
    check_plain(output)  # a folder may have no name to which an ending could be given
    page = output.with_suffix(".html")
    if page == output:
        raise InputError("-o names the page in place of the SQLite file beside it", got=output, allowed="index.sqlite")
    for path, mark in ((output, INDEX_MARK), (page, PAGE_MARK)):
        check_plain(path)
        check_own(path, mark)
    index = read_results(results)
    write_index(output, index)
    write_index_page(page, index)
    counts = {str(verdict): int(count) for verdict, count in index.runs["verdict"].value_counts().items()}
    tally = ", ".join(f"{verdict} {counts[verdict]}" for verdict in known if verdict in counts)
    text = f"{len(index.runs)} run{'s' * (len(index.runs) != 1)} ({tally})"
    return Outcome("index", (output, page), text, {"verdicts": counts}, failure=_failure(index, asked))


def _failure(index: ResultsIndex, verdicts: Sequence[str]) -> TowvalError | None:
    runs = index.runs[index.runs["verdict"].isin([*verdicts, UNFINISHED])]
    if not verdicts or not len(runs):
        return None
    names = [f"{row.campaign}/{row.run} ({row.verdict})" for row in runs.head(10).itertuples()]
    more = f" and {len(runs) - 10} more" if len(runs) > 10 else ""
    return TowvalError(f"{len(runs)} of {len(index.runs)} runs: {', '.join(names)}{more}")
