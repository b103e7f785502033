"""The effects of a lab: by how much each moves the path of a run, and which inputs should be measured better.

An effect that the scene has is left out in one more simulation. For one that the scene does not have, the draws
suffice: the share of the error's variance that its inputs explain gives the shift by one standard deviation of them.
Where draws may say nothing of single inputs, because they are too few, there is no such row.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from towval.model import Choice, RunUncertainty, SimulatedMotion, TowingScene
from towval.model.geometry import rms_length
from towval.model.inputs import INPUTS, UncertainInput
from towval.physics.ladder import DYNAMICS
from towval.validation.simulate_many import Batch, Drawn

_RMS = "RMS over the path"
_TRIED = 1e-3  # a size that any input that cannot be negative may have, in its unit
_MOST_INPUTS = 5
"""Largest number of inputs to be measured better that get a row: a table of all thirty would hide them."""


@dataclass(frozen=True)
class Effect:
    """An effect of a lab.

    ``what``: its name in the report; ``inputs`` by which it is uncertain; ``neutral``: fields of the scene, as (part,
    field, value), with their values where the effect is absent.
    """

    what: str
    inputs: tuple[str, ...]
    neutral: tuple[tuple[str, str, Any], ...]

    def acts(self, scene: TowingScene) -> bool:
        """Whether the scene has this effect."""
        return any(
            len(found) > 0 if name == "regions" else np.any(np.asarray(found) != value)
            for part, name, value in self.neutral
            for found in [getattr(getattr(scene, part) if part else scene, name)]
        )

    def without(self, scene: TowingScene) -> TowingScene:
        """The scene without this effect."""
        for part, name, value in self.neutral:
            neutral: dict[str, Any] = {name: value}
            scene = replace(scene, **({part: replace(getattr(scene, part), **neutral)} if part else neutral))
        return scene


EFFECTS = (
    Effect(
        "tow above the floor", ("hinge_height", "anchor_height"),
        (("", "hinge_height", 0.0), ("", "anchor_height", 0.0)),
    ),
    Effect("height of the centre of mass", ("centre_of_mass_height",), (("", "centre_of_mass_height", 0.0),)),
    Effect("slope of the floor", ("slope",), (("ground", "slope", (0.0, 0.0)),)),
    Effect("friction across and along", ("across_over_along",), (("friction", "across_over_along", 1.0),)),
    Effect("friction radius", ("radius_over_planar",), (("friction", "radius_over_planar", 1.0),)),
    Effect("regions of the floor", ("regions",), (("ground", "regions", ()),)),
    Effect("stiffening of the tether", ("stiffening",), (("tether", "stiffening", 0.0),)),
    Effect("mass of the tether", ("tether_mass",), (("tether", "mass_per_length", 0.0),)),
)  # fmt: skip
"""Effects that a level and even floor, a flat sole, a tow in the floor plane and an ideal tether do not have."""


def effect_choices(
    batch: Batch, stated: Drawn, found: RunUncertainty, simulated: SimulatedMotion, limit_m: float
) -> tuple[Choice, ...]:
    """Each effect, taken or left out, with the shift by the other choice [m]; one more simulation for each taken.

    ``batch``: how the run is simulated, ``stated`` with all inputs as stated; ``simulated`` is the run itself at the
    batch's times, ``found`` its uncertainty with the draws. An effect that moves the path by less than ``limit_m`` is
    reported as taken without need.
    """
    batch, scene = replace(batch, rung=DYNAMICS), stated.scene
    taken = [effect for effect in EFFECTS if effect.acts(scene)]
    whole = [scene] if simulated.rung != DYNAMICS else []  # else it has been simulated, and more exactly
    scenes = (*whole, *(effect.without(scene) for effect in taken))
    others = list(batch.simulate([stated._replace(scene=each) for each in scenes]))
    nominal = others.pop(0) if whole else simulated.pose
    turned = replace(batch, sticking=not batch.sticking)
    others += turned.simulate([stated])
    shifts = [rms_length(other - nominal) for other in others]
    moved = dict(zip((effect.what for effect in taken), shifts, strict=False))
    by_input = moves_of_inputs(found, scene)
    choices = []
    for effect in EFFECTS:
        if effect.what in moved:
            # NaN, where the run without it cannot be simulated, is no sign that it is not needed.
            chosen = "taken without need" if moved[effect.what] <= limit_m else "taken"
            choices.append(Choice(f"effect: {effect.what}", chosen, "left out", moved[effect.what], _RMS))
            continue
        known = [by_input[name] for name in effect.inputs if name in by_input]
        if known:
            other = "one deviation of it"
            choices.append(Choice(f"effect: {effect.what}", "left out", other, float(np.hypot.reduce(known)), _RMS))
    sticking = ("taken", "left out") if batch.sticking else ("left out", "taken")
    return (*choices, Choice("effect: sticking", *sticking, shifts[-1], _RMS))


def to_be_measured(
    found: RunUncertainty, scene: TowingScene, deviations: Mapping[str, float], limit_m: float
) -> tuple[Choice, ...]:
    """Up to five inputs of which one standard deviation moves the error of the path by more than a limit [m]."""
    choices = []
    for name, move in sorted(moves_of_inputs(found, scene).items(), key=lambda item: -item[1]):
        row = INPUTS[name]
        if move > limit_m and row.stated:
            unit = f" {row.unit}" if row.unit else ""
            std = f"± {float(f'{deviations.get(name, 0.0):.1e}'):g}{unit}"
            choices.append(Choice(f"input: {row.label}", std, f"known better: {row.stated.key}", move, _RMS))
    return tuple(choices[:_MOST_INPUTS])


def moves_of_inputs(found: RunUncertainty, scene: TowingScene) -> dict[str, float]:
    """Shift of the error of the path by one standard deviation of each drawn input, RMS [m], by name.

    An input that is zero in the ``scene`` and cannot be below, such as a height, is drawn as the size |z| of a
    standard normal number z, of which the share holds 1/π: E[|z| (z² − 1)/√2]². Empty where the draws tell no
    input's share.
    """
    drawn = {name: row for name, row in INPUTS.items() if row.label in found.shares}
    if found.draws is None or not any(found.shares[row.label] for row in drawn.values()):
        return {}
    variance = float(found.draws.error[..., :2].var(axis=0).sum(axis=1).mean())
    return {
        name: float(np.sqrt((np.pi if _cannot_be_below(row, scene) else 1.0) * found.shares[row.label] * variance))
        for name, row in drawn.items()
    }


def _cannot_be_below(row: UncertainInput, scene: TowingScene) -> bool:
    """Whether an input is at zero and acts by its size."""
    return not row.values(scene).any() and row.acts_by_size(scene, -_TRIED)
