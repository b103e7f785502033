"""The fingerprint of code: it changes with the modules that a command uses, and with no others."""

import ast
import shutil
from pathlib import Path

import pytest

import towval
from towval.io import provenance


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package that a test may edit."""
    folder = tmp_path / "towval"
    shutil.copytree(provenance._PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(provenance, "_PACKAGE", folder)
    provenance._source_folder.cache_clear()
    yield folder
    provenance._source_folder.cache_clear()


def edit(path):
    with path.open("a") as stream:
        stream.write("\n# edited\n")


@pytest.mark.parametrize(
    "module", ["validation/decimate.py", "model/tracks.py", "io/records/tracks.py", "commands/decimate.py"]
)
def test_an_edit_in_a_used_module_changes_it(package, module):
    before = provenance.module_hash("towval.commands.decimate")
    edit(package / module)
    assert provenance.module_hash("towval.commands.decimate") != before


def test_an_edit_elsewhere_does_not(package):
    before = provenance.module_hash("towval.commands.decimate")
    edit(package / "optics" / "projection.py")
    assert provenance.module_hash("towval.commands.decimate") == before


def test_a_schema_counts_for_those_who_read_it(package):
    before = provenance.module_hash("towval.commands.calibrate")
    edit(package / "io" / "campaign.schema.yaml")
    assert provenance.module_hash("towval.commands.calibrate") != before


def test_a_file_left_out_does_not_count(package):
    schema = package / "io" / "campaign.schema.yaml"
    before = provenance.module_hash("towval.commands.calibrate", without=[schema])
    edit(schema)
    assert provenance.module_hash("towval.commands.calibrate", without=[schema]) == before
    edit(package / "io" / "campaign.py")
    assert provenance.module_hash("towval.commands.calibrate", without=[schema]) != before


def test_a_study_changes_with_what_it_imports_from_the_package(package):
    before = provenance.module_hash("studies.maps.integrators")
    edit(package / "physics" / "wrench.py")
    assert provenance.module_hash("studies.maps.integrators") != before


def test_a_plugin_of_one_file_counts_with_what_it_imports(tmp_path, monkeypatch):
    """Its own text and that of a neighbour, which is one file, too."""
    monkeypatch.syspath_prepend(tmp_path)
    plugin, neighbour = tmp_path / "lone_plugin.py", tmp_path / "lone_neighbour.py"
    plugin.write_text("import lone_neighbour\n")
    neighbour.write_text("")
    hashes = [provenance.module_hash("lone_plugin")]
    for path in (plugin, neighbour):
        edit(path)
        hashes.append(provenance.module_hash("lone_plugin"))
    assert len(set(hashes)) == 3


def test_versions_name_the_libraries():
    found = provenance.versions()
    assert found["towval"] == towval.__version__
    assert {"numpy", "scipy", "python"} <= found.keys()


def test_no_import_escapes_the_pattern():
    """Every module of the repository, read by Python's own parser as well."""
    for path in sorted(provenance._PACKAGE.rglob("*.py")):
        wanted = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                wanted |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        files = {file for name in wanted for file in provenance._module_files(name)}
        assert files <= set(provenance._imported(path, 0)), path


@pytest.mark.parametrize(
    "text",
    [
        "from neighbour import (  # the one (beside)\n    first,\n    second,\n)",
        "import json, neighbour as n",
        "def f():\n    from neighbour import \\\n        first",
        "try:\n    import neighbour\nexcept ImportError:\n    pass",
    ],
)
def test_imports_of_any_form_are_followed(text, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "neighbour.py").write_text("")
    (tmp_path / "lone.py").write_text(text)
    assert provenance._imported(tmp_path / "lone.py", 0) == (tmp_path / "neighbour.py",)
    provenance._single_file.cache_clear()


@pytest.mark.parametrize("folder", ["site-packages", "dist-packages"])
def test_libraries_of_another_environment_are_no_source_of_ours(tmp_path, monkeypatch, folder):
    """Packages of the system or of the user, below a virtual environment: their version says what they are."""
    library = tmp_path / "usr" / folder / "some_library"
    library.mkdir(parents=True)
    (library / "__init__.py").write_text("import __main__\n")
    (tmp_path / "other_plugin.py").write_text("import some_library\n")
    for path in (tmp_path, library.parent):
        monkeypatch.syspath_prepend(path)
    for kept in (provenance._single_file, provenance._source_folder, provenance._files_below):
        kept.cache_clear()
    assert provenance._closure(tmp_path / "other_plugin.py") == {tmp_path / "other_plugin.py"}


@pytest.mark.parametrize(
    ("file", "module"),
    [
        ("report/templates/macros.html.j2", "towval.commands.report"),
        ("report/templates/run.html.j2", "towval.commands.report"),
        ("io/layouts/lichtblick.json", "towval.commands.exchange"),
    ],
)
def test_what_a_template_names_and_a_layout_count(package, file, module):
    before = provenance.module_hash(module)
    edit(package / file)
    assert provenance.module_hash(module) != before


def test_plugins_of_one_name_are_told_apart():
    paths = [Path("/labs/one/laws.py"), Path("/labs/two/laws.py"), Path("/labs/two/lens.py")]
    assert provenance._by_name(paths) == dict(zip(["one/laws.py", "two/laws.py", "lens.py"], paths, strict=True))
