"""What the system refuses Snakemake is one message of ``towval run``; a fault of a program stays a traceback."""

import signal
from pathlib import Path

import pytest
from snakemake.cli import parse_config

from towval.commands.workflow import _as_path, _system_errors_reported

FRAMES = ["Traceback (most recent call last):\n", "\n", '  File "cli.py", line 1, in main\n', "    os.makedirs(path)\n"]


@pytest.mark.parametrize(
    "last", ["OSError: [Errno 28] No space left on device\n", "PermissionError: [Errno 13] Permission denied: '/x'\n"]
)
def test_a_refusal_is_one_message(last):
    reported = list(_system_errors_reported(["before\n", *FRAMES, last, "after\n"]))
    assert reported[0] == "before\n"
    assert reported[-1] == "after\n"
    assert len(reported) == 3
    assert last.split("] ")[1].strip() in reported[1]
    assert "Traceback" not in reported[1]


def test_a_log_that_cannot_be_written_is_told_once():
    """Each line of the log that a full disk refuses brought its traceback, call stack and arguments."""
    full = "OSError: [Errno 28] No space left on device\n"
    call_stack = ["Call stack:\n", '  File "cli.py", line 1, in main\n', "Message: 'Building'\n", "Arguments: ()\n"]
    chained = [full, "During handling of the above exception, another exception occurred:\n", *FRAMES, full]
    lines = ["before\n", *FRAMES, full, *call_stack, *FRAMES, full, *call_stack, *chained, "after\n"]
    reported = list(_system_errors_reported(lines))
    assert [reported[0], reported[-1], len(reported)] == ["before\n", "after\n", 3]


def test_a_second_call_at_once_is_told_to_wait():
    """Snakemake advises --unlock, which ``towval run`` does not take and which two calls at once do not survive."""
    told = [
        "LockException:\n",
        "Error: Directory cannot be locked.\n",
        "/work\n",
        "removed with the --unlock argument.\n",
    ]
    reported = list(_system_errors_reported(["before\n", *told, "after\n"]))
    assert [reported[0], reported[-1], len(reported)] == ["before\n", "after\n", 3]
    assert "wait until it has ended" in reported[1]


@pytest.mark.parametrize("last", ["ZeroDivisionError: division by zero\n", ""])
def test_a_fault_of_a_program_stays_whole(last):
    lines = [*FRAMES, *([last] if last else [])]
    assert list(_system_errors_reported(lines)) == lines


def test_an_interruption_of_snakemake_is_no_traceback():
    lines = ["before\n", *FRAMES, "KeyboardInterrupt\n", "after\n"]
    assert list(_system_errors_reported(lines)) == ["before\n", "after\n"]


@pytest.mark.parametrize("name", ["1", "True", "[x]", "-dash", "lab", "a/b"])
def test_a_path_is_no_number(name):
    assert _as_path(Path(name)) == f"./{name}"
    assert _as_path(Path("/") / name) == f"/{name}"


@pytest.mark.parametrize("name", ['it\'s "quoted"', "lab'", '"lab"'])
def test_quotes_at_the_end_of_a_path_reach_the_workflow(name):
    assert Path(parse_config([f"campaign={_as_path(Path(name))}"])["campaign"]) == Path(name)


def test_a_traceback_that_the_end_of_the_call_cuts_off_is_left_out():
    assert list(_system_errors_reported(["before\n", *FRAMES], [signal.SIGINT])) == ["before\n"]
    assert list(_system_errors_reported(["before\n", *FRAMES])) == ["before\n", *FRAMES], "ended by nobody we know"
