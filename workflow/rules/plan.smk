from towval.study.paper_studies import paper_parts

PLAN = told(read_yaml, HERE / "workflow" / "plan.yaml")
told(check, PLAN, packaged_schema("plan.schema.yaml"), "plan")

PARTS = told(paper_parts, PLAN)


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
        scene=SCENE,
        part=lambda wildcards: PARTS[wildcards.study][wildcards.part],
        code=code("study_part"),
    message:
        "paper, study {wildcards.study}: part {wildcards.part}"
    script:
        "../scripts/study_part.py"


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
        code=code("study_table"),
    message:
        "paper, study {wildcards.study}: one table"
    script:
        "../scripts/study_table.py"


rule plan:
    output:
        mcap=paper("plan", "{curve}.mcap"),
        csv=paper("plan", "{curve}.csv"),
    log:
        paper("logs", "plan_{curve}.log"),
    conda:
        "../envs/towval.yaml"
    params:
        scene=SCENE,
        code=code("plan"),
    message:
        "paper: plan of the rover on the curve {wildcards.curve}, to be sent to a rover"
    script:
        "../scripts/plan.py"
