"""What a command says at its end: lines for people, or one JSON object for programs."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from report_scenes import small_calibration
from towval.commands.calibrate import _how_good
from towval.commands.console import Outcome, progress, show
from towval.model import Finding, Severity
from towval.model.errors import TowvalError

NOTE = Finding(Severity.NOTE, "start_found", "object: found.")
WARNING = Finding(Severity.WARNING, "stamps_jump", "The stamps jump.")
MADE = Outcome(
    "track a",
    (Path("out/track.mcap"),),
    "seen in 9 of 10 frames",
    {"frames": 10, "std_mm": float("nan")},
    (NOTE, WARNING),
)


def test_people_read_findings_and_then_one_line_with_the_file(capsys):
    show(MADE)
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "track a: note: object: found.", "track a: out/track.mcap: seen in 9 of 10 frames"
    ]  # fmt: skip
    assert told.err == "track a: warning: The stamps jump.\n"


def test_lines_are_written_with_their_ends(monkeypatch):
    """Python writes unbuffered in containers, and several stages to one terminal."""
    pieces = []
    for name in ("stdout", "stderr"):
        stream = SimpleNamespace(write=pieces.append, flush=lambda: None, isatty=lambda: False)
        monkeypatch.setattr(sys, name, stream)
    show(replace(MADE, details=("a detail",)))
    with progress("track a", 2) as done:
        done(1)
        done(2)
    assert [piece[-1:] for piece in pieces if piece] == ["\n"] * 6


def test_large_lengths_are_no_powers_of_ten():
    quality = {"position_std_mm at 0 m": 123.4, "position_std_mm at 0.25 m": 3.024}
    said = _how_good(replace(small_calibration(), quality=quality))
    assert "±123.4 mm at 0 m, ±3.02 mm at 0.25 m above the floor" in said


def test_programs_read_one_object_in_which_what_is_unknown_is_null(capsys):
    show(MADE, as_json=True)
    told = capsys.readouterr()
    assert told.err == ""
    assert json.loads(told.out) == {
        "stage": "track a",
        "files": ["out/track.mcap"],
        "frames": 10,
        "std_mm": None,
        "findings": [
            {"code": "start_found", "severity": "note", "text": "object: found."},
            {"code": "stamps_jump", "severity": "warning", "text": "The stamps jump."},
        ],
    }


def test_a_name_reaches_programs_whole_where_the_terminal_has_no_letters_for_it(capsys):
    """In Latin-1 a file was called ?.sqlite, and é was no UTF-8."""
    name = "日é\udcff.sqlite"
    show(Outcome("index", (Path(name),), ""), as_json=True)
    told = capsys.readouterr().out
    assert told.isascii()
    assert json.loads(told)["files"] == [name]


@pytest.mark.parametrize("as_json", [False, True])
def test_a_failure_is_raised_once_all_is_said(capsys, as_json):
    with pytest.raises(TowvalError, match="1 of 2"):
        show(Outcome("index", (Path("i.sqlite"),), "2 runs", failure=TowvalError("1 of 2 runs disagree")), as_json)
    assert "i.sqlite" in capsys.readouterr().out


def test_work_without_a_known_end_shows_that_it_goes_on(capsys, monkeypatch):
    now = iter(range(0, 1000, 15))
    monkeypatch.setattr("time.monotonic", lambda: next(now))
    with progress("uncertainty a", None, "draw") as done:
        for count in range(1, 5):
            done(count)
    assert "uncertainty a: 2 draws\n" in capsys.readouterr().err
