"""Check of what the tests notice of the tuned constants: each halved and doubled."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import replace

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced
from studies.tables import mutants
from towval.model.constants import constants_of

ASKED = mutants.Asked(jobs=1)
_HERE = sys.modules[__name__]
_QUICK = "test_*_limits.py"
_MODULES = sum(len(constants_of(room)) for room in mutants.ROOMS)


def _noticed() -> Values:
    """How many of the changes are noticed, by module and in all, and which are not."""
    tried: dict[str, list[bool]] = defaultdict(list)
    survived = []
    for mutant, test in mutants.outcomes(ASKED):
        room = mutant.room.rpartition(".")[2]
        tried[f"{room}/{mutant.module}, noticed"].append(bool(test))
        if not test:
            survived.append(f"{mutant.module}.{mutant.name} x {mutant.factor:g}")
    counts = [sum(found) for found in tried.values()]
    all_of = sum(len(found) for found in tried.values())
    found = {name: f"{sum(each)} of {len(each)}" for name, each in tried.items()}
    return found | {
        "all": f"{sum(counts)} of {all_of} ({100 * sum(counts) / all_of:.0f} %)",
        "not noticed": ", ".join(sorted(survived)) or "none",
    }


MUTANTS = Check(
    _noticed,
    {
        "a constant of each module is left as it is, and its quickest tests run": both(
            replaced(mutants, "FACTORS", lambda _: (1.0,)),
            replaced(
                _HERE, "ASKED", lambda asked: replace(asked, size=_MODULES, tests="test_*_limits.py", seconds=0.1)
            ),
        )
    },
    runs=("src/towval/tracking", "src/towval/calibration", "tests/tracking", "tests/calibration"),
)
