rule calibrate:
    input:
        images=lambda wildcards: map(of_lab, CAMPAIGNS[wildcards.campaign].calibration_images),
        floor_images=lambda wildcards: map(of_lab, CAMPAIGNS[wildcards.campaign].floor_images),
    output:
        results("{campaign}", "camera.mcap"),
    log:
        results("{campaign}", "logs", "calibrate.log"),
    benchmark:
        results("{campaign}", "benchmarks", "calibrate.tsv")
    conda:
        "../envs/towval.yaml"
    threads: section("calibrate").get("threads", 2)
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        call="towval.commands.calibrate:run",
        code=code("towval.commands.calibrate"),
        settings=settings_text("calibrate"),
        arguments=lambda wildcards, input, output: dict(
            campaign=folder(wildcards),
            output=output[0],
            keys=section("calibrate"),
        ),
        given=given("calibrate"),
        content=lambda wildcards, input: content(wildcards.campaign, *input.images, *input.floor_images),
    message:
        "{wildcards.campaign}: calibrate camera and floor"
    script:
        "../scripts/run.py"
