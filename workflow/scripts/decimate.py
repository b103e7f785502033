"""Rule decimate: track.mcap → decimate.mcap."""

from pathlib import Path

from towval.commands.decimate import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(Path(snakemake.input[0]), Path(snakemake.output[0]), snakemake.params.settings)
