from towval.io.yaml_text import read_yaml
from studies import registry
from studies.frame import Settings, loaded, module_of

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


def code_with(command, reference):
    """Fingerprint of a command and of the module behind a reference, with all that they import."""
    return code(command) + code(module_of(reference))


def drawing_tables(figure):
    """Tables from which a figure of the paper is drawn."""
    return [paper("tables", f"{study}.csv") for study in loaded(registry.FIGURES[figure]).tables]


def tables_by_name(files):
    """Tables of studies by the study's name."""
    return {Path(file).stem: file for file in files}
