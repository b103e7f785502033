"""Checks of what is measured and simulated on the filmed runs of lab_a and lab_c."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from studies.costs import least_cpu_seconds
from studies.evidence.compute import REPOSITORY, shared_folder
from studies.evidence.lab import restated, stated
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of, tethered_longer
from studies.tables import bound_sources, draws_tolerance
from studies.tables.validation_rendered import judged
from towval.commands import calibrate, decimate, identify, simulate, track
from towval.io.records import read_tracks
from towval.io.records.identification import read_identification
from towval.model import Array, Body, DecimatedTrack, TowingScene, Track
from towval.tracking import follow, known_lengths
from towval.validation import compare as validation_compare
from towval.validation import identify as validation_identify
from towval.validation import simulate as validation_simulate
from towval.validation.hinge_trajectory import trajectory_of
from towval.validation.sampler import Case, Sampler, UncertaintySettings
from towval.validation.scene_model import SceneModel
from towval.validation.simulate_many import Batch, Drawn
from towval.validation.uncertainty import UncertaintySampling

_HERE = sys.modules[__name__]
_MASSES_G_PER_M = (5, 20, 100, 500)
_RAISED_M = 0.05


def filmed(name: str, runs: str) -> Iterator[tuple[str, Case]]:
    """Runs of a campaign, from the pictures to the simulation, as the stage uncertainty reads them."""
    campaign = shared_folder() / "footage" / name
    with TemporaryDirectory() as folder:
        results = Path(folder)
        calibrate.run(campaign, results / "camera.mcap")
        for run in runs:
            files = {stage: results / run / f"{stage}.mcap" for stage in ("track", "decimate", "simulate")}
            (results / run).mkdir()
            track.run(campaign, run, results / "camera.mcap", files["track"])
            decimate.run(files["track"], files["decimate"])
            simulate.run(campaign, files["track"], files["decimate"], files["simulate"])
            yield f"{name}, {run}", draws_tolerance.case_of(campaign, results, run)


def _draws() -> Values:
    """RMS distance of the draws' paths from those at 1e-8 m [mm], by tolerance and run."""
    return {
        f"{each.tolerance_m:g} m, {run}": 1e3 * each.off_m
        for name, runs in (("lab_a", "abc"), ("lab_c", "gh"))
        for run, case in filmed(name, runs)
        for each in draws_tolerance.drawn_paths(case)
    }


def _coarser(original: Any) -> Any:
    return lambda batch, tolerance_m: original(batch, tolerance_m=10 * tolerance_m)


DRAWS = Check(
    _draws,
    {"the tolerance of the draws counts tenfold": replaced(draws_tolerance, "replace", _coarser)},
    needs=("footage/lab_a", "footage/lab_c"),
)


def with_mass(scene: TowingScene, grams_a_metre: float) -> TowingScene:
    """A scene whose tether has a mass; one on the floor is raised, or it could not hang."""
    raised = scene.hinge_height == 0 and scene.anchor_height == 0
    heights = (scene.anchor_height + raised * _RAISED_M, scene.hinge_height + raised * _RAISED_M)
    tether = replace(scene.tether, mass_per_length=1e-3 * grams_a_metre)
    return replace(scene, tether=tether, anchor_height=heights[0], hinge_height=heights[1])


def _tether_mass() -> Values:
    """RMS distance of the simulated paths from that without a mass [mm], by mass [g/m] and run."""
    found: dict[str, float] = {}
    for name, runs in (("lab_a", "ac"), ("lab_c", "gh")):
        for run, case in filmed(name, runs):
            given = case.rover_decimated, case.object_decimated, case.object_track.time_s
            without, *with_one = (
                validation_simulate.simulate(with_mass(case.scene, mass), *given).pose[:, :2]
                for mass in (0, *_MASSES_G_PER_M)
            )
            for mass, path in zip(_MASSES_G_PER_M, with_one, strict=True):
                found[f"{mass} g/m, {run}"] = 1e3 * float(np.sqrt(np.mean(np.sum((path - without) ** 2, axis=1))))
    return found


TETHER_MASS = Check(
    _tether_mass,
    {
        "the tether is half as heavy as it is said to be": replaced(
            _HERE, "with_mass", lambda original: lambda scene, mass: original(scene, 0.5 * mass)
        )
    },
    needs=("footage/lab_a", "footage/lab_c"),
)


_STEPPED = 100
"""Draws whose steps are counted."""


def _steps() -> Values:
    """Steps that draws of lab_c g try and that fail, and the CPU time of a draw [ms]: medians."""
    ((_, case),) = filmed("lab_c", "g")
    sampler = Sampler(case, UncertaintySettings())
    batch, rng = sampler.batch, np.random.default_rng(3)
    tried, failed, spent = [], [], []
    for i in range(_STEPPED):
        drawn, _ = sampler.lay_out(i, rng.standard_normal(sum(sampler.widths.values())))
        if drawn is not None:
            hinge = trajectory_of(drawn.scene.hinge, batch.rover_times, drawn.rover)
            model = SceneModel(drawn.scene, sticking=batch.sticking)
            counts = model.motion(batch.rung, hinge, drawn.start, batch.times, batch.tolerance_m).statistics
            tried.append(counts["steps"] + counts["rejections"])
            failed.append(counts["rejections"])
            spent.append(least_cpu_seconds(partial(_simulated, batch, drawn), 2))
    return {
        "steps tried": float(np.median(tried)),
        "of these fail": float(np.median(failed)),
        "a draw": 1e3 * float(np.median(spent)),
    }


def _simulated(batch: Batch, drawn: Drawn) -> list[Array]:
    return list(batch.simulate([drawn]))


STEPS = Check(
    _steps,
    {
        "a step may be off by 0.01 µm in place of 3 µm": replaced(
            _HERE, "UncertaintySettings", lambda settings: lambda: settings(tolerance_m=1e-8)
        )
    },
    needs=("footage/lab_c",),
)

_ALONE = 256
"""Draws of each source by itself."""

_HEIGHTS, _SIZE = "heights of the tops", "size of the board"
_BETTER = {_SIZE: 1 / 5, _HEIGHTS: 0.3}
"""Deviations of a board measured to 0.1 ‰ and of heights to 0.3 mm, over the default ones."""


_SEEN = (("lab_a", "ab", "ab"), ("lab_c", "gh", "g"))
"""Campaigns, runs, and those whose truth is known."""


def _bound_sources() -> Values:
    """What each source does to the runs [mm], by draws of it alone."""
    found: dict[str, float] = {}
    for name, runs, _ in _SEEN:
        for _, case in filmed(name, runs):
            effects = list(bound_sources.source_effects(case, _ALONE))
            for each in effects:
                at = f"{name} {case.run}, {each.source}"
                found |= {f"{at}, u_D": each.u_d, f"{at}, median": each.median, f"{at}, 95 %": each.most}
                found[f"{at}, scatter"] = each.scatter
            better = [each.u_d * _BETTER.get(each.source, 1.0) for each in effects if each.source != "all"]
            at = f"{name} {case.run}, board known to 0.1 ‰ and heights to 0.3 mm"
            found[f"{at}, u_D"] = float(np.linalg.norm(better))
    return found


def _beside_truth() -> Values:
    """What is left of the simulation's error with true tracks [mm], and errors of tracks along directions."""
    found: dict[str, float] = {}
    for name, _, known in _SEEN:
        cases = {case.run: case for _, case in filmed(name, known)}
        truths = {run: pd.read_csv(shared_folder() / "footage" / name / f"{run}_truth.csv") for run in known}
        for run, case in cases.items():
            for left in bound_sources.left(case, truths[run]):
                found[f"{name} {run}, {left.tracks}, simulated − true at most"] = left.most
        directions = bound_sources.principal_directions((cases[run], truth) for run, truth in truths.items())
        for k, (share, error) in enumerate(zip(directions.shares, directions.errors, strict=True), 1):
            found |= {f"{name}, direction {k}, share": share, f"{name}, direction {k}, error": error}
        found[f"{name}, sum of squares, larger than in"] = directions.larger
    return found


def _less_sure(original: Any) -> Any:
    """Runs whose measurement is less sure than is said, in other proportions, and whose tether is 5 mm longer."""

    def track_of(track: Track) -> Track:
        return replace(track, covariance=25 * track.covariance, start_covariance=16 * track.start_covariance)

    def thin(kept: DecimatedTrack) -> DecimatedTrack:
        return replace(kept, covariance=25 * kept.covariance)

    def higher(body: Body) -> Body:
        return replace(body, height_std_m=3 * body.height_std_m)

    def wrong(*args: Any) -> Iterator[tuple[str, Case]]:
        for run, case in original(*args):
            yield run, replace(
                case,
                scene=tethered_longer(5e-3)(lambda scene: scene)(case.scene),
                deviations={**case.deviations, "readout": 2 * case.deviations["readout"]},
                calibration=replace(case.calibration, covariance=4 * case.calibration.covariance),
                rover=higher(case.rover), towed=higher(case.towed),
                rover_track=track_of(case.rover_track), object_track=track_of(case.object_track),
                rover_decimated=thin(case.rover_decimated),
            )  # fmt: skip

    return wrong


_LESS_SURE = {
    "board, camera, lens and readout are 2 times as uncertain, heights 3, registration 4, noise 5 times, and the "
    "simulated tether is 5 mm too long": both(
        replaced(_HERE, "filmed", _less_sure), replaced(bound_sources, "by_size", result_of(lambda size: 2 * size))
    )
}

BOUND_SOURCES = Check(_bound_sources, _LESS_SURE, needs=("footage/lab_a", "footage/lab_c"))
BESIDE_TRUTH = Check(_beside_truth, _LESS_SURE, needs=("footage/lab_a", "footage/lab_c"))


def _identified() -> Values:
    """The ratio of friction across to along by both runs of lab_c, and how it predicts one from the other [mm RMS]."""
    with TemporaryDirectory() as folder:
        campaign, results = shared_folder() / "footage" / "lab_c", Path(folder)
        for run in "gh":
            judged(campaign, results, run)
        output = results / "identify.mcap"
        identify.run(campaign, results, output, {"parameters": ["across_over_along"]})
        fit = read_identification(output)
    found = {"ratio by both": float(fit.values[0]), "its deviation": float(np.sqrt(fit.covariance[0, 0]))}
    for each in fit.predictions:
        found[f"{each.run}, ratio as stated"] = 1e3 * each.given_rms_m
        found[f"{each.run}, ratio identified on the other run"] = 1e3 * each.predicted_rms_m
    texts = " ".join(each.text for each in fit.findings if each.code == "identify_misfit")
    left = re.search(r"inputs leave ([\d.]+) .* and ([\d.]+) where", texts)
    residual, others = map(float, left.groups()) if left else (0.0, 0.0)
    return found | {"residual": residual, "residual, the other inputs off as stated": others}


def _as_larger(original: Any) -> Any:
    return lambda real, row, component, value: original(real, row, component, 1.02 * value)


IDENTIFIED = Check(
    _identified,
    {
        "the tether is taken 5 mm too long": replaced(identify, "identify", tethered_longer(5e-3)),
        "a value that is tried acts as one that is 2 % larger": replaced(validation_identify, "_changed", _as_larger),
        "inputs that are not fitted move the paths by half as much": replaced(
            validation_identify._Fit, "by_others", result_of(lambda changes: changes / 2)
        ),
    },
    needs=("footage/lab_c",),
)


def _known_lengths() -> Values:
    """Sizes of the tops over the stated ones, less 1, and their deviations [%], with boards as stated and smaller."""
    found: dict[str, float] = {}
    samples, footage = REPOSITORY / "data_samples", shared_folder() / "footage"
    for source, run, boards in (
        (samples / "lab_small", "a", (100.0, 99.7, 99.0)),
        (footage / "lab_a", "a", (100.0, 99.7, 99.0)),
        (footage / "lab_c", "g", (100.0,)),
    ):
        for board in boards:
            with TemporaryDirectory() as folder:
                campaign, camera, output = (Path(folder) / name for name in ("campaign", "camera.mcap", "track.mcap"))
                restated(source, campaign, _boards_of(stated(source), board))
                calibrate.run(campaign, camera)
                track.run(campaign, run, camera, output)
                seen = read_tracks(output)["rover"].camera
            if seen is not None:
                at = f"{source.name} {run}, board of {board:g} %"
                found |= {at: 100 * seen.size, f"{at}, deviation": 100 * seen.size_std}
    return found


def _boards_of(text: str, percent: float) -> str:
    """What campaign.yaml says, of a board that has so much of the size that is stated."""
    return re.sub(r"square_m: ([\d.]+)", lambda square: f"square_m: {float(square[1]) / (percent / 100):.6g}", text)


KNOWN_LENGTHS = Check(
    _known_lengths,
    {
        "outlines come out 0.2 % larger, tops are measured to 3 mm": both(
            replaced(follow, "observe_size", result_of(lambda size: None if size is None else size + 2e-3)),
            replaced(known_lengths, "OUTLINE", lambda said: replace(said, length_std_m=3 * said.length_std_m)),
        )
    },
    needs=("footage/lab_a", "footage/lab_c"),
)


_STATIC, _SPEEDS, _FLAT = "static friction stated 0.45", "speeds stated 25 % too large", "without heights and slope"

_MISSTATED: dict[str, Callable[[str], str]] = {
    _STATIC: lambda text: text.replace("static: 0.396", "static: 0.45"),
    _SPEEDS: lambda text: re.sub(
        r"(\w+_velocity_m_per_s: )([\d.]+)", lambda found: f"{found[1]}{1.25 * float(found[2]):.6g}", text
    ),
    _FLAT: lambda text: re.sub(r"(?m)^  (slope|tether_\w+_height).*\n", "", text),
}
"""What campaign.yaml says wrong, by name."""

_PLANTED = {_STATIC: "static_friction", _FLAT: "hinge_height"}
"""The input that has to be named, by what is stated wrong; none for speeds, with which the runs agree."""


def _misstated() -> Values:
    """What is said of runs whose campaign.yaml states something wrong: verdict, bound and E [mm], and what is named."""
    found: dict[str, float | str] = {}
    for name, runs, wrongs in (("lab_a", "a", (_STATIC, _SPEEDS)), ("lab_c", "gh", (_FLAT,))):
        source = shared_folder() / "footage" / name
        for wrong in wrongs:
            with TemporaryDirectory() as folder:
                campaign, results = Path(folder) / name, Path(folder) / "results"
                restated(source, campaign, _MISSTATED[wrong](stated(source)))
                for run in runs:
                    result = judged(campaign, results, run)
                    at = f"{name} {run}, {wrong}"
                    found |= {f"{at}, verdict": str(result.verdict), f"{at}, E": 1e3 * result.path_rms_m}
                    found[f"{at}, first bound"] = 1e3 * result.error_upper_m
                    named = dict.fromkeys((_PLANTED[wrong],) if wrong in _PLANTED else (), 0.0)
                    if result.explanation is not None:
                        named |= result.explanation.moved
                        found[f"{at}, remains"] = 1e3 * result.explanation.remaining_rms_m
                    found |= {f"{at}, {what}": deviations for what, deviations in named.items()}
    return found


def _twice_as_far(original: Any) -> Any:
    """What simulates a run with inputs moved: twice as far as asked for, on a path 1 mm to one side."""

    def wrong(*given: Any) -> Any:
        left = original(*given)

        def errors(moves: Sequence[Mapping[int, float]]) -> Array:
            aside = 1e-3 * np.array([any(each.values()) for each in moves])
            farther = [{column: 2 * value for column, value in each.items()} for each in moves]
            return np.asarray(left(farther) + aside[:, None, None] * np.array([0.0, 1.0, 0.0]))

        return errors

    return wrong


MISSTATED = Check(
    _misstated,
    {
        "nothing is misstated": replaced(
            _HERE, "_MISSTATED", lambda wrongs: {wrong: lambda text: text for wrong in wrongs}
        ),
        "moved inputs act twice as far, on a path 1 mm to one side; a tenth of the tolerance matters": both(
            replaced(UncertaintySampling, "_left", _twice_as_far),
            replaced(validation_compare, "TOLERANCE_M", lambda tolerance: tolerance / 10),
        ),
    },
    needs=("footage/lab_a", "footage/lab_c"),
)
