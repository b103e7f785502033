"""Command compare: track.mcap, simulate.mcap and uncertainty.mcap → compare.mcap."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from towval.commands.console import Outcome
from towval.commands.settings import settings_from
from towval.io.chain import check_together
from towval.io.provenance import provenance
from towval.io.records import read_simulated, read_tracks, read_uncertainty, write_comparison
from towval.model import Verdict
from towval.report.wording import at_most, millimetres
from towval.validation.compare import CompareSettings, compare


def run(
    name: str, track: Path, simulated: Path, uncertainty: Path, output: Path, keys: Mapping[str, Any] | None = None
) -> Outcome:
    """Compare the simulated with the measured path of the object."""
    settings = settings_from(CompareSettings, keys, "compare")
    files = {"track.mcap": track, "simulate.mcap": simulated, "uncertainty.mcap": uncertainty}
    check_together(files, run=name)
    measured, motion = read_tracks(track)["object"], read_simulated(simulated)
    comparison = compare(name, motion, measured, read_uncertainty(uncertainty), settings)
    write_comparison(output, comparison, measured, motion, provenance("compare", settings, files, run=name))
    names = ("path_rms_m", "path_max_m", "error_upper_m", "tolerance_m", "detectable_m", "u_val_m")
    numbers = {"verdict": comparison.verdict.value, **{name: float(getattr(comparison, name)) for name in names}}
    cited = np.isfinite(comparison.error_upper_m) and comparison.verdict is not Verdict.NOT_JUDGED
    bound = f"off by at most {at_most(comparison.error_upper_m)}; " if cited else ""
    text = f"{comparison.verdict}; {bound}simulated minus measured path {millimetres(comparison.path_rms_m)} RMS"
    return Outcome(f"compare {name}", (output,), text, numbers, comparison.findings)
