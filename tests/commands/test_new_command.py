"""The command ``new``: campaign.yaml from videos, pictures and facts, with what is guessed marked."""

import io
import math
import re
from importlib import resources
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from towval.commands.new import run
from towval.io.campaign import load_campaign
from towval.io.yaml_text import read_yaml
from towval.model.errors import InputError
from towval.model.inputs import INPUTS, Realisation

SAMPLE = Path(str(resources.files("towval"))) / "sample"
FACTS = {
    "camera.board.square_m": 0.04,
    "rover.tracked_plane_height_m": 0.42,
    "rover.top_corners_m": [0.75, 0.5],
    "object.tracked_plane_height_m": 0.25,
    "object.top_corners_m": [0.5, 0.35],
    "object.mass_kg": 4.0,
    "tether.rest_length_m": 0.6,
}


@pytest.fixture
def footage(tmp_path):
    """A folder with footage and nothing else."""
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "calibration").mkdir()
    for path in (SAMPLE / "calibration").iterdir():
        (folder / "calibration" / path.name).symlink_to(path)
    (folder / "a.mp4").symlink_to(SAMPLE / "a.mp4")
    return folder


def test_what_pictures_show_is_found_and_the_campaign_loads(footage):
    run(footage, FACTS, ask=False, find=False)
    found, given = load_campaign(footage), load_campaign(SAMPLE)
    assert found.resolution_px == given.resolution_px
    assert sorted(found.board.inner_corners) == sorted(given.board.inner_corners)
    assert found.floor_images == tuple(footage / "calibration" / path.name for path in given.floor_images)
    assert {path.name for path in given.calibration_images} <= {path.name for path in found.calibration_images}
    # The lower left corner of the board, which a person had clicked to a pixel or two.
    assert math.dist(found.floor_reference.origin_corner_px, given.floor_reference.origin_corner_px) < 3
    assert math.dist(found.floor_reference.x_axis_end_corner_px, given.floor_reference.x_axis_end_corner_px) < 3
    np.testing.assert_allclose(found.rover.top_corners_m, given.rover.top_corners_m)


@pytest.mark.parametrize(("upright", "size"), [(True, (540, 960)), (False, (960, 540))])
def test_the_size_of_a_phones_video_is_that_in_which_its_pictures_are_stored(footage, upright, size):
    """Pictures taken from such a film by FFmpeg are upright, too; its photos lie, with a tag."""
    (footage / "a.mp4").unlink()
    with av.open(str(SAMPLE / "a.mp4")) as source, av.open(str(footage / "a.mp4"), "w") as made:
        stream = made.add_stream_from_template(source.streams.video[0])
        stream.set_display_rotation(90)
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                made.mux(packet)
    for path in (footage / "calibration").iterdir() if upright else ():
        picture = np.rot90(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        path.unlink()
        cv2.imwrite(str(path), np.ascontiguousarray(picture))
    run(footage, FACTS, ask=False, find=False)
    assert load_campaign(footage).resolution_px == size


def test_pictures_of_several_kinds_are_all_taken(footage):
    """A phone's JPGs beside PNGs, or names in capitals."""
    pictures = sorted((footage / "calibration").iterdir())
    for path in pictures[::2]:
        path.rename(path.with_name(path.name.upper()))
    run(footage, FACTS, ask=False, find=False)
    found = load_campaign(footage)
    assert len({*found.calibration_images, *found.floor_images}) == len(pictures)


def test_pictures_in_another_folder_are_named_as_not_used(footage):
    pictures = sorted(path for path in (footage / "calibration").iterdir() if "floor" not in path.name)
    (footage / "aside").mkdir()
    for path in pictures[:2]:
        path.rename(footage / "aside" / path.name)
    done = run(footage, FACTS, ask=False, find=False)
    assert not {path.name for path in load_campaign(footage).calibration_images} & {path.name for path in pictures[:2]}
    assert "Pictures in other folders are not used: aside/" in done.text
    assert "# Pictures in other folders" in (footage / "campaign.yaml").read_text()


def test_every_guess_is_marked_and_nothing_else(footage):
    run(footage, FACTS | {"friction.kinetic": 0.31}, ask=False, find=False)
    text = (footage / "campaign.yaml").read_text()
    marked = set(re.findall(r"# GUESS: .*\n\s*(\w+):", text))
    assert {"tether_hinge_m", "footprint_m", "tether_anchor_m", "stiffness_N_per_m", "static", "static_std"} <= marked
    # The board was found as one of that kind.
    assert not marked & {key.rpartition(".")[2] for key in FACTS} | marked & {"kinetic", "inner_corners", "type"}
    assert yaml.safe_load(text)["friction"]["static"] == pytest.approx(1.1 * 0.31)


def test_facts_of_a_file_count_and_those_of_the_line_count_more(footage, tmp_path):
    sheet = tmp_path / "facts.yaml"
    sheet.write_text(
        "object: {mass_kg: 9.0, load: {mass_kg: 1.8, at_m: [-0.18, 0.11]}}\ntether: {stiffness_N_per_m: 800}\n"
    )
    run(footage, FACTS, facts=sheet, ask=False, find=False)
    campaign = load_campaign(footage)
    assert (campaign.scene.body_mass, campaign.scene.load.mass, campaign.scene.tether.stiffness) == (4.0, 1.8, 800)


def test_what_cannot_be_guessed_is_told_at_once(footage):
    with pytest.raises(InputError) as caught:
        run(footage, {"object.mass_kg": 4.0}, ask=False, find=False)
    told = set(re.findall(r'--set "?([\w.]+)=', str(caught.value)))
    assert told == set(FACTS) - {"object.mass_kg"}
    assert not (footage / "campaign.yaml").exists()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("friction.kinetic", "0,3"),
        ("rover.top_corners_m", 0.5),
        ("object.top_corners_m", ["0.5", "0.3"]),
        ("camera", 5),
        ("camera.resolution_px", 960),
        ("runs.a", "a.mp4"),
    ],
)
def test_a_fact_of_the_wrong_kind_is_told_before_it_is_used(footage, key, value):
    facts = {name: fact for name, fact in FACTS.items() if not name.startswith(f"{key}.")}
    with pytest.raises(InputError, match=rf"{re.escape(key)} is "):
        run(footage, facts | {key: value}, ask=False, find=False)
    assert not (footage / "campaign.yaml").exists()


def test_a_question_that_nobody_answers_is_told(footage, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(InputError, match=r"nobody answers what camera\.fps is"):
        run(footage, FACTS, ask=True, find=False)


def test_tops_are_found_and_written(footage):
    run(footage, FACTS | {"rover.tether_hinge_m": [-0.42, 0.0]}, ask=False)
    found, given = load_campaign(footage), load_campaign(SAMPLE)
    for body in ("rover", "object"):
        assert np.abs(found.run("a").clicks_px[body] - given.run("a").clicks_px[body]).max() < 2
    assert "# Found by their outlines." in (footage / "campaign.yaml").read_text()
    assert (footage / "check" / "start.html").is_file()


def test_clicks_that_are_stated_stay(footage, monkeypatch):
    clicks = read_yaml(SAMPLE / "campaign.yaml")["runs"]["a"]["first_frame_clicks_px"]
    checked = {"campaign": "lab", "faults": [], "warnings": [], "runs": {}, "cpu_s": 1}
    monkeypatch.setattr("towval.commands.new.check", lambda *_: checked)
    run(footage, FACTS | {"runs.a.video": "a.mp4", "runs.a.first_frame_clicks_px": clicks}, ask=False)
    assert read_yaml(footage / "campaign.yaml")["runs"]["a"]["first_frame_clicks_px"] == clicks


def test_what_is_there_stays(footage):
    (footage / "campaign.yaml").write_text("mine: true\n")
    with pytest.raises(InputError, match="--force"):
        run(footage, FACTS, ask=False, find=False)
    run(footage, FACTS, ask=False, find=False, force=True)
    assert "mine" not in read_yaml(footage / "campaign.yaml")


def test_on_a_terminal_it_asks_and_asks_again(footage, monkeypatch, capsys):
    answers = iter(["", "minus four", "4.0"])
    asked = []

    def answer(question):
        asked.append(question)
        return next(answers) if question.startswith("object.mass_kg") else ""

    monkeypatch.setattr("builtins.input", answer)
    run(footage, {key: value for key, value in FACTS.items() if key != "object.mass_kg"}, ask=True, find=False)
    masses = [question for question in asked if question.startswith("object.mass_kg")]
    assert len(masses) == 3
    assert "[kg]" in masses[0]
    assert "is 'minus four'" in capsys.readouterr().out
    assert load_campaign(footage).scene.body_mass == 4.0


@pytest.mark.parametrize("slip", ["[[0, 0], [1, 0], [1]]", "[a, b]", "[true, false]", "[.inf, 1]", "0.75"])
def test_a_top_that_is_none_is_asked_for_again(footage, monkeypatch, capsys, slip):
    """The first two had ended in a traceback, and what was wrong was called the document."""
    answers = iter([slip, "[0.75, 0.5]"])
    monkeypatch.setattr("builtins.input", lambda question: next(answers) if question.startswith("rover.top") else "")
    run(footage, {key: fact for key, fact in FACTS.items() if key != "rover.top_corners_m"}, ask=True, find=False)
    assert "the answer: rover.top_corners_m" in capsys.readouterr().out
    assert read_yaml(footage / "campaign.yaml")["rover"]["top_corners_m"][2] == [0.375, 0.25]


@pytest.mark.parametrize(("gone", "words"), [("a.mp4", "holds no video"), ("calibration", "holds no picture")])
def test_a_folder_without_footage_is_told(footage, gone, words):
    path = footage / gone
    if path.is_dir():
        for each in path.iterdir():
            each.unlink()
    else:
        path.unlink()
    with pytest.raises(InputError, match=words):
        run(footage, FACTS, ask=False, find=False)


def test_the_rate_of_the_camera_is_not_guessed_from_the_stamps_that_it_has_to_confirm(footage):
    outcome = run(footage, FACTS, ask=False, find=False)
    assert "fps" not in yaml.safe_load((footage / "campaign.yaml").read_text())["camera"]
    assert "not stated: camera.fps, floor.board_thickness_m" in outcome.text
    outcome = run(footage, FACTS | {"camera.fps": 25}, ask=False, find=False, force=True)
    assert yaml.safe_load((footage / "campaign.yaml").read_text())["camera"]["fps"] == 25
    assert "camera.fps" not in outcome.text


def test_heights_of_the_tow_are_asked_for_and_may_stay_unknown(footage, monkeypatch):
    monkeypatch.setattr("builtins.input", lambda question: "0.2" if "hinge_height" in question else "")
    outcome = run(footage, FACTS, ask=True, find=False)
    written = yaml.safe_load((footage / "campaign.yaml").read_text())
    assert written["rover"]["tether_hinge_height_m"] == 0.2
    assert "tether_anchor_height_m" not in written["object"]
    assert "not stated: camera.fps, floor.board_thickness_m, object.tether_anchor_height_m" in outcome.text


def test_axes_that_were_chosen_are_told_where_a_slope_is_given_in_them(footage):
    slope = {"floor.slope_mm_per_m": [1.0, 0.0]}
    told = "floor's axes were chosen, and floor.slope_mm_per_m must be given in them"
    assert told in run(footage, FACTS | slope, ask=False, find=False).text
    axes = yaml.safe_load((footage / "campaign.yaml").read_text())["floor"]
    stated = {f"floor.{key}": axes[key] for key in ("origin_corner_px", "x_axis_end_corner_px")}
    assert told not in run(footage, FACTS | slope | stated, ask=False, find=False, force=True).text
    assert told not in run(footage, FACTS, ask=False, find=False, force=True).text


def test_guesses_can_be_drawn(footage):
    """A guess has a wide deviation; four of them reach below zero, where no scene can be."""
    run(footage, FACTS, ask=False, find=False)
    campaign = load_campaign(footage)
    guessed = {key.rpartition(".")[2] for key in yaml.safe_load((footage / "campaign.yaml").read_text())["rover"]}
    assert "tether_hinge_std_m" in guessed
    for name, std in campaign.deviations.items():
        for many in (-4, 4):
            value = INPUTS[name].values(campaign.scene) + many * std
            INPUTS[name].acts(Realisation.nominal(campaign.scene), value).checked()


def test_a_folder_that_is_not_there_is_told_as_that(tmp_path):
    with pytest.raises(InputError, match="is no folder"):
        run(tmp_path / "lap", FACTS, ask=False, find=False)


def test_results_below_the_folder_are_no_footage(footage):
    """Who works in the campaign folder has them there: their figures were taken for pictures of the board."""
    made = footage / "a results" / "lab"
    (made / "figures").mkdir(parents=True)
    (made / "a").mkdir()
    (made / "camera.mcap").write_bytes(b"")
    (made / "figures" / "fig10.png").write_bytes(b"")
    (made / "a" / "overlay.mp4").symlink_to(SAMPLE / "a.mp4")
    run(footage, FACTS, ask=False, find=False)
    assert list(load_campaign(footage).runs) == ["a"]
    assert all(path.parent.name == "calibration" for path in load_campaign(footage).calibration_images)


def test_what_a_mac_puts_beside_files_is_no_footage(footage):
    """``._a.mp4`` holds what the disk cannot keep of a.mp4; the folder was refused because of it."""
    for name in ("._a.mp4", "calibration/._board_00.jpg", "calibration/._floor.jpg"):
        (footage / name).write_bytes(bytes(4096))
    run(footage, FACTS, ask=False, find=False)
    found = load_campaign(footage)
    assert list(found.runs) == ["a"]
    assert not any(path.name.startswith(".") for path in (*found.calibration_images, *found.floor_images))


def test_videos_of_one_name_are_two_runs(footage):
    (footage / "a.mov").symlink_to(SAMPLE / "a.mp4")
    run(footage, FACTS, ask=False, find=False)
    assert {name: found.video.name for name, found in load_campaign(footage).runs.items()} == {
        "a": "a.mov", "a_2": "a.mp4"
    }  # fmt: skip


@pytest.mark.parametrize("pattern", ["{folder}/calibration/board_*.jpg", "calib**/board_*.jpg"])
def test_pictures_may_be_named_as_in_a_campaign(footage, pattern):
    """By an absolute pattern, say: those of Python's own paths must be relative."""
    pattern = pattern.format(folder=footage)
    run(footage, FACTS | {"camera.calibration_images": pattern}, ask=False, find=False)
    assert len(load_campaign(footage).calibration_images) == len(list((footage / "calibration").glob("board_*.jpg")))


def test_numbers_of_corners_may_be_written_with_a_point(footage):
    run(footage, FACTS | {"camera.board.inner_corners": [9.0, 6.0]}, ask=False, find=False)
    assert load_campaign(footage).board.inner_corners == (9, 6)


def test_the_floor_frame_is_found_on_a_board_with_markers(footage):
    board = {"type": "charuco", "inner_corners": [6, 4], "marker_m": 0.03, "dictionary": "DICT_4X4_50"}
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    drawn = cv2.aruco.CharucoBoard((7, 5), 0.04, 0.03, markers).generateImage((350, 250))
    picture = np.full((540, 960), 128, dtype=np.uint8)
    picture[150:400, 300:650] = drawn
    (footage / "calibration" / "floor.jpg").unlink()
    cv2.imwrite(str(footage / "calibration" / "floor.jpg"), picture)
    run(footage, FACTS | {f"camera.board.{key}": value for key, value in board.items()}, ask=False, find=False)
    reference = load_campaign(footage).floor_reference
    # A square is 50 px wide; (0, 0) is the middle of the first pixel.
    np.testing.assert_allclose(reference.origin_corner_px, [349.5, 349.5], atol=0.5)
    np.testing.assert_allclose(reference.x_axis_end_corner_px, [599.5, 349.5], atol=0.5)


def test_pictures_in_a_folder_with_brackets_in_its_name_are_found(footage):
    """In a pattern these would stand for one of the characters between them."""
    (footage / "calibration").rename(footage / "board [1]")
    run(footage, FACTS, ask=False, find=False)
    assert set((footage / "board [1]").glob("board_*.jpg")) <= set(load_campaign(footage).calibration_images)


@pytest.mark.parametrize(
    ("stem", "name"),
    [("Übung 2", "Ubung_2"), ("U\u0308bung", "Ubung"), ("Lauf 1 (Test)", "Lauf_1_Test"), ("-ß-", "run")],
)
def test_a_run_is_named_as_its_video_as_far_as_letters_allow(footage, stem, name):
    """Übung was bung."""
    (footage / "a.mp4").rename(footage / f"{stem}.mp4")
    run(footage, FACTS, ask=False, find=False)
    assert list(load_campaign(footage).runs) == [name]


def test_videos_whose_names_differ_in_capitals_are_runs_with_names_that_do_not(footage):
    """Some disks would take the folders of their results for one."""
    (footage / "A.mp4").symlink_to(SAMPLE / "a.mp4")
    run(footage, FACTS, ask=False, find=False)
    assert sorted(load_campaign(footage).runs) == ["A", "a_2"]


def test_a_run_is_not_named_as_a_folder_of_the_results(footage):
    (footage / "a.mp4").rename(footage / "Figures.mp4")
    run(footage, FACTS, ask=False, find=False)
    assert list(load_campaign(footage).runs) == ["Figures_2"]
