import re
import sys
from pathlib import Path

from towval.model.errors import TowvalError
from towval.model.plugins import load_plugins
from towval.io.campaigns import Campaigns
from towval.io.manifest import MANIFEST, check_results
from towval.io.provenance import canonical, content_hashes, file_hash, module_hash, read_sections
from towval.io.schema import check, packaged_schema, with_plain_values, without_defaults
from towval.io.workflow_lock import clear_stale_locks
from towval.io.yaml_text import read_yaml
from towval.model.presets import STANDARD, settings_of


def or_exit(function, *arguments):
    """The result of a call; an error of the input becomes one message and ends the workflow before it begins."""
    try:
        return function(*arguments)
    except TowvalError as error:
        sys.exit(f"towval: {error}")


PLUGINS = or_exit(load_plugins)


if str(config.get("quick")).lower() in ("true", "false"):
    # `--config quick=true` comes as a word.
    config["quick"] = str(config["quick"]).lower() == "true"

# Snakemake reads 1e-7 as a text and, within braces on the command line, every value.
config.update({name: with_plain_values(section) for name, section in config.items() if isinstance(section, dict)})

for file in map(Path, workflow.configfiles):
    # Of two sections of one name Snakemake takes the second, without a word. JSON may hold tabs, which YAML refuses.
    if file.is_file() and file.suffix != ".json":
        or_exit(read_yaml, file)

if isinstance(config.get("campaigns"), list) and config["campaigns"]:
    # These take the place of the one campaign, which then need not be named.
    config.setdefault("campaign", config["campaigns"][0])

or_exit(check, config, packaged_schema("config.schema.yaml"), "config")

RESULTS = Path(config["results"])
CAMPAIGNS = or_exit(Campaigns, config.get("campaigns") or [config["campaign"]])
if workflow.is_main_process:
    # The process of a job on a cluster reads its own campaigns only: all were checked before it was submitted.
    or_exit(CAMPAIGNS.check)
    or_exit(check_results, RESULTS, CAMPAIGNS)
    or_exit(clear_stale_locks, Path.cwd(), RESULTS)


wildcard_constraints:
    campaign="|".join(map(re.escape, CAMPAIGNS)),
    run=r"[A-Za-z0-9][A-Za-z0-9_-]*",


def results(campaign, *parts):
    return str(RESULTS.joinpath(campaign, *parts))


def wanted(wildcards):
    """All that the workflow makes; from a function, since braces in the names of folders are no wildcards."""
    pages = [results(name, file) for name in CAMPAIGNS for file in ("report.html", "summary.csv")]
    return pages + [results(name, run, "exchange.mcap") for name, given in CAMPAIGNS.items() for run in given.runs]


def per_run(file):
    """That file of every run of the rule's campaign."""
    return lambda wildcards: [results(wildcards.campaign, run, file) for run in CAMPAIGNS[wildcards.campaign].runs]


def folder(wildcards):
    return str(CAMPAIGNS[wildcards.campaign].folder)


def folder_of(file):
    """The folder of a result where the job reads or writes it, which is a copy where results are on object storage."""
    return str(Path(file).parent)


def of_lab(file):
    """A file of the lab, which stays where it is even where results are on object storage."""
    return local(str(file))


def video(wildcards):
    return of_lab(CAMPAIGNS[wildcards.campaign].run(wildcards.run).video)


def code(module, without=()):
    """Fingerprint of a module, of all that it imports and of the plugins: only an edit there runs its rule again."""
    return module_hash(module, without) + "".join(file_hash(path)[:16] for path in PLUGINS)


def given(stage):
    """The parts of campaign.yaml that a stage reads: an edit there, and only there, runs the stage again."""

    def parts(wildcards):
        document, run = CAMPAIGNS[wildcards.campaign].document, getattr(wildcards, "run", "")
        # Where a probe chooses the number of points, the stage track simulates the run.
        return canonical(read_sections(stage, document, run, simulating=section("track").get("samples") == "auto"))

    return parts


def content(campaign, *files):
    """Fingerprints of files of the lab, so that one replaced by an older copy is noticed; its date would not tell."""
    found = content_hashes([Path(file) for file in files], RESULTS / ".content" / f"{campaign}.json")
    return "".join(digest[:16] for digest in found)


def section(stage):
    return settings_of(config.get("preset", STANDARD), stage, config.get(stage))


def settings_text(stage):
    """A stage's settings as a parameter of their own: Snakemake does not compare those that name input or output.

    Whether a default is stated makes no difference, so that `snakemake` goes on where `towval run` ended.
    """
    later = ("decimate", "simulate") if stage == "track" and section("track").get("samples") == "auto" else ()
    return canonical({name: without_defaults(name, section(name)) for name in (stage, *later)})


def identified(wildcards):
    """The identification of a campaign, where config["identify"]["parameters"] asks for one."""
    return [results(wildcards.campaign, "identify.mcap")] if section("identify").get("parameters") else []


def say_what_is_missing():
    """After an error: which runs keep a campaign from its report."""
    for name, campaign in CAMPAIGNS.items():
        unfinished = [run for run in campaign.runs if not Path(results(name, run, "compare.mcap")).exists()]
        if 0 < len(unfinished) < len(campaign.runs):
            print(
                f"towval: the report of {name} was not made, because not all runs are finished: {', '.join(unfinished)}\n"
                "  what to do: see above; or state in campaign.yaml why a run is left out "
                f"(runs.{unfinished[0]}.left_out: ...). Then call again: what is finished stays.",
                file=sys.stderr,
            )
