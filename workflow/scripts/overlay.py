"""Rule overlay: a run's footage with measured and simulated outlines drawn on it."""

from pathlib import Path

from towval.commands.overlay import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        snakemake.wildcards.run,
        Path(snakemake.input.camera),
        Path(snakemake.input.track).parent,
        Path(snakemake.output[0]),
        snakemake.params.width_px,
    )
