"""The command ``towval``: the stages on single files, without Snakemake."""

import argparse
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import towval
from towval.commands.console import errors_reported
from towval.io.schema import read_value
from towval.model.errors import InputError

_EPILOG = """\
A run by hand, step by step:
  towval calibrate lab_a -o out/camera.mcap
  towval track     lab_a --run a --camera out/camera.mcap -o out/a/track.mcap
  towval decimate  out/a/track.mcap -o out/a/decimate.mcap
  towval simulate  lab_a --track out/a/track.mcap --decimated out/a/decimate.mcap -o out/a/simulate.mcap
  towval uncertainty lab_a --run a --camera out/camera.mcap --folder out/a -o out/a/uncertainty.mcap
  towval compare   --run a --track out/a/track.mcap --simulated out/a/simulate.mcap \\
                   --uncertainty out/a/uncertainty.mcap -o out/a/compare.mcap
  towval report    lab_a --results out

Inputs fitted to all runs, separate from the validation:
  towval identify  lab_a --results out -o out/identify.mcap --set parameters=[rest_length,friction]
  towval report    lab_a --results out --identified out/identify.mcap

A rover plan that makes the object follow a path, and the motion of the object behind any recorded rover:
  towval plan      workflow/plan.yaml --path desired.csv -o out/plan.mcap --csv out/plan.csv
  towval tow       workflow/plan.yaml out/plan.mcap -o out/towed.mcap

All stages at once, resumable and in parallel:
  snakemake --cores 2 --config campaign=lab_a

--set KEY=VALUE changes a setting of the stage, a key of its section in config.yaml: --set excess=2.5
"""


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="towval",
        description="How well does a simulation of a towed object agree with what a ceiling camera saw?",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"towval {towval.__version__}")
    stages = parser.add_subparsers(dest="stage", required=True, metavar="STAGE")

    stage = _stage(stages, "calibrate", "board pictures → camera.mcap: lens and floor with covariance")
    _campaign(stage)
    stage = _stage(stages, "track", "video of a run → track.mcap: poses of rover and object with standard deviations")
    _campaign(stage)
    _run(stage)
    _input(stage, "camera", "camera.mcap of the campaign")
    stage = _stage(stages, "decimate", "track.mcap → decimate.mcap: the fewest poses that the measured noise allows")
    stage.add_argument("track", type=Path, help="track.mcap of the run")
    stage = _stage(stages, "simulate", "decimate.mcap → simulate.mcap: simulated motion of the object")
    _campaign(stage)
    _input(stage, "track", "track.mcap of the run: the times of the output")
    _input(stage, "decimated", "decimate.mcap of the run: path of the rover, first pose of the object")
    stage.add_argument("--camera", type=Path, help="camera.mcap of the campaign, needed by settings that are auto")
    stage = _stage(
        stages, "uncertainty", "results of a run → uncertainty.mcap: covariance of the error if the model is correct"
    )
    _campaign(stage)
    _run(stage)
    _input(stage, "camera", "camera.mcap of the campaign")
    _input(stage, "folder", "folder with track.mcap, decimate.mcap and simulate.mcap of the run")
    stage = _stage(stages, "compare", "simulated and measured path → compare.mcap: errors and verdict")
    _run(stage)
    _input(stage, "track", "track.mcap of the run")
    _input(stage, "simulated", "simulate.mcap of the run")
    _input(stage, "uncertainty", "uncertainty.mcap of the run")
    stage = _stage(
        stages, "identify", "all runs of a campaign → identify.mcap, identify.csv: inputs fitted to the runs"
    )
    _campaign(stage)
    _input(stage, "results", "folder with one folder per run, each with the results up to uncertainty")
    stage = _stage(
        stages, "exchange", "results of a run → exchange.mcap and layouts: one file for viewers", settings=False
    )
    _campaign(stage)
    _run(stage)
    _input(stage, "camera", "camera.mcap of the campaign")
    _input(stage, "folder", "folder with all MCAP files of the run")
    _input(stage, "overlay", "overlay.mp4 of the run, made by the report")
    stage = _stage(
        stages, "report", "results of a campaign → figures, overlays, summary.csv, report.html", output=False
    )
    _campaign(stage)
    stage.add_argument("--results", type=Path, required=True, help="folder with camera.mcap and one folder per run")
    stage.add_argument("--identified", type=Path, help="identify.mcap, shown in a section of its own")
    _planning(stages)
    return parser


def _planning(stages: Any) -> None:
    stage = _stage(
        stages, "plan", "desired path of the object → plan.mcap and a CSV file: motion of the rover", settings=False
    )
    stage.set_defaults(function="run_file")
    _scene(stage)
    stage.add_argument(
        "--path",
        dest="wanted",
        required=True,
        help="a curve of the scene (lemniscate, ...) or a CSV file with x_m and y_m",
    )
    stage.add_argument("--csv", type=Path, required=True, help="the plan as a table, one row per step")
    stage = _stage(
        stages, "tow", "recorded rover → simulate.mcap: motion of the object behind it", module="plan", settings=False
    )
    stage.set_defaults(function="run_tow_file")
    _scene(stage)
    stage.add_argument("recording", type=Path, help="MCAP file with /rover/pose and at least one /object/pose")


def _scene(stage: argparse.ArgumentParser) -> None:
    stage.add_argument("scene", type=Path, help="scene file, like workflow/plan.yaml")
    stage.add_argument(
        "--campaign",
        type=Path,
        help="campaign folder whose object, friction, tether and hinge replace those of the scene",
    )


def _stage(
    stages: Any, name: str, help_text: str, *, module: str = "", settings: bool = True, output: bool = True
) -> argparse.ArgumentParser:
    description = help_text[0].upper() + help_text[1:] + "."
    stage: argparse.ArgumentParser = stages.add_parser(name, help=help_text, description=description)
    stage.set_defaults(module=f"towval.commands.{module or name}", function="run")
    if output:
        stage.add_argument("-o", "--output", type=Path, required=True, help="MCAP file to write, replaced atomically")
    if settings:
        stage.add_argument(
            "--set",
            dest="keys",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help=f"a key of section {name} of config.yaml; repeatable",
        )
    return stage


def _campaign(stage: argparse.ArgumentParser) -> None:
    stage.add_argument("campaign", type=Path, help="campaign folder, with campaign.yaml")


def _run(stage: argparse.ArgumentParser) -> None:
    stage.add_argument("--run", dest="name", required=True, help="name of the run in campaign.yaml")


def _input(stage: argparse.ArgumentParser, name: str, help_text: str) -> None:
    stage.add_argument(f"--{name}", type=Path, required=True, help=help_text)


def _keys(pairs: list[str]) -> dict[str, Any]:
    keys = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not (name and equals):
            raise InputError("--set needs a key and a value", got=pair, allowed="KEY=VALUE")
        keys[name] = read_value(text)
    return keys


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exits with code 1 and one message for errors of the input."""
    given = vars(_arguments().parse_args(arguments))
    given.pop("stage")
    with errors_reported():
        if "keys" in given:
            given["keys"] = _keys(given["keys"])
        run: Callable[..., None] = getattr(importlib.import_module(given.pop("module")), given.pop("function"))
        run(**given)


if __name__ == "__main__":
    main()
