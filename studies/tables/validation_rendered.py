"""Synthetic runs that are filmed and go through the whole pipeline, from pictures of the board to the verdict."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from studies.tables.validation_truth import SyntheticRun, planted, synthetic_run, true_motion
from studies.worlds.campaign import OBJECT, RESOLUTION_PX, ROVER, view
from studies.worlds.folder import film_campaign
from towval.commands import calibrate, decimate, simulate, track, uncertainty
from towval.commands import compare as compare_command
from towval.io.records import read_comparison
from towval.model import Array, Comparison, Verdict
from towval.model.errors import TowvalError
from towval.model.geometry import transform
from towval.optics.projection import project

CASES = ("", "stripe", "centre of mass", "tether", "")
MARGIN_PX = 12
FIRST_SEED = 999
LARGE_M = 0.02
"""A fault that is filmed moves the object by so much: about 3 u_val of these runs."""

Row = tuple[str, str, str, bool]


def rendered_rows(count: int, folder: Path) -> Iterator[Row]:
    """A row a filmed run: its verdict, and what it should be."""
    seed = FIRST_SEED
    for fault in CASES[:count]:
        seed = filmable(seed + 1, fault)
        wanted = Verdict.MODEL_ERROR if fault else Verdict.AGREES
        what = f"filmed, seed {seed}, {fault or 'as the model says'}"
        try:
            size, result = filmed_run(seed, fault, folder / str(seed))
        except TowvalError as error:
            yield what, f"refused: {error}".splitlines()[0], wanted.value, False
            continue
        if fault:
            what += f" ({size / result.u_val_m:.1f} u_val)"
        errors_reported = (
            f"{result.verdict.value}, E {1e3 * result.path_rms_m:.1f}, u_val {1e3 * result.u_val_m:.1f} mm"
        )
        yield what, errors_reported, wanted.value, result.verdict == wanted


def filmable(seed: int, fault: str) -> int:
    """The next seed whose bodies stay in the picture and whose fault, if it has one, is large."""
    while True:
        run = synthetic_run(seed)
        # The rover first: its way costs nothing, the object's a second.
        if in_view(ROVER, np.array([run.drive(t) for t in run.time_s])):
            _, right, motion = motions(seed, fault)
            if in_view(OBJECT, motion) and (not fault or shift(motion, right) > LARGE_M):
                return seed
        seed += 1


def motions(seed: int, fault: str) -> tuple[SyntheticRun, Array, Array]:
    """A run, its object's poses (n, 3) as the model says, and with the fault."""
    run = synthetic_run(seed)
    right = true_motion(run, run.truth)
    return run, right, true_motion(run, planted(run, right, fault, seed)[0]) if fault else right


def shift(motion: Array, right: Array) -> float:
    """Largest distance between two motions at the same time [m]."""
    return float(np.linalg.norm(motion[:, :2] - right[:, :2], axis=1).max())


def in_view(body, pose: Array) -> bool:
    corners = transform(pose[:, None, :], body.top_corners_m)
    points = np.concatenate([corners, np.full((*corners.shape[:2], 1), body.tracked_plane_height_m)], axis=-1)
    pixels = project(*view(), points.reshape(-1, 3))
    return bool(((pixels > MARGIN_PX) & (pixels < np.array(RESOLUTION_PX) - MARGIN_PX)).all())


def filmed_run(seed: int, fault: str, folder: Path) -> tuple[float, Comparison]:
    """Film a run, with a fault planted or none: the largest shift that the fault makes [m], and how it is judged."""
    run, right, motion = motions(seed, fault)
    campaign, results = folder / "campaign", folder / "results"
    campaign.mkdir(parents=True)
    heights = 1e-3 * np.random.default_rng([seed, 4]).standard_normal(2)
    film_campaign(campaign, run.drive, motion, given_of(run), seed, heights)
    return shift(motion, right), judged(campaign, results)


def given_of(run: SyntheticRun) -> dict:
    """What campaign.yaml says of the run."""
    scene = run.scene
    return {
        "mass_kg": scene.body_mass,
        "load": {"mass_kg": scene.load.mass, "at_m": scene.load.at.tolist(), "size_m": scene.load.size.tolist()},
        "tether": {"rest_length_m": scene.tether.rest_length, "stiffness_N_per_m": scene.tether.stiffness},
        "friction": {
            "kinetic": scene.friction.kinetic,
            "static": scene.friction.static,
            "stiction_velocity_m_per_s": scene.friction.stiction_velocity,
            "friction_velocity_m_per_s": scene.friction.friction_velocity,
        },
    }


def judged(campaign: Path, results: Path) -> Comparison:
    """All stages up to the comparison, as the workflow runs them."""
    folder, camera = results / "a", results / "camera.mcap"
    folder.mkdir(parents=True)
    files = {stage: folder / f"{stage}.mcap" for stage in ("track", "decimate", "simulate", "uncertainty", "compare")}
    calibrate.run(campaign, camera)
    track.run(campaign, "a", camera, files["track"])
    decimate.run(files["track"], files["decimate"])
    simulate.run(campaign, files["track"], files["decimate"], files["simulate"])
    uncertainty.run(campaign, "a", camera, folder, files["uncertainty"])
    compare_command.run("a", files["track"], files["simulate"], files["uncertainty"], files["compare"])
    return read_comparison(files["compare"])
