"""Rule compare: track.mcap and simulate.mcap → compare.mcap."""

from pathlib import Path

from towval.commands.compare import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        snakemake.wildcards.run,
        Path(snakemake.input.camera),
        Path(snakemake.input.track),
        Path(snakemake.input.simulated),
        Path(snakemake.output[0]),
    )
