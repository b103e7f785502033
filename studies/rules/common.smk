from towval.io.yaml_text import read_yaml
from studies import registry
from studies.frame import Settings, loaded, module_of
from studies.evidence.compute import REPOSITORY, shared_folder
from studies.evidence.ledger import ROWS, Effort, made_now, read_groups

PLAN = or_exit(read_yaml, Path(workflow.basedir) / "src" / "towval" / "workflow" / "plan.yaml")
or_exit(check, PLAN, packaged_schema("plan.schema.yaml"), "plan")
STUDY_SETTINGS = Settings(quick=bool(config.get("quick", False)), plan=PLAN)

PRODUCTS = {"tradeoff": dict(registry.TRADEOFF), "stability": dict(registry.STABILITY)}
CHARTED = {**registry.TRADEOFF, **registry.STABILITY}
STUDIES = {**registry.PAPER, **CHARTED}


def paper(*parts):
    return str(RESULTS.joinpath("figures", *parts))


def product(*parts):
    return str(RESULTS.joinpath("study", *parts))


STUDY_PARTS = {}


def parts_of(study):
    """The parts of a study by name; the module that computes it is imported for those alone that are asked for."""
    if study not in STUDY_PARTS:
        STUDY_PARTS[study] = or_exit(or_exit(loaded, STUDIES[study]).parts, STUDY_SETTINGS)
    return STUDY_PARTS[study]


def code_with(command, reference, without=()):
    """Fingerprint of a command and of the module behind a reference, with all that they import but these files."""
    return code(command, without) + code(module_of(reference), without)


def drawing_tables(figure):
    """Tables from which a figure of the paper is drawn."""
    return [paper("tables", f"{study}.csv") for study in loaded(registry.FIGURES[figure]).tables]


def tables_by_name(files):
    """Tables of studies by the study's name."""
    return {Path(file).stem: file for file in files}


EVIDENCE = or_exit(read_groups)
WANTED_EFFORTS = (Effort.QUICK,) if STUDY_SETTINGS.quick else (Effort.QUICK, Effort.WHOLE)


def checks_to_make():
    """Groups whose checks run now, with the names of their faults, the program as it is first."""
    found = {}
    for name, group in or_exit(made_now, EVIDENCE, WANTED_EFFORTS, config.get("long", ())).items():
        check = or_exit(loaded, group.check)
        if not check.missing(shared_folder()):
            found[name] = ["", *check.faults]
    return found


def evidence_outcomes(wildcards):
    made = checks_to_make()
    return [str(RESULTS / "evidence" / f"{name}.{k}.json") for name in made for k in range(len(made[name]))]
