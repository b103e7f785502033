"""Rule report: all results of a campaign → figures, summary.csv, report.html."""

from pathlib import Path

from towval.commands.report import run
from towval.commands.shared import told

with told(Path(snakemake.log[0])):
    run(
        Path(snakemake.params.campaign),
        Path(snakemake.params.results),
        snakemake.params.settings,
        next(map(Path, snakemake.input.get("identified", [])), None),
    )
