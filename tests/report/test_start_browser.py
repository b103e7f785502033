"""The page of starts in a real browser: what is wrong is told or mended, and what is saved is a campaign that loads."""

import shutil
from dataclasses import replace
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from browser import Browser

from report_scenes import SMALL_SIZE_PX, small_calibration
from towval.commands.check import check
from towval.io.campaign import load_campaign
from towval.io.campaign_text import FloorCorner, RunClicks, text_in_parts
from towval.io.video import Video
from towval.model import Body, Camera, FrictionSpecification, Load, Patch, Tether, TowingScene
from towval.model.geometry import lifted, transform
from towval.optics.projection import project
from towval.report.start_page import StartOfRun, without_distortion, write_start_page

SAMPLE = Path(str(resources.files("towval"))) / "sample"
COMMENT = "# measured </script><b id=injected>on Monday</b>"
# A name that every object of JavaScript knows.
LEFT_OUT = "  constructor: {video: a.mp4, left_out: the lamp fell}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A copy of the sample with a comment that tries to leave its place and a run that is left out, and its page."""
    folder = tmp_path_factory.mktemp("lab") / "lab <b id=injected>x"
    shutil.copytree(SAMPLE, folder)
    file = folder / "campaign.yaml"
    file.write_text(f"{file.read_text().replace('tether:', f'{COMMENT}{chr(10)}tether:')}{LEFT_OUT}")
    told = check(folder, folder / "check")
    assert told["faults"] == []
    return folder


@pytest.fixture(scope="module", params=[(1280, 800), (390, 844)], ids=["desktop", "phone"])
def page(request, folder, tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open((folder / "check" / "start.html").as_uri(), *request.param)
        browser.run("window.confirm = (text) => { window.asked = text; return true; }")
        browser.wait_for("runs[run].grey !== undefined")
        # A phone lays the page out once more when it has read how wide it wants to be.
        browser.wait_for(f"innerWidth === {request.param[0]} && Math.abs(view.width - view.clientWidth) < 1")
        browser.run("window.first = structuredClone(runs[run].poses)")
        yield browser


@pytest.fixture(autouse=True)
def start(page):
    page.run("runs[run].poses = structuredClone(first), past = [], asked = '', select('rover'), fit(), changed()")
    page.run("frame = { origin: BOARD.origin, end: BOARD.end }, byId('floor').open = false")


def told(page):
    """The warnings of the run that is shown."""
    return page.run("warnings(run).join(' | ')")


def test_an_outline_that_was_placed_nowhere_is_so_again_after_undo(page):
    """The page forgot that the body had not been found, and saved where the outline happened to begin."""
    page.run("runs[run].unplaced.add('object'), select('object')")
    assert "The object was not found" in told(page)
    page.run("nudge(40, 0)")
    assert "not found" not in told(page)
    page.run("undo()")
    again = told(page)
    page.run("runs[run].unplaced.delete('object')")
    assert "The object was not found" in again


def place(page, body, corner=None):
    """Where the middle or a corner of an outline is in the window [px]."""
    point = "[0, 0]" if corner is None else f"DATA.bodies.{body}.corners[{corner}]"
    x, y = page.run(f"onScreen(picture('{body}', runs[run].poses.{body}, {point}))")
    box = page.run("view.getBoundingClientRect().toJSON()")
    return box["left"] + x, box["top"] + y


def drag(page, start, by, touch=False):
    """Drag with the mouse, or with a finger."""
    (x, y), (dx, dy) = start, by
    stops = [(x + k * dx / 5, y + k * dy / 5) for k in range(6)]
    for i, (u, v) in enumerate(stops):
        if touch:
            page.send(
                "Input.dispatchTouchEvent", type="touchStart" if i == 0 else "touchMove", touchPoints=[{"x": u, "y": v}]
            )
        else:
            kind = "mousePressed" if i == 0 else "mouseMoved"
            page.send("Input.dispatchMouseEvent", type=kind, x=u, y=v, button="left", buttons=1, clickCount=1)
    if touch:
        page.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    else:
        page.send("Input.dispatchMouseEvent", type="mouseReleased", x=u, y=v, button="left", clickCount=1)


def off_px(page, body):
    """How far the farthest corner is from where it was at first [px of the picture]."""
    return page.run(f"apart('{body}', runs[run].poses.{body}, first.{body})")


def saved(page, folder, tmp_path):
    """The campaign that Save hands out, with the files of the folder."""
    page.run("URL.createObjectURL = (blob) => { window.blob = blob; return '#'; }")
    page.run("byId('save').click()")
    text = page.run("blob.text()")
    for name in ("calibration", "a.mp4"):
        (tmp_path / name).symlink_to(folder / name)
    (tmp_path / "campaign.yaml").write_text(text)
    return load_campaign(tmp_path), text


def test_it_opens_without_a_complaint_a_request_or_a_warning(page):
    assert page.complaints() == []
    assert len(page.requests()) == 1
    assert told(page) == ""
    assert page.run("document.getElementById('injected')") is None
    assert "injected" in page.run("byId('title').textContent")


def test_saved_at_once_it_is_the_campaign_that_was_read(page, folder, tmp_path):
    campaign, text = saved(page, folder, tmp_path)
    # A browser saves among its downloads: the file in the folder is the old one until somebody replaces it.
    assert "Put it in place of the one in lab <b id=injected>x" in page.run("byId('saved').textContent")
    before = load_campaign(folder)
    for body in ("rover", "object"):
        clicks, given = campaign.run("a").clicks_px[body], before.run("a").clicks_px[body]
        # The clicks were made by hand; an outline of the stated size fits them to a pixel.
        assert np.abs(clicks - given).max() < 1.5
    assert COMMENT in text
    assert text.endswith(LEFT_OUT)
    assert page.run("asked") == ""


def test_the_camera_of_the_page_is_the_one_of_the_package(page, folder):
    clicks = load_campaign(folder).run("a").clicks_px["object"]
    found = page.run("clicked('object', first.object)")
    assert np.abs(np.array(found) - clicks).max() < 1.5
    there = page.run("(() => { const [u, v] = project(...toPlane(700, 120, 0.42), 0.42); return [u, v]; })()")
    assert there == pytest.approx([700, 120], abs=1e-6)


def test_the_picture_is_shown_without_the_distortion_of_the_lens(page, folder):
    first = next(iter(Video(folder / "a.mp4")))[1]
    seen = page.run("""(() => {
      const rows = [];
      for (let x = -0.6; x <= 2.6; x += 0.02) for (let y = -0.4; y <= 1.6; y += 0.02)
        rows.push([...filmed(x, y, 0), greyAt(runs[run].grey, ...project(x, y, 0))]);
      return rows.map((row) => row.map((value) => Number.isNaN(value) ? -1 : value));
    })()""")
    u, v, shown = np.array(seen).T
    height, width = first.shape
    inside = (u > 1) & (v > 1) & (u < width - 2) & (v < height - 2) & (shown >= 0)
    assert inside.sum() > 3000

    def off(shift_px):
        at = u[inside] + shift_px, v[inside]
        there = cv2.remap(first, *(pixels.astype(np.float32)[:, None] for pixels in at), cv2.INTER_LINEAR)[:, 0]
        return np.abs(there - shown[inside]).mean()

    # A picture that is a pixel beside the camera that draws over it fits less well.
    assert off(0) < 0.6 * off(1)


@pytest.mark.parametrize("touch", [False, True], ids=["mouse", "finger"])
def test_an_outline_dragged_off_is_told_and_snapped_back(page, touch):
    shift = 6 * page.run("scale")
    drag(page, place(page, "object"), (shift, shift), touch)
    assert off_px(page, "object") == pytest.approx(6 * 2**0.5, abs=2.5)
    assert "outline of the object is" in told(page)
    page.run("byId('snap').click()")
    assert off_px(page, "object") < 1.5
    assert told(page) == ""
    page.run("byId('undo').click(), byId('undo').click()")
    assert off_px(page, "object") == 0


@pytest.mark.parametrize("body", ["rover", "object"])
def test_a_corner_dragged_turns_the_outline_which_keeps_its_size(page, body):
    page.run(f"select('{body}'), zoom(2)")
    x, y = place(page, body, 2)
    box = page.run("view.getBoundingClientRect().toJSON()")
    dx, dy = box["left"] + box["width"] / 2 - x, box["top"] + box["height"] / 2 - y
    page.run(f"offset = [offset[0] + {dx}, offset[1] + {dy}], draw()")
    sides = f"corners('{body}', runs[run].poses.{body}).length"
    assert page.run(sides) == 4
    drag(page, place(page, body, 2), (0, -8 * page.run("scale")))
    turned = page.run(f"Math.abs(wrapped(runs[run].poses.{body}[2] - first.{body}[2]))")
    assert 0.01 < turned < 0.3
    assert off_px(page, body) > 3
    assert f"outline of the {body} is" in told(page)
    page.run("snap()")
    assert off_px(page, body) < 1.5


def test_half_a_turn_is_told_before_saving(page, folder, tmp_path):
    page.press("h")
    assert "tether" in told(page)
    campaign, _ = saved(page, folder, tmp_path)
    assert "tether" in page.run("asked")
    before = load_campaign(folder).run("a").clicks_px["rover"]
    assert np.abs(campaign.run("a").clicks_px["rover"] - np.roll(before, 2, axis=0)).max() < 1.5


def test_keys_move_turn_and_select(page):
    page.run("view.focus()")
    page.press("ArrowRight")
    assert off_px(page, "rover") == pytest.approx(1, abs=0.2)
    page.press("u")
    page.press("2")
    # As a German keyboard makes it on Windows, by AltGr.
    page.run("window.dispatchEvent(new KeyboardEvent('keydown', { key: '[', ctrlKey: true, altKey: true }))")
    assert page.run("wrapped(runs[run].poses.object[2] - first.object[2])") == pytest.approx(np.pi / 360)
    page.press("u")
    page.press("q")
    quarter = page.run("wrapped(runs[run].poses.object[2] - first.object[2])")
    assert quarter == pytest.approx(np.pi / 2)
    assert told(page) != ""


def in_window(page, corner):
    """Where an outer corner of the floor board is in the window [px]."""
    box = page.run("ground.getBoundingClientRect().toJSON()")
    u, v = page.run(f"BOARD.corners[{corner}]")
    left, top = page.run("BOARD.offset")
    scale = box["width"] / page.run("BOARD.width")
    return box["left"] + (u - left + 0.5) * scale, box["top"] + (v - top + 0.5) * scale


@pytest.mark.parametrize("touch", [False, True], ids=["mouse", "finger"])
def test_the_floor_frame_is_dragged_to_other_corners_of_the_board(page, folder, tmp_path, touch):
    page.run("byId('floor').open = true, byId('floor').scrollIntoView()")
    page.wait_for("ground.clientWidth > 0 && ground.height > 150")
    origin, end = page.run("[frame.origin, frame.end]")
    (x, y), (p, q) = in_window(page, origin), in_window(page, (origin + 2) % 4)
    drag(page, (x, y), (p - x, q - y), touch)
    assert page.run("frame.origin") == (origin + 2) % 4
    campaign, _ = saved(page, folder, tmp_path)
    before = load_campaign(folder)
    corners = np.array(page.run("BOARD.corners"))
    assert campaign.floor_reference.origin_corner_px == pytest.approx(corners[(origin + 2) % 4], abs=0.06)
    assert campaign.floor_reference.x_axis_end_corner_px == pytest.approx(
        before.floor_reference.x_axis_end_corner_px if page.run("frame.end") == end else corners[page.run("frame.end")],
        abs=1.5,
    )
    assert campaign.run("a").clicks_px.keys() == before.run("a").clicks_px.keys()


def test_the_floor_frame_goes_round_the_board_by_buttons(page):
    seen = set()
    for _ in range(4):
        page.run("byId('origin').click()")
        for _ in range(2):
            page.run("byId('side').click()")
            seen.add(tuple(page.run("[frame.origin, frame.end]")))
    assert len(seen) == 8
    assert all((origin - end) % 2 == 1 for origin, end in seen)


def without_lens(pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """Where a pinhole camera of the same matrix sees what a camera sees at pixels (n, 2), by OpenCV."""
    if camera.lens_model.startswith("fisheye"):
        bend = np.append(camera.distortion[[0, 1, 4]], 0.0)
        return cv2.fisheye.undistortPoints(pixels[:, None], camera.matrix, bend, P=camera.matrix)[:, 0]
    return cv2.undistortImagePoints(pixels, camera.matrix, camera.distortion)[:, 0]


def test_each_run_has_the_camera_that_filmed_it(tmp_path):
    """The video of b is 3 % wider, and c is filmed by a fisheye; OpenCV shows where they are without the lens."""
    calibration = small_calibration()
    camera = replace(calibration.camera, matrix=calibration.camera.matrix * [[1.03], [1.03], [1.0]])
    bent = np.array([0.02, -0.01, 0, 0, 0.003, 0, 0, 0])
    fisheye = replace(calibration.camera, distortion=bent, lens_model="fisheye k1 k2 k3")
    views = {"a": calibration, "b": replace(calibration, camera=camera), "c": replace(calibration, camera=fisheye)}
    corners = np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]])
    bodies = {"rover": Body("rover", 0.42, corners), "object": Body("object", 0.25, corners)}
    poses = {"rover": np.array([0.6, 0.8, 0.0]), "object": np.array([-0.3, 0.8, 0.4])}
    luma = np.full(SMALL_SIZE_PX[::-1], 90, dtype=np.uint8)
    starts = {name: StartOfRun(luma, view, poses, {}) for name, view in views.items()}
    scene = TowingScene(
        Patch(corners), 4.0, Load(0.0, (0.0, 0.0), (0.0, 0.0, 0.0)), (0.2, 0.0), (-0.2, 0.0), Tether(0.9, 800.0),
        FrictionSpecification(0.4, 0.35, 0.005, 0.07),
    )  # fmt: skip
    write_start_page(tmp_path / "start.html", "lab", [], scene, bodies, 1.0, starts, None)
    with Browser(tmp_path / "profile") as browser:
        browser.open((tmp_path / "start.html").as_uri(), 1280, 800)
        browser.wait_for("['a', 'b', 'c'].every((name) => runs[name].grey !== undefined)")
        for shown in "abc":
            browser.run(f"show('{shown}')")
            for name, view in views.items():
                for body, pose in poses.items():
                    top = lifted(transform(pose, corners), bodies[body].tracked_plane_height_m)
                    there = project(view.camera, view.floor, top)
                    assert np.abs(np.array(browser.run(f"clicks('{name}').{body}")) - there).max() < 1e-6
                    if name == shown:
                        seen = browser.run(f"corners('{body}', runs[run].poses.{body})")
                        shift, _ = without_distortion(view.camera)
                        straight = without_lens(there, view.camera)
                        straight += shift[:2, 2] - view.camera.matrix[:2, 2]
                        assert np.abs(np.array(seen) - straight).max() < 1e-3
        # Before saving all runs are looked at, not only the one that is shown.
        browser.run("show('a'), runs.b.poses.rover = [9, 0.8, 0]")
        assert browser.run("warnings('a').join()").count("outside") == 0
        assert "A corner of the rover is outside the picture" in browser.run("warnings('b').join()")
        assert browser.complaints() == []


BLOCK = """\
runs:
  a:
    video: a.mp4
    first_frame_clicks_px:
      rover: [[1, 2]]
    damaged_video: true  # once
  b:
    video: b.mp4
"""
FLOW = "runs: {a: {video: a.mp4, first_frame_clicks_px: {rover: [[1, 2]]}}, b: {video: b.mp4}}\ntether: {}\n"


COMMA = "runs:\n  a: {video: a.mp4,}\n  b: {video: b.mp4, }\n"
ANCHORED = "runs:\n  a: &first\n    video: a.mp4\n  b: &second\n    video: b.mp4\n"
# Bodies that start at the same places: the clicks of both runs were put where the anchor is, which is no YAML.
SHARED = """\
runs:
  a:
    first_frame_clicks_px: &start
      rover: [[1, 2]]
    # once: the codec
    video: a.mp4
  b:
    first_frame_clicks_px: *start
    video: b.mp4
"""
SHARED_FLOW = "runs: {a: {first_frame_clicks_px: &s {rover: [[1, 2]]}}, b: {first_frame_clicks_px: *s, video: b.mp4}}\n"
REMARKS = "runs:\n  a:\n    video: a.mp4  # once\n\n  # The second run.\n  b:\n    video: b.mp4\n"


@pytest.mark.parametrize(
    "text",
    [BLOCK, BLOCK.replace("\n", "\r\n"), FLOW, BLOCK + "# the end\n", COMMA, ANCHORED, SHARED, SHARED_FLOW, REMARKS],
)
def test_clicks_are_put_into_any_way_of_writing_the_runs(text):
    pieces = [
        f"{piece.before}{{rover: [[{piece.run}, 0]]}}" if isinstance(piece, RunClicks) else piece
        for piece in text_in_parts(text)
    ]
    assert "".join(piece if isinstance(piece, str) else piece.stated for piece in text_in_parts(text)) == text
    document, before = yaml.safe_load("".join(pieces)), yaml.safe_load(text)
    for name in "ab":
        assert document["runs"][name].pop("first_frame_clicks_px") == {"rover": [[name, 0]]}
        before["runs"][name].pop("first_frame_clicks_px", None)
    assert document == before
    assert ("# once" in text) == ("# once" in "".join(pieces))
    assert ("\r\n" in text) == ("\n" not in "".join(pieces).replace("\r\n", ""))
    # What is said of a run stays above it.
    assert ("# The second run.\n  b:" in text) == ("# The second run.\n  b:" in "".join(pieces))


@pytest.mark.parametrize("corner", ["[1, 2]", "\n  - 1\n  - 2  # once", "\n    - 1\n    - 2"])
def test_the_floor_frame_is_put_into_any_way_of_writing_it(corner):
    text = f"floor:\n  image: f.jpg\n  origin_corner_px: {corner}\n  x_axis_end_corner_px: [3, 4]\nruns:\n  a: {{}}\n"
    pieces = text_in_parts(text)
    put = [f"{piece.before}[7, 8]" if isinstance(piece, FloorCorner) else piece for piece in pieces]
    kept = [piece.stated if isinstance(piece, FloorCorner) else piece for piece in pieces]
    as_text = ["".join(part if isinstance(part, str) else "" for part in parts) for parts in (put, kept)]
    document, same = (yaml.safe_load(each.replace(", first_frame_clicks_px: ", "")) for each in as_text)
    assert document["floor"] == {"image": "f.jpg", "origin_corner_px": [7, 8], "x_axis_end_corner_px": [7, 8]}
    assert same["floor"] == yaml.safe_load(text)["floor"]
