"""A sample of the faults of ``make damage``, and whether its judges see what they must."""

import time

import numpy as np
import pytest

from studies.robustness import campaign_faults, file_faults
from studies.robustness.trial import attempt
from studies.robustness.workflow_faults import fault_of
from studies.tables.damage import look_at_files
from towval.io.campaign import load_campaign
from towval.io.manifest import MANIFEST, write_manifest
from towval.io.mcap_file import read_mcap, write_mcap
from towval.io.provenance import provenance
from towval.model.errors import InputError


def raising(error):
    raise error


@pytest.mark.parametrize(
    ("call", "kind"),
    [
        (lambda: 3, "returned"),
        (lambda: raising(InputError("the key is missing")), "refused"),
        (lambda: 1 / 0, "traceback"),
        (lambda: time.sleep(60), "hang"),
        (lambda: sum(iter(int, 1)), "hang"),
        (lambda: bytearray(2**29), "memory"),
        (lambda: raising(SystemExit(1)), "traceback"),
    ],
)
def test_a_trial_tells_how_a_call_ends(call, kind):
    assert attempt(call, seconds=0.5, memory_bytes=2**28).kind == kind


def test_the_words_of_a_call_are_judged():
    assert fault_of("towval: the disk is full") == ""
    assert fault_of("Traceback (most recent call last):\n towval: x") == "traceback"
    assert fault_of("OSError: [Errno 28] No space left on device") == ""
    assert fault_of("") == fault_of("FileNotFoundError in line 8 of Snakefile") == "no message"


def test_damaged_campaigns_are_read_or_refused(lab_small, tmp_path):
    """Fresh faults at every call would make a test that fails now and then; ``make damage SEED=`` looks for more."""
    rng, ended = np.random.default_rng(18), []
    for i in range(60):
        folder = tmp_path / f"{i}"
        folder.mkdir()
        campaign_faults.write_damaged(lab_small, folder, rng)
        outcome = attempt(lambda folder=folder: look_at_files(load_campaign(folder)))
        assert outcome.told, (folder / "campaign.yaml", outcome)
        ended.append(outcome.kind)
    assert 30 < ended.count("refused") < 60


def test_another_way_to_write_a_campaign_means_the_same(lab_small, tmp_path):
    rng, written = np.random.default_rng(18), set()
    wanted = load_campaign(lab_small)
    for i in range(30):
        folder = tmp_path / f"{i}"
        folder.mkdir()
        campaign_faults.write_rewritten(lab_small, folder, rng)
        found = load_campaign(folder)
        assert found.document == wanted.document
        assert repr(found.scene) == repr(wanted.scene)
        assert found.deviations == wanted.deviations
        written.add((folder / "campaign.yaml").read_bytes())
    assert len(written) > 25


@pytest.fixture
def results(tmp_path):
    """Two runs of two results each, a camera and a page, listed."""

    def make(place, stage, inputs, run=""):
        path = tmp_path / place
        path.parent.mkdir(exist_ok=True)
        write_mcap(path, [], {"run": run, "value_mm": 0.533}, provenance(stage, None, inputs, run=run))
        return path

    camera = make("camera.mcap", "calibrate", {})
    listed = [camera]
    for run in "ab":
        files = {"camera.mcap": camera}
        for stage in ("track", "decimate", "simulate", "uncertainty", "compare"):
            files[f"{stage}.mcap"] = make(f"{run}/{stage}.mcap", stage, dict(files), run)
        listed += files.values()
    (tmp_path / "summary.csv").write_text("run,path_rms_m\na,0.533\n")
    write_manifest(tmp_path / MANIFEST, {*listed, tmp_path / "summary.csv"})
    return tmp_path


def test_undamaged_results_are_read_within_the_memory_of_a_trial(results):
    """Else damaged ones are refused for that, whatever is wrong with them."""
    for path in sorted(results.rglob("*.mcap")):
        assert attempt(lambda path=path: read_mcap(path)).kind == "returned", path


def test_damaged_results_are_never_read_as_right(results, tmp_path_factory):
    counts = file_faults.read_trials(results, 200, 18, tmp_path_factory.mktemp("corpus"))
    assert set(counts) <= {"refused", "same"}
    assert counts["refused"] > 180


def test_a_reader_that_overlooks_is_found(results, tmp_path_factory, monkeypatch):
    monkeypatch.setattr(file_faults, "_reader", lambda *_: lambda: None)
    counts = file_faults.read_trials(results, 10, 18, tmp_path_factory.mktemp("corpus"))
    assert counts["wrong"] >= 8
