"""Command decimate: track.mcap → decimate.mcap."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from towval.commands.console import Outcome
from towval.commands.settings import settings_from
from towval.io.chain import check_together
from towval.io.provenance import provenance
from towval.io.records import read_tracks, write_decimated
from towval.report.wording import decimal
from towval.validation.decimate import DecimateSettings, decimate


def run(track: Path, output: Path, keys: Mapping[str, Any] | None = None) -> Outcome:
    """Decimate the tracks of a run."""
    settings = settings_from(DecimateSettings, keys, "decimate")
    run_name = check_together({"track.mcap": track})
    decimated = {name: decimate(body, settings) for name, body in read_tracks(track).items()}
    write_decimated(output, decimated, provenance("decimate", settings, {"track.mcap": track}, run=run_name))
    noise = {f"{name}_noise_mm": 1e3 * float(np.hypot(*body.noise[:2])) for name, body in decimated.items()}
    kept = {f"{name}_poses": len(body.time_s) for name, body in decimated.items()}
    text = "; ".join(
        f"{name} {len(body.time_s)} of {body.frames} poses, noise of one ±{decimal(noise[f'{name}_noise_mm'])} mm"
        for name, body in decimated.items()
    )
    found = tuple(dict.fromkeys(one for body in decimated.values() for one in body.findings))
    return Outcome(f"decimate {run_name}".strip(), (output,), text, {**kept, **noise}, found)
