"""Rule compare: track.mcap, simulate.mcap and uncertainty.mcap → compare.mcap."""

from pathlib import Path

from towval.commands.compare import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        snakemake.wildcards.run,
        Path(snakemake.input.track),
        Path(snakemake.input.simulated),
        Path(snakemake.input.uncertainty),
        Path(snakemake.output[0]),
        snakemake.params.settings,
    )
