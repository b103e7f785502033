"""What a command writes: never over its input or a file of others; what the system refuses is one message."""

import errno
import json
import os
import resource
import shutil
import subprocess
import sys
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from towval.cli import main
from towval.commands import exchange, verify
from towval.commands.console import errors_reported
from towval.commands.run_folder import check_spared
from towval.io.atomic import write_text
from towval.io.campaign import load_campaign, names_in
from towval.io.exchange import write_layouts
from towval.io.manifest import MANIFEST, check_results, write_manifest
from towval.io.mcap_file import check_replaceable, write_mcap
from towval.io.provenance import file_hash, provenance
from towval.io.records import write_tracks
from towval.io.summary import write_summary
from towval.io.workflow_lock import clear_stale_locks
from towval.model.errors import InputError

SAMPLE = Path(str(resources.files("towval"))) / "sample"


@pytest.fixture
def track(tmp_path, make_track):
    path = tmp_path / "track.mcap"
    tracks = {
        name: make_track(lambda t: np.stack([t, 0 * t, 0 * t], axis=1), body=name) for name in ("rover", "object")
    }
    write_tracks(path, tracks, {"stage": "track", "run": "a", "versions": "{}", "settings": "{}",
                                "inputs_sha256": "{}", "campaign_sha256": "{}"})  # fmt: skip
    return path


def refused(capsys, *arguments):
    with pytest.raises(SystemExit) as error:
        main([str(argument) for argument in arguments])
    assert error.value.code == 1
    message = capsys.readouterr().err
    assert message.startswith("towval: ")
    assert "Traceback" not in message
    return message


def test_an_input_is_never_replaced(track, tmp_path, capsys):
    before = track.read_bytes()
    (tmp_path / "link.mcap").symlink_to(track)
    os.link(track, tmp_path / "hard.mcap")
    for output in (track, tmp_path / "link.mcap", tmp_path / "hard.mcap"):
        assert "where the stage decimate writes" in refused(capsys, "decimate", track, "-o", output)
    assert track.read_bytes() == before
    main(["decimate", str(track), "-o", str(tmp_path / "decimate.mcap")])
    main(["decimate", str(track), "-o", str(tmp_path / "decimate.mcap")])


def test_what_is_not_ours_is_never_replaced(track, tmp_path, capsys):
    for name, content in (("notes.txt", b"mine"), ("other.mcap", b"\x89MCAP0\r\nmine"), ("empty.mcap", b"")):
        (tmp_path / name).write_bytes(content)
        assert "towval did not make" in refused(capsys, "decimate", track, "-o", tmp_path / name)
        assert (tmp_path / name).read_bytes() == content
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in (tmp_path / "folder", tmp_path / "pipe", "/dev/null"):
        assert "cannot be written" in refused(capsys, "decimate", track, "-o", name)
    (tmp_path / "summary.csv").write_text("my,own,table\n")
    with pytest.raises(InputError, match="towval did not make"):
        write_summary(tmp_path / "summary.csv", [])


@pytest.mark.parametrize(
    ("name", "content"),
    [("files.sha256", "mine\n"), ("files.sha256", ""), ("report.html", "mine"), ("summary.csv", "my,own,table\n")],
)
def test_a_file_of_others_is_told_before_the_report_is_made(name, content, lab_small, tmp_path, capsys):
    """At the end it was told of the list, as one that is damaged, and of the page, once the summary was replaced."""
    (tmp_path / name).write_text(content)
    message = refused(capsys, "report", lab_small, "--results", tmp_path)
    assert f"{name} is not replaced" in message
    assert "move it" in message
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_files_beside_the_file_for_viewers_are_never_those_of_others(lab_small, tmp_path, capsys):
    arguments = ["--run", "a", "--camera", tmp_path / "camera.mcap", "--folder", tmp_path, "-o", tmp_path / "e.mcap"]
    write_layouts(tmp_path)
    assert "camera.mcap is missing" in refused(capsys, "exchange", lab_small, *arguments)
    (tmp_path / "lichtblick.json").write_text("mine")
    assert "lichtblick.json is not replaced" in refused(capsys, "exchange", lab_small, *arguments)
    write_mcap(tmp_path / "e.mcap", [], {}, {"stage": "exchange"})  # so these are of an earlier version
    assert "camera.mcap is missing" in refused(capsys, "exchange", lab_small, *arguments)


def test_a_start_is_never_drawn_over_a_picture_of_the_lab(lab_small, tmp_path):
    """With --pictures in the folder of the lab's pictures, and a run named as one of them."""
    given = load_campaign(lab_small)
    for own in (given.calibration_images[0], given.floor_images[0], given.runs["a"].video):
        with pytest.raises(InputError, match="towval did not make"):
            check_spared(own, given)
        (tmp_path / own.name).symlink_to(own.resolve())
        with pytest.raises(InputError, match="towval did not make"):
            check_spared(tmp_path / own.name, given)
    check_spared(lab_small / "check" / "a.jpg", given)


def test_a_film_never_replaces_footage(lab_small, tmp_path, capsys):
    paths = ("--camera", tmp_path / "camera.mcap", "--folder", tmp_path)
    assert "is not replaced" in refused(capsys, "overlay", lab_small, "--run", "a", *paths, "-o", lab_small / "a.mp4")
    new = lab_small / "new.mp4"
    assert "every video of this folder" in refused(capsys, "overlay", lab_small, "--run", "a", *paths, "-o", new)


def test_a_film_is_drawn_among_results_below_the_campaign(tmp_path, capsys):
    """Results may stand there, and `towval new` does not take what lies beside a camera.mcap for a run."""
    lab = tmp_path / "lab"
    results = lab / "results" / "lab"
    shutil.copytree(SAMPLE, lab)
    for camera in (results / "camera.mcap", lab / "camera.mcap"):
        arguments = ("--run", "a", "--camera", camera, "--folder", results / "a", "-o", results / "a" / "overlay.mp4")
        told = refused(capsys, "overlay", lab, *arguments)
        assert ("every video of this folder" in told) == (camera.parent == lab)
        assert ("is missing" in told) == (camera.parent == results)


def test_the_file_beside_an_output_is_looked_at_before_anything_is_read(lab_small, tmp_path, capsys):
    """With results that are missing, any reading would be told first."""
    none = tmp_path / "none"
    assert "names the page" in refused(capsys, "index", none, "-o", tmp_path / "index.html")
    assert "names the table" in refused(capsys, "identify", lab_small, "--results", none, "-o", tmp_path / "i.csv")
    for name in ("index.html", "i.csv"):
        (tmp_path / name).write_text("mine")
    assert "is not replaced" in refused(capsys, "index", none, "-o", tmp_path / "index.sqlite")
    assert "is not replaced" in refused(capsys, "identify", lab_small, "--results", none, "-o", tmp_path / "i.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["i.csv", "index.html"]


@pytest.mark.parametrize("output", [".", "", "/"])
def test_a_folder_as_the_output_of_the_index_is_told(output, tmp_path, capsys):
    """Such a path has no name to which an ending could be given."""
    assert "got: a folder of that name" in refused(capsys, "index", tmp_path, "-o", output)


@pytest.mark.parametrize(("command", "kind"), [("track", "MCAP"), ("overlay", "MP4"), ("index", "SQLite")])
def test_the_help_names_the_kind_of_file_that_is_written(command, kind, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    assert f"{kind} file to write" in " ".join(capsys.readouterr().out.split())


def test_commands_without_a_result_of_their_own_are_not_held_up(lab_small, tmp_path):
    with pytest.raises(SystemExit) as error:
        main(["check", "--help"])
    assert error.value.code == 0
    main(["check", str(lab_small), "--pictures", str(tmp_path)])


def test_a_damaged_result_may_be_made_again(tmp_path):
    path = tmp_path / "simulate.mcap"
    write_mcap(path, [], {}, {"stage": "simulate"})
    path.write_bytes(path.read_bytes()[:-3])
    check_replaceable(path, "simulate")


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EMFILE, errno.ENAMETOOLONG])
def test_what_the_system_refuses_is_one_message(number, tmp_path, capsys):
    log = tmp_path / "logs" / "x.log"
    with pytest.raises(SystemExit) as error, errors_reported(log):
        raise OSError(number, os.strerror(number), "results/a/track.mcap")
    message = capsys.readouterr().err
    assert error.value.code == 1
    assert os.strerror(number) in message
    assert "what to do" in message
    assert log.read_text() == message


@pytest.mark.parametrize("refused", ["tempfile.mkstemp", "os.replace"])
def test_a_refusal_names_the_file_that_was_asked_for(refused, tmp_path, monkeypatch, capsys):
    """It named the temporary file beside it."""

    def refuse(*args, **_):
        temporary = args[0] if args else str(tmp_path / ".x-1234.csv")
        raise OSError(errno.EACCES, os.strerror(errno.EACCES), temporary)

    monkeypatch.setattr(refused, refuse)
    with pytest.raises(SystemExit), errors_reported():
        write_text(tmp_path / "x.csv", "1\n")
    assert f"refuses {tmp_path / 'x.csv'}\n" in capsys.readouterr().err


@pytest.mark.parametrize("in_compiled_code", [False, True])
def test_an_interruption_is_told(in_compiled_code, capsys):
    interruption: BaseException = KeyboardInterrupt()
    if in_compiled_code:
        interruption, interruption.__cause__ = SystemError("returned a result with an exception set"), interruption
    with pytest.raises(SystemExit) as error, errors_reported():
        raise interruption
    assert error.value.code == 130
    assert "goes on" in capsys.readouterr().err


def test_another_error_of_compiled_code_is_not_taken_for_an_interruption():
    with pytest.raises(SystemError, match="broken"), errors_reported():
        raise SystemError("broken")


def test_the_folder_above_the_results_of_a_campaign_is_not_called_damaged(tmp_path):
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "camera.mcap").touch()
    with pytest.raises(InputError, match=r"results of campaigns(.|\n)*got: lab\n(.|\n)*towval verify .*lab"):
        verify.run(tmp_path)


def test_a_campaign_in_place_of_its_results_is_told():
    with pytest.raises(InputError, match=r"holds no results\n  got: a campaign(.|\n)*results/sample"):
        verify.run(SAMPLE)


def test_what_snakemake_leaves_among_figures_is_none(tmp_path):
    (tmp_path / "figures").mkdir()
    for name in (".snakemake_timestamp", "shares.svg"):
        (tmp_path / "figures" / name).touch()
    write_manifest(tmp_path / MANIFEST, [tmp_path / "figures" / "shares.svg"])
    assert [line.split()[0] for line in verify.run(tmp_path).details] == ["figures/shares.svg"]


def test_inputs_that_were_added_since_are_named(tmp_path):
    """A picture more, which the next calibration would use, or a run more counted as nothing changed."""
    lab, results = tmp_path / "lab", tmp_path / "results"
    shutil.copytree(SAMPLE, lab)
    given = load_campaign(lab)
    pictures = names_in(lab, (*given.calibration_images, *given.floor_images))
    made_of = provenance("calibrate", None, pictures, document=given.document)
    write_mcap(results / "camera.mcap", [], {}, made_of)

    def said():
        with pytest.raises(InputError) as error:
            verify.run(results, lab)
        return str(error.value)

    assert "made without" not in said()
    shutil.copy(lab / "calibration" / "board_00.jpg", lab / "calibration" / "board_77.jpg")
    assert "camera.mcap was made without calibration/board_77.jpg, which is used now" in said()
    assert "run a of campaign.yaml has no results" in said()


def test_what_a_run_left_that_the_report_leaves_out_is_no_fault(tmp_path):
    """It stays among the results, as documented, and index and tables pass over it; verify called them changed."""
    for run in "ab":
        write_mcap(tmp_path / run / "track.mcap", [], {}, provenance("track", None, {}, run=run))
    write_manifest(tmp_path / MANIFEST, [tmp_path / "a" / "track.mcap"])
    os.utime(tmp_path / "b" / "track.mcap", (0, 0))
    found = verify.run(tmp_path)
    assert (found.numbers["results"], found.numbers["left_out"]) == (1, ["b"])
    assert "b: left out by the report, not verified" in found.details
    (tmp_path / "b" / "track.mcap").touch()  # made since: the report does not know of it
    with pytest.raises(InputError, match=r"b/track\.mcap is on no list"):
        verify.run(tmp_path)


def test_a_layout_of_an_earlier_version_is_no_fault(tmp_path, monkeypatch):
    """Sound results had failed as soon as the layout of the installed version was another."""
    run = tmp_path / "lab" / "a"
    write_layouts(run)
    record = provenance("exchange", None, {name: run / name for name in ("lichtblick.json", "rerun.rbl")}, run="a")
    write_mcap(run / "exchange.mcap", [], {}, record)
    write_manifest(tmp_path / "lab" / MANIFEST, [run / "exchange.mcap"])
    (tmp_path / "new").write_text("the layout of the next version")
    later = dict.fromkeys(("lichtblick.json", "rerun.rbl"), tmp_path / "new")
    monkeypatch.setattr("towval.commands.verify.packaged_layouts", lambda: later)
    verify.run(tmp_path / "lab")
    (run / "rerun.rbl").write_text("edited")
    with pytest.raises(InputError, match=r"rerun\.rbl is not the layout"):
        verify.run(tmp_path / "lab")


def test_a_figure_is_of_the_run_that_its_whole_name_tells(tmp_path):
    """A figure of the calibration was said to be made of a run that is called as the end of its name."""
    figures = [tmp_path / "figures" / f"{name}.svg" for name in ("calibration_coverage", "decimate_coverage")]
    figures[0].parent.mkdir()
    for path in figures:
        path.touch()
    write_mcap(tmp_path / "coverage" / "track.mcap", [], {}, provenance("track", None, {}, run="coverage"))
    write_manifest(tmp_path / MANIFEST, [*figures, tmp_path / "coverage" / "track.mcap"])
    of_calibration, of_run = verify.run(tmp_path).details[-2:]
    assert of_calibration.endswith("from all results of the campaign")
    assert of_run.endswith("from coverage/*.mcap, camera.mcap")


def test_a_video_of_any_name_is_a_file_of_the_lab(tmp_path):
    """One named as the film that towval overlay draws was looked for among the results."""
    lab, results = tmp_path / "lab", tmp_path / "results"
    lab.mkdir()
    shutil.copy(SAMPLE / "a.mp4", lab / "overlay.mp4")
    made_of = provenance("exchange", None, {"overlay.mp4": lab / "overlay.mp4"}, run="a")
    write_mcap(results / "a" / "exchange.mcap", [], {}, made_of)
    with pytest.raises(InputError, match=r"files\.sha256 is missing") as error:
        verify.run(results)
    assert "overlay.mp4" not in str(error.value)


def test_films_of_one_name_in_two_folders_are_told_apart(tmp_path, monkeypatch):
    """The file for viewers recorded a film by its bare name, and counted as made of another run's of that name."""
    lab, results = tmp_path / "lab", tmp_path / "results"
    shutil.copytree(SAMPLE, lab)
    (lab / "films").mkdir()
    (lab / "films" / "a.mp4").write_bytes((lab / "a.mp4").read_bytes() + b"\0\0\0\x08free")
    text = (lab / "campaign.yaml").read_text(encoding="utf-8")
    (lab / "campaign.yaml").write_text(f"{text.rstrip()}\n  b:\n    video: films/a.mp4\n", encoding="utf-8")
    assert load_campaign(lab).runs["b"].video == lab / "films" / "a.mp4"
    monkeypatch.setattr(exchange, "read_calibration", lambda _: None)
    monkeypatch.setattr(exchange, "read_run", lambda *_: None)
    monkeypatch.setattr(exchange, "named", lambda *_: {})
    monkeypatch.setattr(exchange, "write_run_file", lambda path, *others: write_mcap(path, [], {}, others[-1]))
    output = results / "b" / "exchange.mcap"
    exchange.run(lab, "b", results / "camera.mcap", output.parent, output)
    with pytest.raises(InputError, match="no results") as error:
        verify.run(results, lab)
    assert "is not the file of which b/exchange.mcap was made" not in str(error.value)
    (lab / "films" / "a.mp4").write_bytes((lab / "a.mp4").read_bytes())
    with pytest.raises(InputError, match=r"films/a\.mp4 is not the file of which b/exchange\.mcap was made"):
        verify.run(results, lab)


def test_a_full_disk_leaves_what_was_there(tmp_path):
    """The size of a file limited as a full disk limits it; the old file stays, and nothing half."""
    path = tmp_path / "page.html"
    write_text(path, "old")
    code = (
        "import resource, signal, sys; from pathlib import Path; from towval.io.atomic import write_text\n"
        "from towval.commands.console import errors_reported\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "with errors_reported(): write_text(Path(sys.argv[1]), 'new' * 10_000)\n"
    )
    answer = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert "Traceback" not in answer.stderr
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["page.html"]
    assert resource.getrlimit(resource.RLIMIT_FSIZE)


class Lab:
    def __init__(self, folder):
        self.folder, self.runs, self.calibration_images, self.floor_images = folder, {}, (), ()


def test_results_never_go_into_the_campaign_or_over_files_of_the_lab(tmp_path):
    lab = tmp_path / "lab"
    lab.mkdir()
    with pytest.raises(InputError, match="own folder"):
        check_results(tmp_path, {"lab": Lab(lab)})
    (tmp_path / "out" / "lab" / "figures").mkdir(parents=True)
    check_results(tmp_path / "out", {"lab": Lab(lab)})
    (tmp_path / "out" / "lab" / "figures" / "mine.png").write_bytes(b"")
    with pytest.raises(InputError, match="towval did not make"):
        check_results(tmp_path / "out", {"lab": Lab(lab)})
    (tmp_path / "out" / "lab" / MANIFEST).write_text("a list of the lab\n")
    with pytest.raises(InputError, match="towval did not make"):
        check_results(tmp_path / "out", {"lab": Lab(lab)})
    # A report made by hand has a list and no logs.
    (tmp_path / "out" / "lab" / MANIFEST).write_text(f"{'0' * 64}  figures/mine.png\n")
    check_results(tmp_path / "out", {"lab": Lab(lab)})
    with pytest.raises(InputError, match="brace"):
        check_results(tmp_path / "{x}", {"lab": Lab(lab)})
    with pytest.raises(InputError, match="<b> in its path"):
        check_results(tmp_path / "out", {"a<b>c": Lab(lab)})
    with pytest.raises(InputError, match="repeats 'xy' twenty times"):
        check_results(tmp_path / "out", {"lab_" + 30 * "xy": Lab(lab)})
    check_results(tmp_path / "out", {"a<b c>" + 15 * "x": Lab(lab)})


def test_the_results_of_another_campaign_of_one_name_are_not_replaced(tmp_path):
    """Two labs with a folder for each day, called from one place: the second one's results took the first one's."""
    lab = Lab(tmp_path / "lab")
    picture, video = lab.folder / "board.jpg", lab.folder / "a.mp4"
    lab.folder.mkdir()
    lab.calibration_images, lab.runs = (picture,), {"a": SimpleNamespace(video=video)}
    picture.write_bytes(b"board")
    video.write_bytes(b"film")
    results = tmp_path / "out" / "lab"

    def made(name, **inputs):
        known = {"stage": name, "run": "", "versions": "{}", "settings": "{}", "campaign_sha256": "{}"}
        write_mcap(results / name, [], {}, {**known, "inputs_sha256": json.dumps(inputs)})

    made("camera.mcap", board="another")
    made("a/track.mcap", **{"a.mp4": "another", "camera.mcap": file_hash(results / "camera.mcap")})
    with pytest.raises(InputError, match=r"another campaign of this name(.|\n)*--results"):
        check_results(tmp_path / "out", {"lab": lab})
    made("a/track.mcap", **{"a.mp4": file_hash(video)})  # the pictures were taken anew
    check_results(tmp_path / "out", {"lab": lab})
    made("a/track.mcap", **{"a.mp4": "another"})  # the film was exchanged, and the campaign moved
    made("camera.mcap", board=file_hash(picture))
    check_results(tmp_path / "out", {"lab": lab})


@pytest.mark.parametrize(
    "name",
    [
        "report.html",
        "summary.csv",
        "identify.csv",
        "identify.mcap",
        "a/simulate.mcap",
        "a/exchange.mcap",
        "a/rerun.rbl",
    ],
)
def test_the_workflow_replaces_no_file_of_others(name, tmp_path):
    """Snakemake removes what a rule is about to make, and so files of others, before the stage could refuse to."""
    lab, mine = Lab(tmp_path / "lab"), tmp_path / "out" / "lab" / name
    lab.runs = {"a": SimpleNamespace(video=tmp_path / "a.mp4")}
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    with pytest.raises(InputError, match=f"{mine.name} is not replaced(.|\\n)*towval did not make"):
        check_results(tmp_path / "out", {"lab": lab})


def test_results_that_single_stages_made_are_replaced(tmp_path):
    """Without the workflow's logs or a list of files."""
    lab, results = Lab(tmp_path / "lab"), tmp_path / "out" / "lab"
    lab.runs = {"a": SimpleNamespace(video=tmp_path / "a.mp4")}
    for name in ("identify.mcap", "a/track.mcap", "a/exchange.mcap"):
        write_mcap(results / name, [], {}, {})
    write_layouts(results / "a")
    (results / "identify.csv").write_text("parameter,given,\n")
    check_results(tmp_path / "out", {"lab": lab})


def test_a_folder_that_snakemake_cannot_write_is_refused_by_name(tmp_path):
    (tmp_path / ".snakemake").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        clear_stale_locks(tmp_path, tmp_path / "results")
