"""The command ``towval``: the stages on single files, without Snakemake."""

import argparse
import importlib
import os
from argparse import BooleanOptionalAction
from collections.abc import Callable
from pathlib import Path
from typing import Any

import towval
from towval.commands.console import Outcome, errors_reported, show
from towval.io.mcap_file import check_replaceable
from towval.io.yaml_text import read_value
from towval.model.errors import InputError

_EPILOG = """\
All stages at once, resumable and in parallel, first on the sample that comes with the package:
  towval demo
  towval run lab_a

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
  towval identify  lab_a --results out -o out/identify.mcap --set "parameters=[rest_length,friction]"
  towval report    lab_a --results out --identified out/identify.mcap

Are results whole, and what were they made of:
  towval verify    out --campaign lab_a

A rover plan that makes the object follow a path, and the motion of the object behind any recorded rover:
  towval plan      paper --campaign lab_a --path desired.csv -o out/plan.mcap --csv out/plan.csv
  towval tow       paper out/plan.mcap --campaign lab_a -o out/towed.mcap

An overview of all campaigns; a continuous integration fails where a run does not agree:
  towval index     results results_of_last_year -o index.sqlite --fail-on disagrees

--set KEY=VALUE changes a setting of the stage, in config.yaml: --set excess=2.5 or decimate.excess=2.5
--json prints what a command made, and how good it is, as one JSON object
Completion of commands, options and files in bash, zsh and fish: eval "$(register-python-argcomplete towval)"
"""


_Argument = tuple[str, dict[str, Any]]
"""Name of an argument and its options for ``argparse``."""


def _file(name: str, help_text: str, **options: Any) -> _Argument:
    """A file or folder; as an option it is required unless ``options`` say otherwise."""
    return name, {"type": Path, "help": help_text, **({"required": True} if name[0] == "-" else {}), **options}


_CAMPAIGN = _file("campaign", "campaign folder, with campaign.yaml")
_RUN = ("--run", {"dest": "name", "required": True, "help": "name of the run in campaign.yaml"})
_CAMERA = _file("--camera", "camera.mcap of the campaign")
_SCENE = _file("scene", "scene file, or paper for the one in the package (src/towval/workflow/plan.yaml)")
_REPLACING = "campaign folder whose object, friction, tether and hinge replace those of the scene"
_WANTED = "a curve of the scene (lemniscate, ...) or a CSV file with x_m and y_m"

_MAP = _file("--map", "SVG file for a map of rover and object", required=False, dest="map_file")
_FAIL_ON = "exit with code 1 where a run has this verdict, or is unfinished; repeatable"
_RESULTS = _file("--results", "folder for results, results by default", required=False, default=Path("results"))
_CORES = ("--cores", {"type": int, "help": "processor cores to use, all by default"})

_STAGES: dict[str, tuple[str, list[_Argument]]] = {
    "demo": ("the sample that comes with the package → report.html", [
        _file("folder", "new folder for the sample, demo by default", nargs="?", default=Path("demo")),
        _RESULTS, _CORES,
    ]),
    "new": ("folder with videos and pictures, measured facts → campaign.yaml", [
        _file("folder", "folder with the videos of the runs and the pictures of the board"),
        _file("--facts", "YAML file with facts, in the sections of campaign.yaml", required=False),
        ("--ask", {"action": BooleanOptionalAction, "help": "ask for what is missing; by default on a terminal"}),
        ("--force", {"action": "store_true", "help": "replace a campaign.yaml that is there"}),
        ("--find", {"action": BooleanOptionalAction, "default": True, "help": "check, and find the starts"}),
    ]),
    "check": ("campaign folder → every fault at once, a picture of each start, expected accuracy and cost", [
        _CAMPAIGN,
        _file("--pictures", "folder for pictures and start.html, by default check in it", required=False),
    ]),
    "run": ("campaign folder → results, with report.html", [
        _CAMPAIGN, _RESULTS, _CORES,
        ("--snakemake", {"default": "", "metavar": "OPTIONS", "help": "options for Snakemake: --snakemake='-n'"}),
    ]),
    "calibrate": ("board pictures → camera.mcap: lens and floor with covariance", [_CAMPAIGN]),
    "track": ("video of a run → track.mcap: poses of rover and object with standard deviations", [
        _CAMPAIGN, _RUN, _CAMERA,
    ]),
    "decimate": ("track.mcap → decimate.mcap: the fewest poses that the measured noise allows", [
        _file("track", "track.mcap of the run"),
    ]),
    "simulate": ("decimate.mcap → simulate.mcap: simulated motion of the object", [
        _CAMPAIGN,
        _file("--track", "track.mcap of the run: the times of the output"),
        _file("--decimated", "decimate.mcap of the run: path of the rover, first pose of the object"),
        _file("--camera", "camera.mcap of the campaign, needed by settings that are auto", required=False),
    ]),
    "uncertainty": ("results of a run → uncertainty.mcap: covariance of the error if the model is correct", [
        _CAMPAIGN, _RUN, _CAMERA,
        _file("--folder", "folder with track.mcap, decimate.mcap and simulate.mcap of the run"),
    ]),
    "compare": ("simulated and measured path → compare.mcap: errors and verdict", [
        _RUN,
        _file("--track", "track.mcap of the run"),
        _file("--simulated", "simulate.mcap of the run"),
        _file("--uncertainty", "uncertainty.mcap of the run"),
    ]),
    "identify": ("all runs of a campaign → identify.mcap, identify.csv: inputs fitted to the runs", [
        _CAMPAIGN, _file("--results", "folder with one folder per run, each with the results up to uncertainty"),
    ]),
    "exchange": ("results of a run → exchange.mcap and layouts: one file for viewers", [
        _CAMPAIGN, _RUN, _CAMERA,
        _file("--folder", "folder with all MCAP files of the run"),
    ]),
    "overlay": ("footage and results of a run → overlay.mp4: outlines drawn into the film", [
        _CAMPAIGN, _RUN, _CAMERA,
        _file("--folder", "folder with all MCAP files of the run"),
    ]),
    "report": ("results of a campaign → figures, summary.csv, report.html", [
        _CAMPAIGN,
        _file("--results", "folder with camera.mcap and one folder per run"),
        _file("--identified", "identify.mcap, shown in a section of its own", required=False),
    ]),
    "verify": ("folder of results → what each result and figure was made of, or what is not as it was made", [
        _file("results", "folder with camera.mcap and one folder per run"),
        _file("--campaign", "campaign folder, to compare its files as well", required=False),
    ]),
    "plan": ("desired path of the object → plan.mcap and a CSV file: motion of the rover", [
        _SCENE, _file("--campaign", _REPLACING, required=False),
        ("--path", {"dest": "wanted", "required": True, "help": _WANTED}),
        _file("--csv", "the plan as a table, one row per step"), _MAP,
    ]),
    "tow": ("recorded rover → simulate.mcap: motion of the object behind it", [
        _SCENE, _file("--campaign", _REPLACING, required=False),
        _file("recording", "MCAP file with /rover/pose and at least one /object/pose"), _MAP,
    ]),
    "index": ("results of many campaigns → index.sqlite, index.html: one row per run, filters, trends, changes", [
        ("results", {"type": Path, "nargs": "+", "help": "folders of results, each of one campaign or of many"}),
        ("--fail-on", {"action": "append", "default": [], "metavar": "VERDICT", "help": _FAIL_ON}),
    ]),
}  # fmt: skip
"""Help text and arguments of each stage, in addition to ``-o``, ``--set`` and ``--json``."""

_FUNCTIONS = {"tow": ("plan", "run_tow"), "run": ("workflow", "run"), "demo": ("workflow", "run_demo")}
"""Module and function of a stage, where they are not ``run`` in the module of its name."""

_OUTPUTS = {
    "index": "SQLite file to write, replaced atomically; the page beside it ends in .html",
    "overlay": "MP4 file to write, replaced atomically",
}
_WITHOUT_OUTPUT = ("report", "verify", "run", "demo", "check", "new")
_SETTINGS = {"run": "config.yaml, as track.method", "new": "campaign.yaml, as object.mass_kg"}
_WITHOUT_SETTINGS = ("exchange", "overlay", "plan", "tow", "index", "verify", "demo", "check")


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="towval",
        description="How well does a simulation of a towed object agree with what a ceiling camera saw?",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"towval {towval.__version__}")
    stages = parser.add_subparsers(dest="stage", required=True, metavar="STAGE")
    for name, (text, arguments) in _STAGES.items():
        begun = text if text.partition(" ")[0].endswith(".mcap") else text[0].upper() + text[1:]
        stage = stages.add_parser(name, help=text, description=f"{begun}.")
        module, function = _FUNCTIONS.get(name, (name, "run"))
        stage.set_defaults(module=f"towval.commands.{module}", function=function)
        if name not in _WITHOUT_OUTPUT:
            output = _OUTPUTS.get(name, "MCAP file to write, replaced atomically")
            stage.add_argument("-o", "--output", type=Path, required=True, help=output)
        if name not in _WITHOUT_SETTINGS:
            of = _SETTINGS.get(name, f"section {name} of config.yaml")
            setting = f"a key of {of}; repeatable"
            given: dict[str, Any] = {"dest": "keys", "action": "append", "default": []}
            stage.add_argument("--set", **given, metavar="KEY=VALUE", help=setting)
        stage.add_argument("--json", dest="as_json", action="store_true", help="print one JSON object")
        for flag, options in arguments:
            stage.add_argument(flag, **options)
    return parser


def _keys(pairs: list[str], stage: str) -> dict[str, Any]:
    """Keys and values; a key of the stage's own section may be written as in ``towval run``, with the stage's name."""
    keys = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not (name and equals):
            raise InputError("--set needs a key and a value", got=pair, allowed="KEY=VALUE")
        keys[name.removeprefix(f"{stage}.")] = read_value(text, f"--set {pair}")
    return keys


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exits with code 1 and one message for errors of the input."""
    parser = _arguments()
    if "_ARGCOMPLETE" in os.environ:  # a shell asks how the line may go on
        import argcomplete  # noqa: PLC0415

        argcomplete.autocomplete(parser)
    given = vars(parser.parse_args(arguments))
    stage = given.pop("stage")
    as_json = stage != "check" and given.pop("as_json")
    with errors_reported():
        if stage not in (*_OUTPUTS, *_WITHOUT_OUTPUT):
            check_replaceable(given["output"], stage)
        if "keys" in given:
            given["keys"] = _keys(given["keys"], stage)
        run: Callable[..., Outcome | None] = getattr(
            importlib.import_module(given.pop("module")), given.pop("function")
        )
        outcome = run(**given)
        if outcome is not None:
            show(outcome, as_json)


if __name__ == "__main__":
    main()
