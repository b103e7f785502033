"""The command ``towval report``: what it refuses before it writes, and what it says of inputs and origin."""

import json
import shlex
from dataclasses import replace

import pytest

from towval.cli import _arguments, _keys, main
from towval.commands.report import _inputs, _provenance, _stated
from towval.io.campaign import load_campaign
from towval.io.chain import Origin
from towval.io.mcap_file import write_mcap
from towval.model.towing import FloorRegion


@pytest.mark.parametrize(
    ("place", "words"), [("elsewhere", "is not among the results"), ("results", ".csv is missing")]
)
def test_what_the_list_of_files_cannot_name_is_refused_first(lab_small, tmp_path, capsys, place, words):
    identified = tmp_path / place / "identify.mcap"
    with pytest.raises(SystemExit):
        main(["report", str(lab_small), "--results", str(tmp_path / "results"), "--identified", str(identified)])
    assert words in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


def test_the_factors_of_regions_are_shown_not_the_change_of_them(lab_small):
    given = load_campaign(lab_small)
    corner = [[0, 0], [1, 0], [0, 1]]
    ground = replace(given.scene.ground, regions=(FloorRegion(corner, 1.3), FloorRegion(corner, 0.8)))
    deviations = {**given.deviations, "regions": 0.02}
    rows = _inputs(replace(given, scene=replace(given.scene, ground=ground), deviations=deviations))
    shown = {row.name: (row.value, row.std) for row in rows}
    assert shown["friction of the floor's regions"] == ("(1.3, 0.8)", "0.02")


def test_the_command_of_the_report_makes_the_same_folder(lab_small, tmp_path):
    results = tmp_path / "some results" / "lab_small"
    settings = json.dumps({"lens_models": ["k1 k2"], "folds": 6, "position_limit_m": 1e-05})
    origin = {"stage": "calibrate", "run": "", "versions": "{}", "settings": settings}
    write_mcap(results / "camera.mcap", [], {}, {**origin, "inputs_sha256": "{}", "campaign_sha256": "{}"})
    given = replace(load_campaign(lab_small), runs={})
    program, *words = shlex.split(_provenance(given, results).command)
    parsed = _arguments().parse_args(words)
    assert (program, parsed.stage) == ("towval", "run")
    assert parsed.results / load_campaign(parsed.campaign).name == results
    # With the settings that are not the defaults: a reader who copies the line gets the same numbers.
    assert _keys(parsed.keys, parsed.stage) == {"calibrate.lens_models": ["k1 k2"], "calibrate.position_limit_m": 1e-5}


def test_the_command_of_the_report_states_no_setting_of_one_run_for_all():
    """The default of the other run did not count: the line made that run with the setting of the first."""
    one, other = (Origin("decimate", "", {}, {}, settings=json.dumps({"excess": excess})) for excess in (2.5, 3.0))
    assert list(_stated([one, other])) == []
    assert list(_stated([one, one])) == ["--set", "decimate.excess=2.5"]
