"""Rule plan: the rover's plan on a curve of the paper → MCAP and CSV."""

from pathlib import Path

from towval.commands.plan import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(snakemake.params.scene, snakemake.wildcards.curve, Path(snakemake.output.mcap), Path(snakemake.output.csv))
