"""The report in a real browser: no complaint, film and plots at the same frame, nothing carried out or loaded."""

import base64
import dataclasses
import re

import numpy as np
import pytest
from browser import Browser

from report_scenes import (
    NUMBER_PX,
    SMALL_SIZE_PX,
    numbered_film,
    simulated_up_to,
    small_calibration,
    towed_run,
    uncertainty_of,
)
from towval.model import Finding, Severity
from towval.report.data import InputRow, Provenance, ReportData, RunReport
from towval.report.film import series
from towval.report.outlines import film_layers
from towval.report.page import write_report

FRAMES = 80
FRAME_S = 0.04
WIDE, PHONE = (1280, 900), (390, 844)
FILM = "document.querySelector('video')"
RUN = "document.querySelector('#run-a')"

# Number of the frame that the film shows, read from its picture; of the outlines; and the time of each cursor.
HELPERS = f"""
window.picture = document.createElement("canvas").getContext("2d", {{ willReadFrequently: true }});
picture.canvas.width = {SMALL_SIZE_PX[0]};
picture.canvas.height = {SMALL_SIZE_PX[1]};
window.film = (run = {RUN}) => {{
  picture.drawImage(run.querySelector("video"), 0, 0, {SMALL_SIZE_PX[0]}, {SMALL_SIZE_PX[1]});
  let number = 0;
  for (let bit = 0; bit < 10; bit += 1) {{
    const at = [(bit + 0.5) * {NUMBER_PX}, {SMALL_SIZE_PX[1]} - 0.5 * {NUMBER_PX}];
    number += (picture.getImageData(...at.map(Math.floor), 1, 1).data[0] > 128) << bit;
  }}
  return number;
}};
window.copied = (run) => {{
  const canvas = run.querySelector("canvas"), {{ width, height }} = canvas;
  const copy = Object.assign(document.createElement("canvas"), {{ width, height }});
  const context = copy.getContext("2d", {{ willReadFrequently: true }});
  context.drawImage(canvas, 0, 0);
  return context.getImageData(0, 0, width, height);
}};
window.cursors = (run = {RUN}) => [...run.querySelectorAll(".timeplot")].map((plot) => {{
  const {{ left, right, first, last }} = plot.dataset;
  const share = parseFloat(plot.querySelector(".cursor").style.left) / 100;
  return Number(first) + (share - left) / (right - left) * (last - first);
}});
window.state = (run = {RUN}) => ({{ film: film(run), outlines: Number(run.dataset.frame), cursors: cursors(run),
  slider: Number(run.querySelector(".time").value) }});
0
"""


def known(name, **changes):
    run = towed_run(name, n=FRAMES, **changes)
    return dataclasses.replace(run, uncertainty=uncertainty_of(run))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def report(folder):
    """Run a with its film, run b without one, run c whose film no browser decodes, run d whose film starts late."""
    runs = (
        RunReport(known("a"), numbered_film(folder / "a.mp4", FRAMES)),
        RunReport(known("b")),
        RunReport(known("c"), numbered_film(folder / "c.mp4", FRAMES, codec="mpeg4")),
        RunReport(known("d"), numbered_film(folder / "d.mp4", FRAMES, first_pts=50, bf="3", g="60")),
    )
    data = ReportData("lab", runs, Provenance("towval report lab"), calibration=small_calibration())
    return write_report(folder / "report.html", data)


@pytest.fixture(scope="module", params=[WIDE, PHONE], ids=["desktop", "phone"])
def page(report, tmp_path_factory, request):
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open(report.as_uri(), *request.param)
        if not browser.run("document.createElement('video').canPlayType('video/mp4; codecs=\"avc1.64001e\"')"):
            pytest.skip("this browser was built without H.264")
        browser.run(HELPERS)
        see(browser, "a")
        yield browser


def see(browser, name):
    """Scroll to a run and wait until its film shows a frame."""
    browser.run(f"document.querySelector('#run-{name}').scrollIntoView({{ behavior: 'instant' }})")
    browser.wait_for(f"document.querySelector('#run-{name}').matches('.ready, .unseen')")


def box_of(browser, selector):
    browser.run(f"document.querySelector('{selector}').scrollIntoView({{ block: 'center', behavior: 'instant' }})")
    return browser.run(f"document.querySelector('{selector}').getBoundingClientRect().toJSON()")


def click_at(browser, selector, time_s):
    """Click on a plot where its axis shows a time."""
    box = box_of(browser, selector)
    left, right, first, last = browser.run(
        f"(({{ left, right, first, last }}) => [left, right, first, last].map(Number))"
        f"(document.querySelector('{selector}').dataset)"
    )
    share = left + (right - left) * (time_s - first) / (last - first)
    browser.click(box["left"] + box["width"] * share, box["top"] + box["height"] / 2)


def settled(browser, frame, name="a"):
    """The state once the film shows a frame and the outlines have followed."""
    run = f"document.querySelector('#run-{name}')"
    browser.wait_for(f"film({run}) === {frame} && !{run}.querySelector('video').seeking")
    # The browser tells of a frame when it next paints, which a busy machine may delay by a few.
    browser.wait_for(f"state({run}).outlines === {frame}")
    return browser.run(f"state({run})")


def test_a_playing_film_outlines_and_cursors_are_never_more_than_a_frame_apart(page):
    seen = page.run(f"""new Promise((done) => {{
      const video = {FILM}, seen = [];
      video.currentTime = 0;
      const next = () => {{ seen.push(state()); if (!video.ended) {{ video.requestVideoFrameCallback(next); }} }};
      video.requestVideoFrameCallback(next);
      video.addEventListener("ended", () => done(seen), {{ once: true }});
      document.querySelector(".play").click();
    }})""")
    assert len({state["film"] for state in seen}) > FRAMES / 4
    for state in seen:
        assert abs(state["outlines"] - state["film"]) <= 1
        assert state["slider"] == state["outlines"]
        np.testing.assert_allclose(state["cursors"], FRAME_S * state["outlines"], atol=1e-4)


def test_a_click_on_a_plot_moves_film_outlines_and_all_cursors_to_that_frame(page):
    for frame in (40, 7, 79, 41):
        click_at(page, "#run-a .timeplot", FRAME_S * frame)
        state = settled(page, frame)
        assert state["outlines"] == state["slider"] == frame
        np.testing.assert_allclose(state["cursors"], FRAME_S * frame, atol=1e-4)


def test_the_slider_steps_frame_by_frame(page):
    page.run("document.querySelector('#run-a .time').focus()")
    for key, frame in (
        ("Home", 0),
        ("ArrowRight", 1),
        ("ArrowRight", 2),
        ("End", FRAMES - 1),
        ("ArrowLeft", FRAMES - 2),
    ):
        page.press(key)
        assert settled(page, frame)["outlines"] == frame
    error_mm = 1e3 * np.hypot(*known("a").comparison.along_across[FRAMES - 2])
    assert page.run(f"{RUN}.querySelector('.readout').textContent").startswith(f"3.12 s: error {error_mm:.2f} mm")


def test_a_frame_after_the_simulation_has_neither_error_nor_tension(page):
    """It was said not to be tracked, and to be pulled as in the last frame that was simulated."""
    run, times = simulated_up_to(towed_run(n=FRAMES), 50), FRAME_S * np.arange(FRAMES)
    told = [page.run(f"Run.prototype.words.call({{ series: {series(run, times, times)} }}, {i})") for i in (49, 60)]
    assert told[0].startswith("1.96 s: error ")
    assert told[0].endswith(f", tension {np.linalg.norm(run.simulated.tether_force[49]):.1f} N")
    assert told[1] == "2.40 s: object not simulated"


def test_scrubbing_ends_at_the_last_place_asked_for(page):
    page.run(f"""(() => {{
      const slider = {RUN}.querySelector(".time");
      for (slider.value = 5; slider.value < 60; slider.value++) {{ slider.dispatchEvent(new Event("input")); }}
      slider.dispatchEvent(new Event("input"));
    }})()""")
    assert settled(page, 60)["outlines"] == 60


def test_a_frame_that_the_browser_shows_without_a_call_gets_its_outlines(page):
    page.run(f"""(() => {{
      const film = {FILM};
      // The call that is out reaches the page once more, at the next frame; no later one does.
      film.requestVideoFrameCallback = (next) => {{ film.unanswered = next; }};
    }})()""")
    try:
        for frame in (12, 55, 31):
            click_at(page, "#run-a .timeplot", FRAME_S * frame)
            assert settled(page, frame)["slider"] == frame
    finally:
        page.run(f"delete {FILM}.requestVideoFrameCallback; {FILM}.requestVideoFrameCallback({FILM}.unanswered)")


def test_a_film_that_starts_late_and_is_coded_out_of_order_shows_the_frame_of_its_outlines(page):
    see(page, "d")
    for frame in (33, 0, 78):
        click_at(page, "#run-d .timeplot", FRAME_S * frame)
        assert settled(page, frame, "d")["outlines"] == frame


def coloured(page, colour):
    """Number of pixels of run a's canvas close to a colour."""
    return page.run(f"""(() => {{
      const {{ data }} = copied({RUN}), wanted = {list(colour)};
      let count = 0;
      for (let i = 0; i < data.length; i += 4) {{
        count += data[i + 3] > 200 && wanted.every((value, k) => Math.abs(data[i + k] - value) < 40);
      }}
      return count;
    }})()""")


def test_layers_can_be_switched(page):
    page.run(
        f"(() => {{ const s = {RUN}.querySelector('.time'); s.value = 40; s.dispatchEvent(new Event('input')); }})()"
    )
    settled(page, 40)
    for layer, colour in (
        ("measured", (255, 60, 36)),
        ("rover", (64, 150, 255)),
        ("tether", (255, 214, 80)),
        ("simulated", (0, 0, 0)),
    ):
        box = f"{RUN}.querySelector('.layer.{layer} input')"
        shown = coloured(page, colour)
        page.run(f"{box}.click()")
        hidden = coloured(page, colour)
        page.run(f"{box}.click()")
        assert shown > hidden + 10, layer
        assert coloured(page, colour) == shown


def test_outlines_lie_where_the_lens_shows_them(page):
    """The blue of the rover's outline against the projected corners, in the page's own pixels."""
    page.run(
        f"(() => {{ const s = {RUN}.querySelector('.time'); s.value = 50; s.dispatchEvent(new Event('input')); }})()"
    )
    settled(page, 50)
    run = known("a")
    layers = film_layers(run, small_calibration(), run.rover_track.time_s)
    corners = layers.pixels()["rover"][50]
    found = page.run(f"""(() => {{
      const {{ data, width }} = copied({RUN}), scale = width / {SMALL_SIZE_PX[0]};
      return {corners.tolist()}.map(([u, v]) => {{
        const at = 4 * (Math.floor((u + 0.5) * scale) + width * Math.floor((v + 0.5) * scale));
        return data[at + 3] > 100 && data[at + 2] > 150 && data[at] < 150;
      }});
    }})()""")
    assert all(found)


def test_a_film_that_cannot_be_decoded_is_named_and_shown_as_pictures(page):
    see(page, "c")
    page.wait_for("document.querySelector('#run-c').matches('.unseen')")
    note = page.run("document.querySelector('#run-c .unplayable').innerText")
    assert "c.mp4" in note
    assert "MPEG-4 part 2" in note
    assert page.run("document.querySelector('#run-c .stills img').naturalWidth") == SMALL_SIZE_PX[0]
    click_at(page, "#run-c .timeplot", 1.0)
    assert page.run("document.querySelector('#run-c').dataset.frame") == "25"


def test_a_run_without_film_has_a_cursor_of_its_own(page):
    click_at(page, "#run-b .timeplot", 2.0)
    np.testing.assert_allclose(page.run("cursors(document.querySelector('#run-b'))"), 2.0, atol=1e-4)


def test_the_picture_saved_is_the_frame_with_its_outlines(page):
    page.run(
        f"(() => {{ const s = {RUN}.querySelector('.time'); s.value = 20; s.dispatchEvent(new Event('input')); }})()"
    )
    settled(page, 20)
    name, size, red = page.run(f"""new Promise((done) => {{
      const create = URL.createObjectURL;
      URL.createObjectURL = (blob) => {{
        HTMLAnchorElement.prototype.click = async function () {{
          const bitmap = await createImageBitmap(blob);
          picture.drawImage(bitmap, 0, 0);
          const {{ data }} = picture.getImageData(0, 0, bitmap.width, bitmap.height);
          let red = 0;
          for (let i = 0; i < data.length; i += 4) {{ red += data[i] > 200 && data[i + 1] < 120 && data[i + 2] < 120; }}
          done([this.download, [bitmap.width, bitmap.height], red]);
        }};
        return create(blob);
      }};
      {RUN}.querySelector(".save").click();
    }})""")
    assert name == "run_a_0.80s.png"
    assert tuple(size) == SMALL_SIZE_PX
    assert red > 20


def test_page_has_no_complaint_and_needs_no_sideways_scrolling(page, report):
    assert page.run("document.documentElement.scrollWidth") <= page.run("innerWidth")
    assert [url for url in page.requests() if not url.startswith("blob:")] == [report.as_uri()]
    assert page.complaints() == []


NASTY = (
    """x" onclick="pwned=1'><script>pwned=1</script><img src=x onerror="pwned=1">{{ 7 * 7 }}--><svg/onload=pwned=1>"""
)


def test_names_and_texts_of_a_campaign_carry_nothing_out(tmp_path):
    run = known("a")
    finding = Finding(Severity.WARNING, "odd", NASTY)
    comparison = dataclasses.replace(run.comparison, findings=(Finding(Severity.NOTE, "verdict", NASTY), finding))
    data = ReportData(
        NASTY,
        (RunReport(dataclasses.replace(run, name=NASTY, comparison=comparison)),),
        Provenance(NASTY, {NASTY: NASTY}, {NASTY: NASTY}, NASTY, {NASTY: NASTY}),
        calibration=small_calibration(),
        inputs=(InputRow(NASTY, NASTY, NASTY, NASTY, NASTY),),
        findings=(finding,),
    )
    with Browser(tmp_path / "profile") as browser:
        browser.open(write_report(tmp_path / "report.html", data).as_uri())
        browser.run("for (const part of document.querySelectorAll('details')) { part.open = true; }")
        assert browser.run("typeof pwned") == "undefined"
        assert browser.run("document.querySelector('h1').textContent") == NASTY
        assert (
            browser.run("document.querySelectorAll('[onclick], [onerror], [onload], main script:not([type])').length")
            == 0
        )
        assert browser.complaints() == []


def test_a_linked_film_plays_beside_the_page_and_can_be_chosen_by_hand_elsewhere(tmp_path):
    film = numbered_film(tmp_path / "films of a & b" / "a #1.mp4", FRAMES)
    data = ReportData(
        "lab", (RunReport(known("a"), film),), Provenance(""), calibration=small_calibration(), embed_mb=0
    )
    report = write_report(tmp_path / "results" / "report.html", data)
    for moved in (False, True):
        if moved:
            film = film.rename(tmp_path / "elsewhere.mp4")
        with Browser(tmp_path / f"profile {moved}") as browser:
            browser.open(report.as_uri())
            browser.run(HELPERS)
            if moved:
                browser.wait_for(f"{RUN}.matches('.unseen')")
                node = browser.handle("document.querySelector('.unplayable input')")
                browser.send("DOM.setFileInputFiles", files=[str(film)], objectId=node)
            browser.wait_for(f"{RUN}.matches('.ready')")
            click_at(browser, "#run-a .timeplot", FRAME_S * 30)
            browser.wait_for(f"{RUN}.dataset.frame === '30'")
            assert abs(browser.run(f"{FILM}.currentTime") - 30.25 * FRAME_S) < 1e-3
            # A browser does not give away the pictures of a linked file.
            assert browser.run(f"{RUN}.querySelector('.save').hidden") is not moved
            if moved:
                assert settled(browser, 30)["outlines"] == 30
                # Lost while the page waits for another frame of it, as on a drive that is unplugged, and chosen again.
                browser.run(f"runs[0].go(10), {FILM}.src = 'gone.mp4'")
                browser.wait_for(f"{RUN}.matches('.unseen')")
                browser.send("DOM.setFileInputFiles", files=[str(film)], objectId=node)
                browser.wait_for(f"{RUN}.matches('.ready')")
                click_at(browser, "#run-a .timeplot", FRAME_S * 20)
                assert settled(browser, 20)["outlines"] == 20


def test_two_runs_fit_the_limits_of_words_pages_and_bytes(tmp_path):
    films = [numbered_film(tmp_path / f"{name}.mp4", FRAMES, crf="0") for name in "ab"]
    runs = tuple(RunReport(known(film.stem), film) for film in films)
    report = write_report(
        tmp_path / "report.html", ReportData("lab", runs, Provenance(""), calibration=small_calibration())
    )
    assert report.stat().st_size <= 1.2 * sum(film.stat().st_size for film in films) + 1.5e6
    with Browser(tmp_path / "profile") as browser:
        browser.open(report.as_uri())
        assert len(browser.run("document.body.innerText").split()) <= 700
        assert pages(browser) <= 6


def test_the_frame_printed_carries_its_own_outlines(tmp_path):
    """Even where the cursor was moved before the film was there."""
    data = ReportData(
        "lab",
        (RunReport(known("a"), numbered_film(tmp_path / "a.mp4", FRAMES)),),
        Provenance(""),
        calibration=small_calibration(),
    )
    report = write_report(tmp_path / "report.html", data)
    with Browser(tmp_path / "profile") as browser:
        browser.open(report.as_uri())
        browser.run(HELPERS)
        slider = f"{RUN}.querySelector('.time')"
        browser.run(f"{slider}.value = 37, {slider}.dispatchEvent(new Event('input'))")
        browser.wait_for(f"{RUN}.matches('.ready')")
        assert settled(browser, 37)["outlines"] == 37
        printed = browser.run(f"""(() => {{
          dispatchEvent(new Event("beforeprint"));
          const {{ data, width, height }} = copied({RUN}), square = {NUMBER_PX} * width / {SMALL_SIZE_PX[0]};
          let number = 0;
          for (let bit = 0; bit < 10; bit += 1) {{
            const at = 4 * (Math.floor((bit + 0.5) * square) + width * Math.floor(height - 0.5 * square));
            number += (data[at] > 128) << bit;
          }}
          return number;
        }})()""")
        assert printed == 37
        assert pages(browser) <= 6


def pages(browser):
    printed = base64.b64decode(browser.send("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"])
    return len(re.findall(rb"/Type\s*/Page\b", printed))


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
    runs = tuple(RunReport(known(name)) for name in "abcd")
    data = ReportData("lab", runs, Provenance("towval report lab"), calibration=small_calibration())
    report = write_report(tmp_path / "report.html", data)
    with Browser(tmp_path / "profile") as browser:
        browser.open(report.as_uri(), *PHONE)
        browser.run("for (const part of document.querySelectorAll('details')) { part.open = true; }")
        assert browser.run("document.querySelectorAll('.by-run td').length") > 40
        assert browser.run(BROKEN_WORDS) == []
        assert browser.run("document.documentElement.scrollWidth") == PHONE[0]
