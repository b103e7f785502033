"""The commands ``run`` and ``demo``: the workflow of the package on a folder, without a clone."""

import errno
import getpass
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from report_scenes import small_calibration
from towval.commands.workflow import _check_as_stated, _environment, _lines, run, run_demo
from towval.io.atomic import write_bytes
from towval.io.campaign import load_campaign
from towval.io.manifest import MANIFEST, write_manifest
from towval.io.provenance import provenance
from towval.io.records import write_calibration
from towval.model.errors import InputError

SAMPLE = Path(str(resources.files("towval"))) / "sample"


def towval(folder, *arguments):
    """The command line, run in a folder."""
    return subprocess.run(
        [sys.executable, "-m", "towval", *map(str, arguments)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_the_sample_is_small_enough_for_a_wheel():
    assert sum(path.stat().st_size for path in SAMPLE.rglob("*")) < 3e6


@pytest.mark.parametrize("cores", [0, -1])
def test_no_core_at_all_is_refused(cores):
    with pytest.raises(InputError, match=f"--cores asks for none\n  got: {cores}\n"):
        run(SAMPLE, cores=cores)


def test_results_of_another_campaign_yaml_are_not_taken_for_those_of_this_one(tmp_path):
    """From another working folder Snakemake knows dates only: the call ended well, over results of other masses."""
    given, made = load_campaign(SAMPLE), tmp_path / "lab"
    (made / "a").mkdir(parents=True)
    made_of = provenance("calibrate", None, {}, document=given.document)
    write_calibration(made / "camera.mcap", small_calibration(), made_of)
    (made / "a" / "rosbag.mcap").write_text("a recording of somebody else's, cut off")
    _check_as_stated(made, given)
    floor = given.document["floor"] | {"board_thickness_m": 0.02}
    other = replace(given, document={**given.document, "floor": floor})
    with pytest.raises(InputError, match=r"camera\.mcap was made with another campaign\.yaml(.|\n)*since: floor"):
        _check_as_stated(made, other)


def test_the_sample_is_planned_whole(tmp_path):
    done = towval(tmp_path, "run", SAMPLE, "--cores", 1, "--snakemake=--dry-run")
    assert done.returncode == 0, done.stderr
    for words in ("calibrate camera and floor", "track rover and object", "figures, summary and report"):
        assert words in done.stdout + done.stderr
    assert not (tmp_path / "results" / "sample").exists()


def test_a_target_is_planned_alone(tmp_path):
    """It was taken for a value of the option --quiet, and refused."""
    done = towval(tmp_path, "run", SAMPLE, "--cores", 1, "--snakemake", "overlay --dry-run")
    assert done.returncode == 0, done.stderr
    assert "draw the outlines onto the footage" in done.stderr
    assert "figures, summary and report" not in done.stdout + done.stderr


def test_a_run_that_the_campaign_does_not_have_is_told(tmp_path):
    """It was KeyError: 'c'."""
    done = towval(tmp_path, "run", SAMPLE, "--cores", 1, "--snakemake", "results/sample/c/track.mcap --dry-run")
    assert done.returncode == 1
    assert "has no such run\n  got: c\n  allowed: a" in done.stderr


def test_a_stage_runs_with_the_settings_given(tmp_path):
    options = ("--set", "calibrate.folds=3", "--set", "preset=draft", "--snakemake=--until calibrate")
    done = towval(tmp_path, "run", SAMPLE, "--cores", 1, "--results", "out", *options)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "sample" / "camera.mcap").is_file()
    assert "Select jobs" not in done.stderr


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("track.metod=klt", "unknown key track.metod; did you mean track.method?"),
        ("preset=rough", "preset is 'rough'; allowed"),
        ("object.mass_kg=4", "unknown key object: it belongs in campaign.yaml"),
    ],
)
def test_a_wrong_setting_is_told_before_anything_runs(tmp_path, setting, message):
    done = towval(tmp_path, "run", SAMPLE, "--set", setting)
    assert done.returncode == 1
    assert message.split(";")[0] in done.stderr
    assert not (tmp_path / ".snakemake").exists()


@pytest.mark.parametrize("key", ["campaign", "campaigns", "results"])
def test_what_a_call_works_on_is_no_setting(tmp_path, monkeypatch, key):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=f"{key} is no key to set here"):
        run(SAMPLE, keys={key: "other"})


@pytest.mark.parametrize(("verdict", "cited"), [("agrees", True), ("not judged", False)])
def test_the_bound_of_a_run_is_stated_where_it_counts(verdict, cited):
    row = {"verdict": verdict, "error_upper_m": 0.00224, "tolerance_m": 0.02, "path_rms_m": 0.0005, "u_val_m": 0.001}
    (line,) = _lines({"a": row})
    assert line.startswith(f"run a: {verdict}; ")
    assert ("off by at most 2.3 mm, tolerance 20 mm" in line) == cited


@pytest.mark.parametrize("options", ["-n --config preset=draft", "--config=preset=draft", "-Cpreset=draft"])
def test_keys_among_the_options_for_snakemake_are_refused(options):
    """They were passed over: what was judged had the default settings."""
    with pytest.raises(InputError, match="--set KEY=VALUE"):
        run(SAMPLE, snakemake=options)


def test_options_for_snakemake_with_an_open_quote_are_told():
    with pytest.raises(InputError, match="close the quote"):
        run(SAMPLE, snakemake="--configfile 'x")


@pytest.mark.parametrize(
    ("options", "said", "makes", "stated"),
    [
        ("-n", "total        8\n", True, True),
        ("-n", "total        8\n", False, False),
        ("-n", "total        0\n", False, True),
        # What these leave out may be older than its inputs, and the report with it.
        ("--until track", "Nothing to be done\n", False, False),
        ("-Utrack", "total        0\n", False, False),
        ("--keep-going --omit-from=report", "total        0\n", False, False),
        ("--until report", "total        1\n", True, True),
        ("overlay", "Nothing to be done\n", False, False),
    ],
)
def test_an_outcome_is_stated_for_what_was_made_or_is_up_to_date(tmp_path, monkeypatch, options, said, makes, stated):
    report = tmp_path / "sample" / "report.html"
    report.parent.mkdir()
    report.write_text("of an earlier call")
    os.utime(report, ns=(1, 1))

    @contextmanager
    def workflow(_line):
        if makes:
            os.utime(report)
        yield SimpleNamespace(stderr=[said], returncode=0), []

    monkeypatch.setattr("towval.commands.workflow._ending_with_us", workflow)
    monkeypatch.setattr("towval.commands.workflow.read_summary", lambda _: {})
    assert (run(SAMPLE, tmp_path, snakemake=options) is not None) == stated
    # Without options, what succeeded is up to date.
    assert run(SAMPLE, tmp_path) is not None


@pytest.mark.parametrize("fails_at", ["track", "exchange"])
def test_a_report_that_stays_where_a_stage_failed_is_said_to_be_of_before(tmp_path, monkeypatch, capsys, fails_at):
    """A new video was refused: the page beside it still gave the verdict on the one before, and nothing said so."""
    made = tmp_path / "sample"
    write_bytes(made / "report.html", b"the run agrees")
    write_bytes(made / "a" / "track.mcap", b"of the video before")
    write_manifest(made / MANIFEST, [made / "report.html", made / "a" / "track.mcap"])

    @contextmanager
    def workflow(_line):
        if fails_at == "track":  # Snakemake takes away what it is about to make
            (made / "a" / "track.mcap").unlink()
        yield SimpleNamespace(stderr=[], returncode=1), []

    monkeypatch.setattr("towval.commands.workflow._ending_with_us", workflow)
    with pytest.raises(SystemExit):
        run(SAMPLE, tmp_path)
    said = f"report.html, summary.csv and figures in {made} are of an earlier call: a/track.mcap is gone since"
    assert (said in capsys.readouterr().err) == (fails_at == "track")


def test_a_fault_of_the_campaign_is_told_before_anything_runs(tmp_path):
    document = yaml.safe_load((SAMPLE / "campaign.yaml").read_text())
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "campaign.yaml").write_text(yaml.safe_dump(document))
    done = towval(tmp_path, "run", "lab")
    assert done.returncode == 1
    assert "camera.calibration_images finds no picture" in done.stderr
    assert not (tmp_path / ".snakemake").exists()


def test_a_user_without_a_name_is_given_one(monkeypatch):
    for name in ("LOGNAME", "USER", "LNAME", "USERNAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    monkeypatch.setenv("LOGNAME", _environment()["LOGNAME"])
    assert getpass.getuser() == "towval"


def test_the_demo_overwrites_nobodys_folder(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="does not hold the sample"):
        run_demo(tmp_path)


def test_the_demo_runs_the_sample_only_also_where_its_campaign_was_edited(tmp_path, monkeypatch):
    """It ran whatever campaign it was given, as if that were the sample."""
    ran = []
    monkeypatch.setattr("towval.commands.workflow.run", lambda folder, *_: ran.append(folder))
    with pytest.raises(InputError, match=r"does not hold the sample(.|\n)*towval run"):
        run_demo(SAMPLE.parents[2] / "data_samples" / "lab_small")
    run_demo(tmp_path / "demo")
    with (tmp_path / "demo" / "campaign.yaml").open("a") as stream:
        stream.write("# edited\n")
    run_demo(tmp_path / "demo")
    assert ran == 2 * [tmp_path / "demo"]


def test_a_demo_whose_copy_was_cut_off_goes_on(tmp_path, monkeypatch):
    """Over a full disk half of it stayed, and the next call took the folder for somebody else's."""
    monkeypatch.setattr("towval.commands.workflow.run", lambda *_: None)
    folder, copied = tmp_path / "demo", []

    def write(path, content):
        if path.name == "floor_3.jpg":
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        copied.append(path)
        write_bytes(path, content)

    monkeypatch.setattr("towval.commands.workflow.write_bytes", write)
    with pytest.raises(OSError, match=r"No space left on device: '.*floor_3\.jpg'"):
        run_demo(folder)
    assert copied
    monkeypatch.setattr("towval.commands.workflow.write_bytes", write_bytes)
    run_demo(folder)
    assert {path.relative_to(folder) for path in folder.rglob("*")} == {
        path.relative_to(SAMPLE) for path in SAMPLE.rglob("*")
    }


def in_calibration(folder):
    """A whole call in a process group of its own, once its first stage is at work."""
    line = [sys.executable, "-m", "towval", "run", str(SAMPLE), "--set", "preset=draft"]
    process = subprocess.Popen(line, cwd=folder, start_new_session=True, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 120
    while not [*(folder / ".snakemake").glob("scripts/*.py")]:
        assert time.monotonic() < until
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.1)
    time.sleep(0.5)
    return process


def alive(group):
    """Whether a process of the group that is more than an entry in a table is left."""
    states = subprocess.run(["ps", "-o", "stat=", "--pgrp", str(group)], capture_output=True, text=True, check=False)
    return any(not state.startswith("Z") for state in states.stdout.split())


@pytest.mark.skipif(sys.platform != "linux", reason="death of the parent is a signal on Linux only")
@pytest.mark.parametrize("to", ["all, by SIGTERM", "all, by SIGINT", "the first, by SIGINT", "the first, by SIGKILL"])
def test_a_call_that_is_ended_leaves_nothing_that_waits_and_the_next_goes_on(tmp_path, to):
    process = in_calibration(tmp_path)
    number = signal.Signals[to.split()[-1]]
    (os.killpg if "all" in to else os.kill)(process.pid, number)
    _, told = process.communicate(timeout=120)
    assert process.returncode != 0
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert told.endswith("towval: interrupted; what is finished stays, and the next call goes on from there\n")
    assert "Traceback" not in told
    until = time.monotonic() + 60
    while alive(process.pid):
        assert time.monotonic() < until, "something of the call is left"
        time.sleep(0.2)
    done = towval(tmp_path, "run", SAMPLE, "--set", "preset=draft", "--snakemake=--until calibrate")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "sample" / "camera.mcap").is_file()


DEALING_WITH_A_FAILURE = """
import sys, time
from snakemake.cli import main
from snakemake.scheduling.job_scheduler import JobScheduler
failed = JobScheduler._error_jobs
def slowly(self):
    if self._toerror:
        print("dealing with it", file=sys.stderr, flush=True)
        time.sleep(5)
    failed(self)
JobScheduler._error_jobs = slowly
sys.exit(main())
"""

ENDED_THEN = """
import os, signal, sys
from towval.commands.workflow import _ending_with_us
with _ending_with_us(sys.argv[1:]) as (workflow, _):
    for line in workflow.stderr:
        print(line, end="", flush=True)
        if line == "dealing with it\\n":
            os.kill(os.getpid(), signal.SIGTERM)
sys.exit(workflow.returncode)
"""


def interruptible():
    """A shell's job in the background ignores SIGINT, and so does what it starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def ignoring_interrupts():
    """As in the background of a script."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@pytest.mark.skipif(sys.platform == "win32", reason="SIGTERM ends a process of Windows at once")
@pytest.mark.parametrize("started", [interruptible, ignoring_interrupts])
def test_a_workflow_that_waits_for_itself_when_it_is_to_end_is_interrupted_or_killed(tmp_path, started):
    """Snakemake's handler of SIGTERM takes the lock that its main thread holds while it deals with failed jobs."""
    (tmp_path / "Snakefile").write_text("rule all:\n    shell: 'false'\n")
    snakemake = [sys.executable, "-c", DEALING_WITH_A_FAILURE, "--cores", "1"]
    done = subprocess.run(
        [sys.executable, "-c", ENDED_THEN, *snakemake],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
        preexec_fn=started,  # the test has one thread
    )
    assert "dealing with it" in done.stdout
    if started is interruptible:
        assert done.returncode == 1
        assert "Terminating processes on user request" in done.stdout
        assert not [*(tmp_path / ".snakemake").glob("locks/*")], "the folder is still locked"
    else:
        assert done.returncode == 256 - signal.SIGKILL


@pytest.mark.skipif(sys.platform == "win32", reason="there are no process groups")
@pytest.mark.parametrize(
    "imported", ["argparse", "towval.model.errors", "towval.commands.console", "towval.io.campaign"]
)
def test_ctrl_c_at_the_start_shows_no_traceback(tmp_path, imported):
    line = [sys.executable, "-X", "importtime", "-m", "towval", "run", str(SAMPLE)]
    process = subprocess.Popen(
        line,
        cwd=tmp_path,
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,  # noqa: PLW1509  # the test has one thread
    )
    assert any(said.rstrip().endswith(f" {imported}") for said in process.stderr), "never imported"
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=120)
    assert process.returncode in {130, -signal.SIGINT}
    assert "Traceback" not in told
