"""The stages' results as MCAP files and back: one pair of functions per file of ``results/``.

Topics are those of docs/formats.md. What fits no ROS message (findings, covariances of parameters, names of outcomes)
is in the file's attachment ``details.json``.
"""

from towval.io.records.calibration import camera_place, read_calibration, write_calibration
from towval.io.records.results import (
    error_messages,
    read_comparison,
    read_simulated,
    read_uncertainty,
    write_comparison,
    write_simulated,
    write_uncertainty,
)
from towval.io.records.tracks import read_decimated, read_tracks, write_decimated, write_tracks

__all__ = [
    "camera_place", "error_messages", "read_calibration", "read_comparison", "read_decimated", "read_simulated",
    "read_tracks", "read_uncertainty", "write_calibration", "write_comparison", "write_decimated", "write_simulated",
    "write_tracks", "write_uncertainty",
]  # fmt: skip
