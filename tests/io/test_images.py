"""Pictures read from files: whole ones, with whatever follows them, and cut ones."""

import cv2
import numpy as np
import pytest
from PIL import Image

from towval.io.images import read_gray, turned_by_tag
from towval.model.errors import InputError

SIZE = (160, 120)
CODINGS = {
    "baseline": [],
    "progressive": [cv2.IMWRITE_JPEG_PROGRESSIVE, 1],
    "restart marks": [cv2.IMWRITE_JPEG_RST_INTERVAL, 4],
}


def jpeg(coding):
    picture = np.random.default_rng(0).integers(0, 256, SIZE[::-1], dtype=np.uint8)
    return cv2.imencode(".jpg", picture, CODINGS[coding])[1].tobytes()


@pytest.mark.parametrize("coding", CODINGS)
@pytest.mark.parametrize("seed", range(5))
def test_what_a_phone_appends_to_a_picture_is_no_part_of_it(tmp_path, coding, seed):
    """A short film, in which bytes stand that look like marks of a JPEG."""
    path, film = tmp_path / "motion.jpg", np.random.default_rng(seed).bytes(400_000)
    assert b"\xff\xda" in film
    path.write_bytes(jpeg(coding))
    alone = read_gray(path, SIZE)
    path.write_bytes(jpeg(coding) + film)
    np.testing.assert_array_equal(read_gray(path, SIZE), alone)


def test_what_is_left_behind_the_end_of_a_png_is_no_part_of_it(tmp_path):
    """As phones leave of a picture that was cropped: it was called none."""
    path, picture = tmp_path / "cropped.png", np.random.default_rng(0).integers(0, 256, SIZE[::-1], dtype=np.uint8)
    data = cv2.imencode(".png", picture)[1].tobytes()
    path.write_bytes(data + bytes(1000))
    np.testing.assert_array_equal(read_gray(path, SIZE), picture)
    path.write_bytes(data[:-8])
    with pytest.raises(InputError, match="no picture that can be read"):
        read_gray(path, SIZE)


@pytest.mark.parametrize("coding", CODINGS)
@pytest.mark.parametrize("kept", [0.6, 0.9, -1])
def test_a_picture_that_is_cut_off_is_refused(tmp_path, coding, kept):
    """Decoders fill up with grey what is not there."""
    path, data = tmp_path / "cut.jpg", jpeg(coding)
    path.write_bytes(data[: int(kept * len(data)) if kept > 0 else kept])
    with pytest.raises(InputError, match="no picture that can be read"):
        read_gray(path, SIZE)


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp"])
@pytest.mark.parametrize(("tag", "turned"), [(1, False), (3, True), (6, True)])
def test_a_tag_for_orientation_is_seen_and_turns_nothing(tmp_path, suffix, tag, turned):
    grey, exif = np.random.default_rng(0).integers(0, 256, SIZE[::-1], dtype=np.uint8), Image.Exif()
    exif[0x0112] = tag
    plain, tagged = tmp_path / f"plain.{suffix}", tmp_path / f"tagged.{suffix}"
    Image.fromarray(grey).save(plain, lossless=True)
    Image.fromarray(grey).save(tagged, exif=exif, lossless=True)
    assert (turned_by_tag(plain), turned_by_tag(tagged)) == (False, turned)
    np.testing.assert_array_equal(read_gray(tagged, SIZE), read_gray(plain, SIZE))


def test_a_damaged_tag_is_none(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / "tagged.jpg"
    Image.new("L", SIZE).save(path, exif=exif)
    data = path.read_bytes()
    at = data.index(b"Exif")
    for cut in range(6, 20):
        path.write_bytes(data[: at + cut] + b"\xff" * 8 + data[at + cut + 8 :])
        turned_by_tag(path)
    path.write_text("no picture")
    assert not turned_by_tag(path)
