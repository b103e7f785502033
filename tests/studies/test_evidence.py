"""The ledger of our own numbers: its rules, its table, its page, and what it finds in documents."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from studies.evidence import compute, show, workflow
from studies.evidence.documents import passages, unfounded
from studies.evidence.ledger import Check, Effort, EvidenceClass, Group, Statement, made_now, read_groups
from studies.evidence.page import faults_of, judged, markdown, read_ledger, write_ledger
from studies.evidence.planting import given, numbers_of, repeated, replaced, result_of
from studies.frame import loaded
from towval.model.errors import InputError, RefusedError, TowvalError

GROUPS = read_groups()
WORLD = SimpleNamespace(length=lambda: 2.0, refuses=False)


def _measure():
    if WORLD.refuses:
        raise RefusedError("it is refused", got="so", allowed="other", remedy="none")
    return {"length": WORLD.length(), "colour": "red"}


CHECK = Check(
    _measure,
    {
        "it is longer": replaced(WORLD, "length", result_of(lambda length: 1.1 * length)),
        "it is refused": replaced(WORLD, "refuses", lambda _: True),
    },
)
MISTAKEN = Check(_measure, {"it has no length": replaced(WORLD, "length", result_of(lambda length: length.missing))})
GROUP = Group(
    "bar", "How long it is, tilted by 20°.", EvidenceClass.OWN, Effort.QUICK, "A bar.", "measure", f"{__name__}:CHECK",
    (Statement("length", "2.0", "m", "within", 0.1), Statement("colour", "red", "", "is")),
)  # fmt: skip


def outcomes(folder):
    found = []
    for fault in ("", *CHECK.faults):
        path = folder / f"bar.{len(found)}.json"
        compute.run_check(f"{__name__}:CHECK", fault, path)
        found.append(path)
    return found


@pytest.mark.parametrize(
    ("rule", "allowed", "measured", "holds"),
    [
        ("within", 0.1, 2.1, True), ("within", 0.1, 2.11, False), ("within", 0.1, float("nan"), False),
        ("factor", 2, 1.0, True), ("factor", 2, 4.1, False), ("at most", 0, 2.0, True), ("at most", 0, 2.1, False),
        ("at least", 0, 2.0, True), ("at least", 0, 1.9, False), ("within", 0.1, None, False),
    ],
)  # fmt: skip
def test_a_number_holds_within_its_tolerance(rule, allowed, measured, holds):
    assert Statement("length", "2.0", "m", rule, allowed).holds(measured) == holds


def test_a_fault_is_planted_and_taken_out_again(tmp_path):
    as_is, longer, refused = (json.loads(path.read_text(encoding="utf-8")) for path in outcomes(tmp_path))
    assert as_is["values"] == {"length": 2.0, "colour": "red"}
    assert longer["values"]["length"] == pytest.approx(2.2)
    assert "refused" in refused["values"]["stopped"]
    assert WORLD.length() == 2.0
    assert as_is["fault"] == ""
    assert longer["commit"]


def test_files_that_changed_since_an_outcome_are_counted(tmp_path, monkeypatch):
    def git(*words):
        settings = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        done = subprocess.run(
            ["git", "-C", str(tmp_path), *settings, *words], check=True, capture_output=True, text=True
        )
        return done.stdout.strip()

    used, other = tmp_path / "used.py", tmp_path / "other.py"
    used.write_text("1\n")
    other.write_text("1\n")
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "-m", "Begin")
    head = git("rev-parse", "HEAD")
    monkeypatch.setattr(compute, "REPOSITORY", tmp_path)
    monkeypatch.setattr(compute, "module_files", lambda _: [used, Path("/elsewhere/library.py")])
    other.write_text("2\n")
    assert compute.changed_since(head, "used:CHECK") == 0
    assert compute.changed_since(head, "used:CHECK", ["other.py"]) == 1  # what runs in another process
    used.write_text("2\n")
    assert compute.changed_since(head, "used:CHECK") == 1
    assert compute.changed_since(f"{head[:7]}+", "used:CHECK") == 1
    assert compute.changed_since("0123456", "used:CHECK") is None


def test_a_group_is_measured_and_shown_as_it_is_and_with_a_fault(monkeypatch, capsys):
    monkeypatch.setattr("studies.evidence.show.read_groups", lambda: {"bar": GROUP})
    for options, status, said in (
        ((), 0, "length: stated 2.0 m (± 0.1), measured 2: holds"),
        (("--fault", "1"), 1, "length: stated 2.0 m (± 0.1), measured 2.2: does not hold"),
        (("--fault", "2"), 1, "* 2: it is refused\ntowval: it is refused\n"),
        (("--fault", "3"), 1, "towval: there is no such fault\n"),
    ):
        with pytest.raises(SystemExit) as ended:
            show.main(["bar", *options])
        assert ended.value.code == status
        assert said in "".join(capsys.readouterr())
    with pytest.raises(SystemExit):
        show.main(["foo"])
    assert "no such group" in capsys.readouterr().err


def test_an_error_of_the_fault_itself_is_not_taken_for_notice(tmp_path):
    with pytest.raises(AttributeError):
        compute.run_check(f"{__name__}:MISTAKEN", "it has no length", tmp_path / "bar.json")


def test_the_page_shows_what_holds_and_what_noticed_the_faults(tmp_path, monkeypatch):
    monkeypatch.setattr("studies.evidence.page.read_groups", lambda: {"bar": GROUP})
    page, data = tmp_path / "evidence.md", tmp_path / "evidence.json"
    write_ledger(outcomes(tmp_path), tmp_path / "none.json", [page, data])
    (first, second) = read_ledger(data)["bar"]["rows"]
    assert first["holds"]
    assert [control["noticed"] for control in first["controls"]] == [True, True]
    assert [control["noticed"] for control in second["controls"]] == [False, True]
    assert "| length | 2.0 m | ± 0.1 | 2 | 2.2, noticed |" in page.read_text(encoding="utf-8")
    hours = {"bar": {"cpu_s": 3600.0, "rows": []}, "rod": {"cpu_s": 1800.0, "rows": []}}
    assert "took 90 minutes of CPU time" in markdown({"bar": GROUP, "rod": replace(GROUP, name="rod")}, hours)
    # What is not made again keeps what is known of it.
    write_ledger([], data, [data])
    assert read_ledger(data)["bar"]["rows"][0] == first


def test_outcomes_that_are_kept_are_decided_by_the_present_rows_and_faults(tmp_path, monkeypatch):
    data, wider = tmp_path / "evidence.json", Statement("length", "2.0", "m", "within", 0.3)

    def rows_for(group):
        monkeypatch.setattr("studies.evidence.page.read_groups", lambda: {"bar": group})
        write_ledger([], data, [data])
        return read_ledger(data)["bar"]["rows"]

    monkeypatch.setattr("studies.evidence.page.read_groups", lambda: {"bar": GROUP})
    write_ledger(outcomes(tmp_path), tmp_path / "none.json", [data])
    (first, _) = rows_for(replace(GROUP, statements=(wider, *GROUP.statements[1:])))
    assert [control["noticed"] for control in first["controls"]] == [False, True]
    (first, second) = rows_for(replace(GROUP, check=f"{__name__}:MISTAKEN"))
    assert first["controls"] == second["controls"] == []
    assert first["measured"] == 2.0


def test_a_row_that_does_not_hold_and_a_fault_that_nobody_notices_end_with_an_error(tmp_path, monkeypatch):
    strict = replace(GROUP, statements=(Statement("length", "1.5", "m", "within", 0.1),))
    lax = replace(GROUP, statements=(Statement("length", "2.0", "m", "within", 9.0),))
    made = [json.loads(path.read_text(encoding="utf-8")) for path in outcomes(tmp_path)]
    assert faults_of("bar", judged(strict, made, {})) == ["bar, length: 2.0, not 1.5"]
    assert faults_of("bar", judged(lax, made, {})) == ["bar: no row notices that it is longer"]
    without = {**made[1], "values": {"colour": "red"}}
    assert faults_of("bar", judged(lax, [made[0], without], {}))[0] == "bar: no row notices that it is longer"
    unrefused = judged(replace(GROUP, statements=(*lax.statements, *strict.statements)), made[:2], {})
    assert faults_of("bar", unrefused)[-1] == "bar, length: no fault fails it"
    monkeypatch.setattr("studies.evidence.page.read_groups", lambda: {"bar": strict})
    with pytest.raises(TowvalError, match="does not hold"):
        write_ledger(outcomes(tmp_path), tmp_path / "none.json", [tmp_path / "evidence.json"])
    assert not read_ledger(tmp_path / "evidence.json")["bar"]["rows"][0]["holds"]


def test_ways_to_plant_a_fault():
    calls = []
    assert repeated(3)(calls.append)(1) is None
    assert calls == [1, 1, 1]
    assert given(size=2)(lambda size: size)(size=1) == 2
    assert numbers_of([("speed", "", "46 × (2.03 s)", True)]) == {"speed": 46.0, "speed, 2": 2.03}


def test_what_is_needed_and_not_here_is_named(tmp_path, monkeypatch):
    (tmp_path / "a_program").touch(mode=0o755)
    monkeypatch.setenv("TOWVAL_VIEWERS", str(tmp_path))
    needs = ("real/nothing", "no_such_module", "json", "a_program")
    assert Check(_measure, {}, needs=needs).missing(tmp_path) == ["real/nothing", "no_such_module"]


PAGE = """# Bar

It is 2.0 m long at 20°.
<!-- evidence: bar -->

## Settings

<!-- settings -->
It stops at 5 mm, and `7 mm` and `<!-- evidence: foo -->` in code.

## Table

| what | length |
|---|---|
| bar 9 | 2.0 |

<!-- evidence: bar -->

```
80 mm
```
"""


def test_a_document_with_marks_is_founded():
    found = list(passages("page.md", PAGE))
    assert [(each.groups, each.settings) for each in found] == [(("bar",), False), ((), True), (("bar",), False)]
    assert [each.numbers for each in found] == [["2.0", "20"], ["5"], ["2.0"]]
    assert unfounded(found, {"bar": GROUP}) == []
    # A column of what is required is no result.
    required = PAGE.replace("| what | length |", "| what | required | length |").replace("|---|---|", "|---|---|---|")
    assert unfounded(list(passages("page.md", required.replace("| 2.0 |", "| 7 | 2.0 |"))), {"bar": GROUP}) == []


@pytest.mark.parametrize(
    ("stated", "written", "founds"),
    [
        ("12.6", "13", True), ("12.6", "12", False), ("0.0126", "12.6", True), ("0.0126", "13", True),
        ("12600", "12.6", True), ("1.26e-5", "1.3e-5", True), ("1.26e-5", "1.2e-5", False), ("2.6", "3", False),
        ("0", "0", True), ("0", "0.0", True), ("1.26", "0.0", False), ("0.2", "0", False), ("4870", "4,870", True),
    ],
)  # fmt: skip
def test_a_number_is_founded_as_it_is_rounded_or_in_another_unit(stated, written, founds):
    bar = replace(GROUP, statements=(Statement("length", stated, "mm", "within", 1),), conditions=("77",))
    row = PAGE.replace("| bar 9 | 2.0 |", f"| bar 9 | {written} |").replace("It is 2.0 m long at 20°.", "At 20°, 77 g.")
    assert (unfounded(list(passages("page.md", row)), {"bar": bar}) == []) == founds
    # Conditions found a sentence, not the results of a table.
    assert (
        "no row has 77"
        in unfounded(list(passages("page.md", row.replace(f"9 | {written}", "9 | 77"))), {"bar": bar})[0]
    )


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("at 20°", "at 20°, 3 mm too short", "no row has 3"), ("at 20°", "at 20°, 1.7 times", "no row has 1.7"),
        ("bar -->\n\n## S", "foo -->\n\n## S", "no group foo"),
        ("<!-- settings -->\n", "", "without a mark"), ("| bar 9 | 2.0 |", "| bar 9 | 2.1 |", "no row has 2.1"),
        ("| bar 9 | 2.0 |", "| bar 9 | 2.04 |", "no row has 2.04"),
        ("| bar 9 | 2.0 |", "| bar 9 | 3 |", "no row has 3"),
        ("stops at 5 mm", "is off by 5 mm RMS", "speaks of what was measured"),
        ("stops at 5 mm", "stops at 5 mm, as 9 of 10", "speaks of what was measured"),
        ("stops at 5 mm", "stops, on lab_a after 5 mm", "speaks of what was measured"),
        ("stops at 5 mm", "stops. On lab_a, of 5 mm, a share of 0.2", "speaks of what was measured"),
        ("stops at 5 mm", "takes 0.1 s of CPU time for 5 mm", "speaks of what was measured"),
        ("stops at 5 mm", "is late, by 5 mm", "speaks of what was measured"),
    ],
)  # fmt: skip
def test_what_a_document_states_without_a_row_is_found(old, new, what):
    assert old in PAGE
    wrong = unfounded(list(passages("page.md", PAGE.replace(old, new))), {"bar": GROUP})
    assert what in wrong[0]


@pytest.mark.parametrize("name", GROUPS)
def test_every_check_has_faults_that_can_be_planted(name):
    """What they replace is found by name: a rename showed only when the check ran."""
    check = loaded(GROUPS[name].check)
    assert isinstance(check, Check)
    assert check.faults
    for fault in check.faults.values():
        with fault():
            pass


def test_the_ledger_in_the_documents_is_that_of_the_table(repository):
    """Each row of the table is in the JSON as it is stated, and the page is made from the JSON."""
    found = read_ledger(repository / "docs" / "evidence.json")
    stated = {name: [(each.name, each.stated) for each in group.statements] for name, group in GROUPS.items()}
    assert {name: [(row["name"], row["stated"]) for row in found[name]["rows"]] for name in found} == stated
    assert (repository / "docs" / "evidence.md").read_text(encoding="utf-8") == markdown(GROUPS, found)


def test_every_row_that_was_made_holds_and_has_a_control_that_fails(repository):
    found = read_ledger(repository / "docs" / "evidence.json")
    made = {name: group for name, group in found.items() if "date" in group}
    assert len(made) > 10
    assert [fault for name, group in made.items() for fault in faults_of(name, group)] == []


def test_long_checks_are_made_when_they_are_asked_for():
    efforts = {"bar": Effort.QUICK, "rod": Effort.WHOLE, "lap": Effort.LONG}
    groups = {name: replace(GROUP, name=name, effort=effort) for name, effort in efforts.items()}
    assert list(made_now(groups, [Effort.QUICK], ())) == ["bar"]
    assert list(made_now(groups, [Effort.QUICK, Effort.WHOLE], ())) == ["bar", "rod"]
    assert list(made_now(groups, [Effort.QUICK, Effort.WHOLE], ["lap"])) == ["lap"]
    for wrong in ("bar", "none"):
        with pytest.raises(InputError, match=wrong):
            made_now(groups, [Effort.QUICK], [wrong])


def test_the_page_tells_long_checks_from_the_others():
    groups = {"bar": replace(GROUP, effort=Effort.LONG), "rod": replace(GROUP, name="rod")}
    page = markdown(groups, {"bar": {"cpu_s": 600.0, "rows": []}, "rod": {"rows": []}})
    assert "took 0 minutes of CPU time" in page
    assert "when asked for, took 10 more" in page
    assert "Made by its own command, `snakemake evidence --config long=[bar]`" in page
    assert "- Made: never" in page


def test_a_table_that_cannot_be_read_is_refused_by_name(tmp_path):
    (tmp_path / "rows.yaml").write_text("bar: {says: x, class: magic, effort: quick, states: {}}", encoding="utf-8")
    with pytest.raises(InputError, match="bar"):
        read_groups(tmp_path / "rows.yaml")


_FORKING = """
import multiprocessing, os, time
from concurrent.futures import ProcessPoolExecutor

def work(_):
    until = time.process_time() + 0.1
    while time.process_time() < until:
        pass

with ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool:
    list(pool.map(work, range(2)))
print(os.times().children_user + os.times().children_system)
"""


def test_a_planted_slowdown_reaches_processes_that_are_forked(tmp_path):
    """The report draws in such processes."""
    (tmp_path / "sitecustomize.py").write_text(workflow._SLOWER.replace("400_000_000", "1"))
    (tmp_path / "forking.py").write_text(_FORKING)
    line = [sys.executable, str(tmp_path / "forking.py")]
    as_is, slower = (
        float(subprocess.check_output(line, env={**os.environ, "PYTHONPATH": path})) for path in ("", str(tmp_path))
    )
    assert as_is == pytest.approx(0.2, abs=0.05)
    assert slower == pytest.approx(2.5 * as_is, rel=0.3)
