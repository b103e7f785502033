"""From a campaign folder to figures and report; the experiment, top to bottom."""

from snakemake.utils import min_version

min_version("9.5")


configfile: "config.yaml"


include: "workflow/rules/common.smk"


localrules:
    all,
    decimate,
    simulate,
    compare,
    report,
    paper_table,
    study_table,
    paper_chart,
    study_chart,
    tradeoff,
    stability,


rule all:
    default_target: True
    input:
        wanted,


include: "workflow/rules/calibrate.smk"
include: "workflow/rules/run.smk"
include: "workflow/rules/identify.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/exchange.smk"
include: "workflow/rules/studies.smk"
