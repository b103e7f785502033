"""What the command line offers beside its stages: completion, JSON."""

import json
import os
import subprocess
import sys

import pytest

from result_folders import make_run
from towval.cli import main


@pytest.mark.parametrize(
    ("line", "offered"),
    [("towval cal", {"calibrate "}), ("towval track lab --", {"--camera", "--run", "--json", "--set"})],
)
def test_a_shell_is_told_how_the_line_may_go_on(tmp_path, line, offered):
    answer = tmp_path / "answer"
    shell = {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line, "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
    }  # fmt: skip
    subprocess.run([sys.executable, "-m", "towval.cli"], env=os.environ | shell, check=True)
    assert offered <= set(answer.read_text().split("\n"))


def test_help_on_a_stage_begins_with_the_name_of_its_file_as_it_is(capsys):
    for stage, begin in (("decimate", "track.mcap → "), ("track", "Video of a run → ")):
        with pytest.raises(SystemExit):
            main([stage, "--help"])
        assert f"\n{begin}" in capsys.readouterr().out


def test_one_json_object_stands_for_what_people_read(tmp_path, capsys):
    make_run(tmp_path / "results" / "lab" / "a")
    output = tmp_path / "index.sqlite"
    main(["index", str(tmp_path / "results"), "-o", str(output), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["stage"] == "index"
    assert told["files"] == [str(output), str(output.with_suffix(".html"))]
    assert told["verdicts"] == {"agrees": 1}


@pytest.mark.parametrize("written", ["embed_mb", "report.embed_mb"])
def test_a_key_of_the_stage_may_be_written_as_for_all_stages(tmp_path, capsys, written):
    with pytest.raises(SystemExit):
        main(["report", str(tmp_path), "--results", str(tmp_path), "--set", f"{written}=5000"])
    assert "report: embed_mb is 5000; allowed: at least 0 and at most 400" in capsys.readouterr().err


def test_a_value_that_is_no_yaml_is_told_with_its_key(capsys):
    with pytest.raises(SystemExit):
        main(["run", "lab", "--set", "report.formats=[png"])
    assert "--set report.formats=[png is not valid YAML" in capsys.readouterr().err


@pytest.mark.parametrize(("given", "used"), [({}, "1"), ({"OMP_NUM_THREADS": "2"}, "2")])
def test_blas_has_one_thread_unless_the_user_says_otherwise(given, used):
    # What is set when the command line, and with it NumPy, is imported.
    code = (
        "import importlib, os, sys\n"
        "from towval.__main__ import main\n"
        "def imported(name):\n"
        "    sys.exit(print(os.environ['OMP_NUM_THREADS'], 'numpy' in sys.modules))\n"
        "importlib.import_module = imported\n"
        "main()"
    )
    environment = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"} | given
    ended = subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True)
    assert ended.stdout.split() == [used, "False"]
