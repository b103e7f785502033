"""The configuration of the paper's scene as the workflow reads it, and a quick variant of it."""

from pathlib import Path

from towval.io.schema import check, packaged_schema
from towval.io.yaml_text import read_yaml

WORKFLOW = Path(__file__).resolve().parents[1] / "src" / "towval" / "workflow"


def paper_plan():
    plan = read_yaml(WORKFLOW / "plan.yaml")
    check(plan, packaged_schema("plan.schema.yaml"), "plan")
    return plan


def quick_plan():
    """The same scene in a tenth of the steps, with sweeps of two values."""
    plan = paper_plan()
    plan["quasi_static"] |= {"time_step_s": 0.5}
    plan["sensitivity"] |= {
        "mean_speeds_m_s": [0.01, 0.02, 0.06, 0.1],
        "time_steps_s": [0.2, 0.5],
        "stiffnesses_n_m": [1e3, 1e5],
        "thresholds_m": [0.2, 0.6],
        "shown_thresholds_m": [0.2],
        "wheelbases_m": [0.4, 0.5],
        "surface_thresholds_m": [0.1, 0.4, 2],
        "surface_look_aheads_steps": [300, 350, 2],
        "surface_blocks": 2,
    }
    plan["table_1"]["element_sizes_m"] = [0.0075, 0.0100]
    return plan
