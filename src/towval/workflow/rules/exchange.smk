rule exchange:
    input:
        camera=results("{campaign}", "camera.mcap"),
        track=results("{campaign}", "{run}", "track.mcap"),
        decimated=results("{campaign}", "{run}", "decimate.mcap"),
        simulated=results("{campaign}", "{run}", "simulate.mcap"),
        uncertainty=results("{campaign}", "{run}", "uncertainty.mcap"),
        compared=results("{campaign}", "{run}", "compare.mcap"),
        video=video,
    output:
        file=results("{campaign}", "{run}", "exchange.mcap"),
        layouts=[results("{campaign}", "{run}", name) for name in ("lichtblick.json", "rerun.rbl")],
    log:
        results("{campaign}", "{run}", "logs", "exchange.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "exchange.tsv")
    conda:
        "../envs/towval.yaml"
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        call="towval.commands.exchange:run",
        code=code("towval.commands.exchange"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            name=wildcards.run,
            camera=input.camera,
            folder=folder_of(input.track),
            output=output.file,
        ),
    message:
        "{wildcards.campaign}, run {wildcards.run}: one file for viewers"
    script:
        "../scripts/run.py"
