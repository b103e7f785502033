# Tables from which each figure of the paper is drawn.
FIGURES = {
    "figure_2": ["contact"],
    "figure_3": [],
    "figure_4": ["nominal"],
    "figure_5": ["loop"],
    "figure_6": ["speeds", "time_steps", "stiffnesses", "feedforward_paths"],
    "figure_7": ["thresholds"],
    "figure_8": ["surface"],
    "table_1": ["meshes"],
}


rule figures:
    input:
        [paper(f"{name}.{ending}") for name in FIGURES for ending in ("pdf", "svg", "png")],
        [paper("plan", f"{curve}.{ending}") for curve in ("lemniscate", "rounded_square") for ending in ("mcap", "csv")],
        paper("claims.md"),
        paper("claims.json"),


rule figure:
    input:
        lambda wildcards: [table(study) for study in FIGURES[wildcards.figure]],
    output:
        multiext(paper("{figure}"), ".pdf", ".svg", ".png"),
    log:
        paper("logs", "{figure}.log"),
    wildcard_constraints:
        figure="|".join(FIGURES),
    conda:
        "../envs/towval.yaml"
    params:
        call="studies.paper.figures_command:draw",
        code=code("studies.paper.figures_command"),
        arguments=lambda wildcards, input, output: dict(
            name=wildcards.figure,
            plan=PLAN,
            tables=tables_by_name(input),
            folder=paper(),
        ),
    message:
        "paper: {wildcards.figure}"
    script:
        "../scripts/run.py"


rule claims:
    input:
        [table(study) for study in PARTS],
    output:
        ledger=paper("claims.md"),
        twin=paper("claims.json"),
        docs=str(HERE / "docs" / "claims.md"),
        docs_twin=str(HERE / "docs" / "claims.json"),
    log:
        paper("logs", "claims.log"),
    conda:
        "../envs/towval.yaml"
    params:
        call="studies.paper.claims_command:write_ledger",
        code=code("studies.paper.claims_command"),
        arguments=lambda wildcards, input, output: dict(
            plan=PLAN,
            tables=tables_by_name(input),
            outputs=list(output),
        ),
    message:
        "paper: the ledger of claims"
    script:
        "../scripts/run.py"
