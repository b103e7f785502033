"""Rule uncertainty: what the error of a run may be if the model is right → uncertainty.mcap."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.uncertainty import run

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        snakemake.wildcards.run,
        Path(snakemake.input.camera),
        Path(snakemake.input.track).parent,
        Path(snakemake.output[0]),
        snakemake.params.settings,
    )
