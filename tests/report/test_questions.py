"""The ten questions of docs/questions.md: each answered by the first screen of a report, or one click from there."""

import dataclasses
from pathlib import Path

import pytest
from browser import Browser

from report_scenes import numbered_film, small_calibration, towed_run, uncertainty_of
from towval.model import Bounds, Finding, Severity, Verdict
from towval.report.data import InputRow, Provenance, ReportData, RunReport
from towval.report.page import write_report

PAGE = Path(__file__).resolve().parents[2] / "docs" / "questions.md"
QUESTIONS = [
    tuple(cell.strip() for cell in line.strip("|").split("|"))
    for line in PAGE.read_text(encoding="utf-8").splitlines()
    if line.startswith("|")
][2:]

# Whether the words stand in the window: in the text of an element without others of its text that is to be seen.
SEEN = """(words) => {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode, text = node.parentElement;
    if (!node.data.toLowerCase().includes(words.toLowerCase()) || !text.checkVisibility()) { continue; }
    const range = document.createRange();
    range.selectNodeContents(node);
    const { top, bottom, width } = range.getBoundingClientRect();
    if (width > 0 && top >= 0 && bottom <= innerHeight) { return true; }
  }
  return false;
}"""
CLICK = """(name) => {
  const found = [...document.querySelectorAll("a, summary")].find((one) => one.innerText.trim().startsWith(name));
  found.scrollIntoView({ block: "start", behavior: "instant" });
  found.click();
}"""


def judged(name, verdict, **changes):
    run = towed_run(name, n=80)
    heading = {"heading_max": (0.0, 0.004), "position_max": (0.0, 0.003)}
    fields = {
        "error_upper_m": 0.003,
        "detectable_m": 0.006,
        "tolerance_m": 0.01,
        "size_statistic": 0.8,
        "size_limit": 1.2,
    }
    comparison = dataclasses.replace(
        run.comparison, verdict=verdict, bounds=Bounds(heading, heading), **(fields | changes)
    )
    known = dataclasses.replace(uncertainty_of(run), shares={"stiffness": 0.6, "camera": 0.1})
    return dataclasses.replace(run, comparison=comparison, uncertainty=known)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    folder = tmp_path_factory.mktemp("questions")
    reason = Finding(Severity.WARNING, "verdict", "Disagrees: it begins between 1.28 m and 1.38 m of the path.")
    runs = (
        judged("a", Verdict.AGREES),
        judged("b", Verdict.AGREES),
        judged("d", Verdict.DISAGREES, error_upper_m=0.02, begins_m=1.28, ends_m=1.38, findings=(reason,)),
    )
    film = numbered_film(folder / "a.mp4", 80)
    data = ReportData(
        "lab",
        tuple(RunReport(run, film if run.name == "a" else None) for run in runs),
        Provenance("snakemake --cores 2 --config campaign=lab"),
        calibration=small_calibration(),
        inputs=(InputRow("stiffness", "4000", "N/m", "400", "campaign.yaml"),),
    )
    report = write_report(folder / "report.html", data)
    with Browser(folder / "profile") as browser:
        browser.open(report.as_uri())
        yield browser


def test_there_are_ten():
    assert len(QUESTIONS) == 10


@pytest.mark.parametrize(("question", "click", "words"), QUESTIONS)
def test_a_question_is_answered_by_the_first_screen_or_one_click(browser, question, click, words):
    browser.run("document.querySelectorAll('details.part').forEach((part) => { part.open = false; }), scrollTo(0, 0)")
    if click:
        # Without its click the answer is not there yet, or the click would be for nothing.
        assert not browser.run(f"({SEEN})({words!r})"), question
        browser.run(f"({CLICK})({click!r})")
    browser.wait_for(f"({SEEN})({words!r})")
