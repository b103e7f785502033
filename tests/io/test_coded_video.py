"""Pictures passed on as they are stored: the same pictures, one at a time, only where viewers take them."""

import av
import numpy as np
import pytest

from report_scenes import numbered_film, quarter_turned
from towval.io.coded_video import coded_video
from towval.io.video import Video, luma_plane

FRAMES = 40
FIRST_PTS = 7

NO_REORDERING = {"libx264": {"bf": "0", "g": "12"}, "libx265": {"x265-params": "bframes=0:keyint=12:log-level=none"}}


@pytest.fixture(scope="module", params=["libx264", "libx265"])
def film(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("coded")
    return numbered_film(folder / "a.mp4", FRAMES, FIRST_PTS, request.param, **NO_REORDERING[request.param])


def test_another_decoder_gets_the_same_pictures_one_by_one(film):
    """The bytes alone are decoded: no container, no header but what is in them."""
    coded = coded_video(Video(film))
    decoder = av.CodecContext.create({"h264": "h264", "h265": "hevc"}[coded.coding], "r")
    decoder.thread_count = 1
    shown = [frame for data in coded for frame in decoder.decode(av.Packet(data))] + decoder.decode(None)
    stored = list(Video(film))
    assert len(shown) == len(coded.time_s) == FRAMES
    for frame, (_, luma) in zip(shown, stored, strict=True):
        np.testing.assert_array_equal(luma_plane(frame), luma)
    np.testing.assert_array_equal(coded.time_s, [time_s for time_s, _ in stored])


def units(data: bytes, coding: str) -> list[int]:
    """Types of the units of an access unit in Annex B form."""
    starts = [i + 3 for i in range(len(data) - 3) if data[i : i + 3] == b"\0\0\1"]
    return [data[i] & 31 if coding == "h264" else data[i] >> 1 & 63 for i in starts]


def test_every_keyframe_comes_with_its_parameter_sets(film):
    coded = coded_video(Video(film))
    parameter_set, keyframes = {"h264": (7, {5}), "h265": (33, set(range(16, 22)))}[coded.coding]
    types = [units(data, coded.coding) for data in coded]
    keys = [i for i, own in enumerate(types) if keyframes & set(own)]
    assert keys == [0, 12, 24, 36]
    assert [i for i, own in enumerate(types) if parameter_set in own] == keys


def test_pictures_coded_out_of_order_are_not_passed_on(tmp_path):
    assert coded_video(Video(numbered_film(tmp_path / "b.mp4", FRAMES, bf="2", g="12"))) is None


def test_pictures_coded_out_of_order_under_times_in_order_are_not_passed_on(tmp_path):
    """As some writers of MP4 leave them: the times are all there, but on the wrong pictures."""
    film, wrong = numbered_film(tmp_path / "b.mp4", FRAMES, bf="2", g="12"), tmp_path / "wrong.mp4"
    with av.open(film) as stored:
        first = next(stored.demux(video=0)).dts
    with av.open(film) as source, av.open(wrong, "w") as target:
        out = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.size:
                packet.stream = out
                # The first is to be shown at zero: the film cuts nothing off.
                packet.dts -= first
                packet.pts = packet.dts
                target.mux(packet)
    with av.open(wrong) as stored:
        pts = [packet.pts for packet in stored.demux(video=0) if packet.size]
    assert (np.diff(pts) > 0).all(), "the times are not in order: this tests nothing"
    assert coded_video(Video(wrong)) is None


def test_a_turned_film_is_not_passed_on(tmp_path):
    film = numbered_film(tmp_path / "a.mp4", FRAMES, bf="0")
    assert coded_video(Video(film)) is not None
    turned = tmp_path / "turned.mp4"
    turned.write_bytes(quarter_turned(film.read_bytes()))
    assert coded_video(Video(turned)) is None
    assert coded_video(Video(turned, quarter_turns=1)) is not None, "turned back, it lies as it is stored"


def test_other_codings_are_not_passed_on(tmp_path):
    assert coded_video(Video(numbered_film(tmp_path / "a.mp4", 5, codec="mpeg4"))) is None


def test_a_film_whose_start_is_cut_off_is_not_passed_on(tmp_path):
    """An edit list that begins after the keyframe: players decode what comes before and do not show it."""
    whole, cut = numbered_film(tmp_path / "a.mp4", FRAMES, bf="0", g="40"), tmp_path / "cut.mp4"
    with av.open(whole) as source, av.open(cut, "w") as target:
        out = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.size:
                packet.stream = out
                packet.pts -= 10 * 512
                packet.dts -= 10 * 512
                target.mux(packet)
    assert len(list(Video(cut))) < FRAMES, "nothing is cut off: this tests nothing"
    assert coded_video(Video(cut)) is None
