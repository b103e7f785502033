"""What becomes of a calibration whose pictures, board or stated numbers are wrong.

    python -m studies.tables.calibration_faults [FOLDER]

Every fault of a campaign's calibration (`studies.camera_faults.faults`) is planted into a copy of it. The table gives
the difference of positions over the picture to the calibration of the campaign as it is, RMS on the worst of the planes
of the floor and the tops, in brackets the deviation that is stated there, and what is reported.
"""

import argparse
import contextlib
import io
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from zlib import crc32

import numpy as np
import yaml

from studies.camera_faults.faults import FAULTS, Fault
from towval.commands import calibrate
from towval.commands.console import errors_reported
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration
from towval.model import Calibration, Severity
from towval.model.errors import TowvalError
from towval.optics.plane_uncertainty import pixel_grid, uncertainty_map
from towval.optics.projection import to_plane

_OF_VIDEO = ("clicks", "one corner clicked", "tops", "bumped")
"""Faults of these names touch no picture of the board, or leave to `track` what the calibration cannot know."""


def calibrated(campaign: Path, fault: Fault, strength: float) -> Calibration:
    """The calibration of a copy of a campaign with a fault; raises what the command raises."""
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / campaign.name
        shutil.copytree(campaign, copy, ignore=shutil.ignore_patterns("*_truth.csv"))
        document = yaml.safe_load((copy / "campaign.yaml").read_text(encoding="utf-8"))
        if fault.campaign is not None:
            seed = crc32(f"{campaign.name} {fault.name} {strength}".encode())
            fault.campaign(copy, document, strength, np.random.default_rng(seed))
        (copy / "campaign.yaml").write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            calibrate.run(copy, copy / "camera.mcap")
        return read_calibration(copy / "camera.mcap")


@dataclass(frozen=True)
class Cell:
    """What a fault of some strength does: the worst plane's difference of positions, what is stated there, codes.

    NaN where the calibration is refused.
    """

    fault: str
    strength: str
    off_mm: float
    stated_mm: float
    codes: tuple[str, ...]

    @property
    def refused(self) -> bool:
        """Whether there is no calibration."""
        return np.isnan(self.off_mm)

    def __str__(self) -> str:
        return f"{self.strength}: " + ("refused" if self.refused else f"{self.off_mm:.2f} mm ({self.stated_mm:.2f})")


def cells(campaign: Path) -> Iterator[Cell]:
    """All faults of a campaign's calibration, at all strengths."""
    heights_m = (0.0, *(body.tracked_plane_height_m for body in load_campaign(campaign).bodies))
    sound = calibrated(campaign, FAULTS[0], 1)
    for fault in FAULTS:
        if fault.campaign is None or fault.film is not None or fault.name.startswith(_OF_VIDEO):
            continue
        for strength in fault.strengths:
            text = f"{strength:g} {fault.unit}".strip()
            try:
                found = calibrated(campaign, fault, strength)
            except TowvalError as error:
                # A refusal ends without a record of findings; its text is theirs.
                turned = "against those of the floor" in str(error)
                yield Cell(fault.name, text, np.nan, np.nan, ("held-flipped",) if turned else ())
                continue
            codes = {each.code for each in found.findings if each.severity is not Severity.NOTE}
            yield Cell(fault.name, text, *_worst_plane(sound, found, heights_m), tuple(sorted(codes)))


def _worst_plane(sound: Calibration, found: Calibration, heights_m: tuple[float, ...]) -> tuple[float, float]:
    """Difference and stated deviation on the worst plane [mm]."""
    pixels = pixel_grid(sound.camera.resolution_px, 12)
    worst, stated = 0.0, 0.0
    for height in heights_m:
        apart = to_plane(found.camera, found.floor, pixels, height) - to_plane(
            sound.camera, sound.floor, pixels, height
        )
        rms_mm = 1e3 * float(np.sqrt(np.mean(np.sum(apart**2, axis=-1))))
        if rms_mm >= worst:
            worst, stated = rms_mm, 1e3 * uncertainty_map(found, height).rms_m
    return worst, stated


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", nargs="?", type=Path, default=Path("data_samples/lab_small"), metavar="FOLDER")
    campaign = parser.parse_args().campaign
    print("| fault | weak | middle | strong | findings |\n|---|---|---|---|---|")
    for fault, grouped in groupby(cells(campaign), key=lambda cell: cell.fault):
        own = list(grouped)
        codes = sorted({code for cell in own for code in cell.codes})
        print(f"| {fault} | {' | '.join(map(str, own))} | {', '.join(codes)} |", flush=True)


if __name__ == "__main__":
    main()
