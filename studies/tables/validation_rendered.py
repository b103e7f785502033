"""Verdicts on synthetic runs that are filmed and go through the whole pipeline, from pictures of the board on.

    python -m studies.tables.validation_rendered [--runs 1]

``validation_must_reach`` has these rows, too.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studies.worlds.campaign import OBJECT, RESOLUTION_PX, ROVER, view
from studies.worlds.folder import film_campaign
from studies.worlds.towed_runs import SyntheticRun, planted, synthetic_run, true_motion
from towval.commands import calibrate, decimate, simulate, track, uncertainty
from towval.commands import compare as compare_command
from towval.commands.console import errors_reported
from towval.io.records import read_comparison
from towval.model import Array, Body, Comparison, Verdict
from towval.model.errors import TowvalError
from towval.model.geometry import transform
from towval.optics.projection import project

WANTED = {
    "": Verdict.AGREES,
    "stripe": Verdict.DISAGREES,
    "centre of mass": Verdict.DISAGREES,
    # Its ends are seen farther apart than the stated tether reaches: what was stated is wrong, not the model.
    "tether": Verdict.NOT_JUDGED,
}
MARGIN_PX = 12
FIRST_SEED = 1000
LARGE_M = 0.02
"""A fault that is filmed moves the object by so much: about 3 u_val of these runs."""

Row = tuple[str, str, str, bool]


@dataclass(frozen=True)
class Rendered:
    """A filmed run: its fault ("" for none), by how much that moves the object [m], and how it is judged or refused."""

    seed: int
    fault: str
    shift_m: float
    result: Comparison | str

    @property
    def said(self) -> str:
        """The verdict, or "refused"."""
        return "refused" if isinstance(self.result, str) else self.result.verdict.value


def rendered_runs(each: int, folder: Path) -> Iterator[Rendered]:
    """So many filmed runs of each fault, and as many without one."""
    for fault in WANTED:
        seed = FIRST_SEED
        for _ in range(each):
            seed = filmable(seed, fault)
            with tempfile.TemporaryDirectory(dir=folder) as scratch:
                yield filmed_run(seed, fault, Path(scratch))
            seed += 1


def rendered_rows(each: int, folder: Path) -> Iterator[Row]:
    """A row a filmed run: its verdict, and what it should be."""
    for run in rendered_runs(each, folder):
        what = f"filmed, seed {run.seed}, {run.fault or 'as the model says'}"
        wanted = WANTED[run.fault].value
        if isinstance(run.result, str):
            yield what, f"refused: {run.result}", wanted, False
            continue
        result = run.result
        if run.fault:
            what += f" ({run.shift_m / result.u_val_m:.1f} u_val)"
        stated = f"{run.said}, E {1e3 * result.path_rms_m:.1f}, u_val {1e3 * result.u_val_m:.1f} mm"
        yield what, stated, wanted, run.said == wanted


def filmable(seed: int, fault: str) -> int:
    """The first seed, from one on, whose bodies stay in the picture and whose fault, if it has one, is large."""
    while True:
        run = synthetic_run(seed)
        # The rover first: its trajectory costs nothing to compute, the object's a second.
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


def in_view(body: Body, pose: Array) -> bool:
    """Whether a body with poses (n, 3) stays in the picture."""
    corners = transform(pose[:, None, :], body.top_corners_m)
    points = np.concatenate([corners, np.full((*corners.shape[:2], 1), body.tracked_plane_height_m)], axis=-1)
    pixels = project(*view(), points.reshape(-1, 3))
    return bool(((pixels > MARGIN_PX) & (pixels < np.array(RESOLUTION_PX) - MARGIN_PX)).all())


def filmed_run(seed: int, fault: str, folder: Path) -> Rendered:
    """Film a run, with a fault planted or none, and judge it."""
    run, right, motion = motions(seed, fault)
    campaign, results = folder / "campaign", folder / "results"
    film(run, motion, seed, campaign)
    try:
        result: Comparison | str = judged(campaign, results)
    except TowvalError as error:
        result = str(error).splitlines()[0]
    return Rendered(seed, fault, shift(motion, right), result)


def film(run: SyntheticRun, motion: Array, seed: int, campaign: Path) -> None:
    """The campaign folder of a run whose object moves so (n, 3)."""
    campaign.mkdir(parents=True)
    rover, towed = 1e-3 * np.random.default_rng([seed, 4]).standard_normal(2)
    film_campaign(campaign, run.drive, motion, given_of(run), seed, (rover, towed))


def given_of(run: SyntheticRun) -> dict:
    """What campaign.yaml says of the run.

    Its tether has no damping at all, and that is stated: where nothing is, a lossless tether is as good as ruled out.
    """
    scene = run.scene
    return {
        "mass_kg": scene.body_mass,
        "load": {"mass_kg": scene.load.mass, "at_m": scene.load.at.tolist(), "size_m": scene.load.size.tolist()},
        "tether": {
            "rest_length_m": scene.tether.rest_length,
            "stiffness_N_per_m": scene.tether.stiffness,
            "damping_Ns_per_m": 0.0,
            "damping_std_Ns_per_m": 0.0,
        },
        "friction": {
            "kinetic": scene.friction.kinetic,
            "static": scene.friction.static,
            "stiction_velocity_m_per_s": scene.friction.stiction_velocity,
            "friction_velocity_m_per_s": scene.friction.friction_velocity,
        },
    }


def judged(campaign: Path, results: Path, name: str = "a") -> Comparison:
    """All stages of a run up to the comparison, as the workflow runs them; the camera of an earlier run is used."""
    folder, camera = results / name, results / "camera.mcap"
    folder.mkdir(parents=True)
    files = {stage: folder / f"{stage}.mcap" for stage in ("track", "decimate", "simulate", "uncertainty", "compare")}
    if not camera.is_file():
        calibrate.run(campaign, camera)
    track.run(campaign, name, camera, files["track"])
    decimate.run(files["track"], files["decimate"])
    simulate.run(campaign, files["track"], files["decimate"], files["simulate"])
    uncertainty.run(campaign, name, camera, folder, files["uncertainty"])
    compare_command.run(name, files["track"], files["simulate"], files["uncertainty"], files["compare"])
    return read_comparison(files["compare"])


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1, help="of each fault, and of none")
    with tempfile.TemporaryDirectory() as folder:
        for what, measured, wanted, good in rendered_rows(parser.parse_args().runs, Path(folder)):
            print(f"{what:60} {measured:44} {wanted:16} {'' if good else 'MISSED'}", flush=True)


if __name__ == "__main__":
    main()
