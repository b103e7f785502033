"""Rules tradeoff and stability: all charts of a product → its summary and the page of the studies."""

from pathlib import Path

from towval.commands.shared import told
from towval.commands.study import write_product

with told(Path(snakemake.log[0])):
    summary = Path(snakemake.output[0])
    write_product(summary.stem, summary.parent, summary)
