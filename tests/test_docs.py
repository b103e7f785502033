"""The documents agree with the code: links, the index, the drawing of imports, quoted code."""

import ast
import re

import pytest

from studies.evidence.documents import documented, unfounded
from studies.evidence.ledger import read_groups


def documents(repository):
    return [repository / "README.md", *sorted((repository / "docs").glob("*.md"))]


def imports_of(room):
    """Rooms that the modules of a room import."""
    files = room.rglob("*.py") if room.is_dir() else [room]
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            yield from (name.split(".")[1] for name in names if name.startswith("towval."))


def test_links_lead_to_files(repository):
    missing = [
        f"{document.name}: {target}"
        for document in documents(repository)
        for target in re.findall(r"\]\(([^)#\s]+)", document.read_text(encoding="utf-8"))
        if "://" not in target and not (document.parent / target).exists()
    ]
    assert missing == []


def test_the_index_leads_to_the_definitions(repository):
    text = (repository / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [^|]+ \| (`[^|]+`) \| \[([^\]]+)\]\(([^)]+)\)", text, re.MULTILINE)
    assert len(rows) > 10
    for names, shown, target in rows:
        source = (repository / "docs" / target).read_text(encoding="utf-8")
        assert target.endswith(f"src/towval/{shown}")
        for name in re.findall(r"[\w.]+", names):
            own, _, method = name.partition(".")
            pattern = rf"^class {own}\b.*?^    def {method}\b" if method else rf"^(def|class) {own}\b"
            assert re.search(pattern, source, re.MULTILINE | re.DOTALL), f"{target} does not define {name}"


@pytest.mark.parametrize(
    "name", ["README.md", "docs", "src/towval/cli.py", "src/towval/commands", "src/towval/validation"]
)
def test_commands_with_brackets_have_quotes(repository, name):
    """The shell of macOS takes brackets for a pattern, and refuses the call where no file fits."""
    place = repository / name
    # The ledger of evidence quotes calls as they were made.
    files = [place] if place.is_file() else [path for path in place.glob("*.*") if path.stem != "evidence"]
    wrong = [f"{path.name}: {call}" for path in files for call in _BARE.findall(path.read_text(encoding="utf-8"))]
    assert wrong == []


_BARE = re.compile(r"--(?:set|config) [\w.]+=\[[^]\n]*\]")


def test_the_drawing_of_imports_is_that_of_the_code(repository):
    text = (repository / "docs" / "architecture.md").read_text(encoding="utf-8")
    drawn = set(re.findall(r"^  (\w+) --> (\w+)$", text, re.MULTILINE))
    package = repository / "src" / "towval"
    rooms = [path for path in package.iterdir() if path.is_dir() and (path / "__init__.py").exists()]
    rooms.append(package / "cli.py")
    found = {(room.stem, other) for room in rooms for other in imports_of(room) if other != room.stem}
    # Arrows to the lowest room are left out, but for those of the two rooms right above it.
    assert drawn == {(a, b) for a, b in found if b != "model" or a in ("optics", "physics")}


@pytest.mark.parametrize("package", ["towval", "studies"])
def test_documents_name_modules_that_exist(repository, package):
    root = repository / "src" / "towval" if package == "towval" else repository / "studies"
    for document in documents(repository):
        for name in re.findall(rf"`{package}((?:\.\w+)+)`", document.read_text(encoding="utf-8")):
            parts = name.strip(".").split(".")
            # The last one or two parts may be names within a module.
            heads = [root.joinpath(*parts[:end]) for end in range(len(parts), max(0, len(parts) - 2), -1)]
            assert any(
                p.is_dir() or p.with_suffix(".py").exists() for p in [*heads, *([root] if len(parts) < 2 else [])]
            ), f"{document.name} names {package}{name}"


def test_recipes_quote_the_tested_code(repository):
    text = (repository / "docs" / "extending.md").read_text(encoding="utf-8")
    quoted = re.findall(r"`(tests/extending/\w+\.py)`:\n\n```python\n(.*?)\n```", text, re.DOTALL)
    assert len(quoted) == text.count("```python") > 0
    for file, code in quoted:
        assert code in (repository / file).read_text(encoding="utf-8"), f"docs/extending.md quotes {file} as it was"
    named = set(re.findall(r"`(test_\w+\.py)`", text)) - {"test_docs.py", "test_config.py"}
    assert named == {path.name for path in (repository / "tests" / "extending").glob("test_*.py")}


def test_every_number_that_is_stated_has_a_row_in_the_ledger():
    """Else: add a row to studies/evidence/rows.yaml, mark the passage as settings, or leave the number out."""
    assert unfounded(documented(), read_groups()) == []
