"""Rule study_table: the parts of a study → one table."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.tables import gather

with told(Path(snakemake.log[0])):
    gather([Path(part) for part in snakemake.input], Path(snakemake.output[0]))
