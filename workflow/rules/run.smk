rule track:
    input:
        camera=results("{campaign}", "camera.mcap"),
        video=lambda wildcards: str(CAMPAIGNS[wildcards.campaign].runs[wildcards.run].video),
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
        campaign=folder,
        # Where a probe chooses the number of points, it simulates the run.
        given=given("rover", "object", *(["tether", "friction"] if section("track").get("samples") == "auto" else [])),
        clicks=lambda wildcards: canonical(CAMPAIGNS[wildcards.campaign].document["runs"][wildcards.run]),
        settings=section("track"),
        code=code("track"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: track rover and object"
    script:
        "../scripts/track.py"


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
        settings=section("decimate"),
        code=code("decimate"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: thin the tracks"
    script:
        "../scripts/decimate.py"


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
        campaign=folder,
        given=given("rover", "object", "tether", "friction"),
        settings=section("simulate"),
        code=code("simulate"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: simulate the towed object"
    script:
        "../scripts/simulate.py"


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
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        campaign=folder,
        given=given("rover", "object", "tether", "friction"),
        settings=section("uncertainty"),
        code=code("uncertainty"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: sample what is not known exactly"
    script:
        "../scripts/uncertainty.py"


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
        settings=section("compare"),
        code=code("compare"),
    message:
        "{wildcards.campaign}, run {wildcards.run}: compare simulated with measured"
    script:
        "../scripts/compare.py"
