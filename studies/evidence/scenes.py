"""Check of the page of five scenes: what was selected for each, and how far the alternative would move positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies import end_to_end
from studies.end_to_end import AUTO
from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import Planting, both, replaced, result_of
from studies.evidence.tracker_faults import scattered
from studies.tables import five_scenes
from studies.tables.five_scenes import Scene
from towval.model import TowingScene
from towval.selection import draws, sample_points, simulation
from towval.validation import sampler


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


def _shares(factor: float) -> Planting:
    """What a choice may move positions by, over the measurement's deviation, counts so many times."""
    rules = (simulation, draws, sample_points)
    return both(*(replaced(rule, "SHARE", lambda share: factor * share) for rule in rules))


def _of_a_tangential_lens(presets: Any) -> Any:
    return {**presets, AUTO: {**presets[AUTO], "calibrate": {"lens_models": ["k1 k2 p1 p2"]}}}


def _lifted_or_laid(stated: Any) -> Any:
    """A tow on the floor is taken to be 0.1 m above it, one above it to be on a level floor."""

    def wrong(scene: TowingScene, by_m: float) -> TowingScene:
        height_m = 0.0 if scene.anchor_height else 0.1
        ground = replace(scene.ground, slope=np.zeros(2))
        scene = replace(scene, anchor_height=height_m, hinge_height=height_m, centre_of_mass_height=0.0, ground=ground)
        return stated(scene, by_m)

    return wrong


SCENES = Check(
    _scenes,
    {
        "preset draft in place of auto": replaced(five_scenes, "AUTO", lambda _: "draft"),
        "a choice may move positions by a hundredth of what it may, inputs are twice as uncertain": both(
            _shares(0.01), replaced(sampler, "_root", result_of(lambda root: 2 * root))
        ),
        "a choice may move positions by 1000 times what it may": _shares(1000.0),
        "lenses are k1 k2 p1 p2, a tow on the floor is taken to be 0.1 m above it and one above it to be on a level "
        "floor, and poses scatter by another 0.3 mm": both(
            replaced(five_scenes, "PRESETS", _of_a_tangential_lens),
            replaced(end_to_end, "stated_longer", _lifted_or_laid),
            scattered(3e-4, 0.0),
        ),
    },
    needs=("footage/lab_a", "footage/lab_c"),
)
