"""Rule claims: tables of the studies → the ledger of the paper's claims and its machine-readable twin."""

from pathlib import Path

from towval.commands.claims import write_ledger
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    tables = {Path(table).stem: Path(table) for table in snakemake.input}
    write_ledger(snakemake.params.plan, tables, [Path(path) for path in snakemake.output])
