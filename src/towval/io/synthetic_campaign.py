"""Synthetic campaigns as folders, such as a lab would hand in."""

from __future__ import annotations

from pathlib import Path

import cv2
import yaml

from towval.io.atomic import write_text
from towval.io.film import write_video
from towval.synthetic.campaign import FRAMES, RATE_HZ, synthetic_campaign
from towval.types import Array


def write_campaign(folder: Path, seed: int = 0, frames: int = FRAMES) -> dict[str, Array]:
    """Write a synthetic campaign with one run ``a``.

    Parameters
    ----------
    folder : Path
        Where to; it gets ``campaign.yaml``, ``calibration/`` and ``a.mp4``.
    seed, frames : int, optional
        Of noise and clicks; pictures of the run.

    Returns
    -------
    dict
        The truth: ``time_s`` (n,), ``rover`` and ``object`` poses (n, 3) [m, m, rad].
    """
    made = synthetic_campaign(seed, frames)
    pictures = folder / "calibration"
    pictures.mkdir(parents=True)
    for name, picture in made.pictures.items():
        cv2.imwrite(str(pictures / name), picture)
    write_video(folder / "a.mp4", made.film(), rate=RATE_HZ, crf="16")
    write_text(folder / "campaign.yaml", yaml.safe_dump(made.document, sort_keys=False))
    return {"time_s": made.time_s, "rover": made.rover, "object": made.towed}
