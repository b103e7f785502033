"""The report in a real browser: no complaint, the film plays, the cursor moves the film and the film the cursor."""

import dataclasses

import pytest
from browser import Browser

from report_scenes import grey_film, small_calibration, towed_run, uncertainty_of
from towval.report.overlay import write_overlay
from towval.report.page import Provenance, ReportData, RunReport, write_report

FRAMES = 80
LAST_S = (FRAMES - 1) / 25
FRAME_S = 0.04

# The time that the cursor stands at, from its place on the plot.
CURSOR_S = """(() => {
  const plot = document.querySelector("[role=slider]");
  const share = parseFloat(plot.querySelector(".cursor").style.left) / 100;
  const { left, right } = plot.dataset;
  return (share - left) / (right - left) * plot.getAttribute("aria-valuemax");
})()"""
FILM = "document.querySelector('video')"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    run, calibration = towed_run(n=FRAMES), small_calibration()
    run = dataclasses.replace(run, uncertainty=uncertainty_of(run))
    overlay = write_overlay(grey_film(folder / "a.mp4", FRAMES), folder / "overlay.mp4", calibration, run)
    runs = (RunReport(run, overlay), RunReport(towed_run("b", n=FRAMES)))
    report = write_report(folder / "report.html", ReportData("lab", runs, Provenance("towval report lab")))
    return report.as_uri()


@pytest.fixture(scope="module")
def page(address, tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open(address)
        if not browser.run("document.createElement('video').canPlayType('video/mp4; codecs=\"avc1.64001e\"')"):
            pytest.skip("this browser was built without H.264")
        browser.wait_for(f"{FILM}.readyState >= 3")
        yield browser


@pytest.fixture
def plot_box(page):
    page.run("document.querySelector('[role=slider]').scrollIntoView({ block: 'center', behavior: 'instant' })")
    return page.run("document.querySelector('[role=slider]').getBoundingClientRect().toJSON()")


def axis_x(page, box, share):
    left, right = page.run("(({ left, right }) => [+left, +right])(document.querySelector('[role=slider]').dataset)")
    return box["left"] + box["width"] * (left + share * (right - left))


def test_playing_film_moves_the_cursor(page):
    page.run(f"{FILM}.currentTime = 0, {FILM}.play()")
    page.wait_for(f"{FILM}.currentTime > 0.4")
    page.run(f"{FILM}.pause()")
    page.wait_for(f"Math.abs({FILM}.currentTime - {CURSOR_S}) < 0.001")
    assert page.run("document.querySelector('.readout').textContent").startswith("0.")


def test_click_on_the_plot_moves_film_cursor_and_plan(page, plot_box):
    before = page.run("document.querySelector('.dot.rover').style.left")
    page.click(axis_x(page, plot_box, 0.5), plot_box["top"] + plot_box["height"] / 2)
    page.wait_for(f"!{FILM}.seeking")
    # A click lands on a whole pixel.
    pixel_s = LAST_S / plot_box["width"]
    assert page.run(f"{FILM}.currentTime") == pytest.approx(LAST_S / 2, abs=2 * pixel_s)
    assert page.run(CURSOR_S) == pytest.approx(LAST_S / 2, abs=2 * pixel_s)
    assert page.run("document.querySelector('.dot.rover').style.left") != before


def test_the_plot_along_and_across_has_the_same_cursor(page):
    second = "document.querySelector('.timeplot:not([role])')"
    page.run(f"{second}.scrollIntoView({{ block: 'center', behavior: 'instant' }})")
    box = page.run(f"{second}.getBoundingClientRect().toJSON()")
    left, right = page.run(f"(({{ left, right }}) => [+left, +right])({second}.dataset)")
    page.click(box["left"] + box["width"] * (left + 0.75 * (right - left)), box["top"] + box["height"] / 2)
    page.wait_for(f"!{FILM}.seeking")
    assert page.run(CURSOR_S) == pytest.approx(0.75 * LAST_S, abs=2 * LAST_S / box["width"])
    assert page.run(f"{FILM}.currentTime") == pytest.approx(0.75 * LAST_S, abs=2 * LAST_S / box["width"])
    place = page.run(f"parseFloat({second}.querySelector('.cursor').style.left) / 100")
    assert place == pytest.approx(left + 0.75 * (right - left), abs=2 / box["width"])


def test_arrow_keys_step_frame_by_frame(page, plot_box):
    page.click(axis_x(page, plot_box, 0.25), plot_box["top"] + 50)
    page.press("Home")
    page.press("ArrowRight")
    page.press("ArrowRight")
    page.wait_for(f"!{FILM}.seeking")
    assert page.run(f"{FILM}.currentTime") == pytest.approx(2 * FRAME_S, abs=0.001)
    page.press("End")
    # A style keeps six digits.
    assert page.run(CURSOR_S) == pytest.approx(LAST_S, rel=1e-5)


def test_plan_shows_the_object_only_where_it_was_seen(page, plot_box):
    # The scene loses the object from frame 60 to 71 of 80.
    for share, shown in ((30 / 79, "visible"), (65 / 79, "hidden"), (78 / 79, "visible")):
        page.click(axis_x(page, plot_box, share), plot_box["top"] + 50)
        assert page.run("document.querySelector('.dot.measured').style.visibility") == shown


def test_a_browser_that_refuses_the_data_gets_a_blob(page):
    page.run(f"{FILM}.dispatchEvent(new Event('error'))")
    page.wait_for(f"{FILM}.src.startsWith('blob:') && {FILM}.readyState >= 3")
    page.run(f"{FILM}.currentTime = 1")
    page.wait_for(f"!{FILM}.seeking && Math.abs({CURSOR_S} - 1) < 0.001")


def test_a_run_without_film_has_a_cursor_of_its_own(page):
    script = "document.querySelector('#run-b .cursor').style"
    page.run("document.querySelector('#run-b [role=slider]').focus()")
    before = page.run(f"{script}.left")
    page.press("End")
    assert page.run(f"{script}.visibility") == "visible"
    assert page.run(f"{script}.left") != before


def test_a_narrow_screen_needs_no_sideways_scrolling(address, tmp_path):
    with Browser(tmp_path) as browser:
        browser.open(address, width=390, height=844)
        assert browser.run("document.documentElement.scrollWidth") == 390


# Words of tables that are broken over two lines, but for hashes, which have no better place.
BROKEN_WORDS = """[...document.querySelectorAll("table:not(.hashes) :is(th, td)")].flatMap((cell) =>
  [...cell.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE).flatMap((node) =>
    [...node.data.matchAll(/\\S+/g)].filter((word) => {
      const range = document.createRange();
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      return new Set([...range.getClientRects()].map((box) => box.top)).size > 1;
    }).map((word) => word[0])))"""


def test_a_narrow_screen_breaks_no_number_in_the_tables_of_four_runs(tmp_path):
    known = [towed_run(name, n=FRAMES) for name in "abcd"]
    runs = tuple(RunReport(dataclasses.replace(run, uncertainty=uncertainty_of(run))) for run in known)
    data = ReportData("lab", runs, Provenance("towval report lab"), calibration=small_calibration())
    report = write_report(tmp_path / "report.html", data)
    with Browser(tmp_path / "profile") as browser:
        browser.open(report.as_uri(), width=390, height=844)
        assert browser.run("document.querySelectorAll('.by-run td').length") > 40
        assert browser.run(BROKEN_WORDS) == []
        assert browser.run("document.documentElement.scrollWidth") == 390


def test_page_has_no_complaint_and_asks_for_nothing(page, address):
    assert page.complaints() == []
    assert [url for url in page.requests() if not url.startswith("blob:")] == [address]
