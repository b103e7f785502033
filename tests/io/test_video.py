import errno
import itertools
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from av.stream import Disposition

from studies.worlds.film import cut_off, write_video
from towval.io.film import decoded, frame_times, opened_film
from towval.io.video import Video, luma_plane, upright
from towval.model.errors import InputError


def pictures(count=30, start_s=0.0, rate=25.0, size=(96, 128)):
    """Pictures that brighten one grey level a frame, with a mark in the upper left."""
    for i in range(count):
        luma = np.full(size, 60 + i, np.uint8)
        luma[8:24, 8:40] = 200
        yield start_s + i / rate, luma


def read(path, **options):
    video = Video(path, **options)
    return video, [(time_s, luma.copy()) for time_s, luma in video]


def test_luma_comes_back_as_written_and_so_do_times_with_their_start(tmp_path):
    write_video(tmp_path / "a.mp4", pictures(start_s=1.25), crf="1")
    video, frames = read(tmp_path / "a.mp4")
    assert len(frames) == 30
    assert [t for t, _ in frames] == pytest.approx([1.25 + i / 25 for i in range(30)], abs=1e-9)
    assert video.header.resolution_px == (128, 96)
    assert video.header.frames == video.decoded_frames == 30
    for i, (_, luma) in enumerate(frames):
        assert abs(float(luma[60, 100]) - (60 + i)) <= 2
        assert abs(float(luma[16, 24]) - 200) <= 3


def test_times_that_vary_are_kept(tmp_path):
    times = np.cumsum([0.02, 0.05, 0.011, 0.1, 0.03, 0.04, 0.25, 0.01])
    frames = ((t, luma) for t, (_, luma) in zip(times, pictures(8), strict=True))
    write_video(tmp_path / "a.mkv", frames)
    # Matroska keeps whole milliseconds.
    assert [t for t, _ in read(tmp_path / "a.mkv")[1]] == pytest.approx(times, abs=0.6e-3)


def test_times_are_the_same_to_the_last_bit_without_decoding(tmp_path):
    write_video(tmp_path / "a.mkv", pictures(20, rate=20.0))
    video, frames = read(tmp_path / "a.mkv")
    assert video.stamps_s().tolist() == [t for t, _ in frames]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.mp4", {"codec": "libx265", "x265-params": "log-level=none"}),
        ("a.mp4", {"codec": "libx264", "pixel_format": "yuv420p10le"}),
        ("a.mp4", {"codec": "mpeg4", "b": "4M"}),
        ("a.ts", {"codec": "libx264"}),
        ("a.avi", {"codec": "mjpeg", "pixel_format": "yuvj420p"}),
        ("a.mov", {"codec": "prores_ks", "pixel_format": "yuv422p10le"}),
        ("a.mkv", {"codec": "libsvtav1", "preset": "12"}),
        ("a.mkv", {"codec": "ffv1", "pixel_format": "gray"}),
    ],
)
def test_formats_of_cameras_are_read(tmp_path, name, options):
    try:
        av.codec.Codec(options["codec"], "w")
    except av.codec.codec.UnknownCodecError:
        pytest.skip(f"this FFmpeg cannot write {options['codec']}")
    write_video(tmp_path / name, pictures(10), **options)
    _, frames = read(tmp_path / name)
    assert len(frames) == 10
    assert np.diff([t for t, _ in frames]) == pytest.approx([0.04] * 9, abs=2e-3)
    for i, (_, luma) in enumerate(frames):
        assert luma.dtype == np.uint8
        assert luma.shape == (96, 128)
        # ProRes knows only the narrow range; what is asked is that depth and plane are right.
        assert abs(float(luma[60, 100]) - (60 + i)) <= (12 if "prores" in options["codec"] else 6)


@pytest.mark.parametrize("pixels", ["gray", "gray10le", "gray12le", "gray16le", "grayf32le", "y210le", "rgb24"])
def test_grey_levels_come_from_every_kind_of_pixel(pixels):
    """A 32-bit plane holds floating-point numbers; what is in their bytes is no grey level."""
    luma = np.add.outer(np.arange(64), np.arange(96)).astype(np.uint8)
    frame = av.VideoFrame.from_ndarray(luma, format="gray").reformat(format=pixels)
    assert np.abs(luma_plane(frame).astype(int) - luma).max() <= 2


def test_a_truncated_file_says_how_much_is_good(tmp_path):
    noise = np.random.default_rng(0)
    frames = ((i / 25, noise.integers(0, 255, (96, 128), dtype=np.uint8)) for i in range(40))
    write_video(tmp_path / "whole.mp4", frames, movflags="faststart")
    cut_off(tmp_path / "whole.mp4", tmp_path / "a.mp4", 0.6)
    with pytest.raises(InputError, match=r"damaged or truncated.*\n.*of 40 frames are good, up to") as caught:
        read(tmp_path / "a.mp4")
    assert "damaged_video: true" in str(caught.value)
    with pytest.raises(InputError, match=r"\(the file ends early\)\n.*of 40 pictures can be found"):
        Video(tmp_path / "a.mp4").stamps_s()
    video, good = read(tmp_path / "a.mp4", damaged=True)
    assert 10 < len(good) < 40
    assert 10 < len(video.stamps_s()) < 40
    assert [f.code for f in video.findings] == ["video_damaged"]
    assert f"{len(good)} of 40" in video.findings[0].text


@pytest.mark.parametrize(("ending", "codec"), [("mkv", "libx264"), ("webm", "libvpx"), ("ts", "libx264")])
def test_what_ffmpeg_takes_for_a_shorter_video_is_found_cut_off(tmp_path, ending, codec):
    noise = np.random.default_rng(0)
    frames = [(i / 25, noise.integers(0, 255, (96, 128), dtype=np.uint8)) for i in range(40)]
    file = tmp_path / f"a.{ending}"
    write_video(file, frames, codec=codec)
    assert len(read(file)[1]) == len(Video(file).stamps_s()) == 40
    whole = file.read_bytes()
    file.write_bytes(whole[: int(0.6 * len(whole)) // 188 * 188 + 100])
    for look in (list, Video.stamps_s):
        with pytest.raises(InputError, match="damaged or truncated"):
            look(Video(file))
    video, good = read(file, damaged=True)
    assert 10 < len(good) < 40
    assert [f.code for f in video.findings] == ["video_damaged"]


def test_how_much_of_a_damaged_video_is_good_does_not_depend_on_chance(tmp_path, monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    noise = np.random.default_rng(0)
    file = tmp_path / "a.ts"
    write_video(file, [(i / 25, noise.integers(0, 255, (240, 320), dtype=np.uint8)) for i in range(20)])
    whole = file.read_bytes()
    file.write_bytes(whole[: int(0.6 * len(whole))])
    assert len({len(read(file, damaged=True)[1]) for _ in range(20)}) == 1


def test_a_recording_whose_length_was_never_written_is_taken_as_it_is(tmp_path):
    file = tmp_path / "a.mkv"
    write_video(file, pictures())
    whole = file.read_bytes()
    length = whole.index(bytes.fromhex("18538067")) + 4
    file.write_bytes(whole[:length] + bytes.fromhex("01ffffffffffffff") + whole[length + 8 :])
    assert len(read(file)[1]) == 30


def test_a_late_picture_is_far_from_the_first_or_at_hand(tmp_path):
    pictures = [np.full((48, 64), grey, np.uint8) for grey in (40, 90, 140, 190)]
    write_video(tmp_path / "whole.mp4", ((i / 25, picture) for i, picture in enumerate(pictures)), crf="1")
    assert abs(int(Video(tmp_path / "whole.mp4").late_picture()[20, 20]) - 190) < 4
    rng = np.random.default_rng(0)
    noise = ((i / 25, rng.integers(0, 255, (48, 64), np.uint8)) for i in range(40))
    write_video(tmp_path / "noise.mp4", noise, crf="10")
    cut_off(tmp_path / "noise.mp4", tmp_path / "cut.mp4", 0.5)
    assert Video(tmp_path / "cut.mp4", damaged=True).late_picture().shape == (48, 64)


@pytest.mark.parametrize(("count", "grey"), [(1, 40), (3, 90), (9, 115)])
def test_the_mean_of_the_first_pictures_is_that_of_all_where_these_are_fewer(tmp_path, count, grey):
    pictures = [np.full((48, 64), level, np.uint8) for level in (40, 90, 140, 190)]
    write_video(tmp_path / "a.mp4", ((i / 25, picture) for i, picture in enumerate(pictures)), crf="1")
    assert abs(int(Video(tmp_path / "a.mp4").mean_of_first(count)[20, 20]) - grey) < 4


def test_what_is_no_video_is_said_in_one_message(tmp_path):
    (tmp_path / "a.mp4").write_text("hello\n" * 100)
    with pytest.raises(InputError, match="no video that FFmpeg can open"):
        Video(tmp_path / "a.mp4")
    with pytest.raises(InputError, match="is missing"):
        Video(tmp_path / "b.mp4")


def test_a_coding_that_nothing_decodes_is_said_in_one_message(tmp_path):
    write_video(tmp_path / "whole.mp4", pictures(4))
    (tmp_path / "a.mp4").write_bytes((tmp_path / "whole.mp4").read_bytes().replace(b"avc1", b"zzz9"))
    with pytest.raises(InputError, match="coded in a way that FFmpeg cannot decode"):
        Video(tmp_path / "a.mp4")


def test_a_recording_without_its_beginning_is_said_in_one_message(tmp_path):
    """What decoders must know of pictures, their size among it, is sent with the first one alone."""
    write_video(tmp_path / "whole.ts", pictures(20), g="100")
    with av.open(str(tmp_path / "whole.ts")) as whole, av.open(str(tmp_path / "a.ts"), "w") as cut:
        stream = cut.add_stream_from_template(whole.streams.video[0])
        for packet in [one for one in whole.demux(video=0) if one.size][5:]:
            packet.stream = stream
            cut.mux(packet)
    with pytest.raises(InputError, match=r"no picture of a\.ts can be decoded"):
        Video(tmp_path / "a.ts")


class BrokenOff:
    """An opened video whose packets cannot be read from the eighth on."""

    def __init__(self, container):
        self.container = container
        self.streams = container.streams

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.container.close()

    def demux(self, stream):
        yield from itertools.islice(self.container.demux(stream), 7)
        raise av.error.InvalidDataError(1, "Invalid data")

    def decode(self, stream):
        for packet in self.demux(stream):
            yield from packet.decode()


def test_pictures_that_cannot_be_found_are_said_by_whoever_reads_their_times(tmp_path, monkeypatch):
    write_video(tmp_path / "a.mp4", pictures(20))
    opened = Video.opened
    monkeypatch.setattr(Video, "opened", lambda self: BrokenOff(opened(self)))
    with pytest.raises(InputError, match=r"damaged or truncated \(Invalid data\)\n.*7 of 20 pictures can be found"):
        Video(tmp_path / "a.mp4").stamps_s()
    with pytest.raises(InputError, match="damaged or truncated"):
        read(tmp_path / "a.mp4")
    assert len(Video(tmp_path / "a.mp4", damaged=True).stamps_s()) == 7


def test_sound_is_no_video(tmp_path):
    with av.open(str(tmp_path / "a.wav"), "w") as file:
        stream = file.add_stream("pcm_s16le", rate=8000, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        frame.rate, frame.pts, frame.time_base = 8000, 0, Fraction(1, 8000)
        file.mux(stream.encode(frame))
        file.mux(stream.encode())
    with pytest.raises(InputError, match="holds no video stream"):
        Video(tmp_path / "a.wav")


@pytest.mark.parametrize(
    ("degrees", "corner"), [(0, (0, 0)), (90, (-1, 0)), (-90, (0, -1)), (180, (-1, -1)), (270, (0, -1))]
)
def test_pictures_are_turned_counter_clockwise(degrees, corner):
    luma = np.zeros((4, 6), np.uint8)
    luma[0, 0] = 1
    assert upright(luma, degrees)[corner] == 1


def test_one_frame_is_held_at_a_time(tmp_path):
    write_video(tmp_path / "a.mp4", pictures(60))
    iterator = iter(Video(tmp_path / "a.mp4"))
    _, first = next(iterator)
    assert first.base is not None, "the plane is a view of the decoder's memory, not a copy"


@pytest.mark.parametrize("ending", ["mp4", "mkv", "avi"])
def test_a_title_in_another_encoding_is_no_obstacle(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    with av.open(str(path), "w") as file:
        file.metadata["title"] = "XXXXXXXXXXXX"
        stream = file.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 128, 96, "yuv420p"
        for _, luma in pictures(3):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(luma, format="gray").reformat(format="yuv420p")))
        file.mux(stream.encode())
    data = path.read_bytes()
    assert b"XXXXXXXXXXXX" in data
    path.write_bytes(data.replace(b"XXXXXXXXXXXX", "Versuch für1".encode("latin-1")))
    assert len(read(path)[1]) == 3


def copied(source, path, change, **options):
    """A copy of a video whose packets, in the order of coding, a function of their number has changed."""
    with av.open(str(source)) as given, av.open(str(path), "w", options=options) as file:
        stream = file.add_stream_from_template(given.streams.video[0])
        for number, packet in enumerate(p for p in given.demux(video=0) if p.size):
            change(number, packet)
            packet.stream = stream
            file.mux(packet)


def test_pictures_that_an_edit_list_cuts_off_lend_no_times_to_others(tmp_path):
    """Times in coding order, as AVI has them, in a file that was cut without coding it anew."""
    write_video(tmp_path / "a.mp4", pictures(), crf="1", bf="2", **{"x264-params": "b-adapt=0"})

    def later(number, packet):
        packet.pts = packet.dts = int((number - 6) * Fraction(1, 25) / packet.time_base)

    copied(tmp_path / "a.mp4", tmp_path / "cut.mp4", later, avoid_negative_ts="disabled", use_editlist="1")
    video, frames = read(tmp_path / "cut.mp4")
    assert video.header.frames == 30
    assert [t for t, _ in frames] == pytest.approx([i / 25 for i in range(24)], abs=1e-9)


@pytest.mark.parametrize("cut", [6, 6.25, 6.5, 6.75, 7])
@pytest.mark.parametrize("bf", ["0", "2"])
def test_a_film_that_was_cut_within_a_picture_is_whole(tmp_path, cut, bf):
    """As phones trim films, without coding them anew: at any time. Half of such films were said to be damaged."""
    write_video(tmp_path / "a.mp4", pictures(), crf="1", bf=bf)

    def earlier(_, packet):
        packet.pts -= round(cut / 25 / packet.time_base)
        packet.dts -= round(cut / 25 / packet.time_base)

    copied(tmp_path / "a.mp4", tmp_path / "cut.mp4", earlier, avoid_negative_ts="disabled", use_editlist="1")
    video, frames = read(tmp_path / "cut.mp4")
    assert video.header.frames == 30
    assert len(frames) == 30 - np.ceil(cut)
    assert np.diff([t for t, _ in frames]) == pytest.approx(0.04)


@pytest.mark.parametrize("ending", ["mp4", "mkv"])
def test_the_track_that_players_show_is_read(tmp_path, ending):
    """The first one is a preview or a second camera; its pictures were taken for those of the run."""
    write_video(tmp_path / "other.mp4", ((t, luma[::2, ::2]) for t, luma in pictures(3)), crf="1")
    write_video(tmp_path / "a.mp4", pictures(), crf="1")
    path = tmp_path / f"two.{ending}"
    with av.open(str(path), "w") as file:
        given = [av.open(str(tmp_path / name)) for name in ("other.mp4", "a.mp4")]
        tracks = [file.add_stream_from_template(one.streams.video[0]) for one in given]
        tracks[0].disposition, tracks[1].disposition = Disposition(0), Disposition.default
        for one, track in zip(given, tracks, strict=True):
            for packet in one.demux(video=0):
                if packet.size:
                    packet.stream = track
                    file.mux(packet)
            one.close()
    video, frames = read(path)
    assert [t for t, _ in frames] == pytest.approx([i / 25 for i in range(30)], abs=1e-3)
    assert video.header.resolution_px == (128, 96)
    assert video.stamps_s().tolist() == frame_times(path)[0].tolist() == [t for t, _ in frames]
    with opened_film(path) as film:
        assert [frame.width for frame in decoded(film, damaged=False)] == [128] * 30


def test_a_folder_whose_name_looks_like_a_protocol_can_be_drawn_from(tmp_path, monkeypatch):
    """That of a campaign named by the hour: tracked, and then refused by the report."""
    (tmp_path / "10:30").mkdir()
    write_video(tmp_path / "10:30" / "a.mp4", pictures(3))
    monkeypatch.chdir(tmp_path)
    path = Path("10:30/a.mp4")
    assert len(frame_times(path)[0]) == Video(path).header.frames
    with opened_film(path) as film:
        assert len(list(decoded(film, damaged=False))) == len(frame_times(path)[0])


def test_a_full_disk_is_no_fault_of_the_video_that_is_drawn_on(tmp_path):
    write_video(tmp_path / "a.mp4", pictures(3))
    for code, kind in ((errno.ENOSPC, OSError), (errno.EIO, InputError)):
        with pytest.raises(kind), opened_film(tmp_path / "a.mp4"):
            av.error.err_check(-code)


@pytest.mark.parametrize(("most", "counted"), [(8, 8), (40, 24)])
def test_pictures_are_counted_as_far_as_asked_for_without_those_cut_off(tmp_path, most, counted):
    write_video(tmp_path / "a.mp4", pictures(), crf="1", bf="0")

    def earlier(number, packet):
        packet.pts = packet.dts = int((number - 6) * Fraction(1, 25) / packet.time_base)

    copied(tmp_path / "a.mp4", tmp_path / "cut.mp4", earlier, avoid_negative_ts="disabled", use_editlist="1")
    assert Video(tmp_path / "cut.mp4").stored_pictures(most) == counted


def test_times_below_zero_are_told(tmp_path):
    """As in a transport stream whose clock goes round soon after its start."""
    write_video(tmp_path / "a.mp4", pictures(), crf="1", bf="0")

    def earlier(number, packet):
        packet.pts = packet.dts = int((number - 6) * Fraction(1, 25) / packet.time_base)

    copied(tmp_path / "a.mp4", tmp_path / "early.ts", earlier, avoid_negative_ts="disabled")
    with pytest.raises(InputError, match=r"begin below zero(.|\n)*got: -0\.24 s(.|\n)*ffmpeg -i IN"):
        read(tmp_path / "early.ts")


@pytest.mark.parametrize(("start_s", "length_s", "sound_s"), [(0.0, 1.2, 1.2), (0.7, 0.5, 1.2), (0.0, 2.0, 2.0)])
def test_the_sound_is_as_long_as_it_goes_on_after_the_first_picture(tmp_path, start_s, length_s, sound_s):
    """Where the microphone was switched on later it is shorter, and ends with the pictures all the same."""
    write_video(tmp_path / "a.mp4", pictures())
    with av.open(str(tmp_path / "a.mp4")) as given, av.open(str(tmp_path / "b.mp4"), "w") as file:
        shown = file.add_stream_from_template(given.streams.video[0])
        heard = file.add_stream("aac", rate=8000, layout="mono")
        for packet in given.demux(video=0):
            if packet.size:
                packet.stream = shown
                file.mux(packet)
        for i in range(round(length_s * 8)):
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1000), np.float32), format="fltp", layout="mono")
            frame.rate, frame.pts, frame.time_base = 8000, round(8000 * start_s) + 1000 * i, Fraction(1, 8000)
            file.mux(heard.encode(frame))
        file.mux(heard.encode())
    assert Video(tmp_path / "b.mp4").header.sound_s == pytest.approx(sound_s, abs=0.15)
