"""``identify.mcap``: identified inputs as details, the predicted motion of each run as poses; and ``identify.csv``."""

from pathlib import Path

import numpy as np
import pandas as pd

from towval.io import ros
from towval.io.mcap_file import Message, read_mcap, write_mcap
from towval.io.records.details import details_with, findings_in, planar_poses, result_reader, rows_of, with_nan
from towval.model import Identification, Prediction


def write_identification(path: Path, identified: Identification, provenance: dict[str, str]) -> None:
    """Write ``identify.mcap``: on ``/<run>/object/pose_predicted`` each run as the others predict it."""
    messages = [
        Message(f"/{p.run}/object/pose_predicted", ros.nanoseconds(t), ros.stamped_pose(t, pose))
        for p in identified.predictions
        for t, pose in zip(p.time_s, p.pose, strict=True)
    ]
    details = {
        "parameters": list(identified.parameters),
        "runs": list(identified.runs),
        "given": identified.given.tolist(),
        "given_std": identified.given_std.tolist(),
        "values": identified.values.tolist(),
        "covariance": identified.covariance,
        "identifiable": list(identified.identifiable),
        "predictions": [
            {
                "run": p.run,
                "values": p.values.tolist(),
                "given_rms_m": p.given_rms_m,
                "predicted_rms_m": p.predicted_rms_m,
            }
            for p in identified.predictions
        ],
        "findings": rows_of(identified.findings),
    }
    write_mcap(path, messages, details, provenance)


@result_reader
def read_identification(path: Path) -> Identification:
    """Read ``identify.mcap``.

    Raises `InputError` when the file is missing, damaged or of another stage.
    """
    content = read_mcap(path)
    details = details_with(content, path, "identifiable")
    predictions = []
    for entry in details["predictions"]:
        topic = f"/{entry['run']}/object/pose_predicted"
        poses = [value.pose for value in content.values(topic)]
        predictions.append(Prediction(time_s=content.times_s(topic), pose=planar_poses(poses), **with_nan(entry)))
    p = len(details["parameters"])
    return Identification(
        parameters=tuple(details["parameters"]),
        runs=tuple(details["runs"]),
        given=details["given"],
        given_std=details["given_std"],
        values=details["values"],
        covariance=np.array(details["covariance"], dtype=np.float64).reshape(p, p),
        identifiable=tuple(details["identifiable"]),
        predictions=tuple(predictions),
        findings=findings_in(details["findings"]),
    )


def identified_table(identified: Identification) -> str:
    """The text of ``identify.csv``: a row a parameter, with a column for the value that each run's prediction used."""
    std = np.sqrt(np.diag(identified.covariance))
    table = pd.DataFrame(
        {
            "parameter": identified.parameters,
            "given": identified.given,
            "given_std": identified.given_std,
            "identified": identified.values,
            "identified_std": std,
            "identifiable": identified.identifiable,
            **{f"without_{p.run}": p.values for p in identified.predictions},
        }
    )
    return str(table.to_csv(index=False, float_format="%.9g", lineterminator="\n"))
