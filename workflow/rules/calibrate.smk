rule calibrate:
    message:
        "{wildcards.campaign}: calibrate camera and floor"
    input:
        images=lambda wildcards: map(str, CAMPAIGNS[wildcards.campaign].calibration_images),
        floor_images=lambda wildcards: map(str, CAMPAIGNS[wildcards.campaign].floor_images),
    output:
        results("{campaign}", "camera.mcap"),
    params:
        campaign=folder,
        given=given("camera", "floor"),
        keys=settings("calibrate"),
        code=code("calibrate"),
    log:
        results("{campaign}", "logs", "calibrate.log"),
    benchmark:
        results("{campaign}", "benchmarks", "calibrate.tsv")
    threads: 2
    resources:
        mem_mb=2000,
        runtime=10,
    conda:
        "../envs/towval.yaml"
    script:
        "../scripts/calibrate.py"
