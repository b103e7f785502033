from studies.evidence.compute import REPOSITORY, shared_folder
from studies.evidence.ledger import ROWS, read_groups

EVIDENCE = or_exit(read_groups)
WANTED_EFFORTS = ("quick",) if STUDY_SETTINGS.quick else ("quick", "whole")


def checks_to_make():
    """Groups whose checks run now, with the names of their faults, the program as it is first."""
    found = {}
    for name, group in EVIDENCE.items():
        if group.effort in WANTED_EFFORTS:
            check = or_exit(loaded, group.check)
            if not check.missing(shared_folder()):
                found[name] = ["", *check.faults]
    return found


def evidence_outcomes(wildcards):
    made = checks_to_make()
    return [str(RESULTS / "evidence" / f"{name}.{k}.json") for name in made for k in range(len(made[name]))]


localrules:
    evidence,


rule evidence_check:
    output:
        str(RESULTS / "evidence" / "{group}.{number}.json"),
    log:
        str(RESULTS / "evidence" / "logs" / "{group}.{number}.log"),
    wildcard_constraints:
        group="|".join(EVIDENCE),
        number="[0-9]+",
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        call="studies.evidence.compute:run_check",
        code=lambda wildcards: code_with("studies.evidence.compute", EVIDENCE[wildcards.group].check),
        arguments=lambda wildcards, input, output: dict(
            check=EVIDENCE[wildcards.group].check,
            fault=checks_to_make()[wildcards.group][int(wildcards.number)],
            output=output[0],
        ),
    message:
        "evidence: {wildcards.group}, control {wildcards.number}"
    script:
        "../../src/towval/workflow/scripts/run.py"


# The ledger in docs/ is written beside the output: rows that are not made now keep what it says.
rule evidence:
    input:
        evidence_outcomes,
    output:
        str(RESULTS / "evidence" / "evidence.json"),
    log:
        str(RESULTS / "evidence" / "logs" / "evidence.log"),
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    params:
        call="studies.evidence.page:write_ledger",
        code=code("studies.evidence.page"),
        rows=file_hash(ROWS),
        arguments=lambda wildcards, input, output: dict(
            outcomes=list(input),
            memory=str(REPOSITORY / "docs" / "evidence.json"),
            outputs=[output[0], *(str(REPOSITORY / "docs" / f"evidence.{ending}") for ending in ("json", "md"))],
        ),
    message:
        "the ledger of our own numbers: docs/evidence.md"
    script:
        "../../src/towval/workflow/scripts/run.py"
