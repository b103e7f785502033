"""Command of the ledger: outcomes of the checks → ``evidence.md`` and ``evidence.json``."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from studies.evidence.compute import changed_since
from studies.evidence.ledger import Effort, EvidenceClass, Group, Statement, read_groups
from studies.frame import loaded
from towval.io.atomic import write_text
from towval.model.errors import TowvalError

_HEAD = """# Evidence: what is stated of towval, and what it rests on

Made by `snakemake evidence` from `studies/evidence/rows.yaml`; do not edit. The same as data is `evidence.json`. A
number about accuracy, cost or coverage stands in README or on a page of the documentation only with a group here: a
test compares both. Numbers of a set-up, of what was found at another time, and what follows from a row (an interval of
a count) may stand in the words of the group alone. Pages that a command of their own makes are left out, and say when
they were made: the [claims of the paper](claims.md) and the [five scenes](scenes.md), of which the first table is a
group here.

- *Class* says how far the truth is from us: real data of others, another program, our own synthetic worlds, or a cost.
- *Holds* is the stated number's tolerance against what was measured at the date and commit given; a plus behind the
  commit: files differed from it. Where the data or a program is not at hand, and for what takes too long, the last
  outcome stands. *Changed since* counts the files of the check, and of all that it imports, which differ from that
  commit as this page is written, by a word or by a method: 0 is an outcome of the present code; –: that commit is not
  known any more.
- Any of a group's numbers is measured again, with or without a fault, by `python -m studies.evidence.show GROUP`;
  *command* is what a user would run for the like.
- *Control* plants a fault and decides the row again; "noticed" where the row then fails, as it must; None: the number
  is not made then, which is no notice; nan: it is sought and there is none, which is. A fault's words say where it is:
  in the program, in what is given to it, or in the result as it is read, which shows no more than that the row can
  fail. Long checks are not made with the others but when asked for, `snakemake evidence --config long=[GROUP]`.
"""


def write_ledger(outcomes: Sequence[Path], memory: Path, outputs: Sequence[Path]) -> None:
    """Judge all groups and write the ledger.

    Parameters
    ----------
    outcomes : sequence of Path
        JSON files of :func:`studies.evidence.compute.run_check`, named ``<group>.<number>.json``, 0 without a fault.
    memory : Path
        The ledger's last JSON: rows that were not made now keep what it says.
    outputs : sequence of Path
        Files to write: Markdown as ``.md``, data as ``.json``.

    Raises
    ------
    TowvalError
        A row that was made now does not hold or is failed by no fault, or no row notices a fault; after writing.
    """
    groups = read_groups()
    before = read_ledger(memory) if memory.is_file() else {}
    made: dict[str, list[dict[str, Any]]] = {}
    for path in outcomes:
        made.setdefault(path.name.split(".")[0], []).append(json.loads(path.read_text(encoding="utf-8")))
    found = {
        name: judged(group, made.get(name, ()), _as_planted_now(group, before.get(name, {})))
        for name, group in groups.items()
    }
    for name, group in groups.items():
        found[name] |= _age(group, found[name])
    data = _one_row_a_line(found)
    for output in outputs:
        write_text(output, data if output.suffix == ".json" else markdown(groups, found))
    wrong = [fault for name in made for fault in faults_of(name, found[name])]
    if wrong:
        raise TowvalError("the ledger does not hold", got="; ".join(wrong), remedy="see evidence.md")


def read_ledger(path: Path) -> dict[str, Any]:
    """The groups of a ledger's JSON, by name, with the words of each fault in the place of its number."""
    groups: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["groups"]
    for group in groups.values():
        words = group.pop("faults", [])
        for control in _controls(group):
            control["fault"] = words[control["fault"]]
    return groups


def _controls(group: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [control for row in group["rows"] for control in row.get("controls", ())]


def _one_row_a_line(found: Mapping[str, Mapping[str, Any]]) -> str:
    """The ledger as JSON: half the size of an indented one, and a changed row is one changed line.

    The words of a fault stand once a group; each control has their number.
    """
    written = partial(json.dumps, ensure_ascii=False)
    parts = []
    for name, group in found.items():
        faults = {fault: k for k, fault in enumerate(dict.fromkeys(each["fault"] for each in _controls(group)))}
        numbered = (
            row | {"controls": [each | {"fault": faults[each["fault"]]} for each in row["controls"]]}
            if "controls" in row
            else row
            for row in group["rows"]
        )
        rows = ",\n   ".join(map(written, numbered))
        head = written({key: value for key, value in group.items() if key != "rows"} | {"faults": list(faults)})[1:-1]
        parts.append(f'  {written(name)}: {{{head}, "rows": [\n   {rows}\n  ]}}')
    return '{"groups": {\n' + ",\n".join(parts) + "\n}}\n"


def _as_planted_now(group: Group, before: Mapping[str, Any]) -> dict[str, Any]:
    """What was known of a group, without outcomes of faults that its check does not plant any more."""
    planted = set(loaded(group.check).faults)
    rows = [
        row | {"controls": [each for each in row["controls"] if each["fault"] in planted]} if "controls" in row else row
        for row in before.get("rows", ())
    ]
    return {**before, "rows": rows}


def judged(group: Group, outcomes: Sequence[Mapping[str, Any]], before: Mapping[str, Any]) -> dict[str, Any]:
    """A group with its rows decided on outcomes, the first without a fault, or on what was known before."""
    if not outcomes:
        known = {row["name"]: row for row in before.get("rows", ())}
        rows = [known.get(each.name, {}) | _stated(each) for each in group.statements]
        for row, each in zip(rows, group.statements, strict=True):
            if "measured" in row:
                row["holds"] = each.holds(row["measured"])
                row["controls"] = [was | {"noticed": _noticed(each, was["measured"])} for was in row["controls"]]
        last = {key: before[key] for key in ("date", "commit", "machine", "cpu_s") if key in before}
        return {"effort": str(group.effort), "class": str(group.kind), **last, "rows": rows}
    as_is, *faulty = outcomes
    rows = []
    for each in group.statements:
        row = _stated(each) | {"measured": as_is["values"].get(each.name), "controls": []}
        row["holds"] = each.holds(row["measured"])
        for other in faulty:
            measured = other["values"].get(each.name, other["values"].get("stopped"))
            noticed = _noticed(each, measured)
            row["controls"].append({"fault": other["fault"], "measured": measured, "noticed": noticed})
        rows.append(row)
    kept = {key: as_is[key] for key in ("date", "commit", "machine")}
    spent = round(sum(outcome["cpu_s"] for outcome in outcomes), 1)
    return {"effort": str(group.effort), "class": str(group.kind), **kept, "cpu_s": spent, "rows": rows}


def _noticed(each: Statement, measured: float | str | None) -> bool:
    """Whether a row fails under a fault: not where it is not made then; words in place of a number say what stopped."""
    if measured is None:
        return False
    return not each.holds(measured) if each.rule == "is" or not isinstance(measured, str) else True


def _age(group: Group, found: Mapping[str, Any]) -> dict[str, Any]:
    """How many files have changed since an outcome was made, where that can be told."""
    changed = changed_since(found["commit"], group.check, loaded(group.check).runs) if "commit" in found else None
    return {} if changed is None else {"changed_files": changed}


def faults_of(name: str, group: Mapping[str, Any]) -> list[str]:
    """What is wrong with a group that was made: rows that do not hold or that no fault fails, faults unnoticed."""
    wrong = [
        f"{name}, {row['name']}: {row['measured']}, not {row['stated']}" for row in group["rows"] if not row["holds"]
    ]
    controls = _controls(group)
    noticed = {control["fault"] for control in controls if control["noticed"]}
    unnoticed = {control["fault"] for control in controls} - noticed
    wrong += [f"{name}: no row notices that {fault}" for fault in sorted(unnoticed)]
    idle = [row["name"] for row in group["rows"] if not any(control["noticed"] for control in row["controls"])]
    return wrong + [f"{name}, {row}: no fault fails it" for row in idle]


def _stated(each: Any) -> dict[str, Any]:
    return {"name": each.name, "stated": each.stated, "unit": each.unit, "tolerance": each.tolerance}


def markdown(groups: Mapping[str, Group], found: Mapping[str, Mapping[str, Any]]) -> str:
    """The ledger as Markdown: counts by class, a line a group, then each group's rows."""
    rows = [(groups[name], row) for name, group in found.items() for row in group["rows"]]
    head = ("class", "groups", "rows", "hold", "of them by the present code", "do not", "never made")
    lines = [_HEAD, f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for kind in EvidenceClass:
        own = [(group, row) for group, row in rows if group.kind is kind]
        count = Counter("none" if "holds" not in row else str(row["holds"]) for _, row in own)
        names = {group.name for group, _ in own}
        of_now = sum(row.get("holds", False) and found[group.name].get("changed_files") == 0 for group, row in own)
        counts = (len(names), len(own), count["True"], of_now, count["False"], count["none"])
        lines.append(f"| {kind} | {' | '.join(map(str, counts))} |")
    spent = {False: 0.0, True: 0.0}
    for name, group in found.items():
        spent[groups[name].effort is Effort.LONG] += group.get("cpu_s", 0.0) / 60
    lines += ["", f"Checks and their controls took {spent[False]:.0f} minutes of CPU time in all, each as last made."]
    lines += [f"Long ones, which are made when asked for, took {spent[True]:.0f} more."]
    lines += ["", "| group | class | made | rows | hold | control noticed by | date | commit | changed since |"]
    lines += ["|---" * 9 + "|"]
    lines += [_overview(groups[name], group) for name, group in found.items()]
    for name, group in found.items():
        lines += _section(groups[name], group)
    return "\n".join(lines) + "\n"


def _overview(group: Group, found: Mapping[str, Any]) -> str:
    rows = found["rows"]
    holding = sum(bool(row.get("holds")) for row in rows) if any("holds" in row for row in rows) else "–"
    noticing = sum(any(control["noticed"] for control in row.get("controls", ())) for row in rows)
    cells = (
        f"[{group.name}](#{group.name.replace('_', '-')})", group.kind, group.effort, len(rows), holding, noticing,
        found.get("date", "never"), found.get("commit", "–"),
        found.get("changed_files", "–"),
    )  # fmt: skip
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def _section(group: Group, found: Mapping[str, Any]) -> list[str]:
    lines = ["", f"## {group.name.replace('_', ' ')}", "", group.says, ""]
    lines += [f"- Data: {group.data} Class: {group.kind}."]
    lines += [f"- Shared with the program: {group.shares}"] if group.shares else []
    when = f"{found.get('date', 'never')}, commit {found.get('commit', '–')}"
    when += f", on {found['machine']}" if "machine" in found else ""
    by = ""
    if group.effort is Effort.LONG:
        by = f" by its own command, `snakemake evidence --config long=[{group.name}]`"
    lines += [
        f"- Made{by}: {when}" + (f", {found['cpu_s']:g} s of CPU time with its controls." if "cpu_s" in found else ".")
    ]
    lines += [f"- Command: `{group.command}`"]
    lines += ["", group.note.strip()] if group.note else []
    faults = list(dict.fromkeys(each["fault"] for each in _controls(found)))
    lines += ["", f"| statement | stated | holds within | measured |{''.join(f' {fault} |' for fault in faults)}"]
    lines += ["|---" * (4 + len(faults)) + "|"]
    return lines + [_row(row, faults) for row in found["rows"]]


def _row(row: Mapping[str, Any], faults: Sequence[str]) -> str:
    mark = "" if row.get("holds", True) else " **does not hold**"
    controls = {control["fault"]: control for control in row.get("controls", ())}
    cells = [row["name"], f"{row['stated']} {row['unit']}".strip(), row["tolerance"]]
    cells.append(f"{_number(row['measured'])}{mark}" if "measured" in row else "never made")
    for fault in faults:
        control = controls.get(fault)
        cells.append(
            "" if control is None else f"{_number(control['measured'])}{', noticed' if control['noticed'] else ''}"
        )
    return f"| {' | '.join(cells)} |"


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float | int) else str(value)
