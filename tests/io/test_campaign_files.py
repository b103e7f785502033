"""Files and names of a campaign: any that a system allows work, or are refused by name; none blocks or unfolds."""

import os
import shutil
import struct
import zlib

import cv2
import numpy as np
import pytest
import yaml

from towval.io.campaign import load_campaign, names_in
from towval.io.images import read_gray
from towval.io.video import Video
from towval.model.errors import InputError


@pytest.fixture
def lab(tmp_path, lab_small):
    folder = tmp_path / "lab"
    shutil.copytree(lab_small / "calibration", folder / "calibration")
    for name in ("a.mp4", "b.mp4", "campaign.yaml"):
        shutil.copy(lab_small / name, folder)
    return folder


def changed(folder, change):
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    change(document)
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document, allow_unicode=True))
    return folder


NAMES = ["two words", "quo'te\"s", "ümläut", "a+b", "[x]", "{1}", "$x^$", "-dash", "1", "True", "figures", "x" * 200,
         "<img src=x onerror=alert(1)>", "a;b&c|d", "%41", "~", "*", "\\back", "日本"]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_any_name_of_folder_picture_and_video_works(lab, name):
    odd = lab.rename(lab.with_name(name))
    (odd / "calibration" / "board_00.jpg").rename(odd / "calibration" / f"board_{name[:180]}.jpg")
    (odd / "a.mp4").rename(odd / f"{name}.mp4")
    campaign = load_campaign(changed(odd, lambda d: d["runs"]["a"].update(video=f"{name}.mp4")))
    assert campaign.name == name
    assert len(campaign.calibration_images) == 20
    assert Video(campaign.runs["a"].video).header.resolution_px == (960, 540)


@pytest.mark.parametrize("name", ["1", "True", "1_5", "on", "null", "x" * 200])
def test_the_name_of_a_run_is_what_is_written(lab, name):
    text = (lab / "campaign.yaml").read_text().replace("\n  a:", f"\n  {name}:")
    (lab / "campaign.yaml").write_text(text)
    assert set(load_campaign(lab).runs) == {name, "b"}


@pytest.mark.parametrize("name", ["figures", "Logs", "1.5", "-a", "a b", "../a", "x" * 201, "ü", "~"])
def test_the_name_of_a_run_is_refused_by_name(lab, name):
    changed(lab, lambda d: d["runs"].update({name: d["runs"].pop("a")}))
    with pytest.raises(InputError, match=r"runs|named"):
        load_campaign(lab)


def test_names_that_cannot_be_printed_are_refused_by_name(lab):
    os.rename(lab / "calibration" / "board_00.jpg", os.fsencode(lab / "calibration") + b"/board_\xff.jpg")
    with pytest.raises(InputError, match=r"cannot be printed\n.*udcff"):
        load_campaign(lab)


@pytest.mark.parametrize("kind", ["pipe", "dangling", "loop", "folder", "device", "missing"])
@pytest.mark.parametrize("name", ["a.mp4", "calibration/floor.jpg", "calibration/board_00.jpg"])
def test_what_is_no_plain_file_is_refused_by_key(lab, name, kind):
    path = lab / name
    path.unlink()
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind != "missing":
        path.symlink_to({"dangling": "nowhere", "loop": path.name, "device": "/dev/zero"}[kind])
    elif "board" in name:
        return
    with pytest.raises(InputError, match=r"runs\.a\.video|floor\.image|camera\.calibration_images"):
        load_campaign(lab)


def test_starts_that_the_check_draws_are_no_calibration_pictures(lab):
    """Of a pattern that walks through all folders they were, from the second call on."""
    folder = changed(lab, lambda document: document["camera"].update(calibration_images="**/*.jpg"))
    before = load_campaign(folder).calibration_images
    (folder / "check").mkdir()
    shutil.copy(folder / "calibration" / "floor.jpg", folder / "check" / "a.jpg")
    assert load_campaign(folder).calibration_images == before
    changed(folder, lambda document: document["camera"].update(calibration_images="check/*.jpg"))
    assert load_campaign(folder).calibration_images == (folder / "check" / "a.jpg",)


@pytest.mark.parametrize(
    "pattern", ["board_**", "/**/*.jpg", "../**/*.jpg", "nothing", "/dev/*", "a\0b", "[", "*" * 50]
)
def test_an_odd_pattern_is_one_message(lab, pattern):
    changed(lab, lambda d: d["camera"].update(calibration_images=pattern))
    with pytest.raises(InputError, match=r"calibration_images|cannot be printed|not valid YAML"):
        load_campaign(lab)


def test_absolute_and_upward_paths_are_read_where_they_are_written(lab, tmp_path):
    shutil.move(lab / "calibration", tmp_path / "elsewhere")
    shutil.move(lab / "a.mp4", tmp_path / "a.mp4")

    def change(document):
        document["camera"]["calibration_images"] = str(tmp_path / "elsewhere" / "board_*.jpg")
        document["floor"]["image"] = "../elsewhere/floor.jpg"
        document["floor"]["more_images"] = "../elsewhere/floor_*.jpg"
        document["runs"]["a"]["video"] = "../a.mp4"

    campaign = load_campaign(changed(lab, change))
    assert len(campaign.calibration_images) == 20
    assert set(names_in(campaign.folder, [campaign.runs["a"].video])) == {"../a.mp4"}


@pytest.mark.parametrize(("stored", "stated"), [("FILM.MP4", "film.mp4"), ("Ku\u0308che.mp4", "K\u00fcche.mp4")])
def test_a_file_whose_name_only_looks_the_same_is_told(lab, stored, stated):
    """Cameras write capitals, macOS an accent as a letter of its own."""
    (lab / "a.mp4").rename(lab / stored)
    if (lab / stated).exists():
        pytest.skip("this file system takes the two names for one")
    changed(lab, lambda d: d["runs"]["a"].update(video=stated))
    with pytest.raises(InputError, match="capitals and coding of accents") as caught:
        load_campaign(lab)
    assert ascii(stored) in str(caught.value)


def png(width, height, data=b""):
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def test_a_picture_that_lies_on_its_side_is_told_as_that(tmp_path):
    """As phones store it, with a tag that turns it; without the tag's help its pixels are not those of the video."""
    cv2.imwrite(str(tmp_path / "board.png"), np.zeros((960, 540), np.uint8))
    with pytest.raises(InputError, match="a tag for orientation in the file is not applied"):
        read_gray(tmp_path / "board.png", (960, 540))


def test_a_picture_that_unfolds_is_refused_by_its_size(tmp_path):
    (tmp_path / "bomb.png").write_bytes(png(60_000, 60_000, bytes(10**7)))
    with pytest.raises(InputError, match=r"60000 × 60000|no picture"):
        read_gray(tmp_path / "bomb.png", (960, 540))


@pytest.mark.parametrize("name", ["calibration/floor.jpg"])
def test_a_picture_cut_off_is_refused(lab, name):
    data = (lab / name).read_bytes()
    assert read_gray(lab / name, (960, 540)).shape == (540, 960)
    for share in (0.0, 0.3, 0.9, 0.999):
        (lab / name).write_bytes(data[: int(share * len(data))])
        with pytest.raises(InputError, match="no picture"):
            read_gray(lab / name, (960, 540))


def test_a_playlist_is_no_video(tmp_path):
    """It names other files, or hosts, which FFmpeg would open."""
    (tmp_path / "a.mp4").write_text(
        "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n#EXT-X-ENDLIST\n"
    )
    with pytest.raises(InputError, match=r"a\.mp4"):
        Video(tmp_path / "a.mp4")


@pytest.mark.parametrize("value", [None, 1, "text", [], {}, [[]], {"a": 1}])
@pytest.mark.parametrize(
    "place", [(key,) for key in ("camera", "floor", "rover", "object", "tether", "friction", "runs")]
    + [("camera", "board"), ("camera", "calibration_images"), ("camera", "resolution_px"), ("floor", "image"),
       ("object", "load"), ("object", "top_corners_m"), ("runs", "a"), ("runs", "a", "first_frame_clicks_px")],
)  # fmt: skip
def test_a_part_of_the_wrong_kind_or_missing_is_told(lab, place, value):
    def change(document):
        for key in place[:-1]:
            document = document[key]
        if value is None:
            del document[place[-1]]
        else:
            document[place[-1]] = value

    changed(lab, change)
    try:
        load_campaign(lab)
    except InputError:
        return
    assert value in (None, {}), (place, value)  # what may be left out


LINE = [[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.3, 0.0]]
BOW = [[0.0, 0.0], [0.1, 0.1], [0.1, 0.0], [0.0, 0.2]]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("key", ["footprint_m", "top_corners_m"])
@pytest.mark.parametrize(
    ("corners", "message"),
    [(LINE, "encloses no area"), ([[0.1, 0.2]] * 4, "encloses no area"), (BOW, "crosses itself")],
)
def test_an_outline_that_is_none_is_refused_once_by_its_key(lab, key, corners, message):
    changed(lab, lambda d: d["object"].update({key: corners, "mass_over": "footprint" if key < "g" else "top"}))
    with pytest.raises(InputError) as raised:
        load_campaign(lab)
    assert f"object.{key}" in str(raised.value)
    assert str(raised.value).count(message) == 1
