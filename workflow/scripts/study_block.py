"""Rule study_block: one part of a chart of the studies → its rows."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.study_block import run_block

with told(Path(snakemake.log[0])):
    run_block(snakemake.wildcards.chart, snakemake.params.part, Path(snakemake.output[0]))
