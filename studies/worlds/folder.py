"""Synthetic campaigns as folders, such as a lab would hand in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import yaml

from studies.worlds.campaign import FRAMES, RATE_HZ, bending_tow, synthetic_campaign
from studies.worlds.film import write_video
from studies.worlds.scenes import Motion
from towval.io.atomic import write_text
from towval.model import Array


def write_campaign(folder: Path, seed: int = 0, frames: int = FRAMES) -> dict[str, Array]:
    """Write the synthetic campaign of :func:`studies.worlds.campaign.bending_tow`.

    Returns
    -------
    dict
        The ground truth: ``time_s`` (n,), ``rover`` and ``object`` poses (n, 3) [m, m, rad].
    """
    return film_campaign(folder, *bending_tow(frames), seed=seed)


def film_campaign(
    folder: Path,
    rover: Motion,
    towed: Array,
    given: dict[str, Any] | None = None,
    seed: int = 0,
    height_errors: tuple[float, float] = (0.0, 0.0),
) -> dict[str, Array]:
    """Film a rover and an object and write all that a lab hands in: ``campaign.yaml``, ``calibration/``, ``a.mp4``.

    The arguments are those of :func:`studies.worlds.campaign.synthetic_campaign`; returns the ground truth, as
    :func:`write_campaign`.
    """
    made = synthetic_campaign(rover, towed, given, seed, height_errors)
    pictures = folder / "calibration"
    pictures.mkdir(parents=True)
    for name, picture in made.pictures.items():
        cv2.imwrite(str(pictures / name), picture)
    write_video(folder / "a.mp4", made.film(), rate=RATE_HZ, crf="16")
    write_text(folder / "campaign.yaml", yaml.safe_dump(made.document, sort_keys=False))
    return {"time_s": made.time_s, "rover": made.rover, "object": made.towed}
