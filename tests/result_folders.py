"""Folders of results as the workflow leaves them, with details and provenance but no messages."""

import json
from collections.abc import Mapping
from pathlib import Path

from towval.io.mcap_file import write_mcap
from towval.model.conventions import STAGES_OF_RUN

COMPARED = {"run": "a", "verdict": "agrees", "path_rms_m": 0.0015, "u_val_m": 0.003, "lost_frames": 2, "findings": []}

SHARES = {"stiffness": 0.3, "friction": 0.1, "noise and interactions": 0.6}
"""What no single input explains has a share, too, and is no input."""


def make_run(
    folder: Path,
    *,
    up_to: str = "compare",
    version: str = "1.0.0",
    video: str = "00",
    friction: str = "00",
    shares: Mapping[str, float] = SHARES,
    **compared: object,
):
    provenance = {
        "inputs_sha256": json.dumps({"a.mp4": video, "track.mcap": "ff"}),
        "campaign_sha256": json.dumps({"friction": friction}),
        "settings": json.dumps({"samples": 512}),
        "versions": json.dumps({"towval": version}),
    }
    for stage in STAGES_OF_RUN[: STAGES_OF_RUN.index(up_to) + 1]:
        details: dict[str, object] = {"findings": []}
        if stage == "track":
            row = {"severity": "warning", "code": "blur", "text": "Blurred."}
            details = {"object": {"findings": [row]}, "rover": {"findings": []}}
        if stage == "uncertainty":
            details["shares"] = dict(shares)
        if stage == "compare":
            details = {**COMPARED, **compared}
        write_mcap(folder / f"{stage}.mcap", [], details, provenance)
    (folder / "benchmarks").mkdir()
    for name, seconds in (("track", 4.0), ("simulate", 1.5)):
        (folder / "benchmarks" / f"{name}.tsv").write_text(f"s\tcpu_time\n{seconds}\t{2 * seconds}\n")
