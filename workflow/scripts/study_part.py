"""Rule study_part: one part of a study of the paper → its rows."""

from pathlib import Path

from towval.commands.paper import run_part
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run_part(snakemake.params.scene, snakemake.wildcards.study, snakemake.params.part, Path(snakemake.output[0]))
