"""Rule study_chart: the parts of a chart → one table and one figure."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.study import draw_chart

with told(Path(snakemake.log[0])):
    draw_chart(snakemake.wildcards.chart, [Path(block) for block in snakemake.input], Path(snakemake.output.table))
