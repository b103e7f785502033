"""The whole workflow on a synthetic campaign, filmed in the test: results, second call, edits, a kill, wrong input."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from studies.worlds.campaign import REST_LENGTH
from studies.worlds.folder import write_campaign
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration, read_simulated, read_tracks
from towval.model.geometry import wrapped

STAGES = ("track", "decimate", "simulate", "uncertainty", "compare")


class Lab:
    """A working folder with a campaign in it, and Snakemake to run there."""

    def __init__(self, repository: Path, folder: Path):
        self.repository, self.folder = repository, folder
        self.campaign = folder / "synthetic"
        self.results = folder / "results" / "synthetic"

    def command(self, *arguments: str, repository: Path | None = None) -> tuple[list[str], dict]:
        repository = repository or self.repository
        line = [sys.executable, "-m", "snakemake", "--cores", "2", "--snakefile", str(repository / "Snakefile")]
        line += ["--directory", str(self.folder), "--rerun-triggers", "mtime", "params", "input", "--config"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(repository / "src"), str(repository)])}
        return [*line, f"campaign={self.campaign}", *arguments], {"env": environment, "cwd": self.folder}

    def snakemake(self, *arguments: str, repository: Path | None = None) -> subprocess.CompletedProcess:
        line, options = self.command(*arguments, repository=repository)
        return subprocess.run(line, capture_output=True, text=True, timeout=600, check=False, **options)


@pytest.fixture(scope="module")
def lab(repository, tmp_path_factory):
    """The campaign, filmed once, and the workflow run on it once."""
    lab = Lab(repository, tmp_path_factory.mktemp("lab"))
    lab.campaign.mkdir()
    lab.truth = write_campaign(lab.campaign)
    shutil.copy(repository / "config.yaml", lab.folder)
    lab.first = lab.snakemake()
    return lab


def test_the_workflow_ends_with_all_its_results(lab):
    assert lab.first.returncode == 0, lab.first.stdout + lab.first.stderr
    for name in (
        "camera.mcap",
        "report.html",
        "summary.csv",
        "figures/fig10_a.pdf",
        "figures/fig10_a.svg",
        "a/exchange.mcap",
        "a/lichtblick.json",
        "figures/summary.tex",
    ):
        assert (lab.results / name).stat().st_size > 0, name
    for stage in STAGES:
        assert (lab.results / "a" / f"{stage}.mcap").is_file()


def test_several_campaigns_run_in_one_call(lab):
    other = lab.folder / "other"
    shutil.copytree(lab.campaign, other)
    planned = lab.snakemake(f"campaigns=[{lab.campaign},{other}]", "--dry-run")
    assert planned.returncode == 0, planned.stdout + planned.stderr
    # What is done stays done; the second campaign is all to do.
    assert "results/other/a/compare.mcap" in planned.stdout
    assert "results/synthetic/a/compare.mcap" not in planned.stdout


def test_a_list_of_campaigns_needs_no_single_one_beside_it(lab, repository, tmp_path):
    (tmp_path / "config.yaml").write_text(f"campaigns: ['{lab.campaign}']\nresults: elsewhere\n", encoding="utf-8")
    line, options = lab.command(repository=repository / "src" / "towval" / "workflow")
    line = [*line[: line.index("--config")], "--configfile", str(tmp_path / "config.yaml"), "--dry-run"]
    planned = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False, **options)
    assert planned.returncode == 0, planned.stdout + planned.stderr
    assert "elsewhere/synthetic/report.html" in planned.stdout


def test_identification_comes_on_request_and_into_the_report(lab):
    identified = lab.snakemake('identify={"parameters":["rest_length"]}')
    assert identified.returncode == 0, identified.stdout + identified.stderr
    table = pd.read_csv(lab.results / "identify.csv")
    assert table.parameter.tolist() == ["rest length [m]"]
    # The truth has the length of campaign.yaml; at 450 lines the object is measured to 3 mm.
    assert abs(table.identified[0] - REST_LENGTH) < max(3 * table.identified_std[0], 5e-3)
    assert "Identification: fitted, not validated" in (lab.results / "report.html").read_text(encoding="utf-8")
    # Asked for no more, it leaves the report.
    assert lab.snakemake().returncode == 0
    assert "Identification: fitted" not in (lab.results / "report.html").read_text(encoding="utf-8")


def test_a_run_that_fails_can_be_left_out_with_a_reason(lab):
    """Without it the campaign has its report again, which states the reason."""
    path, film = lab.campaign / "campaign.yaml", lab.campaign / "b.mp4"
    before = path.read_text()
    document = yaml.safe_load(before)
    document["runs"]["b"] = {"video": film.name}
    try:
        film.write_text("not a video")
        path.write_text(yaml.safe_dump(document))
        failed = lab.snakemake()
        assert failed.returncode != 0
        assert "report of synthetic was not made, because not all runs are finished: b\n" in failed.stderr
        assert "runs.b.left_out" in failed.stderr
        document["runs"]["b"]["left_out"] = "the card was full"
        path.write_text(yaml.safe_dump(document))
        again = lab.snakemake()
        assert again.returncode == 0, again.stdout + again.stderr
        page = (lab.results / "report.html").read_text("utf-8")
        assert "Left out of the campaign: run b (the card was full)." in page
    finally:
        film.unlink()
        path.write_text(before)
    assert lab.snakemake().returncode == 0
    assert "Left out of the campaign" not in (lab.results / "report.html").read_text("utf-8")


def test_summary_has_the_promised_columns(lab):
    table = pd.read_csv(lab.results / "summary.csv")
    assert list(table.columns) == [
        "run",
        "path_rms_m",
        "path_max_m",
        "heading_rms_rad",
        "path_length_m",
        "u_num_m",
        "u_input_m",
        "u_measurement_m",
        "u_val_m",
        "verdict",
        "tracked_frames",
        "lost_frames",
        "final_error_m",
        "frechet_m",
        "area_along_m",
        "area_across_m",
        "ratio_max",
        "aligned_rms_m",
        "tolerance_m",
        "error_upper_m",
        "model_error_lower_m",
        "model_error_upper_m",
        "detectable_m",
        "seen_share",
        "size_statistic",
        "size_limit",
        "shape_statistic",
        "shape_limit",
        "input_statistic",
        "input_limit",
        "findings",
    ]
    assert table.tracked_frames[0] == len(lab.truth["time_s"])
    assert table.path_rms_m[0] < 5e-3


@pytest.mark.parametrize("body", ["rover", "object"])
def test_measured_paths_agree_with_the_truth(lab, body):
    """At 450 lines a pixel is 6 mm on the floor: half of it, in which the calibration and its floor frame are most."""
    track = read_tracks(lab.results / "a" / "track.mcap")[body]
    assert track.seen.all()
    np.testing.assert_allclose(track.time_s, lab.truth["time_s"], atol=1e-5)
    error = track.pose - lab.truth[body]
    assert np.sqrt(np.mean(np.sum(error[:, :2] ** 2, axis=1))) < 3e-3
    assert np.degrees(np.sqrt(np.mean(wrapped(error[:, 2]) ** 2))) < 0.3


def test_the_measurement_knows_its_own_error(lab):
    """The object is off by no more than three of the deviations that the run states for it."""
    track = read_tracks(lab.results / "a" / "track.mcap")["object"]
    error = np.linalg.norm(track.pose[:, :2] - lab.truth["object"][:, :2], axis=1)
    stated = pd.read_csv(lab.results / "summary.csv").u_measurement_m[0]
    assert np.sqrt(np.mean(error**2)) < 3 * stated


def test_simulated_path_agrees_with_the_cell_sum(lab):
    simulated = read_simulated(lab.results / "a" / "simulate.mcap")
    error = simulated.pose - lab.truth["object"][: len(simulated.time_s)]
    assert np.sqrt(np.mean(np.sum(error[:, :2] ** 2, axis=1))) < 4e-3
    assert simulated.outcome == "converged"


def test_camera_height_is_recovered(lab):
    calibration = read_calibration(lab.results / "camera.mcap")
    assert calibration.floor.camera_position_m[2] == pytest.approx(4.0, abs=0.02)


def test_a_second_call_does_nothing(lab):
    second = lab.snakemake()
    assert second.returncode == 0
    assert "Nothing to be done" in second.stdout + second.stderr


def _rules_to_run(lab, repository, *arguments):
    plan = lab.snakemake(*arguments, "--dry-run", repository=repository)
    assert plan.returncode == 0, plan.stdout + plan.stderr
    rules = set()
    for line in (plan.stdout + plan.stderr).splitlines():
        parts = line.split()
        if len(parts) == 2 and parts[1].isdigit() and parts[0] in {*STAGES, "calibrate", "report"}:
            rules.add(parts[0])
    return rules


EDITS = {
    "src/towval/optics/projection.py": {"calibrate", *STAGES, "report"},
    "src/towval/tracking/track.py": {*STAGES, "report"},
    # The probe that chooses how many points to track simulates.
    "src/towval/physics/contact.py": {*STAGES, "report"},
    "src/towval/validation/uncertainty.py": {"uncertainty", "compare", "report"},
    "src/towval/validation/compare.py": {"compare", "report"},
    "src/towval/report/page.py": {"report"},
    "src/towval/planning/planner.py": set(),
}


@pytest.mark.parametrize("module", EDITS)
def test_an_edit_reruns_what_depends_on_it_and_nothing_else(lab, repository, tmp_path, module):
    copy = tmp_path / "copy"
    for name in ("src", "studies", "profiles"):
        shutil.copytree(repository / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(repository / "Snakefile", copy)
    with (copy / module).open("a") as stream:
        stream.write("\n# edited\n")
    assert _rules_to_run(lab, copy) == EDITS[module]


def test_another_key_of_the_campaign_reruns_what_reads_it(lab, repository):
    path = lab.campaign / "campaign.yaml"
    before = path.read_text()
    document = yaml.safe_load(before)
    document["friction"]["kinetic_std"] = 0.006
    try:
        path.write_text(yaml.safe_dump(document))
        assert _rules_to_run(lab, repository) == {"simulate", "uncertainty", "compare", "report"}
    finally:
        path.write_text(before)


def test_stages_work_where_results_are_on_object_storage(lab, tmp_path, monkeypatch):
    """A folder stands in for the bucket: what a stage reads and writes has another path there than in the rules."""
    stored = tmp_path / "bucket" / "results" / "synthetic"
    shutil.copytree(lab.results, stored, ignore=shutil.ignore_patterns(".*"))
    shutil.copy(lab.repository / "config.yaml", tmp_path)
    # The plugin copies with rsync, three options before the two paths, which few machines have.
    (tmp_path / "rsync").write_text('#!/bin/sh\nexec cp -RpL "$4" "$5"\n')
    (tmp_path / "rsync").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    made = [stored / "a" / name for name in ("uncertainty.mcap", "compare.mcap", "exchange.mcap")]
    bytes_before, times_before = [file.read_bytes() for file in made], [file.stat().st_mtime_ns for file in made]
    again = lab.snakemake(
        *("--directory", str(tmp_path), "--default-storage-provider", "fs"),
        *("--default-storage-prefix", str(tmp_path / "bucket"), "--forcerun", "uncertainty"),
        *("--", "results/synthetic/a/exchange.mcap"),
    )
    assert again.returncode == 0, again.stdout + again.stderr
    assert all(file.stat().st_mtime_ns > before for file, before in zip(made, times_before, strict=True))
    assert [file.read_bytes() for file in made] == bytes_before


def test_another_setting_reruns_its_stage_and_what_follows(lab):
    changed = _rules_to_run(lab, lab.repository, 'compare={"resolution_m":0.03}')
    assert changed == {"compare", "report"}


def test_a_killed_run_resumes(lab, tmp_path):
    """Killed while it tracks: no half file is left, the next call goes on by itself and does not calibrate again."""
    other = Lab(lab.repository, tmp_path)
    other.campaign = lab.campaign
    shutil.copy(lab.repository / "config.yaml", tmp_path)
    line, options = other.command()
    process = subprocess.Popen(
        line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True, **options
    )
    camera, track = other.results / "camera.mcap", other.results / "a" / "track.mcap"
    deadline = time.monotonic() + 300
    while not (camera.exists() and (other.results / "a").exists()) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert camera.exists()
    assert not track.exists() or read_tracks(track)
    made = camera.stat().st_mtime_ns
    # What follows the stage that was killed runs as in any other call.
    again = other.snakemake("--", "results/synthetic/a/decimate.mcap")
    assert again.returncode == 0, again.stdout + again.stderr
    assert "the last call was killed" in again.stderr
    assert (other.results / "a" / "decimate.mcap").exists()
    assert camera.stat().st_mtime_ns == made


def test_wrong_input_is_one_message_without_a_traceback(lab, tmp_path):
    folder = tmp_path / "synthetic"
    shutil.copytree(lab.campaign, folder)
    path = folder / "campaign.yaml"
    path.write_text(path.read_text().replace("rest_length_m", "rest_lenght_m"))
    other = Lab(lab.repository, tmp_path)
    shutil.copy(lab.repository / "config.yaml", tmp_path)
    answer = other.snakemake()
    printed = answer.stdout + answer.stderr
    assert answer.returncode != 0
    assert "did you mean rest_length_m?" in printed
    assert "Traceback" not in printed


@pytest.mark.parametrize(
    ("line", "argument", "told"),
    [
        ("compare: {bound_confidence: 0.9}", "quick=true", "is not valid YAML\n  got: the key 'compare' is given"),
        ("results: 2026-11-30", "quick=true", "results is datetime.date(2026, 11, 30); allowed: a text"),
        ("", "campaigns=5", "config: campaigns is 5; allowed: a list"),
    ],
)
def test_settings_that_would_be_lost_or_misread_are_one_message(repository, tmp_path, line, argument, told):
    """Of two sections of one name the first was dropped, and the tolerance in it with it."""
    given = ["compare: {tolerance_m: 0.005}", *([] if "results" in line else ["results: results"])]
    (tmp_path / "config.yaml").write_text("\n".join([*given, line]))
    answer = Lab(repository, tmp_path).snakemake(argument, "--dry-run")
    assert answer.returncode == 1
    assert told in answer.stderr
    assert "Traceback" not in answer.stderr


def test_a_video_that_is_none_fails_alone(lab, tmp_path):
    """The error of one job is told once, without a traceback, and what was made before stays."""
    folder = tmp_path / "synthetic"
    shutil.copytree(lab.campaign, folder)
    (folder / "a.mp4").write_text("not a video")
    other = Lab(lab.repository, tmp_path)
    shutil.copy(lab.repository / "config.yaml", tmp_path)
    answer = other.snakemake()
    printed = answer.stdout + answer.stderr
    assert answer.returncode != 0
    assert "a.mp4 is no video" in printed
    assert "Traceback" not in printed
    assert (other.results / "camera.mcap").exists()
    assert not (other.results / "a" / "track.mcap").exists()


def test_the_synthetic_campaign_is_valid(lab):
    assert load_campaign(lab.campaign).board.inner_corners == (7, 5)
