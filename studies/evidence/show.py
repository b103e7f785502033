"""One group of the ledger, measured now: what is stated beside what comes out.

    python -m studies.evidence.show GROUP [--fault NUMBER]

``--fault`` plants one of the group's faults, which are listed with their numbers. Nothing is written.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext

from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Group, Values, read_groups
from studies.frame import loaded
from towval.commands.console import errors_reported
from towval.model.errors import InputError


@errors_reported()
def main(arguments: list[str] | None = None) -> None:
    """Measure a group of the ledger and print its rows; the exit status is 1 where one does not hold."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("group", help="name of a group, as in docs/evidence.md")
    parser.add_argument("--fault", type=int, default=0, metavar="NUMBER", help="plant this fault; 0, the default: none")
    options = parser.parse_args(arguments)
    group, check = _group(options.group)
    faults = ["", *check.faults]
    if not 0 <= options.fault < len(faults):
        raise InputError("there is no such fault", got=options.fault, allowed=f"0 to {len(faults) - 1}")
    for number, fault in enumerate(faults):
        print(f"{'*' if number == options.fault else ' '} {number}: {fault or 'the program as it is'}")
    with check.faults[faults[options.fault]]() if options.fault else nullcontext():
        values = check.measure()
    print("\n".join(lines(group, values)))
    sys.exit(not all(each.holds(values.get(each.name)) for each in group.statements))


def _group(name: str) -> tuple[Group, Check]:
    groups = read_groups()
    if name not in groups:
        raise InputError("there is no such group", got=name, allowed=", ".join(groups))
    check: Check = loaded(groups[name].check)
    if missing := check.missing(shared_folder()):
        raise InputError(
            "the check needs what is not here", got=", ".join(missing), remedy="install it, or set TOWVAL_SHARED"
        )
    return groups[name], check


def lines(group: Group, values: Values) -> list[str]:
    """The rows of a group, what is stated beside what was measured."""
    found = []
    for each in group.statements:
        measured = values.get(each.name)
        text = f"{measured:.4g}" if isinstance(measured, float | int) else str(measured)
        verdict = "holds" if each.holds(measured) else "does not hold"
        found.append(f"{each.name}: stated {each.stated} {each.unit} ({each.tolerance}), measured {text}: {verdict}")
    return found


if __name__ == "__main__":
    main()
