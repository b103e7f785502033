"""Check of the page of five scenes: what was selected for each, and how far the alternative would move positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from studies.end_to_end import PipelineResult
from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced, result_of
from studies.tables import five_scenes
from studies.tables.five_scenes import Scene


def _scenes() -> Values:
    """Of each scene: what was chosen, how far the alternative moves positions [mm], u_D [mm], and the verdict."""
    with TemporaryDirectory() as folder:
        found = [_of_scene(scene) for scene in five_scenes.scenes(shared_folder(), Path(folder))]
    return {what: value for values in found for what, value in values.items()}


def _of_scene(scene: Scene) -> dict[str, float | str]:
    if isinstance(scene.result, str):
        return {f"{scene.name}, verdict": f"refused: {scene.result}"}
    compared = scene.result.comparison
    found: dict[str, float | str] = {"verdict": str(compared.verdict), "u_D": 1e3 * compared.u_measurement_m}
    for what, choice in five_scenes.main_choices(scene.result).items():
        if choice is not None:
            found |= {what: choice.chosen.split(":")[0], f"{what}, the next one moves": 1e3 * choice.change_m}
    found["effects taken"] = five_scenes.effects_taken(scene.result)
    return {f"{scene.name}, {what}": value for what, value in found.items()}


def _misread(result: PipelineResult) -> PipelineResult:
    """What was taken next read as chosen, with twice the effect; u_D twice as large."""
    swapped = [replace(c, chosen=c.next, next=c.chosen, change_m=2 * c.change_m) for c in result.choices]
    compared = replace(result.comparison, u_measurement_m=2 * result.comparison.u_measurement_m)
    return replace(result, choices=tuple(swapped), comparison=compared)


SCENES = Check(
    _scenes,
    {
        "preset draft in place of auto": replaced(five_scenes, "AUTO", lambda _: "draft"),
        "what would have been taken next is read as chosen, with twice the effect, and u_D as twice as large": replaced(
            five_scenes.Pipeline, "run", result_of(_misread)
        ),
    },
    needs=("footage/lab_a", "footage/lab_c"),
)
