"""The command ``check``: what is told of a folder that is right and of folders that are wrong."""

import itertools
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from report_scenes import quarter_turned
from studies.worlds.film import write_video
from towval.commands.calibrate import calibrated
from towval.commands.check import _floor_board, check, for_people, run
from towval.commands.run_folder import same_footage
from towval.io.campaign import load_campaign
from towval.io.campaign_text import text_in_parts
from towval.io.images import read_gray
from towval.io.schema import key_lines
from towval.io.video import Video
from towval.io.yaml_text import read_yaml
from towval.model.geometry import turned_pixels

SAMPLE = Path(str(resources.files("towval"))) / "sample"


@pytest.fixture(scope="module", autouse=True)
def calibrated_once():
    """A set of pictures is calibrated once for each description of camera and floor: that is most of a check."""
    made = {}

    def remembered(given, settings):
        pictures = [path.resolve() for path in (*given.calibration_images, *given.floor_images)]
        heights = [body.tracked_plane_height_m for body in given.bodies]
        camera = {name: value for name, value in given.document["camera"].items() if name != "fps"}
        key = str([camera, given.document["floor"], pictures, heights, settings])
        if key not in made:
            made[key] = calibrated(given, settings)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("towval.commands.check.calibrated", remembered)
        yield


@pytest.fixture
def lab(tmp_path):
    """A function that writes a changed copy of the sample, its pictures linked, and returns the folder."""

    def changed(change=lambda document: None):
        folder = tmp_path / "lab"
        folder.mkdir()
        (folder / "calibration").symlink_to(SAMPLE / "calibration")
        shutil.copy(SAMPLE / "a.mp4", folder)
        document = yaml.safe_load((SAMPLE / "campaign.yaml").read_text())
        change(document)
        (folder / "campaign.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
        return folder

    return changed


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    """What is told of the sample."""
    pictures = tmp_path_factory.mktemp("pictures")
    return check(SAMPLE, pictures), pictures


def test_a_right_folder_has_no_fault_and_says_what_to_expect(right):
    told, pictures = right
    assert told["faults"] == []
    row = told["runs"]["a"]
    assert row["frames"] == 325
    # A pixel of the half-size picture; from the camera's height of 4.1 m and a focal length of about 800 px.
    assert 4 < row["object_pixel_mm"] < 6
    assert 0.1 < row["rover_position_std_mm"] < 2
    assert 20 < told["cpu_s"] < 200
    assert json.loads(json.dumps(told)) == told
    assert read_gray(pictures / "a.jpg", (960, 540)).shape == (540, 960)


def test_the_start_is_drawn_where_the_clicks_are(right):
    drawn = cv2.imread(str(right[1] / "a.jpg"))
    luma = next(iter(Video(SAMPLE / "a.mp4")))[1]
    corners = read_yaml(SAMPLE / "campaign.yaml")["runs"]["a"]["first_frame_clicks_px"]["rover"]
    for u, v in corners:
        near = slice(round(v) - 3, round(v) + 4), slice(round(u) - 3, round(u) + 4)
        blue_minus_red = drawn[near][..., 0].astype(int) - drawn[near][..., 2]
        assert blue_minus_red.max() > 60, "no outline of the rover near its click"
    away = slice(5, 40), slice(5, 40)
    assert abs(drawn[away].mean(axis=2) - luma[away]).mean() < 4


def test_all_faults_come_in_the_order_of_the_file_with_their_lines(lab, tmp_path, capsys):
    def change(document):
        document["runs"]["a"]["video"] = "gone.mp4"
        document["friction"].pop("static")
        document["object"]["load"]["at_m"] = [2.0, 0.0]
        document["camera"]["fsp"] = 25

    folder = lab(change)
    with pytest.raises(SystemExit) as exit_code:
        run(folder, tmp_path / "pictures", as_json=True)
    assert exit_code.value.code == 1
    told = json.loads(capsys.readouterr().out)
    lines = (folder / "campaign.yaml").read_text().splitlines()
    # The friction is not whole, so nothing that needs it is checked: the load's place comes when it is mended.
    assert [fault["key"] for fault in told["faults"]] == ["camera.fsp", "friction.static", "runs.a.video"]
    for fault, word in zip(told["faults"], ("fsp:", "friction:", "video:"), strict=True):
        assert word in lines[fault["line"] - 1]
    assert "Static friction" in told["faults"][1]["allowed"]
    assert "gone.mp4" in told["faults"][2]["got"]


def test_faults_of_videos_and_pictures_are_told_together(lab, tmp_path):
    def change(document):
        document["camera"]["resolution_px"] = [1920, 1080]
        document["runs"]["b"] = {"video": "campaign.yaml"}
        document["runs"]["a"].pop("first_frame_clicks_px")

    told = check(lab(change), tmp_path / "pictures")
    texts = [fault["text"] for fault in told["faults"]]
    for words in ("a.mp4 has another size", "campaign.yaml is no video", "has another size than camera.resolution_px"):
        assert any(words in text for text in texts), words
    assert told["runs"] == {}


def test_all_pictures_that_cannot_be_read_are_told_at_once(lab, tmp_path):
    """The first one ended the check: a campaign of photos in HEIC took as many calls as it has photos."""
    folder = lab()
    (folder / "calibration").unlink()
    shutil.copytree(SAMPLE / "calibration", folder / "calibration")
    first, second, third = sorted((folder / "calibration").glob("*.jpg"))[:3]
    first.write_bytes(b"\0\0\0\x18ftypheic" + bytes(500))
    second.write_bytes(second.read_bytes()[:5000])
    third.write_bytes(b"")
    texts = [fault["text"] for fault in check(folder, tmp_path / "pictures")["faults"]]
    assert len(texts) == 3, texts
    for words in (f"{first.name} is no picture", "HEIC, as phones write it", second.name, third.name):
        assert sum(words in text for text in texts) == 1, words


@pytest.mark.parametrize("pictures", [1, 7])
def test_a_film_of_a_few_pictures_is_refused_before_anything_is_tracked(lab, tmp_path, pictures):
    """A photo was said to have little texture and a rate of nan."""

    def change(document):
        document["camera"]["calibration_images"] = "calibration/board_00.jpg"  # too few: refused at once

    folder = lab(change)
    write_video(folder / "a.mp4", itertools.islice(Video(SAMPLE / "a.mp4"), pictures))
    texts = [fault["text"] for fault in check(folder, tmp_path / "pictures")["faults"]]
    assert sum(f"too short for a run\n  got: {pictures} picture" in text for text in texts) == 1, texts


def test_two_runs_that_show_one_film_are_told(lab, tmp_path):
    def changed(document):
        document["camera"]["calibration_images"] = "calibration/board_00.jpg"  # too few: refused at once
        document["runs"] |= {name: {"video": f"{name}.mp4"} for name in "bcd"}

    folder = lab(changed)
    film = (folder / "a.mp4").read_bytes()
    for name, content in {"b": film, "c": film[:-1] + b"x", "d": film[:-1]}.items():
        (folder / f"{name}.mp4").write_bytes(content)
    found = same_footage(load_campaign(folder))
    assert [each.code for each in found] == ["footage_twice"]
    assert found[0].text.startswith("Runs a and b show the same film")
    assert check(folder, tmp_path / "pictures")["warnings"] == [found[0].text]


def test_another_rate_than_the_stamps_is_told_before_anything_is_tracked(lab, tmp_path, right):
    told = check(lab(lambda document: document["camera"].update(fps=30)), tmp_path / "pictures")
    texts = [fault["text"] for fault in told["faults"]]
    assert len(texts) == 1, texts
    assert "run a: The time stamps give 25.00 pictures a second, but camera.fps is 30" in texts[0]
    assert right[0]["warnings"] == []


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_video_that_a_tag_turns_is_turned_as_the_pictures_lie(lab, tmp_path, right, quarters):
    """It was refused, with advice to take the tag out; clicks may be those that a player shows, too."""

    def clicked_in_a_player(document):
        clicks = document["runs"]["a"]["first_frame_clicks_px"]
        for body, corners in clicks.items():
            clicks[body] = turned_pixels(corners, (960, 540), 2).tolist() if quarters == 2 else corners

    folder = lab(clicked_in_a_player)
    (folder / "a.mp4").write_bytes(quarter_turned((SAMPLE / "a.mp4").read_bytes(), quarters))
    told, (as_it_is, _) = check(folder, tmp_path / "pictures"), right
    assert (told["faults"], told["warnings"]) == ([], [])
    for body in ("rover", "object"):
        key = f"{body}_corners_px"
        np.testing.assert_allclose(told["runs"]["a"][key], as_it_is["runs"]["a"][key], atol=0.2)


def test_a_key_that_is_printed_otherwise_than_it_is_written_ends_the_search_for_its_line(lab, tmp_path):
    """A space that does not break, as copied from a page on the web, is printed as its code."""
    folder = lab(lambda document: document.update({"mass [kg]\xa0": 3.0}))
    (fault,) = check(folder, tmp_path / "check")["faults"]
    assert fault["line"] is None
    assert "mass [kg]\\xa0" in fault["text"]


def test_clicks_for_which_tracking_refuses_the_run_are_a_fault(lab, tmp_path):
    """They were a warning and "no fault"."""

    def change(document):
        clicks = document["runs"]["a"]["first_frame_clicks_px"]
        clicks["rover"], clicks["object"] = clicks["object"], clicks["rover"]

    folder = lab(change)
    told = check(folder, tmp_path / "pictures")
    texts = [fault["text"] for fault in told["faults"]]
    assert any("runs.a: first_frame_clicks_px of object do not fit its outline" in text for text in texts), texts
    assert {fault["line"] for fault in told["faults"]} == {key_lines((folder / "campaign.yaml").read_text())["runs.a"]}
    assert any("they are exchanged" in text for text in told["warnings"])
    assert (tmp_path / "pictures" / "start.html").is_file()


def test_clicks_in_a_video_of_another_zoom_are_judged_as_the_stage_track_judges_them(lab, tmp_path):
    """The calibration is corrected by the floor; without that both tops are 4 % too large."""
    zoom = np.array([[1.04, 0.0, -0.04 * 479.5], [0.0, 1.04, -0.04 * 269.5]])

    def change(document):
        clicks = document["runs"]["a"]["first_frame_clicks_px"]
        for body, corners in clicks.items():
            clicks[body] = [[float(pixel) for pixel in zoom @ [*corner, 1]] for corner in corners]

    folder, film = lab(change), itertools.islice(Video(SAMPLE / "a.mp4"), 60)
    write_video(
        folder / "a.mp4", ((at, cv2.warpAffine(luma, zoom, (960, 540), flags=cv2.INTER_CUBIC)) for at, luma in film)
    )
    told = check(folder, tmp_path / "pictures")
    assert told["faults"] == []
    assert not any("size of the tops" in text or "clicks" in text for text in told["warnings"]), told["warnings"]


def test_the_command_that_comes_next_can_be_pasted():
    told = {"campaign": "my lab", "faults": [], "warnings": [], "runs": {}, "cpu_s": 10}
    assert "my lab: no fault. towval run 'my lab' takes" in for_people(told)
    told["warnings"] = ["the board is bent"]
    assert "my lab: no fault, but 1 warning. towval run 'my lab' takes" in for_people(told)


@pytest.mark.parametrize(
    ("count", "said"), [(1, "lab: 1 fault; correct it and"), (2, "lab: 2 faults; correct them and")]
)
def test_faults_are_counted(count, said):
    told = {"campaign": "lab", "faults": [{"line": None, "text": "x"}] * count, "warnings": [], "runs": {}}
    assert said in for_people(told)


def test_clicks_beside_the_outline_are_warned_about(lab, tmp_path):
    def change(document):
        document["runs"]["a"]["first_frame_clicks_px"]["rover"][0][0] += 30

    told = check(lab(change), tmp_path / "pictures")
    assert told["faults"] == []
    assert any("rover" in text for text in told["warnings"]), told


def test_the_page_is_cut_right_where_an_editor_marks_the_coding(lab, tmp_path):
    """Windows' editors begin a file with such a mark, which counts as a character to some readers of YAML only.

    They end lines by two characters, too, which stay: what is saved differs in nothing but the clicks.
    """
    folder = lab()
    text = (folder / "campaign.yaml").read_text().replace("\n", "\r\n")
    (folder / "campaign.yaml").write_bytes(text.encode("utf-8-sig"))
    told = check(folder, tmp_path / "pictures")
    assert told["faults"] == []
    page = (tmp_path / "pictures" / "start.html").read_text(encoding="utf-8")
    written = json.loads(re.search(r'"text":(\[.*?\]),"bodies"', page)[1])
    assert [part if isinstance(part, str) else part["stated"] for part in written] == [
        part if isinstance(part, str) else part.stated for part in text_in_parts(text)
    ]


def test_the_clicks_of_runs_that_are_one_by_an_alias_stand_once():
    """They stood twice in what the page saves, which was no YAML."""
    for keys in ("{video: a.mp4}", "{video: a.mp4, first_frame_clicks_px: {rover: [[1, 2]]}}"):
        text = f"runs:\n  a: &a {keys}\n  b: *a\n"
        parts = [part for part in text_in_parts(text) if not isinstance(part, str)]
        assert [part.run for part in parts] == ["a"]
        assert "".join(part if isinstance(part, str) else part.stated for part in text_in_parts(text)) == text


def test_no_board_is_shown_where_marks_fix_the_frame():
    """The calibration takes the marks then, and does not need the board in that picture either."""
    given = load_campaign(SAMPLE)
    marks = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert _floor_board(given).corners_px.shape == (4, 2)
    assert (
        _floor_board(replace(given, floor_reference=replace(given.floor_reference, marks_px=marks, marks_m=marks)))
        is None
    )


def test_the_command_line_writes_beside_the_campaign(lab):
    folder = lab()
    line = [sys.executable, "-m", "towval.cli", "check", str(folder)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "no fault" in done.stdout
    assert (folder / "check" / "start.html").is_file()


def test_starts_are_found_without_clicks(lab, tmp_path):
    clicks = yaml.safe_load((SAMPLE / "campaign.yaml").read_text())["runs"]["a"]["first_frame_clicks_px"]

    def change(document):
        document["runs"]["a"] = {"video": "a.mkv"}

    folder = lab(change)
    with av.open(str(folder / "a.mp4")) as given, av.open(str(folder / "a.mkv"), "w") as file:
        track = file.add_stream_from_template(given.streams.video[0])
        for packet in given.demux(video=0):
            if packet.size:
                packet.stream = track
                file.mux(packet)
    told = check(folder, tmp_path / "pictures")
    assert told["faults"] == []
    assert told["runs"]["a"]["frames"] == 325  # the header of Matroska does not say
    for body in ("rover", "object"):
        # Clicked by hand to about a pixel, on pictures of half the size.
        assert np.abs(np.array(told["runs"]["a"][f"{body}_corners_px"]) - clicks[body]).max() < 2


def test_the_lines_of_keys():
    lines = key_lines("a:\n  b: 1\n  c:\n  - x: 2\n  - [3,\n     4]\n")
    assert lines == {
        "a": 1,
        "a.b": 2,
        "a.c": 3,
        "a.c[0]": 4,
        "a.c[0].x": 4,
        "a.c[1]": 5,
        "a.c[1][0]": 5,
        "a.c[1][1]": 6,
    }


def test_a_folder_that_cannot_be_written_to_is_one_fault_beside_all_others(lab, tmp_path, capsys):
    """It ended the check, and what had been found was lost."""
    (tmp_path / "file").write_text("")
    told = check(lab(lambda document: document["camera"].update(fps=30)), tmp_path / "file" / "check")
    (fault,) = (fault for fault in told["faults"] if "cannot be written to" in fault["what"])
    assert "--pictures" in fault["remedy"]
    assert ["camera.fps is 30" in other["what"] for other in told["faults"]].count(True) == 1
    assert 4 < told["runs"]["a"]["object_pixel_mm"] < 6
    assert "check: look at the start of run a" in capsys.readouterr().err


def test_a_fault_without_a_line_comes_after_all_others_in_a_file_of_many_comments(lab, tmp_path):
    """The number of keys stood for that of lines."""

    def change(document):
        document["camera"]["fps"] = 30
        document["runs"]["b"] = {"video": "campaign.yaml"}

    folder = lab(change)
    file = folder / "campaign.yaml"
    file.write_text("# a comment\n" * 400 + file.read_text())
    named, other = check(folder, tmp_path / "pictures")["faults"]
    assert named["line"] > 400
    assert other["line"] is None


def test_a_start_is_drawn_over_no_picture_but_an_earlier_start(lab, tmp_path):
    """With --pictures in a folder of photos, that of a run's name was lost."""
    folder, pictures = lab(), tmp_path / "pictures"
    pictures.mkdir()
    photo = (SAMPLE / "calibration" / "floor.jpg").read_bytes()
    (pictures / "a.jpg").write_bytes(photo)
    told = check(folder, pictures)
    assert ["a.jpg is not replaced" in fault["what"] for fault in told["faults"]] == [True]
    assert told["runs"]["a"]["picture"] == ""
    assert [path.name for path in pictures.iterdir()] == ["a.jpg"]
    assert (pictures / "a.jpg").read_bytes() == photo
    (pictures / "a.jpg").unlink()
    for _ in range(2):
        assert check(folder, pictures)["faults"] == []
    assert sorted(path.name for path in pictures.iterdir()) == ["a.jpg", "start.html"]
