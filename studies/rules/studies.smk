include: "common.smk"


localrules:
    paper_table,
    study_table,
    paper_chart,
    study_chart,
    tradeoff,
    stability,


# One frame for all studies: part -> table -> chart -> page. studies/registry.py names the studies and charts; those of
# the paper go to results/figures, the products tradeoff and stability to results/study.
rule paper_part:
    output:
        paper("parts", "{study}", "{part}.csv"),
    log:
        paper("logs", "{study}_{part}.log"),
    benchmark:
        paper("benchmarks", "{study}_{part}.tsv")
    wildcard_constraints:
        study="|".join(registry.PAPER),
        part="[A-Za-z0-9_-]+",
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        call="studies.compute:run_part",
        code=lambda wildcards: code_with("studies.compute", STUDIES[wildcards.study]),
        arguments=lambda wildcards, input, output: dict(
            study=STUDIES[wildcards.study],
            part=parts_of(wildcards.study)[wildcards.part],
            output=output[0],
            short=STUDY_SETTINGS.quick,
        ),
    message:
        "study {wildcards.study}: part {wildcards.part}"
    script:
        "../../src/towval/workflow/scripts/run.py"


use rule paper_part as study_part with:
    output:
        product("blocks", "{study}", "{part}.csv"),
    log:
        product("logs", "{study}_{part}.log"),
    benchmark:
        product("benchmarks", "{study}_{part}.tsv")
    wildcard_constraints:
        study="|".join(CHARTED),
        part="[A-Za-z0-9_-]+",


rule paper_table:
    input:
        lambda wildcards: [paper("parts", wildcards.study, f"{part}.csv") for part in parts_of(wildcards.study)],
    output:
        paper("tables", "{study}.csv"),
    log:
        paper("logs", "{study}.log"),
    wildcard_constraints:
        study="|".join(registry.PAPER),
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    params:
        call="studies.compute:gather",
        code=code("studies.compute"),
        arguments=lambda wildcards, input, output: dict(
            parts=list(input),
            output=output[0],
        ),
    message:
        "study {wildcards.study}: table"
    script:
        "../../src/towval/workflow/scripts/run.py"


use rule paper_table as study_table with:
    input:
        lambda wildcards: [product("blocks", wildcards.study, f"{part}.csv") for part in parts_of(wildcards.study)],
    output:
        product("{study}.csv"),
    log:
        product("logs", "{study}_table.log"),
    wildcard_constraints:
        study="|".join(CHARTED),


rule paper_chart:
    input:
        lambda wildcards: drawing_tables(wildcards.chart),
    output:
        multiext(paper("{chart}"), ".pdf", ".svg", ".png"),
    log:
        paper("logs", "{chart}.log"),
    wildcard_constraints:
        chart="|".join(registry.FIGURES),
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    params:
        call="studies.draw:draw_chart",
        code=lambda wildcards: code_with("studies.draw", registry.FIGURES[wildcards.chart]),
        arguments=lambda wildcards, input, output: dict(
            name=wildcards.chart,
            chart=registry.FIGURES[wildcards.chart],
            plan=PLAN,
            tables=tables_by_name(input),
            folder=paper(),
        ),
    message:
        "paper: {wildcards.chart}"
    script:
        "../../src/towval/workflow/scripts/run.py"


use rule paper_chart as study_chart with:
    input:
        product("{chart}.csv"),
    output:
        multiext(product("{chart}"), ".pdf", ".svg", ".png"),
    log:
        product("logs", "{chart}.log"),
    wildcard_constraints:
        chart="|".join(CHARTED),
    params:
        call="studies.draw:draw_chart",
        code=lambda wildcards: code_with("studies.draw", CHARTED[wildcards.chart]),
        arguments=lambda wildcards, input, output: dict(
            name=wildcards.chart,
            chart=CHARTED[wildcards.chart],
            plan={},
            tables=tables_by_name(input),
            folder=product(),
        ),
    message:
        "study {wildcards.chart}: chart"


# Each product writes study.html beside its summary, with whatever charts there are: a file that both update is nobody's
# output.
rule tradeoff:
    input:
        [product(f"{study}.{ending}") for study in PRODUCTS["tradeoff"] for ending in ("csv", "svg", "png", "pdf")],
    output:
        product("tradeoff.md"),
    log:
        product("logs", "tradeoff.log"),
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    params:
        call="studies.page:write_page",
        code=code("studies.page"),
        arguments=lambda wildcards, input, output: dict(
            product="tradeoff",
            products=PRODUCTS,
            folder=product(),
            summary=output[0],
        ),
    message:
        "error against cost: results in {output}"
    script:
        "../../src/towval/workflow/scripts/run.py"


use rule tradeoff as stability with:
    input:
        [product(f"{study}.{ending}") for study in PRODUCTS["stability"] for ending in ("csv", "svg", "png", "pdf")],
    output:
        product("stability.md"),
    log:
        product("logs", "stability.log"),
    params:
        call="studies.page:write_page",
        code=code("studies.page"),
        arguments=lambda wildcards, input, output: dict(
            product="stability",
            products=PRODUCTS,
            folder=product(),
            summary=output[0],
        ),
    message:
        "where methods fail: results in {output}"


rule figures:
    input:
        [paper(f"{chart}.{ending}") for chart in registry.FIGURES for ending in ("pdf", "svg", "png")],
        [paper("plan", f"{curve}.{ending}") for curve in ("lemniscate", "rounded_square") for ending in ("mcap", "csv")],
        paper("claims.md"),
        paper("claims.json"),


rule claims:
    input:
        [paper("tables", f"{study}.csv") for study in registry.PAPER],
    output:
        paper("claims.md"),
        paper("claims.json"),
    log:
        paper("logs", "claims.log"),
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    params:
        call="studies.paper.claims_page:write_ledger",
        code=code("studies.paper.claims_page"),
        arguments=lambda wildcards, input, output: dict(
            plan=PLAN,
            tables=tables_by_name(input),
            outputs=list(output),
        ),
    message:
        "paper: the ledger of its claims"
    script:
        "../../src/towval/workflow/scripts/run.py"


rule plan:
    output:
        mcap=paper("plan", "{curve}.mcap"),
        csv=paper("plan", "{curve}.csv"),
    log:
        paper("logs", "plan_{curve}.log"),
    conda:
        "../../src/towval/workflow/envs/towval.yaml"
    params:
        call="towval.commands.plan:run",
        code=code("towval.commands.plan"),
        arguments=lambda wildcards, input, output: dict(
            scene=STUDY_SETTINGS.scene,
            wanted=wildcards.curve,
            output=output.mcap,
            csv=output.csv,
        ),
    message:
        "paper: plan of the rover on the curve {wildcards.curve}"
    script:
        "../../src/towval/workflow/scripts/run.py"
