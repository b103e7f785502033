"""Model no more than a scene needs: what five scenes needed, what was left out, and what that would have changed.

    python -m studies.tables.five_scenes [--output docs/scenes.md] [--shared ../shared]

Each scene goes through the whole pipeline with ``preset: auto``: three that are filmed here (the paper's cube, a light
fast disc, a heavy slow sledge, whose motion is the package's own dynamics, since the page is about what is chosen and
not about how right it is), and the first runs of two campaigns that other programs rendered, where they are at hand.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import yaml

from studies.end_to_end import AUTO, Pipeline, PipelineResult
from studies.evidence.compute import commit, shared_folder
from studies.worlds.campaign import ANCHOR, HINGE, RATE_HZ
from studies.worlds.folder import film_campaign
from studies.worlds.scenes import Motion, drive
from towval.commands.console import errors_reported
from towval.io.atomic import write_text
from towval.io.campaign import Campaign, load_campaign
from towval.model import Array, Choice, FrictionSpecification, Patch, Tether, TimedPath, TowedObject
from towval.model.errors import TowvalError
from towval.model.geometry import rms_length, transform
from towval.model.presets import PRESETS
from towval.physics.dynamics import feedback
from towval.physics.friction_laws.makkar import fit_specification
from towval.validation.decimate import decimate
from towval.validation.simulate import SimulateSettings, simulate

_RUNG, _LENS, _POINTS, _TOLERANCE, _DRAWS = (
    "model of the object",
    "lens model",
    "points to track",
    "tolerance of a step",
    "draws",
)


@dataclass(frozen=True)
class FilmedTow:
    """A tow that is filmed here.

    ``footprint`` rings (n, 2) in the object's frame [m]; ``mass`` [kg], its centre at the frame's origin; ``stiffness``
    of the tether [N/m]; ``speed`` [m/s] and ``turn`` [1/m] of the rover; ``seconds`` of film.
    """

    what: str
    footprint: tuple[Array, ...]
    mass: float
    stiffness: float
    friction: FrictionSpecification
    speed: float
    turn: float
    seconds: float

    @property
    def rover(self) -> Motion:
        """The rover's motion, from a rest."""
        return drive((-0.15, 0.05, 0.1), speed=self.speed, turn=self.turn, rest_s=0.5)

    def towed(self, rest_length_m: float) -> Array:
        """Poses (n, 3) of the object in the frames of the film."""
        patch = Patch.of(list(self.footprint))
        centre = np.zeros(2)
        inertia = self.mass * (0.5**2 + 0.35**2) / 12
        times = np.arange(round(self.seconds * RATE_HZ)) / RATE_HZ
        fine = np.linspace(0, times[-1], 10 * len(times))
        hinge = TimedPath(fine, transform(np.array([self.rover(t) for t in fine]), HINGE))
        ahead = hinge.position[0] - (rest_length_m + ANCHOR[0]) * np.array([np.cos(0.1), np.sin(0.1)])
        towed = TowedObject(patch, self.mass, centre, inertia, ANCHOR)
        law = fit_specification(self.friction).law
        return feedback(towed, law, Tether(rest_length_m, self.stiffness), hinge, (*ahead, 0.1), times).pose

    def film(self, folder: Path) -> Campaign:
        """Write the campaign's folder."""
        given: dict[str, Any] = {
            "mass_kg": 0.98 * self.mass,
            "load": {"mass_kg": 0.02 * self.mass, "at_m": [0.0, 0.0], "size_m": [0.05, 0.05, 0.0]},
            "tether": {"rest_length_m": 0.6, "stiffness_N_per_m": self.stiffness},
            "friction": {
                "kinetic": self.friction.kinetic,
                "static": self.friction.static,
                "stiction_velocity_m_per_s": self.friction.stiction_velocity,
                "friction_velocity_m_per_s": self.friction.friction_velocity,
            },
        }
        folder.mkdir()
        film_campaign(folder, self.rover, self.towed(0.6), given)
        path = folder / "campaign.yaml"
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        rings = [ring.round(4).tolist() for ring in self.footprint]
        document["object"]["footprint_m"] = rings[0] if len(rings) == 1 else rings
        write_text(path, yaml.safe_dump(document, sort_keys=False))
        return load_campaign(folder)


def _rectangle(x: float, y: float, length: float, width: float) -> Array:
    return np.array([x, y]) + 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])


_ANGLE = 2 * np.pi * np.arange(24) / 24
_COULOMB = FrictionSpecification(static=0.35, kinetic=0.35, stiction_velocity=1e-3, friction_velocity=1e-2)

FILMED = {
    "paper's cube": FilmedTow(
        "0.4 m, 5 kg, μ = 0.35, κ = 1e5 N/m, 2 cm/s", (_rectangle(0, 0, 0.4, 0.4),), 5.0, 1e5, _COULOMB, 0.02, 0.8, 20.0
    ),
    "light fast disc": FilmedTow(
        "0.15 m of radius, 0.25 kg, 0.5 m/s, κ = 200 N/m",
        (0.15 * np.column_stack([np.cos(_ANGLE), np.sin(_ANGLE)]),),
        0.25, 200.0, _COULOMB, 0.5, 0.6, 3.6,
    ),
    "heavy slow sledge": FilmedTow(
        "two runners of 0.5 m, 60 kg, 2 cm/s, κ = 2e4 N/m",
        (_rectangle(0, 0.14, 0.5, 0.04), _rectangle(0, -0.14, 0.5, 0.04)),
        60.0, 2e4, FrictionSpecification(static=0.25, kinetic=0.2, stiction_velocity=1e-3, friction_velocity=1e-2),
        0.02, 0.5, 12.0,
    ),
}  # fmt: skip
RENDERED = {"lab_a, run a": "footage/lab_a", "lab_c, run g": "footage/lab_c"}


class Scene(NamedTuple):
    """Name, what it is, the result, or why the pipeline refuses it, and what is to be said beside it."""

    name: str
    what: str
    result: PipelineResult | str
    remark: str = ""


def scenes(shared: Path, folder: Path) -> Iterator[Scene]:
    """All scenes, with ``preset: auto``."""
    for name, tow in FILMED.items():
        yield Scene(name, tow.what, _result(tow.film(folder / name.replace(" ", "_").replace("'", ""))))
    for name, place in RENDERED.items():
        if (shared / place).is_dir():
            campaign = load_campaign(shared / place)
            result = _result(campaign)
            remark = "" if isinstance(result, str) else _sticking_and_truth(campaign, result)
            yield Scene(name, f"footage of {Path(place).name}", result, remark)


def _result(campaign: Campaign) -> PipelineResult | str:
    try:
        return Pipeline(campaign).run(PRESETS[AUTO])
    except TowvalError as error:
        return "; ".join(line.strip() for line in str(error).splitlines())


def _sticking_and_truth(campaign: Campaign, result: PipelineResult) -> str:
    """How far the first run is simulated from its known truth with sticking, and without."""
    run = next(iter(campaign.runs))
    truth = pd.read_csv(campaign.folder / f"{run}_truth.csv")
    thin = {name: decimate(track) for name, track in result.measured.items()}
    off_mm = {}
    for sticking in (False, True):
        settings = SimulateSettings(sticking=sticking)
        motion = simulate(campaign.scene, thin["rover"], thin["object"], result.measured["object"].time_s, settings)
        path = [np.interp(motion.time_s, truth.t_s, truth[f"object_{axis}_m"]) for axis in "xy"]
        off_mm[sticking] = 1e3 * rms_length(motion.pose[:, :2] - np.column_stack(path))
    return (
        f"The true path of this footage is known. The simulated one is {off_mm[False]:.2g} mm RMS from it without "
        f"sticking and {off_mm[True]:.2g} mm with it (at the default tolerance)."
    )


def page(found: list[Scene]) -> str:
    """The page as Markdown, with today's date and the commit that is checked out."""
    lines = [
        "# Model no more than a scene needs",
        "",
        "This page shows, for five scenes, what `preset: auto` selected, and how far the alternative would have moved",
        "positions. Each scene went through the whole pipeline, from the pictures of the board to the verdict.",
        "",
        "Three scenes were rendered for this page, at 800 × 450 pixels of 6 mm. Their motion was computed with the",
        "package's own dynamics. So the page shows what was selected, not how accurate it is: for that see",
        "[evidence](evidence.md).",
        "",
        "In the first table, the number in brackets is the effect of the alternative that the scene's own table names",
        "in its column *compared with*. Rows of inputs give the standard deviation, the key that states it, and the",
        "effect of one such deviation. u_D is the uncertainty of the measurement.",
        "",
        "An effect of the floor, the object or the tether is taken where `campaign.yaml` states it, however little it",
        "moves, and left out where it does not, however much one deviation of it would move: that is then part of the",
        "uncertainty. Sticking is taken where the object would otherwise creep by more than 5 mm while the rover",
        "stands. A large number in its row asks what the real object does: one that creeps below the stated stiction",
        "velocity is simulated right without sticking, and one that sticks with it.",
        "",
        f"Made on {datetime.now(UTC).date().isoformat()} at commit {commit()} by",
        "`python -m studies.tables.five_scenes --output docs/scenes.md`; do not edit.",
        "",
        "| scene | what | "
        + " | ".join((_RUNG, _LENS, _POINTS, "poses kept", _TOLERANCE, _DRAWS))
        + " | effects taken |",
        "|---" * 9 + "|",
    ]
    lines += [_overview(each) for each in found]
    missing = [name for name in (*FILMED, *RENDERED) if name not in {each.name for each in found}]
    if missing:
        lines += ["", f"Not made in this run: {'; '.join(missing)}."]
    for name, _, result, remark in found:
        lines += ["", f"## {name[0].upper()}{name[1:]}", ""]
        if isinstance(result, str):
            lines.append(f"Refused: {result}.")
            continue
        lines += [" ".join(filter(None, (_conclusion(result), remark))), ""]
        lines += ["| what | chosen | compared with | would move positions by |", "|---|---|---|---|"]
        lines += [f"| {c.what} | {c.chosen} | {c.next} | {_moved(c)} {c.measure} |" for c in result.choices]
    return "\n".join(lines) + "\n"


def main_choices(result: PipelineResult) -> dict[str, Choice | None]:
    """What was chosen for the object, the lens, the tracking, a step and the draws; None where nothing was."""
    by_name = {choice.what: choice for choice in result.choices}
    points = next((c for c in result.choices if "points" in c.chosen), None)
    return {
        name: points if name == _POINTS else by_name.get(name) for name in (_RUNG, _LENS, _POINTS, _TOLERANCE, _DRAWS)
    }


def effects_taken(result: PipelineResult) -> str:
    """The effects of the lab that were simulated, or "none"."""
    taken = [c.what.removeprefix("effect: ") for c in _effects(result) if c.chosen.startswith("taken")]
    return ", ".join(taken) or "none"


def _overview(scene: Scene) -> str:
    name, what, result, _ = scene
    if isinstance(result, str):
        return f"| {name} | {what} | refused |" + " |" * 6
    cells = ["–" if c is None else f"{c.chosen} ({_moved(c)})" for c in main_choices(result).values()]
    frames = len(result.measured["object"].time_s)
    cells.insert(3, f"{' and '.join(map(str, result.kept))} of {frames}")
    return f"| {name} | {what} | {' | '.join(cells)} | {effects_taken(result)} |"


def _conclusion(result: PipelineResult) -> str:
    """What mattered most of what was taken, and of what was left out, against the uncertainty of the measurement."""
    measurement = result.comparison.u_measurement_m
    parts = [f"u_D is {1e3 * measurement:.2f} mm; the verdict: {result.comparison.verdict}."]
    for state, words in (("taken", "that were taken"), ("left out", "that were left out")):
        own = sorted((c for c in _effects(result) if c.chosen == state), key=lambda c: -np.nan_to_num(c.change_m))
        if own:
            most = own[0]
            what = most.what.removeprefix("effect: ")
            parts.append(
                f"Of the effects {words}, the largest is {what}: {_moved(most)}, {most.change_m / measurement:.1f} u_D."
            )
    return " ".join(parts)


def _effects(result: PipelineResult) -> list[Choice]:
    return [choice for choice in result.choices if choice.what.startswith("effect: ")]


def _moved(choice: Choice) -> str:
    return f"{1e3 * choice.change_m:.2g} mm" if np.isfinite(choice.change_m) else "not known"


@errors_reported()
def main() -> None:
    """Write or print the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", type=Path, help="file to write in place of printing")
    parser.add_argument("--shared", type=Path, default=shared_folder(), help="folder that holds footage/")
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        text = page(list(scenes(given.shared, Path(folder))))
    if given.output:
        write_text(given.output, text)
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
