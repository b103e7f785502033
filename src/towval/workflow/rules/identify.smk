# Kept apart from the validation: nothing of it goes into simulate, uncertainty or compare.
rule identify:
    input:
        camera=results("{campaign}", "camera.mcap"),
        tracks=per_run("track.mcap"),
        decimated=per_run("decimate.mcap"),
        simulated=per_run("simulate.mcap"),
        uncertainties=per_run("uncertainty.mcap"),
    output:
        values=results("{campaign}", "identify.mcap"),
        table=results("{campaign}", "identify.csv"),
    log:
        results("{campaign}", "logs", "identify.log"),
    benchmark:
        results("{campaign}", "benchmarks", "identify.tsv")
    conda:
        "../envs/towval.yaml"
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        call="towval.commands.identify:run",
        code=code("towval.commands.identify"),
        settings=settings_text("identify"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            results=folder_of(output.values),
            output=output.values,
            keys=section("identify"),
        ),
        given=given("identify"),
    message:
        "{wildcards.campaign}: identify inputs from the runs"
    script:
        "../scripts/run.py"
