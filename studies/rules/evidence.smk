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
        # What the rows state is not what a check measures: one restated makes none anew.
        code=lambda wildcards: code_with("studies.evidence.compute", EVIDENCE[wildcards.group].check, without=(ROWS,)),
        arguments=lambda wildcards, input, output: dict(
            check=EVIDENCE[wildcards.group].check,
            fault=checks_to_make()[wildcards.group][int(wildcards.number)],
            output=output[0],
        ),
    message:
        "evidence: {wildcards.group}, control {wildcards.number}"
    script:
        "../../src/towval/workflow/scripts/run.py"


# What takes a minute or more goes first: begun last, it would run alone while the other cores wait.
use rule evidence_check as evidence_check_first with:
    wildcard_constraints:
        group="lab_a|calibration_sets|bound_given_error|tracking_a_metre|tracking_memory",
        number="[0-9]+",
    priority: 1


ruleorder: evidence_check_first > evidence_check


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
