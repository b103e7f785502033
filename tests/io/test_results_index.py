"""The index over folders of results: what it reads, what it leaves out, and what it says of runs in the making."""

import json
import os
import shutil
import sqlite3

import pandas as pd
import pytest

from result_folders import COMPARED, make_run
from towval.io.manifest import write_manifest
from towval.io.mcap_file import write_mcap
from towval.io.provenance import file_hash
from towval.io.results_index import UNFINISHED, read_results, write_index
from towval.model.conventions import STAGES_OF_RUN
from towval.model.errors import InputError


def test_a_run_is_a_row_with_findings_inputs_and_costs(tmp_path):
    make_run(tmp_path / "lab" / "a", path_max_m=0.004)
    index = read_results([tmp_path])
    row = index.runs.iloc[0]
    assert (row.campaign, row.run, row.state, row.verdict) == ("lab", "a", "compare", "agrees")
    assert (row.path_rms_m, row.path_max_m, row.lost_frames) == (0.0015, 0.004, 2)
    assert (row.main_input, row.main_share, row.version) == ("stiffness", 0.3, "1.0.0")
    assert (row.cpu_s, row.wall_s) == (11.0, 5.5)
    assert index.findings[["stage", "code", "severity"]].values.tolist() == [["track", "blur", "warning"]]
    assert set(index.inputs["input"]) == {"a.mp4", "track.mcap", "campaign.yaml: friction"}


def test_a_run_names_all_versions_with_which_its_stages_were_made(tmp_path):
    make_run(tmp_path / "lab" / "a")
    for path, version in (("camera", "0.8.0"), ("a/track", "0.9.0")):
        file = tmp_path / "lab" / f"{path}.mcap"
        write_mcap(file, [], {}, {"versions": json.dumps({"towval": version})})
        os.utime(file, (1, 1))  # before what was made of it
    assert read_results([tmp_path]).runs["version"].tolist() == ["0.8.0, 0.9.0, 1.0.0"]


def test_no_input_is_the_main_one_where_none_has_a_share(tmp_path):
    """With fewer draws than it takes to tell: the first by name had been, with 0 %."""
    make_run(tmp_path / "lab" / "a", shares={"stiffness": 0.0, "friction": 0.0, "noise and interactions": 1.0})
    row = read_results([tmp_path]).runs.iloc[0]
    assert (row.main_input, row.main_share) == ("", None)


def test_a_folder_of_one_campaign_is_found_as_well(tmp_path):
    make_run(tmp_path / "lab" / "a")
    (tmp_path / "lab" / "figures").mkdir()
    runs = read_results([tmp_path / "lab"]).runs
    assert runs[["campaign", "run"]].values.tolist() == [["lab", "a"]]


def test_a_run_beside_campaigns_does_not_hide_them(tmp_path):
    """One track that was made by hand in results/tried: of all campaigns there nothing was read, without a word."""
    make_run(tmp_path / "lab" / "a", verdict="disagrees")
    make_run(tmp_path / "tried", up_to="track")
    runs = read_results([tmp_path]).runs
    found = [[tmp_path.name, "tried", UNFINISHED], ["lab", "a", "disagrees"]]
    assert runs[["campaign", "run", "verdict"]].values.tolist() == found


def test_runs_in_the_making_and_damaged_comparisons_are_unfinished(tmp_path):
    make_run(tmp_path / "lab" / "a", up_to="simulate")
    make_run(tmp_path / "lab" / "b")
    compared = tmp_path / "lab" / "b" / "compare.mcap"
    compared.write_bytes(compared.read_bytes()[:-20])
    runs = read_results([tmp_path]).runs
    assert runs["verdict"].tolist() == [UNFINISHED, UNFINISHED]
    assert runs["state"].tolist() == ["simulate", "uncertainty"]
    assert runs["path_rms_m"].isna().all()


@pytest.mark.parametrize(
    ("details", "provenance"),
    [
        ({"findings": ["Blurred."]}, {}),
        ({"findings": [{"code": "blur", "text": "Blurred."}]}, {}),
        ({}, {"inputs_sha256": "[1]"}),
        ({}, {"campaign_sha256": "null"}),
        ({}, {"versions": "1.0.0"}),
    ],
)
def test_a_file_of_a_version_that_wrote_otherwise_counts_as_not_made(tmp_path, details, provenance):
    """One such file among all had ended the index with a traceback."""
    for name in "ab":
        make_run(tmp_path / "lab" / name)
    write_mcap(tmp_path / "lab" / "a" / "compare.mcap", [], {**COMPARED, **details}, provenance)
    runs = read_results([tmp_path]).runs
    assert runs[["state", "verdict"]].values.tolist() == [["uncertainty", UNFINISHED], ["compare", "agrees"]]


def test_a_comparison_that_does_not_belong_to_the_run_is_not_made(tmp_path):
    for name in "abc":
        make_run(tmp_path / "lab" / name)
    a, b, c = (tmp_path / "lab" / name for name in "abc")
    # The track of a has been made anew since; that of c is only newer, as in a copy.
    for folder, made_of in ((a, "ff"), (c, file_hash(c / "track.mcap"))):
        for stage in ("decimate", "simulate", "uncertainty", "compare"):
            write_mcap(folder / f"{stage}.mcap", [], COMPARED, {"inputs_sha256": json.dumps({"track.mcap": made_of})})
        later = (folder / "compare.mcap").stat().st_mtime_ns + 10**9
        os.utime(folder / "track.mcap", ns=(later, later))
    write_mcap(b / "compare.mcap", [], COMPARED, {"run": "a"})  # the file of another run
    runs = read_results([tmp_path]).runs
    assert runs["state"].tolist() == ["track", "uncertainty", "compare"]
    assert runs["verdict"].tolist() == [UNFINISHED, UNFINISHED, "agrees"]


def test_a_copy_of_a_run_under_another_name_is_no_run_more(tmp_path):
    lab = tmp_path / "lab"
    make_run(lab / "a")
    for stage in STAGES_OF_RUN:
        write_mcap(lab / "a" / f"{stage}.mcap", [], COMPARED, {"run": "a"})
    shutil.copytree(lab / "a", lab / "a_before")
    assert read_results([tmp_path]).runs["verdict"].tolist() == ["agrees", UNFINISHED]


@pytest.mark.parametrize("gone", ["a/track.mcap", "a/simulate.mcap", "camera.mcap"])
def test_a_verdict_on_what_could_not_be_made_anew_does_not_count(tmp_path, gone):
    """A new video was refused by the tracker: --fail-on passed by the verdict on the video before."""
    lab, names = tmp_path / "lab", ("camera", *STAGES_OF_RUN)
    for k, name in enumerate(names):
        inputs = {f"{other}.mcap": "ff" for other in names[:k]}
        where = lab if name == "camera" else lab / "a"
        write_mcap(where / f"{name}.mcap", [], COMPARED, {"inputs_sha256": json.dumps(inputs)})
        os.utime(where / f"{name}.mcap", (k, k))
    (lab / "a" / "logs").mkdir()
    (lab / "a" / "logs" / "track.log").touch()
    assert read_results([tmp_path]).runs["verdict"].tolist() == ["agrees"]
    (lab / gone).unlink()
    assert read_results([tmp_path]).runs["verdict"].tolist() == [UNFINISHED]


def test_a_run_that_a_later_report_leaves_out_is_passed_over(tmp_path):
    lab = tmp_path / "lab"
    for run in "ab":
        make_run(lab / run)
    listing = lab / "files.sha256"
    write_manifest(listing, [lab / "a" / "compare.mcap", lab / "a" / "track.mcap"])
    later = (lab / "b" / "compare.mcap").stat().st_mtime_ns + 10**9
    os.utime(listing, ns=(later, later))
    assert read_results([tmp_path]).runs["run"].tolist() == ["a"]
    # Made after the list, the run is on its way into the next report.
    os.utime(listing, ns=(later - 10**10, later - 10**10))
    assert read_results([tmp_path]).runs["run"].tolist() == ["a", "b"]
    listing.write_text("damaged")
    os.utime(listing, ns=(later, later))
    assert read_results([tmp_path]).runs["run"].tolist() == ["a", "b"]


def test_a_run_that_was_left_out_stays_so_in_a_copy_without_times(tmp_path):
    """Copied after the list of files, by the order of names, it counted again, and verify named its files."""
    lab = tmp_path / "lab"
    for run in ("a", "straight"):
        make_run(lab / run)
    (lab / "report.html").write_text("page")
    write_manifest(lab / "files.sha256", [lab / "a" / "track.mcap", lab / "report.html"])
    copied = ["a/track.mcap", "files.sha256", "report.html", *(f"straight/{stage}.mcap" for stage in STAGES_OF_RUN)]
    for k, name in enumerate(copied):
        os.utime(lab / name, (k, k))
    assert read_results([tmp_path]).runs["run"].tolist() == ["a"]
    # Of another page there is no telling: the run may be on its way into the next report.
    (lab / "report.html").write_text("another")
    assert read_results([tmp_path]).runs["run"].tolist() == ["a", "straight"]


def test_the_file_holds_what_was_read(tmp_path):
    make_run(tmp_path / "lab" / "a")
    index = read_results([tmp_path])
    write_index(tmp_path / "index.sqlite", index)
    with sqlite3.connect(tmp_path / "index.sqlite") as database:
        for table in ("runs", "findings", "inputs", "settings"):
            read = pd.read_sql(f"select * from {table}", database)
            pd.testing.assert_frame_equal(read, getattr(index, table), check_dtype=False)


def test_a_run_that_could_not_be_tracked_is_unfinished(tmp_path):
    """It was on no list, so that --fail-on found nothing to fail on; a left out one is none."""
    make_run(tmp_path / "lab" / "a")
    log = tmp_path / "lab" / "b" / "logs" / "track.log"
    log.parent.mkdir(parents=True)
    log.write_text("towval: b.mp4 is damaged or truncated\n")
    runs = read_results([tmp_path]).runs
    assert runs[["run", "state", "verdict"]].values.tolist() == [["a", "compare", "agrees"], ["b", "", UNFINISHED]]
    os.utime(log, (0, 0))
    write_manifest(tmp_path / "lab" / "files.sha256", [tmp_path / "lab" / "a" / "track.mcap"])
    assert read_results([tmp_path]).runs["run"].tolist() == ["a"]


def test_folders_without_runs_are_refused(tmp_path):
    with pytest.raises(InputError, match="there are no runs"):
        read_results([tmp_path])
    with pytest.raises(InputError, match="is no folder"):
        read_results([tmp_path / "missing"])
