"""Tables: each is a command that says how it is called."""

import importlib
import pkgutil
import re
from pathlib import Path

import pytest

import studies
from studies import tables
from studies.tables import workflow_time

NAMES = [module.name for module in pkgutil.iter_modules(tables.__path__)]


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_a_command_with_help(name, monkeypatch, capsys):
    module = importlib.import_module(f"studies.tables.{name}")
    assert f"python -m studies.tables.{name}" in module.__doc__
    monkeypatch.setattr("sys.argv", [name, "--help"])
    with pytest.raises(SystemExit) as left:
        module.main()
    assert left.value.code == 0
    assert "usage:" in capsys.readouterr().out


def test_a_file_in_place_of_a_campaign_ends_with_one_message(tmp_path, monkeypatch, capsys):
    file = tmp_path / "campaign.yaml"
    file.touch()
    monkeypatch.setattr("sys.argv", ["workflow_time", str(file)])
    with pytest.raises(SystemExit) as left:
        workflow_time.main()
    assert left.value.code == 1
    assert capsys.readouterr().err.startswith("towval: the campaign folder is a file")


def test_every_command_of_the_studies_reports_errors_of_its_input():
    modules = list(Path(studies.__file__).parent.rglob("*.py"))
    commands = [text for text in (module.read_text() for module in modules) if re.search(r"^def main\(", text, re.M)]
    assert len(commands) >= len(NAMES)
    assert all(re.search(r"^@errors_reported\(\)\ndef main\(", text, re.M) for text in commands)
