"""Rule exchange: all of a run → exchange.mcap and layouts with which viewers open it."""

from pathlib import Path

from towval.commands.exchange import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        snakemake.wildcards.run,
        Path(snakemake.input.camera),
        Path(snakemake.input.track).parent,
        Path(snakemake.input.overlay),
        Path(snakemake.output.file),
    )
