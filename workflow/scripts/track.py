"""Rule track: a video → track.mcap."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.track import run

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        snakemake.wildcards.run,
        Path(snakemake.input.camera),
        Path(snakemake.output[0]),
        snakemake.params.settings,
    )
