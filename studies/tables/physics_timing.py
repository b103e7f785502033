"""How the physics benchmarks take times."""

from __future__ import annotations

import time
from collections.abc import Callable


def least_cpu(run: Callable[[], object], repeats: int = 5) -> float:
    """Least CPU time of a call [s], the first, which may compile, left out."""
    run()
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        spent.append(time.process_time() - start)
    return min(spent)
