"""Rule simulate: decimate.mcap → simulate.mcap."""

from pathlib import Path

from towval.commands.simulate import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        Path(snakemake.input.track),
        Path(snakemake.input.decimated),
        Path(snakemake.output[0]),
        snakemake.params.keys,
    )
