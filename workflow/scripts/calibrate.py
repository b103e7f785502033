"""Rule calibrate: pictures of the board → camera.mcap."""

from pathlib import Path

from towval.commands.calibrate import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(Path(snakemake.params.campaign), Path(snakemake.output[0]), snakemake.params.settings)
