from studies.paper.studies import paper_parts

PLAN = or_exit(read_yaml, HERE / "workflow" / "plan.yaml")
or_exit(check, PLAN, packaged_schema("plan.schema.yaml"), "plan")

PARTS = or_exit(paper_parts, PLAN)


# What a part varies is in the part itself: a longer sweep runs its new parts only.
SCENE = {name: section for name, section in PLAN.items() if name not in ("sensitivity", "closed_loop", "table_1")}


rule study_part:
    output:
        paper("parts", "{study}", "{part}.csv"),
    log:
        paper("logs", "{study}_{part}.log"),
    benchmark:
        paper("benchmarks", "{study}_{part}.tsv")
    wildcard_constraints:
        study="|".join(PARTS),
        part="[A-Za-z0-9_]+",
    conda:
        "../envs/towval.yaml"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        call="studies.paper.part_command:run_part",
        code=code("studies.paper.part_command"),
        arguments=lambda wildcards, input, output: dict(
            scene=SCENE,
            study=wildcards.study,
            part=PARTS[wildcards.study][wildcards.part],
            output=output[0],
        ),
    message:
        "paper, study {wildcards.study}: part {wildcards.part}"
    script:
        "../scripts/run.py"


rule study_table:
    input:
        lambda wildcards: [paper("parts", wildcards.study, f"{part}.csv") for part in PARTS[wildcards.study]],
    output:
        paper("tables", "{study}.csv"),
    log:
        paper("logs", "{study}.log"),
    wildcard_constraints:
        study="|".join(PARTS),
    conda:
        "../envs/towval.yaml"
    params:
        call="studies.tables_command:gather",
        code=code("studies.tables_command"),
        arguments=lambda wildcards, input, output: dict(
            parts=list(input),
            output=output[0],
        ),
    message:
        "paper, study {wildcards.study}: one table"
    script:
        "../scripts/run.py"


rule plan:
    output:
        mcap=paper("plan", "{curve}.mcap"),
        csv=paper("plan", "{curve}.csv"),
    log:
        paper("logs", "plan_{curve}.log"),
    conda:
        "../envs/towval.yaml"
    params:
        call="towval.commands.plan:run",
        code=code("towval.commands.plan"),
        arguments=lambda wildcards, input, output: dict(
            scene=SCENE,
            wanted=wildcards.curve,
            mcap=output.mcap,
            csv=output.csv,
        ),
    message:
        "paper: plan of the rover on the curve {wildcards.curve}, to be sent to a rover"
    script:
        "../scripts/run.py"
