"""The page over many runs in a real browser: filters, order, changes; names that would be markup stay text."""

import json
import os

import pytest
from browser import Browser

from result_folders import make_run
from towval.io.mcap_file import read_details, write_mcap
from towval.io.results_index import read_results
from towval.report.index_page import write_index_page

HOSTILE = "<img src=x onerror=alert(1)>"


def state_tether(run, **digests):
    """Let stages say with which tether of campaign.yaml they were made."""
    for stage, digest in digests.items():
        details, provenance = read_details(run / f"{stage}.mcap")
        sections = json.loads(provenance["campaign_sha256"]) | {"tether": digest}
        write_mcap(run / f"{stage}.mcap", [], details, provenance | {"campaign_sha256": json.dumps(sections)})


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("index")
    for k in range(60):
        make_run(folder / "old" / f"lab_{k}" / "a", path_rms_m=0.001 * (k + 1), video=f"{k:02d}")
    state_tether(folder / "old" / "lab_3" / "a", decimate="22", simulate="22")
    make_run(folder / "old" / HOSTILE / "<!--<script>", up_to="track")
    for path in (folder / "old").rglob("*.mcap"):
        os.utime(path, (1.7e9, 1.7e9))
    make_run(
        folder / "new" / "lab_3" / "a",
        path_rms_m=0.009,
        verdict="not judged",
        version="2.0.0",
        video="03",
        friction="11",
    )
    state_tether(folder / "new" / "lab_3" / "a", decimate="11", simulate="22")
    make_run(folder / "new" / "lab_4" / "a", path_rms_m=0.005, video="xx")
    make_run(folder / "new" / "lab_5" / "a", path_rms_m=0.006, video="05", heading_rms_rad=0.01)
    make_run(folder / "new" / "LAB_4" / "a", path_rms_m=0.006)
    write_index_page(folder / "index.html", read_results([folder / "old", folder / "new"]))
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open((folder / "index.html").as_uri())
        yield browser


def shown(page):
    return page.run("document.getElementById('counts').textContent")


def change(page, script):
    page.run(f"{script}, document.getElementById('filters').dispatchEvent(new Event('input'))")


def cells(page, table, column):
    rows = f"[...document.querySelectorAll('#{table} tbody tr:not(.space)')]"
    return page.run(f"{rows}.map((row) => row.cells[{column}].textContent)")


@pytest.fixture(autouse=True)
def unfiltered(page):
    yield
    change(page, "document.getElementById('filters').reset()")


def test_all_runs_are_there_and_only_rows_in_view_are_made(page):
    assert shown(page).startswith("65 of 65 runs")
    assert len(cells(page, "runs", 0)) < 65
    assert not page.complaints()
    assert len(page.requests()) == 1


def test_all_rows_in_view_are_made_after_there_were_few(page):
    """The view was as high as the few rows then: on a high screen the lower part of the table stayed empty."""
    address, high = page.run("location.href"), page.run("document.getElementById('scroller').clientHeight")
    assert len(cells(page, "runs", 0)) * 26 >= high
    page.open(address, 1280, 2000)
    for text in ("LAB_59", ""):
        change(page, f"document.getElementById('search').value = '{text}'")
    assert len(cells(page, "runs", 0)) * 26 >= page.run("document.getElementById('scroller').clientHeight")
    page.open(address)


def test_filters(page):
    change(page, "document.getElementById('search').value = 'LAB_59'")
    assert shown(page) == "1 of 65 runs shown: agrees 1"
    change(page, "document.getElementById('filters').reset(), document.getElementById('least').value = 59")
    assert shown(page) == "2 of 65 runs shown: agrees 2"
    change(page, "document.getElementById('filters').reset(), document.querySelector('[value=agrees]').checked = false")
    assert shown(page) == "2 of 65 runs shown: unfinished 1, not judged 1"


def test_order_by_a_column_of_numbers_and_back(page):
    click = "document.querySelectorAll('#runs thead button')[3].click()"
    page.run(click)
    first = cells(page, "runs", 3)
    page.run(click)
    last = cells(page, "runs", 3)
    assert first[0] == "1.00"
    assert next(text for text in last if text) == "60.00"


def test_the_table_stays_where_it_is_when_the_window_changes(page):
    """A phone resizes the page with each turn of its bar of addresses, which threw the reader back to the first row."""
    scroller = "document.getElementById('scroller')"
    page.run(f"{scroller}.scrollTop = 300")
    page.run("window.dispatchEvent(new Event('resize'))")
    assert page.run(f"{scroller}.scrollTop") == 300


def test_changes_are_at_first_those_from_the_older_to_the_newer_folder(page):
    """The folders stand in the order of their names, by which the newer one is the first here."""
    chosen = "((select) => select.options[select.selectedIndex].text)(document.getElementById('{}'))"
    assert page.run(chosen.format("before")).endswith("old")
    assert page.run(chosen.format("after")).endswith("new")
    assert cells(page, "pairs", 2)[0] == "agrees → not judged"


def test_changes_between_two_folders_name_what_differs(page):
    old = page.run("[...document.getElementById('before').options].findIndex((o) => o.text.endsWith('old'))")
    new = 1 - old
    page.run(
        f"document.getElementById('before').value = {old}, document.getElementById('after').value = {new}, "
        "document.getElementById('after').dispatchEvent(new Event('change'))"
    )
    assert page.run("document.getElementById('changed').textContent").startswith(
        "3 runs are in both; the verdict changed in 1, a number in 2"  # and one of them in the heading alone
    )
    assert cells(page, "pairs", 2) == ["agrees → not judged", "agrees"]
    assert cells(page, "pairs", 6) == ["", "none → 0.5730"]
    assert cells(page, "pairs", 8)[0] == "campaign.yaml: friction, campaign.yaml: tether, version of towval"
    # Other libraries or commits are not among what is compared.
    assert cells(page, "pairs", 8)[1] == "no input, setting or version of towval: libraries, or code between versions"


def test_hostile_names_are_shown_and_not_run(page):
    change(page, "document.getElementById('search').value = 'onerror'")
    assert cells(page, "runs", 0) == [HOSTILE]
    assert cells(page, "runs", 1) == ["<!--<script>"]
    assert page.run("document.querySelector('img')") is None
