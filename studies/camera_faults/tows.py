"""Synthetic tows to plant faults into: a drive, a scene and a camera of their own for each seed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from studies.camera_faults.trial import Footage, footage
from studies.worlds.campaign import FRAMES, random_tow
from studies.worlds.folder import film_campaign
from towval.commands import calibrate
from towval.model import Array


@contextmanager
def filmed_tow(seed: int) -> Iterator[tuple[Footage, Path]]:
    """The footage of a random tow whose truth is known, and the calibration of its camera."""
    with TemporaryDirectory() as scratch:
        folder, camera = Path(scratch) / "synthetic", Path(scratch) / "camera.mcap"
        folder.mkdir()
        truth = film_campaign(folder, *random_tow(seed, FRAMES), seed=seed)
        _truth_table(truth).to_csv(folder / "a_truth.csv", index=False)
        calibrate.run(folder, camera)
        yield footage(folder, "a", float(truth["time_s"][-1]), camera), camera


def _truth_table(truth: dict[str, Array]) -> pd.DataFrame:
    """Poses as in the table of truth beside filmed runs."""
    columns = {"t_s": truth["time_s"]}
    for body in ("rover", "object"):
        for part, values in zip(("x_m", "y_m", "heading_rad"), truth[body].T, strict=True):
            columns[f"{body}_{part}"] = values
    return pd.DataFrame(columns)
