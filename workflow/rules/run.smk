rule track:
    message:
        "{wildcards.campaign}, run {wildcards.run}: track rover and object"
    input:
        camera=results("{campaign}", "camera.mcap"),
        video=lambda wildcards: str(CAMPAIGNS[wildcards.campaign].runs[wildcards.run].video),
    output:
        results("{campaign}", "{run}", "track.mcap"),
    params:
        campaign=folder,
        given=given("rover", "object"),
        clicks=lambda wildcards: CAMPAIGNS[wildcards.campaign].document["runs"][wildcards.run],
        keys=settings("track"),
        code=code("track"),
    log:
        results("{campaign}", "{run}", "logs", "track.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "track.tsv")
    resources:
        mem_mb=1000,
        runtime=60,
    conda:
        "../envs/towval.yaml"
    script:
        "../scripts/track.py"


rule decimate:
    message:
        "{wildcards.campaign}, run {wildcards.run}: thin the tracks"
    input:
        results("{campaign}", "{run}", "track.mcap"),
    output:
        results("{campaign}", "{run}", "decimate.mcap"),
    params:
        keys=settings("decimate"),
        code=code("decimate"),
    log:
        results("{campaign}", "{run}", "logs", "decimate.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "decimate.tsv")
    conda:
        "../envs/towval.yaml"
    script:
        "../scripts/decimate.py"


rule simulate:
    message:
        "{wildcards.campaign}, run {wildcards.run}: simulate the towed object"
    input:
        track=results("{campaign}", "{run}", "track.mcap"),
        decimated=results("{campaign}", "{run}", "decimate.mcap"),
    output:
        results("{campaign}", "{run}", "simulate.mcap"),
    params:
        campaign=folder,
        given=given("rover", "object", "tether", "friction"),
        keys=settings("simulate"),
        code=code("simulate"),
    log:
        results("{campaign}", "{run}", "logs", "simulate.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "simulate.tsv")
    conda:
        "../envs/towval.yaml"
    script:
        "../scripts/simulate.py"


rule compare:
    message:
        "{wildcards.campaign}, run {wildcards.run}: compare simulated with measured"
    input:
        camera=results("{campaign}", "camera.mcap"),
        track=results("{campaign}", "{run}", "track.mcap"),
        simulated=results("{campaign}", "{run}", "simulate.mcap"),
    output:
        results("{campaign}", "{run}", "compare.mcap"),
    params:
        campaign=folder,
        given=given("object"),
        code=code("compare"),
    log:
        results("{campaign}", "{run}", "logs", "compare.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "compare.tsv")
    conda:
        "../envs/towval.yaml"
    script:
        "../scripts/compare.py"
