"""Rule figure: tables of the studies → one figure of the paper as PDF, SVG and PNG."""

from pathlib import Path

from towval.commands.paper_figures import draw
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    tables = {Path(table).stem: Path(table) for table in snakemake.input}
    draw(snakemake.wildcards.figure, snakemake.params.plan, tables, Path(snakemake.output[0]).parent)
