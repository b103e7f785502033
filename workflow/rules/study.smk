from studies.frame import STABILITY, TRADEOFF


rule study_block:
    output:
        studies("blocks", "{chart}", "{part}.csv"),
    log:
        studies("logs", "{chart}_{part}.log"),
    benchmark:
        studies("benchmarks", "{chart}_{part}.tsv")
    wildcard_constraints:
        chart="|".join([*TRADEOFF, *STABILITY]),
        part="[A-Za-z0-9_-]+",
    conda:
        "../envs/towval.yaml"
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        call="studies.block_command:run_block",
        code=code_of_chart,
        arguments=lambda wildcards, input, output: dict(
            chart=wildcards.chart,
            part=blocks_of(wildcards.chart)[wildcards.part],
            output=output[0],
        ),
    message:
        "study {wildcards.chart}: part {wildcards.part}"
    script:
        "../scripts/run.py"


rule study_chart:
    input:
        lambda wildcards: [studies("blocks", wildcards.chart, f"{part}.csv") for part in blocks_of(wildcards.chart)],
    output:
        multiext(studies("{chart}"), table=".csv", pdf=".pdf", svg=".svg", png=".png"),
    log:
        studies("logs", "{chart}.log"),
    wildcard_constraints:
        chart="|".join([*TRADEOFF, *STABILITY]),
    conda:
        "../envs/towval.yaml"
    params:
        call="studies.commands:draw_chart",
        code=code("studies.commands"),
        arguments=lambda wildcards, input, output: dict(
            chart=wildcards.chart,
            blocks=list(input),
            table=output.table,
        ),
        labels=code_of_chart,
    message:
        "study {wildcards.chart}: table and chart"
    script:
        "../scripts/run.py"


# Each writes study.html beside its summary, with whatever charts there are: a file that both update is nobody's output.
rule tradeoff:
    input:
        product_charts(TRADEOFF),
    output:
        studies("tradeoff.md"),
    log:
        studies("logs", "tradeoff.log"),
    conda:
        "../envs/towval.yaml"
    params:
        call="studies.commands:write_product",
        code=code("studies.commands"),
        arguments=lambda wildcards, input, output: dict(
            product="tradeoff",
            folder=studies(),
            summary=output[0],
        ),
    message:
        "speed against accuracy: results in {output}"
    script:
        "../scripts/run.py"


rule stability:
    input:
        product_charts(STABILITY),
    output:
        studies("stability.md"),
    log:
        studies("logs", "stability.log"),
    conda:
        "../envs/towval.yaml"
    params:
        call="studies.commands:write_product",
        code=code("studies.commands"),
        arguments=lambda wildcards, input, output: dict(
            product="stability",
            folder=studies(),
            summary=output[0],
        ),
    message:
        "where methods fail: results in {output}"
    script:
        "../scripts/run.py"
