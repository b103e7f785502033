"""Rule simulate: decimate.mcap → simulate.mcap."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.simulate import run

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        Path(snakemake.input.track),
        Path(snakemake.input.decimated),
        Path(snakemake.output[0]),
        snakemake.params.settings,
        camera=Path(snakemake.input.camera),
    )
