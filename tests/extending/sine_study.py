"""A study from outside the package: error and cost of a truncated sine series."""

import math

from studies.costs import cpu_seconds
from studies.frame import Scatter, Study
from studies.registry import TRADEOFF


def rows(terms):
    """A row a number of terms: CPU time of 1,000 sums and error of the sine of one."""

    def series():
        return sum((-1) ** k / math.factorial(2 * k + 1) for k in range(terms))

    cost = cpu_seconds(lambda: [series() for _ in range(1000)])
    error = abs(series() - math.sin(1.0))
    setting = {"panel": "", "series": "Taylor", "setting": f"{terms} terms", "default": terms == 3}
    return [setting | {"cost": cost, "error": error}]


STUDY = Study(
    parts=lambda settings: {f"terms_{n}": {"terms": n} for n in ((1, 3) if settings.quick else (1, 2, 3, 4))},
    rows=rows,
    chart=Scatter("Sine of one", "CPU time of 1,000 sums [s]", "error", "Truncated Taylor series."),
)

TRADEOFF.register("sine", "sine_study:STUDY")
