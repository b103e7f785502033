"""How the sample within the package was made: run a of data_samples/lab_small, with its pictures compressed further.

    python data_samples/make_demo.py data_samples/lab_small src/towval/sample

The wheel stays below 3 MB with it. For tests and examples take data_samples/lab_small.
"""

import shutil
import sys
from pathlib import Path

import cv2
import yaml

QUALITY = 60
RUN = "a"


def main(source, target):
    """Write the sample of the package."""
    (target / "calibration").mkdir(parents=True, exist_ok=True)
    for path in sorted((source / "calibration").glob("*.jpg")):
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        cv2.imwrite(str(target / "calibration" / path.name), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    campaign = yaml.safe_load((source / "campaign.yaml").read_text())
    campaign["runs"] = {RUN: campaign["runs"][RUN]}
    text = yaml.safe_dump(campaign, sort_keys=False, default_flow_style=None, width=120)
    (target / "campaign.yaml").write_text(text)
    shutil.copy(source / f"{RUN}.mp4", target)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
