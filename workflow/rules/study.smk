from towval.study.products import STABILITY, TRADEOFF, module_of, study

QUICK = bool(config.get("quick", False))
# Whoever asks for neither product does not wait for the modules that compute them.
STUDY_BLOCKS = {}


def studies(*parts):
    return str(RESULTS.joinpath("study", *parts))


def blocks_of(chart):
    """The parts of a chart by name."""
    if chart not in STUDY_BLOCKS:
        STUDY_BLOCKS[chart] = study(chart).parts(QUICK)
    return STUDY_BLOCKS[chart]


def code_of_chart(wildcards):
    """Fingerprint of the module that computes a chart and of all that it imports, and of the script's."""
    return code("study_block") + module_hash(f"towval.study.{module_of(wildcards.chart)}")


def product_charts(charts):
    return [studies(f"{chart}.{ending}") for chart in charts for ending in ("csv", "svg", "png", "pdf")]


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
