"""Results that belong together: what was made of something else, or for another run or campaign.yaml, is refused."""

import json
import os
import struct
import zlib

import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from towval.io.chain import check_made_of, check_together
from towval.io.manifest import MANIFEST, read_manifest, unlisted, write_manifest
from towval.io.mcap_file import read_mcap, read_provenance, write_mcap
from towval.io.mcap_records import ALWAYS_ALLOWED, MAGIC
from towval.io.provenance import content_hashes, provenance
from towval.model.errors import InputError

DOCUMENT = {
    "camera": {"fps": 25},
    "floor": {"image": "floor.jpg"},
    "rover": {"tracked_plane_height_m": 0.3},
    "object": {"tracked_plane_height_m": 0.2, "mass_kg": 4},
    "tether": {"rest_length_m": 1.0},
    "friction": {"kinetic": 0.3},
    "runs": {"a": {"video": "a.mp4"}, "b": {"video": "b.mp4"}},
}


@pytest.fixture
def results(tmp_path):
    """A camera and two runs with three results each, empty but for what they record."""
    files = {}

    def make(stage, name, inputs, run=""):
        path = tmp_path / run / name
        path.parent.mkdir(exist_ok=True)
        handed = {key: files[run, key] if (run, key) in files else files["", key] for key in inputs}
        document = DOCUMENT if stage in ("calibrate", "track", "simulate") else None
        write_mcap(path, [], {"run": run}, provenance(stage, None, handed, run=run, document=document))
        files[run, name] = path

    make("calibrate", "camera.mcap", ())
    for run in "ab":
        make("track", "track.mcap", ["camera.mcap"], run)
        make("decimate", "decimate.mcap", ["track.mcap"], run)
        make("simulate", "simulate.mcap", ["track.mcap", "decimate.mcap"], run)
    return files


def of_run(results, run):
    return {name: path for (owner, name), path in results.items() if owner in ("", run)}


def test_what_was_made_of_each_other_belongs_together(results):
    assert check_together(of_run(results, "a"), DOCUMENT, "a") == "a"
    assert check_together({"track.mcap": results["b", "track.mcap"]}) == "b"
    assert check_together({"camera.mcap": results["", "camera.mcap"]}) == ""


@pytest.mark.parametrize("name", ["track.mcap", "decimate.mcap", "simulate.mcap"])
def test_a_file_of_another_run_is_refused(results, name):
    mixed = of_run(results, "a") | {name: results["b", name]}
    with pytest.raises(InputError, match="does not belong"):
        check_together(mixed, DOCUMENT, "a")
    with pytest.raises(InputError, match="does not belong"):
        check_together(mixed)
    # A variable of the shell that is not set: a result of no run was written.
    with pytest.raises(InputError, match="does not belong"):
        check_together(of_run(results, "a"), DOCUMENT, "")


def test_a_file_that_was_made_again_is_refused_by_what_stands_on_it(results):
    track = results["a", "track.mcap"]
    write_mcap(track, [], {"run": "a", "again": 1}, read_provenance(track))
    with pytest.raises(InputError, match=r"decimate.mcap does not belong.*\n.*another track.mcap"):
        check_together(of_run(results, "a"), DOCUMENT, "a")
    with pytest.raises(InputError, match=r"another track\.mcap"):
        check_made_of(results["a", "decimate.mcap"], {"track.mcap": track})


def test_a_file_of_another_stage_is_refused(results):
    with pytest.raises(InputError, match="made by another stage"):
        check_together({"track.mcap": results["a", "decimate.mcap"]})


@pytest.mark.parametrize(
    ("section", "stages"),
    [
        ("camera", {"camera", "track", "simulate"}),
        ("friction", {"simulate"}),
        ("rover", {"camera", "track", "simulate"}),
    ],
)
def test_an_edit_of_the_campaign_is_noticed_by_the_stages_that_read_it(results, section, stages):
    changed = DOCUMENT | {section: DOCUMENT[section] | {"tracked_plane_height_m": 0.31}}
    files = of_run(results, "a")
    refused = set()
    for name, path in files.items():
        try:
            check_together({name: path}, changed, "a" if name != "camera.mcap" else None)
        except InputError:
            refused.add(name.removesuffix(".mcap"))
    assert refused == stages


def test_what_an_edit_changed_is_named(results):
    """Defaults of keys that are left out had been blamed, too, which no result records."""
    changed = DOCUMENT | {"friction": {"kinetic": 0.4}}
    with pytest.raises(InputError, match=r"campaign\.yaml, or what this stage reads of it, was changed .*: friction"):
        check_together({"simulate.mcap": results["a", "simulate.mcap"]}, changed, "a")


def test_another_run_may_change_or_go(results):
    runs = {"a": DOCUMENT["runs"]["a"], "c": {"video": "c.mp4"}}
    check_together(of_run(results, "a"), DOCUMENT | {"runs": runs}, "a")


def test_every_byte_of_a_file_is_covered(tmp_path):
    """One flipped bit at every byte of a small file, and every shorter file: refused each time."""
    path = tmp_path / "simulate.mcap"
    write_mcap(path, [], {"value": 0.533}, {"stage": "simulate", "run": "a"})
    whole = path.read_bytes()
    for place in range(len(whole)):
        for data in (whole[:place], whole[:place] + bytes([whole[place] ^ (1 << place % 8)]) + whole[place + 1 :]):
            path.write_bytes(data)
            with pytest.raises(InputError, match="cannot be read as MCAP"):
                read_mcap(path)
    path.write_bytes(whole + b"\0")
    with pytest.raises(InputError):
        read_mcap(path)


def test_checksums_of_our_own_files_must_be_there(tmp_path):
    """Without them nothing could be verified; a file of others may leave them out."""
    for library, allowed in (("towval 0.1.0", False), ("recorder 2", True)):
        with (tmp_path / "x.mcap").open("wb") as stream:
            writer = Writer(stream, enable_data_crcs=False, enable_crcs=False)
            writer.start(profile="ros2", library=library)
            writer.add_metadata("provenance", {"stage": "track"})
            writer.finish()
        if allowed:
            assert read_provenance(tmp_path / "x.mcap") == {"stage": "track"}
        else:
            with pytest.raises(InputError, match="checksum"):
                read_provenance(tmp_path / "x.mcap")


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def file_of_chunks(*chunks, library=b"other"):
    """An MCAP file of others, without checksums, of chunks given as (uncompressed size, compression, data)."""
    text = struct.pack("<I", 4) + b"ros2" + struct.pack("<I", len(library)) + library
    data = MAGIC + record(Opcode.HEADER, text)
    for size, compression, content in chunks:
        head = struct.pack("<QQQII", 0, 0, size, 0, len(compression)) + compression + struct.pack("<Q", len(content))
        data += record(Opcode.CHUNK, head + content)
    data += record(Opcode.DATA_END, bytes(4)) + record(Opcode.FOOTER, bytes(20)) + MAGIC
    assert zlib.crc32(data)
    return data


@pytest.mark.parametrize("stated", [0, 1000, ALWAYS_ALLOWED, 2**40, 2**63])
def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, stated):
    """200 MB of zeros in 20 kB, whatever the chunk says about its size."""
    bomb = zstandard.ZstdCompressor(level=1).compress(bytes(200_000_000))
    path = tmp_path / "bomb.mcap"
    path.write_bytes(file_of_chunks((stated, b"zstd", bomb)))
    with pytest.raises(InputError, match="cannot be read as MCAP"):
        read_mcap(path)


def test_many_bombs_are_refused_as_one(tmp_path):
    size = ALWAYS_ALLOWED // 4
    piece = zstandard.ZstdCompressor().compress(record(0x80, bytes(size - 9)))
    path = tmp_path / "bombs.mcap"
    path.write_bytes(file_of_chunks(*[(size, b"zstd", piece)] * 5))
    with pytest.raises(InputError, match="more than a file of its size may"):
        read_mcap(path)


def test_an_uncompressed_file_of_others_is_read(tmp_path):
    with (tmp_path / "x.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, use_chunking=False)
        writer.start(profile="ros2", library="other")
        writer.add_attachment(0, 0, "details.json", "application/json", json.dumps({"a": 1}).encode())
        writer.finish()
    assert read_mcap(tmp_path / "x.mcap").details == {"a": 1}


def test_the_list_names_what_changed_went_or_came(tmp_path):
    names = ("one.txt", "figures/two words.svg", "figures/ü.svg")
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    write_manifest(tmp_path / MANIFEST, [tmp_path / name for name in names])
    assert all(row.found == row.stated for row in read_manifest(tmp_path / MANIFEST))
    (tmp_path / names[0]).write_text("other")
    (tmp_path / names[2]).unlink()
    (tmp_path / "new.txt").write_text("")
    rows = read_manifest(tmp_path / MANIFEST)
    assert {row.name for row in rows if row.found != row.stated} == {names[0], names[2]}
    assert list(unlisted(tmp_path, rows)) == ["new.txt"]


def test_a_film_that_is_drawn_after_the_list_is_no_fault(tmp_path):
    """`towval overlay` writes it beside the results of a run on request."""
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "track.mcap").write_bytes(b"track")
    write_manifest(tmp_path / MANIFEST, [tmp_path / "a" / "track.mcap"])
    (tmp_path / "a" / "overlay.mp4").write_bytes(b"film")
    assert list(unlisted(tmp_path, read_manifest(tmp_path / MANIFEST))) == []


def test_one_byte_of_the_list_never_passes(tmp_path):
    (tmp_path / "one.txt").write_text("1")
    (tmp_path / "two.txt").write_text("2")
    path = tmp_path / MANIFEST
    write_manifest(path, [tmp_path / "one.txt", tmp_path / "two.txt"])
    whole = path.read_bytes()
    for place in range(len(whole)):
        for bit in range(8):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :])
            try:
                rows = read_manifest(path)
            except InputError:
                continue
            assert any(row.found != row.stated for row in rows) or list(unlisted(tmp_path, rows)), (place, bit)


def test_an_older_copy_has_another_fingerprint(tmp_path):
    """As ``cp -p`` makes it: same size, older date; the inode stays."""
    video, cache = tmp_path / "a.mp4", tmp_path / ".content.json"
    video.write_bytes(b"first")
    before = content_hashes([video], cache)
    assert content_hashes([video], cache) == before
    stat = video.stat()
    video.write_bytes(b"other")
    os.utime(video, ns=(stat.st_atime_ns, stat.st_mtime_ns - 10**12))
    assert content_hashes([video], cache) != before


def test_a_settled_file_is_hashed_once(tmp_path, monkeypatch):
    import towval.io.provenance as module  # noqa: PLC0415

    video, cache = tmp_path / "a.mp4", tmp_path / ".content.json"
    video.write_bytes(b"first")
    monkeypatch.setattr(module, "_SETTLED_NS", -1)
    digest = content_hashes([video], cache)
    monkeypatch.setattr(module, "file_hash", lambda _: pytest.fail("hashed again"))
    assert content_hashes([video], cache) == digest
    cache.write_text("[]")
    monkeypatch.undo()
    assert content_hashes([video], cache) == digest
    assert digest == content_hashes([video], tmp_path / "no" / "such" / "cache")
