"""Tables: each is a command that says how it is called."""

import importlib
import pkgutil

import pytest

from studies import tables

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
