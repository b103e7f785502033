"""The fingerprint of code: it changes with the modules that a script uses, and with no others."""

import shutil

import pytest

import towval
from towval.io import provenance


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package that a test may edit."""
    folder = tmp_path / "towval"
    shutil.copytree(provenance._PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(provenance, "_PACKAGE", folder)
    return folder


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "decimate.py"
    path.write_text("from towval.commands.decimate import run\n")
    return path


@pytest.mark.parametrize("module", ["decimate.py", "types/tracks.py", "io/records/tracks.py", "commands/decimate.py"])
def test_an_edit_in_a_used_module_changes_it(package, script, module):
    before = provenance.code_hash(script)
    with (package / module).open("a") as stream:
        stream.write("\n# edited\n")
    assert provenance.code_hash(script) != before


def test_an_edit_elsewhere_does_not(package, script):
    before = provenance.code_hash(script)
    with (package / "vision" / "camera.py").open("a") as stream:
        stream.write("\n# edited\n")
    assert provenance.code_hash(script) == before


def test_a_schema_counts_for_those_who_read_it(package, tmp_path):
    script = tmp_path / "calibrate.py"
    script.write_text("from towval.io.campaign import load_campaign\n")
    before = provenance.code_hash(script)
    with (package / "io" / "campaign.schema.yaml").open("a") as stream:
        stream.write("\n# edited\n")
    assert provenance.code_hash(script) != before


def test_versions_name_the_libraries():
    found = provenance.versions()
    assert found["towval"] == towval.__version__
    assert {"numpy", "scipy", "python"} <= found.keys()
