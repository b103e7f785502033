"""Results as tables: the numbers of the files, with units in the names."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

import towval
from report_scenes import LOST, small_calibration, towed_run, uncertainty_of
from towval.io.manifest import MANIFEST
from towval.io.provenance import module_hash, provenance
from towval.io.records import write_calibration, write_comparison, write_simulated, write_tracks, write_uncertainty
from towval.model.errors import InputError


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Folder of results of a campaign with two runs, and their records."""
    folder = tmp_path_factory.mktemp("results") / "lab"
    records = {name: towed_run(name) for name in "ab"}
    for name, run in records.items():
        place = folder / name
        write_tracks(place / "track.mcap", {"rover": run.rover_track, "object": run.object_track}, {})
        write_simulated(place / "simulate.mcap", run.simulated, {})
        write_uncertainty(place / "uncertainty.mcap", uncertainty_of(run), run.simulated, {})
        write_comparison(place / "compare.mcap", run.comparison, run.object_track, run.simulated, {})
    return folder, records


def test_tables_hold_the_numbers_of_the_records(lab):
    folder, records = lab
    results = towval.load(folder)
    for name, run in records.items():
        errors = results.errors[results.errors.run == name]
        np.testing.assert_allclose(errors[["x_m", "y_m", "heading_rad"]], run.comparison.error, atol=1e-12)
        tracks = results.tracks[(results.tracks.run == name) & (results.tracks.body == "object")]
        np.testing.assert_allclose(tracks[["x_m", "y_m"]], run.object_track.pose[:, :2], atol=1e-9)
        np.testing.assert_allclose(tracks.std_x_m, run.object_track.std[:, 0], rtol=1e-6)
        assert np.flatnonzero(tracks.status == "lost").tolist() == [*range(LOST.start, LOST.stop)]
        simulated = results.simulated[results.simulated.run == name]
        force = simulated[["tether_force_x_n", "tether_force_y_n"]]
        np.testing.assert_allclose(force, run.simulated.tether_force, atol=1e-9)
        u_val = math.sqrt(np.trace(uncertainty_of(run).validation[50][:2, :2]))
        assert errors.u_val_m.iloc[50] == pytest.approx(u_val)
    assert results.summary.run.tolist() == ["a", "b"]
    assert set(results.findings.columns) == {"campaign", "run", "stage", "severity", "code", "text"}


def test_a_notebook_shows_results_in_a_line(lab):
    results = towval.load(lab[0])
    shown = repr(results)
    assert shown.startswith(f"Results of lab/a {results.summary.verdict[0]}, lab/b {results.summary.verdict[1]}. ")
    assert f"errors ({len(results.errors)} × {results.errors.shape[1]})" in shown
    assert len(shown) < 300


def test_several_campaigns_are_stacked(lab, tmp_path):
    folder, _ = lab
    (tmp_path / "other").symlink_to(folder)
    both = towval.load(folder, str(tmp_path / "other"))
    assert both.summary.campaign.tolist() == ["lab", "lab", "other", "other"]
    assert len(both.tracks) == 2 * len(towval.load(folder).tracks)


def test_two_folders_of_one_name_are_refused(lab, tmp_path):
    """As those of two years: their rows had the same campaign and run."""
    shutil.copytree(lab[0], tmp_path / "lab")
    with pytest.raises(InputError, match="have one name"):
        towval.load(lab[0], tmp_path / "lab")


def test_lengths_angles_and_times_carry_their_units(lab):
    results = towval.load(lab[0])
    plain = {"campaign", "run", "body", "status", "ratio"}
    for name in ("tracks", "simulated", "errors"):
        for column in set(getattr(results, name).columns) - plain:
            assert column.endswith(("_m", "_rad", "_s", "_n")), column


def test_a_folder_without_results_is_told(tmp_path):
    with pytest.raises(InputError, match="towval run"):
        towval.load(tmp_path)


def test_runs_without_a_comparison_are_named(lab, tmp_path):
    """A mean over the others is one over those that no stage refused."""
    shutil.copytree(lab[0], tmp_path / "lab")
    (tmp_path / "lab" / "b" / "compare.mcap").unlink()
    refused = tmp_path / "lab" / "c" / "logs"
    refused.mkdir(parents=True)
    (refused / "track.log").write_text("track c: refused", encoding="utf-8")
    with pytest.warns(UserWarning, match="lab/b, lab/c") as caught:
        results = towval.load(tmp_path / "lab")
    assert caught[0].filename == __file__
    assert results.summary.run.tolist() == ["a"]
    assert results.left_out == ("lab/b", "lab/c")
    assert "Without a comparison: lab/b, lab/c." in repr(results)
    assert towval.load(lab[0]).left_out == ()


@pytest.mark.parametrize("given", [(), (5,), (None,), (["lab"],), ("missing",), (__file__,)])
def test_what_is_no_folder_is_refused(given):
    with pytest.raises(InputError, match="folder"):
        towval.load(*given)


def test_files_of_a_run_that_were_not_made_of_each_other_are_refused(lab, tmp_path):
    shutil.copytree(lab[0], tmp_path / "lab")
    run, place = lab[1]["a"], tmp_path / "lab" / "a"
    made_of = provenance("compare", {}, {"track.mcap": place / "simulate.mcap"}, run="a")  # of another
    (place / "compare.mcap").unlink()
    write_comparison(place / "compare.mcap", run.comparison, run.object_track, run.simulated, made_of)
    with pytest.raises(InputError, match=r"compare\.mcap does not belong to the others"):
        towval.load(tmp_path / "lab")


def test_runs_of_another_camera_are_refused(lab, tmp_path):
    """Its findings had been given as theirs."""
    shutil.copytree(lab[0], tmp_path / "lab")
    run, camera, track = lab[1]["a"], tmp_path / "lab" / "camera.mcap", tmp_path / "lab" / "a" / "track.mcap"
    write_calibration(camera, small_calibration(), {})
    track.unlink()
    made_of = provenance("track", {}, {"camera.mcap": camera}, run="a")
    write_tracks(track, {"rover": run.rover_track, "object": run.object_track}, made_of)
    assert len(towval.load(tmp_path / "lab").summary) == 2
    write_calibration(camera, replace(small_calibration(), corner_noise_px=0.5), {})
    with pytest.raises(InputError, match=r"track\.mcap does not belong(.|\n)*made from another camera\.mcap"):
        towval.load(tmp_path / "lab")


@pytest.mark.parametrize("gone", ["camera.mcap", "a/decimate.mcap"])
def test_a_verdict_on_what_could_not_be_made_anew_is_refused(lab, tmp_path, gone):
    """The workflow takes a file away before it makes it anew; where that fails, what was made of it stays."""
    shutil.copytree(lab[0], tmp_path / "lab")
    run, origin, simulated = lab[1]["a"], tmp_path / "lab" / gone, tmp_path / "lab" / "a" / "simulate.mcap"
    origin.write_bytes(b"made before")
    simulated.unlink()
    write_simulated(simulated, run.simulated, provenance("simulate", {}, {origin.name: origin}, run="a"))
    origin.unlink()
    with pytest.raises(InputError, match=f"{origin.name} is missing"):
        towval.load(tmp_path / "lab")


def test_a_copy_of_a_run_under_another_name_is_refused(lab, tmp_path):
    """As one of before: it had counted as a run more."""
    shutil.copytree(lab[0], tmp_path / "lab")
    run, place = lab[1]["a"], tmp_path / "lab" / "a" / "compare.mcap"
    place.unlink()
    made_of = provenance("compare", {}, {}, run="a")
    write_comparison(place, run.comparison, run.object_track, run.simulated, made_of)
    shutil.copytree(tmp_path / "lab" / "a", tmp_path / "lab" / "a_before")
    with pytest.raises(InputError, match=r"does not belong(.|\n)*run a\n(.|\n)*run a_before"):
        towval.load(tmp_path / "lab")


def test_no_stage_depends_on_the_tables(monkeypatch):
    """An edit there runs no stage again, though the package's front door leads to it."""
    found = []
    monkeypatch.setattr("towval.io.provenance._file_digest", lambda path, _: found.append(path.name) or b"")
    module_hash("towval.physics.wrench")
    assert "frames.py" not in found
    assert "wrench.py" in found


def test_a_run_that_the_campaign_leaves_out_is_passed_over(lab, tmp_path):
    """As in summary.csv and in the index: the list of files that the last report made does not name it."""
    shutil.copytree(lab[0], tmp_path / "lab")
    lines = [f"{'0' * 64}  a/{name}.mcap" for name in ("track", "compare")]
    (tmp_path / "lab" / MANIFEST).write_text("\n".join(lines) + "\n")
    assert towval.load(tmp_path / "lab").summary.run.tolist() == ["a"]
