from towval.study.products import STABILITY, TRADEOFF


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
        part=lambda wildcards: blocks_of(wildcards.chart)[wildcards.part],
        code=code_of_chart,
    message:
        "study {wildcards.chart}: part {wildcards.part}"
    script:
        "../scripts/study_block.py"


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
        code=code("study_chart"),
        labels=code_of_chart,
    message:
        "study {wildcards.chart}: table and chart"
    script:
        "../scripts/study_chart.py"


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
        code=code("study_product"),
    message:
        "speed against accuracy: results in {output}"
    script:
        "../scripts/study_product.py"


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
        code=code("study_product"),
    message:
        "where methods fail: results in {output}"
    script:
        "../scripts/study_product.py"
