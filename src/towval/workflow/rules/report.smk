rule run_overlay:
    input:
        camera=results("{campaign}", "camera.mcap"),
        video=video,
        track=results("{campaign}", "{run}", "track.mcap"),
        decimated=results("{campaign}", "{run}", "decimate.mcap"),
        simulated=results("{campaign}", "{run}", "simulate.mcap"),
        uncertainty=results("{campaign}", "{run}", "uncertainty.mcap"),
        compared=results("{campaign}", "{run}", "compare.mcap"),
    output:
        report(
            results("{campaign}", "{run}", "overlay.mp4"),
            category="{campaign}",
            labels={"run": "{run}", "what": "overlay video"},
        ),
    log:
        results("{campaign}", "{run}", "logs", "overlay.log"),
    benchmark:
        results("{campaign}", "{run}", "benchmarks", "overlay.tsv")
    conda:
        "../envs/towval.yaml"
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        call="towval.commands.overlay:run",
        code=code("towval.commands.overlay"),
        settings=settings_text("report"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            name=wildcards.run,
            camera=input.camera,
            folder=folder_of(input.track),
            output=output[0],
            width_px=section("report").get("overlay_width_px", 960),
        ),
    message:
        "{wildcards.campaign}, run {wildcards.run}: draw the outlines onto the footage"
    script:
        "../scripts/run.py"


rule overlay:
    input:
        lambda _: [results(name, run, "overlay.mp4") for name, campaign in CAMPAIGNS.items() for run in campaign.runs],


rule report:
    input:
        camera=results("{campaign}", "camera.mcap"),
        tracks=per_run("track.mcap"),
        decimated=per_run("decimate.mcap"),
        simulated=per_run("simulate.mcap"),
        uncertainties=per_run("uncertainty.mcap"),
        compared=per_run("compare.mcap"),
        videos=lambda wildcards: [of_lab(run.video) for run in CAMPAIGNS[wildcards.campaign].runs.values()],
        identified=identified,
    output:
        report=report(
            results("{campaign}", "report.html"), category="{campaign}", labels={"run": "all", "what": "report"}
        ),
        summary=report(
            results("{campaign}", "summary.csv"), category="{campaign}", labels={"run": "all", "what": "summary"}
        ),
        listing=results("{campaign}", MANIFEST),
        figures=report(
            directory(results("{campaign}", "figures")),
            patterns=["fig10_{name}.svg", "agreement_{name}.svg"],
            category="{campaign}",
            labels={"run": "{name}", "what": "figure"},
        ),
    log:
        results("{campaign}", "logs", "report.log"),
    benchmark:
        results("{campaign}", "benchmarks", "report.tsv")
    conda:
        "../envs/towval.yaml"
    threads: 2
    params:
        call="towval.commands.report:run",
        code=code("towval.commands.report"),
        settings=settings_text("report"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            results=folder_of(output.report),
            keys=section("report"),
            identified=next(iter(input.get("identified", [])), None),
        ),
        given=lambda wildcards: canonical(CAMPAIGNS[wildcards.campaign].document),
    message:
        "{wildcards.campaign}: figures, summary and report"
    script:
        "../scripts/run.py"
