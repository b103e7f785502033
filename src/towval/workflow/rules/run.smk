rule track:
    input:
        camera=results("{campaign}", "camera.mcap"),
        video=video,
    output:
        results("{campaign}", "{run}", "track.mcap"),
    log:
        results("{campaign}", "{run}", "logs", "track.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "track.tsv")
    conda:
        "../envs/towval.yaml"
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        given=given("track"),
        content=lambda wildcards, input: content(wildcards.campaign, input.video),
        call="towval.commands.track:run",
        code=code("towval.commands.track"),
        settings=settings_text("track"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            name=wildcards.run,
            camera=input.camera,
            output=output[0],
            keys=section("track"),
            later=(
                {stage: section(stage) for stage in ("decimate", "simulate")}
                if section("track").get("samples") == "auto"
                else None
            ),
        ),
    message:
        "{wildcards.campaign}, run {wildcards.run}: track rover and object"
    script:
        "../scripts/run.py"


rule decimate:
    input:
        results("{campaign}", "{run}", "track.mcap"),
    output:
        results("{campaign}", "{run}", "decimate.mcap"),
    log:
        results("{campaign}", "{run}", "logs", "decimate.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "decimate.tsv")
    conda:
        "../envs/towval.yaml"
    params:
        call="towval.commands.decimate:run",
        code=code("towval.commands.decimate"),
        settings=settings_text("decimate"),
        arguments=lambda wildcards, input, output: dict(
            track=input[0],
            output=output[0],
            keys=section("decimate"),
        ),
    message:
        "{wildcards.campaign}, run {wildcards.run}: decimate the tracks"
    script:
        "../scripts/run.py"


rule simulate:
    input:
        camera=results("{campaign}", "camera.mcap"),
        track=results("{campaign}", "{run}", "track.mcap"),
        decimated=results("{campaign}", "{run}", "decimate.mcap"),
    output:
        results("{campaign}", "{run}", "simulate.mcap"),
    log:
        results("{campaign}", "{run}", "logs", "simulate.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "simulate.tsv")
    conda:
        "../envs/towval.yaml"
    params:
        call="towval.commands.simulate:run",
        code=code("towval.commands.simulate"),
        settings=settings_text("simulate"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            track=input.track,
            decimated=input.decimated,
            output=output[0],
            keys=section("simulate"),
            camera=input.camera,
        ),
        given=given("simulate"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: simulate the towed object"
    script:
        "../scripts/run.py"


rule uncertainty:
    input:
        camera=results("{campaign}", "camera.mcap"),
        track=results("{campaign}", "{run}", "track.mcap"),
        decimated=results("{campaign}", "{run}", "decimate.mcap"),
        simulated=results("{campaign}", "{run}", "simulate.mcap"),
    output:
        results("{campaign}", "{run}", "uncertainty.mcap"),
    log:
        results("{campaign}", "{run}", "logs", "uncertainty.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "uncertainty.tsv")
    conda:
        "../envs/towval.yaml"
    threads: section("uncertainty").get("processes", 1)
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        call="towval.commands.uncertainty:run",
        code=code("towval.commands.uncertainty"),
        settings=settings_text("uncertainty"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            name=wildcards.run,
            camera=input.camera,
            folder=folder_of(input.track),
            output=output[0],
            keys=section("uncertainty"),
        ),
        given=given("uncertainty"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: draw the uncertain inputs"
    script:
        "../scripts/run.py"


rule compare:
    input:
        track=results("{campaign}", "{run}", "track.mcap"),
        simulated=results("{campaign}", "{run}", "simulate.mcap"),
        uncertainty=results("{campaign}", "{run}", "uncertainty.mcap"),
    output:
        results("{campaign}", "{run}", "compare.mcap"),
    log:
        results("{campaign}", "{run}", "logs", "compare.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "compare.tsv")
    conda:
        "../envs/towval.yaml"
    params:
        call="towval.commands.compare:run",
        code=code("towval.commands.compare"),
        settings=settings_text("compare"),
        arguments=lambda wildcards, input, output: dict(
            name=wildcards.run,
            track=input.track,
            simulated=input.simulated,
            uncertainty=input.uncertainty,
            output=output[0],
            keys=section("compare"),
        ),
    message:
        "{wildcards.campaign}, run {wildcards.run}: compare simulated with measured"
    script:
        "../scripts/run.py"
