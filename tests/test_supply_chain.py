"""What is installed is what the project asks for, to the byte, and named once."""

import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version


def locked(repository, name):
    """Version and number of hashes of each package of a lock file."""
    found = {}
    text = (repository / "requirements" / name).read_text().replace("\\\n", " ")
    for line in text.splitlines():
        match = re.fullmatch(r"([A-Za-z0-9._-]+)==(\S+)( ; [^-]*?)?((?:\s+--hash=sha256:[0-9a-f]{64})+)\s*", line)
        assert match, f"{name}: {line[:100]} is not locked"
        found.setdefault(canonicalize_name(match[1]), []).append(Version(match[2]))
    return found


@pytest.mark.parametrize(("name", "extras"), [("run.txt", ()), ("dev.txt", ("dev",))])
def test_every_dependency_is_locked_within_its_range(repository, name, extras):
    project = tomllib.loads((repository / "pyproject.toml").read_text())["project"]
    asked = project["dependencies"] + [row for extra in extras for row in project["optional-dependencies"][extra]]
    asked += (repository / "requirements" / "build.in").read_text().split()
    versions = locked(repository, name)
    for row in map(Requirement, asked):
        found = versions.get(canonicalize_name(row.name), [])
        assert found, f"{row.name} is not in {name}: make lock"
        assert all(version in row.specifier for version in found), f"{row} is locked to {found[0]}: make lock"


def test_the_oldest_versions_are_those_where_the_ranges_begin(repository):
    project = tomllib.loads((repository / "pyproject.toml").read_text())["project"]
    text = (repository / "requirements" / "oldest.txt").read_text()
    versions = {canonicalize_name(name): Version(v) for name, v in re.findall(r"(?m)^([\w.-]+)==([^\s;]+)", text)}
    for row in map(Requirement, project["dependencies"] + project["optional-dependencies"]["dev"]):
        begin = next(Version(each.version) for each in row.specifier if each.operator == ">=")
        found = versions.get(canonicalize_name(row.name))
        assert found is not None, f"{row.name} is not in oldest.txt: make lock"
        assert found in row.specifier, f"{row.name} {found} is not in its range: make lock"
        # The first version of a minor one need not work with the other packages.
        assert (found.major, found.minor) == (begin.major, begin.minor), f"{row.name} {found} is newer: make lock"


def test_both_lock_files_agree(repository):
    run, dev = locked(repository, "run.txt"), locked(repository, "dev.txt")
    assert run.items() <= dev.items()


def test_no_host_is_named(repository):
    for name in ("run.txt", "dev.txt"):
        text = (repository / "requirements" / name).read_text()
        assert "://" not in text
        assert "--index-url" not in text


def test_every_locked_package_has_its_licence_listed(repository):
    text = (repository / "requirements" / "licences.md").read_text()
    listed = {canonicalize_name(name) for name in re.findall(r"^\| ([A-Za-z0-9._-]+) +\|", text, re.MULTILINE)}
    elsewhere = {"colorama", "pywin32", "win-unicode-console", "tzdata", "pyreadline3"}  # other systems' packages
    assert locked(repository, "run.txt").keys() - listed <= elsewhere
