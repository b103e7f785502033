"""What the system refuses Snakemake is one message of ``towval run``; a fault of a program stays a traceback."""

import signal

import pytest
from snakemake.cli import parse_config

from towval.commands.workflow import _as_yaml, _system_errors_reported

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


def test_a_file_that_is_missing_is_no_lack_of_room():
    last = "FileNotFoundError: [Errno 2] No such file or directory: 'settings.yaml'\n"
    (told,) = _system_errors_reported([*FRAMES, last])
    assert "'settings.yaml'\n  what to do: correct that path" in told


@pytest.mark.parametrize("program", ["__main__.py", "python3 -m snakemake", "snakemake"])
def test_an_option_that_snakemake_refuses_is_one_line(program):
    """It printed all of its options before, more than a hundred lines."""
    usage = [f"usage: {program} [-h] [--dry-run]\n", "    [--cores N]\n", "    [targets ...]\n"]
    lines = ["track a: error: lost\n", *usage, f"{program}: error: unrecognized arguments: --frobnicate\n"]
    told = "towval: Snakemake refuses its options: unrecognized arguments: --frobnicate\n"
    assert list(_system_errors_reported(lines)) == ["track a: error: lost\n", told]


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


QUOTED = ['it\'s "quoted"', "lab'", '"lab"']
NAMES = [*QUOTED, "1", "True", "[x]", "-dash", "lab", "a/b", "lab #2", "a: b", "a:", "lab ", "日本 🎈"]


@pytest.mark.parametrize("name", [*NAMES, *(f"/tmp/{name}" for name in NAMES)])
def test_a_path_reaches_the_workflow_as_it_is(name):
    """As plain text ``lab #2`` was read as ``lab``: the results of one campaign went to, or came from, another."""
    assert parse_config([f"campaign={_as_yaml(name)}"]) == {"campaign": name}


def test_a_traceback_that_the_end_of_the_call_cuts_off_is_left_out():
    assert list(_system_errors_reported(["before\n", *FRAMES], [signal.SIGINT])) == ["before\n"]
    assert list(_system_errors_reported(["before\n", *FRAMES])) == ["before\n", *FRAMES], "ended by nobody we know"
