import base64
import dataclasses
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from report_scenes import LOST, ceiling_calibration, towed_run, uncertainty_of
from towval.io.summary import summary_csv, summary_latex
from towval.model import Bounds, Finding, Severity, Verdict
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.report.data import InputRow, Provenance, ReportData, RunReport
from towval.report.drawing import draw_figures
from towval.report.facts import calibration_facts, key_numbers, plane_table, side_by_side, verdict_reason
from towval.report.page import write_report
from towval.report.result import measure_first, result_rows, sentence
from towval.report.view import collect_findings

PROVENANCE = Provenance(
    command="snakemake --cores 2 --config campaign=lab",
    versions={"towval": "0.1.0"},
    input_hashes={"a.mp4": "9f86d081"},
    configuration="track: {method: planes}",
    settings={"track, run a": '{"samples": 1024}'},
)


def data(**changes):
    first, pauses = towed_run("a"), Finding(Severity.NOTE, "pauses", "Two pauses were kept.")
    first = dataclasses.replace(first, decimated=dataclasses.replace(first.decimated, findings=(pauses,)))
    fields = {
        "campaign": "lab <test>",
        "runs": (RunReport(first), RunReport(towed_run("b", seed=3))),
        "provenance": PROVENANCE,
        "calibration": ceiling_calibration(),
        "inputs": (
            InputRow("Kinetic friction", "0.35", std="0.005", source="campaign.yaml"),
            InputRow("Mass", "4.0", "kg"),
        ),
    }
    return ReportData(**(fields | changes))


def figure_names(shown):
    return [drawn.name for drawn in draw_figures(shown)]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return write_report(folder / "report.html", data())


@pytest.fixture(scope="module")
def page(written):
    return written.read_text(encoding="utf-8")


class Parsed(HTMLParser):
    """Ids, addresses and open elements of a page."""

    VOID = frozenset({"meta", "link", "img", "br", "input"})

    def __init__(self, text):
        super().__init__()
        self.ids, self.addresses, self.headings, self.open = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.addresses += [attributes[k] for k in ("src", "href", "xlink:href", "poster") if k in attributes]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_page_is_well_formed_and_its_ids_are_its_own(page):
    parsed = Parsed(page)
    assert parsed.open == []
    assert len(parsed.ids) == len(set(parsed.ids))


def test_page_asks_for_nothing_from_outside(page):
    parsed = Parsed(page)
    assert [a for a in parsed.addresses if not a.startswith(("#", "data:"))] == []
    within = {a[1:] for a in parsed.addresses if a.startswith("#")}
    assert within <= set(parsed.ids)
    assert not re.search(r"@import|url\((?!#)", page)


def test_uncertainties_are_symbols_and_settings_stand_with_their_stage(page):
    assert "<i>u</i><sub>val</sub>, mm</th>" in page
    assert '<th scope="row">track, run a</th><td><code>{&#34;samples&#34;: 1024}</code></td>' in page


def test_a_note_stands_in_the_part_of_its_stage(page):
    tracking = page.split('id="tracking"')[1].split('id="simulation"')[0]
    note = re.search(r'<li class="note".*?</li>', tracking, re.DOTALL).group()
    assert "Two pauses were kept." in note
    assert "run a" in note


def test_what_the_calibration_says_of_planes_is_a_table_by_height():
    base = ceiling_calibration()
    said = {
        "position_std_mm at 0.000 m": 0.2,
        "position_std_mm at 0.250 m": 0.19,
        "halves_difference_mm at 0.250 m": 0.31,
        "focal_length_std_px": 0.59,
    }
    calibration = dataclasses.replace(base, quality=base.quality | said)
    columns, rows = plane_table(calibration)
    assert len(columns) == 2
    assert rows == (("0.000 m", "0.20", "not computed"), ("0.250 m", "0.19", "0.31"))
    facts = dict(calibration_facts(calibration))
    assert facts["Focal length"].endswith("px ± 0.59 px")
    assert not any("0.250" in name for name in facts)
    assert plane_table(base) == ((), ())


def test_names_are_escaped(page):
    assert "lab &lt;test&gt;" in page
    assert "lab <test>" not in page


def test_missing_uncertainties_are_named_and_not_filled(page):
    assert page.count("not computed") >= 6
    assert not re.search(r">\s*nan", page, re.IGNORECASE)


def test_figure_names_cover_every_run():
    drawn = figure_names(data(runs=(RunReport(towed_run("a")),), calibration=None))
    assert drawn == ["fig10", "fig10_a", "errors_a", "tracking_rover_a", "tracking_object_a", "decimate_a"]


def test_series_under_the_cursor_is_the_error(page):
    run = towed_run("a")
    series = json.loads(re.search(r'class="series">(.*?)</script>', page).group(1))
    seen = np.isfinite(run.comparison.error[:, 0])
    assert series["along_mm"][LOST.start] is None
    drawn = np.array(series["along_mm"])[seen].astype(float)
    np.testing.assert_allclose(drawn, 1e3 * run.comparison.along_across[seen, 0], atol=5e-3)
    np.testing.assert_allclose(series["time_s"], run.comparison.time_s, atol=5e-7)


def test_same_data_give_the_same_bytes_with_and_without_figures_beside(tmp_path):
    small = data(runs=(RunReport(towed_run("a", n=100, decimated=None)),), calibration=None)
    alone = write_report(tmp_path / "alone.html", small)
    beside = write_report(tmp_path / "beside.html", small, tmp_path / "figures")
    assert alone.read_bytes() == beside.read_bytes()
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {f"{name}.{ending}" for name in figure_names(small) for ending in ("pdf", "svg", "png")}
    as_png = write_report(tmp_path / "png.html", dataclasses.replace(small, formats=("png",)), tmp_path / "figures")
    assert as_png.read_bytes() == alone.read_bytes()
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {f"{name}.png" for name in figure_names(small)}


def test_gravest_findings_come_first_and_shared_ones_once():
    refusal = Finding(Severity.REFUSAL, "tether_short", "The tether is shorter than nothing.")
    found = collect_findings(data(findings=(refusal,)))
    assert [f.severity for f in found] == ["refusal", "warning", "note", "note"]
    assert found[1].runs == ("a", "b")
    assert found[0].runs == ()


@pytest.mark.parametrize("runs", ["a", "ab"])
def test_runs_that_are_left_out_stand_below_the_first_table(tmp_path, runs):
    """Once, and the verdict on all runs together beside them where there are several."""
    given = [
        Finding(Severity.NOTE, "campaign_verdict", "All runs together agree."),
        Finding(Severity.WARNING, "runs_left_out", "Left out: run <c> (bad light)."),
    ]
    records = tuple(RunReport(towed_run(name, n=100)) for name in runs)
    page = write_report(tmp_path / "report.html", data(runs=records, findings=tuple(given), calibration=None))
    text = page.read_text(encoding="utf-8")
    first_screen = text[text.index('<section id="result"') : text.index('id="run-a"')]
    assert first_screen.count("Left out: run &lt;c&gt; (bad light).") == 1
    assert text.count("Left out: run &lt;c&gt;") == 1
    assert ("All runs together agree." in text) == (len(runs) > 1)


def test_reason_of_a_verdict_is_what_the_comparison_says():
    finding = Finding(Severity.WARNING, "verdict", "Model-form error: it begins between 1.00 m and 1.20 m of the path.")
    comparison = dataclasses.replace(towed_run().comparison, verdict=Verdict.DISAGREES, findings=(finding,))
    assert verdict_reason(comparison) == finding.text
    shown = data(runs=(RunReport(towed_run(comparison=comparison)),))
    assert finding.code not in {f.code for f in collect_findings(shown)}


def test_reason_of_a_missing_verdict_names_the_missing_uncertainty():
    assert verdict_reason(towed_run().comparison) == "No verdict without the uncertainty of: inputs, measurement."


def test_uncertainty_has_its_figures_on_the_page(tmp_path):
    run = towed_run("a", n=100)
    run = dataclasses.replace(run, uncertainty=uncertainty_of(run))
    known = data(runs=(RunReport(run),), calibration=None)
    assert {"agreement_a", "shares"} <= set(figure_names(known))
    assert 'id="uncertainty"' in write_report(tmp_path / "report.html", known).read_text(encoding="utf-8")


def judged(name, verdict, upper_m, share=""):
    run = towed_run(name, n=100)
    known = dataclasses.replace(uncertainty_of(run), shares={share: 0.6, "camera": 0.4}) if share else None
    begins_m, ends_m = (1.28, 1.38) if upper_m > 0.02 else (np.nan, np.nan)
    comparison = dataclasses.replace(
        run.comparison, verdict=verdict, error_upper_m=upper_m, begins_m=begins_m, ends_m=ends_m
    )
    return dataclasses.replace(run, comparison=comparison, uncertainty=known)


def test_the_sentence_says_who_agrees_who_does_not_and_what_to_measure():
    good = [
        judged(name, Verdict.AGREES, upper, "stiffness") for name, upper in (("a", 0.002), ("b", 0.0042), ("c", 0.001))
    ]
    bad = judged("d", Verdict.DISAGREES, 0.03)
    assert (
        sentence([*good, bad])
        == "3 runs agree within 4.2 mm; run d does not, from 1.3 m on; measure the stiffness better first."
    )
    assert sentence(good[:2]).startswith("Both runs agree within 4.2 mm;")
    assert sentence([bad]) == "Run d does not agree, from 1.3 m on."
    unsure = judged("e", Verdict.CANNOT_TELL, 0.03)
    assert sentence([good[0], bad, unsure]).startswith(
        "Run a agrees within 2.0 mm; run d does not, from 1.3 m on; run e leaves open"
    )


def test_a_slip_in_campaign_yaml_comes_before_what_to_measure_better(tmp_path):
    """Page and sentence named inputs that were twenty deviations off in place of a sign."""
    slip = finding("slip", error_mm=34.0, slips="the sign of y of object.load.at_m (0.5 mm)")
    bad = judged("d", Verdict.DISAGREES, 0.03, "stiffness")
    bad = dataclasses.replace(bad, uncertainty=dataclasses.replace(bad.uncertainty, findings=(slip,)))
    assert sentence([bad]) == "Run d does not agree, from 1.3 m on; check campaign.yaml for a slip first."
    said = Finding(Severity.NOTE, "explanation", "Inputs off by so much would explain it: anchor.")
    bad = dataclasses.replace(bad, comparison=dataclasses.replace(bad.comparison, findings=(said,)))
    text = write_report(tmp_path / "report.html", data(runs=(RunReport(bad),), calibration=None)).read_text("utf-8")
    assert 0 < text.find(f">{slip.text}") < text.find(f">{said.text}")


@pytest.mark.parametrize(("verdict", "cited"), [(Verdict.AGREES, True), (Verdict.NOT_JUDGED, False)])
def test_a_bound_is_rounded_up_and_a_run_that_is_not_judged_has_none(verdict, cited):
    run = judged("a", verdict, 0.0022404)
    (row,) = result_rows([run])
    assert row.bound == ("under 2.3 mm" if cited else "none: not judged")
    assert (row.detectable == "none: not judged") != cited
    assert dict(key_numbers(run.comparison))["at most"].startswith("none") != cited
    assert ("& 2.3 &" in summary_latex([run.comparison])) == cited


def test_the_bound_of_the_heading_is_rounded_up_as_well():
    bounds = Bounds(simulation={"heading_max": (0.0, np.radians(0.1241))})
    found = dataclasses.replace(judged("a", Verdict.AGREES, 0.002).comparison, bounds=bounds)
    assert key_numbers(found)[-1] == ("at most", "0.13°")


def test_what_cannot_be_measured_with_a_tool_is_not_named_as_what_to_measure():
    assert measure_first([judged("a", Verdict.AGREES, 0.001, "noise and interactions")]) == ""


def test_nothing_is_named_where_no_input_has_a_share():
    few = judged("a", Verdict.AGREES, 0.001, "stiffness")
    none = dataclasses.replace(few.uncertainty, shares={"stiffness": 0.0, "noise and interactions": 1.0})
    assert measure_first([dataclasses.replace(few, uncertainty=none)]) == ""


def test_a_warning_opens_its_part_and_the_first_screen_links_to_it(page):
    parts = dict(re.findall(r'<details id="(\w+)" class="part"( open)?', page))
    # The scene loses the object in both runs; nothing else is wrong.
    assert [name for name, is_open in parts.items() if is_open] == ["tracking"]
    assert page.count('<a href="#tracking">tracking (1)</a>') == 1


def test_no_figure_and_no_code_of_a_finding_is_seen_twice(page):
    titles = re.findall(r'class="drawing" role="img" aria-label="([^"]*)"', page)
    assert len(titles) == len(set(titles))
    assert not any(title.startswith("Run a: path of the rover") for title in titles)
    assert "frames_lost" not in page
    assert "frames lost, runs a, b</span>" in page


@pytest.mark.parametrize("runs", [(), (RunReport(towed_run("a")), RunReport(towed_run("a")))])
def test_runs_need_distinct_names(runs, tmp_path):
    with pytest.raises(InputError, match="distinct names"):
        write_report(tmp_path / "report.html", data(runs=runs))


def test_a_missing_film_is_named(tmp_path):
    runs = (RunReport(towed_run("a"), tmp_path / "gone.mp4"),)
    with pytest.raises(InputError, match=r"gone\.mp4"):
        write_report(tmp_path / "report.html", data(runs=runs))


def test_summary_as_latex_has_a_row_a_run_and_dashes_for_what_is_missing():
    lines = summary_latex([towed_run("run_a").comparison]).splitlines()
    row = next(line for line in lines if line.startswith("run"))
    assert re.fullmatch(r"run\\_a & [\d.]+ & [\d.]+ & [\d.]+ & -- & -- & not judged \\\\", row)
    # A column of 85 mm holds about 55 characters in a footnote's size.
    assert max(map(len, lines[-3:])) < 55
    columns = re.search(r"tabular}{(\w+)}", "\n".join(lines)).group(1)
    assert all(line.count("&") == len(columns) - 1 for line in lines if "&" in line)


def test_summary_to_download_is_the_summary(page):
    address = re.search(r'download="summary.csv" href="data:text/csv;base64,([^"]+)"', page).group(1)
    assert base64.b64decode(address).decode() == summary_csv([run.record.comparison for run in data().runs])


def test_facts_of_runs_stand_side_by_side():
    runs = [(("steps", "12"), ("slack", "8 %")), (("steps", "14"), ("pauses", "2"))]
    assert side_by_side(runs) == (("steps", ("12", "14")), ("slack", ("8 %", "")), ("pauses", ("", "2")))
