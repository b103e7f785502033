"""The workflow of the package, src/towval/workflow, with config.yaml, and the studies beside it."""


configfile: "config.yaml"


include: "src/towval/workflow/Snakefile"
include: "studies/rules/studies.smk"
include: "studies/rules/evidence.smk"


localrules:
    validation,


# A default target of an included file does not count.
rule validation:
    default_target: True
    input:
        wanted,
