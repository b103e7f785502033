"""Rule identify: all runs of a campaign → identify.mcap, identify.csv."""

from pathlib import Path

from towval.commands.identify import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        Path(snakemake.params.results),
        Path(snakemake.output.values),
        snakemake.params.settings,
    )
