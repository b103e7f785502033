"""What makes the first bound of a filmed run whose truth is known, and how short a bound that holds can be.

    python -m studies.tables.bound_sources path/to/campaign path/to/results/campaign RUN... [--draws 256]

For each source of error of the measurement, alone: u_D, RMS over the path; how far it moves the *simulation*, which is
driven by the measured rover and begins at the measured object, at most along the path (median and 95 % of draws); and
the standard deviation that it leaves the error of the run, RMS. With all stated inputs exact, the second is what a
simulation may be off, however well the comparison is made. Then, where the folder has the truth of the run, the
part of the simulation's true error that is left with the true rover and the true start, and, along the principal
directions of u_D over rover and object of all runs, what the tracks are off in deviations.
"""

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from studies.tables.draws_tolerance import case_of
from towval.commands.console import errors_reported
from towval.model import Array, Board, Body, DecimatedTrack, Track
from towval.model.geometry import pose_difference, rotation
from towval.optics.moved_view import pose_sensitivity
from towval.validation.sampler import Case, Sampler, UncertaintySettings
from towval.validation.scene_model import SceneModel
from towval.validation.simulate import RunSimulation, SimulateSettings
from towval.validation.simulate_many import Drawn

SOURCES = {
    "size of the board": ("camera",),
    "camera, the size being known": ("camera",),
    "heights of the tops": ("rover_height", "object_height"),
    "readout of the rows": ("readout",),
    "registration in the first frame": ("rover_registration", "object_registration"),
    "noise of frames": (),
}
"""Sources of what the measurement is off, and the inputs that stand for each."""

_AXES = ("x_m", "y_m", "heading_rad")
_PLACES = 25  # of a path, for the principal directions


def true_poses(truth: pd.DataFrame, body: str, times: Array) -> Array:
    """Poses (n, 3) of a body from a campaign's `<run>_truth.csv`."""
    return np.column_stack([np.interp(times, truth.t_s, truth[f"{body}_{axis}"]) for axis in _AXES])


def by_size(case: Case) -> Array:
    """Change (18,) of the camera's parameters by one deviation of the board's size, which scales the floor."""
    change = np.zeros(len(case.calibration.covariance))
    change[15:18] = Board.size_std * case.calibration.floor.T_camera_floor[:3, 3]
    return change


def camera_of(case: Case, source: str) -> Case:
    """The case with that part of the camera's covariance that a source is, all of it for other sources."""
    size, whole = np.outer(by_size(case), by_size(case)), case.calibration.covariance
    part = {"size of the board": size, "camera, the size being known": whole - size}.get(source, whole)
    return replace(case, calibration=replace(case.calibration, covariance=part))


class _Source:
    """Draws of a run in which the named inputs alone act, with or without the noise of frames."""

    def __init__(self, case: Case, source: str, names: tuple[str, ...], *, noisy: bool):
        self.sampler = Sampler(camera_of(case, source), UncertaintySettings())
        widths = self.sampler.names
        self.columns = np.repeat([name in names for name in widths], list(widths.values()))
        self.noisy = noisy

    def nominal(self) -> Drawn:
        """The run as it was simulated."""
        case = self.sampler.case
        return Drawn(case.scene, self.sampler.rover_moves, case.simulated.pose[0])

    def laid_out(self, count: int) -> Iterator[tuple[Drawn | None, Array]]:
        """What is simulated and measured (n, 3), draw by draw."""
        for i in range(count):
            draw = self.sampler.generator(i, 7).standard_normal(len(self.columns)) * self.columns
            yield self.sampler.lay_out(i, draw) if self.noisy else self.sampler.moved(draw)


class SourceEffect(NamedTuple):
    """What a source does [mm]: u_D; how far it moves the simulation at most, median and 95 %; the error's scatter."""

    source: str
    u_d: float
    median: float
    most: float
    scatter: float


def source_effects(case: Case, count: int) -> Iterator[SourceEffect]:
    """The effect of each source by itself, and of all of them, over so many draws."""
    track, times = case.object_track, case.simulated.time_s
    seen = np.column_stack([np.interp(times, track.time_s, column) for column in track.pose.T])
    error = pose_difference(case.simulated.pose, seen)[:, :2]
    everything = tuple(name for names in SOURCES.values() for name in names)
    for source, names in {**SOURCES, "all": everything}.items():
        drawing = _Source(case, source, names, noisy=source == "all" or not names)
        drawn, measured = zip(*drawing.laid_out(count), strict=True)
        nominal, *moved = drawing.sampler.batch.simulate([drawing.nominal(), *drawn])
        off = pose_difference(np.array(measured), case.simulated.pose)[..., :2]
        most = np.linalg.norm(pose_difference(np.array(moved), nominal)[..., :2], axis=-1).max(axis=-1)
        errors = error + pose_difference(np.array(moved), np.array(measured))[..., :2]
        scatter = np.nanstd(np.sqrt(np.nanmean(np.sum(errors**2, axis=-1), axis=-1)))
        found = np.sqrt(np.mean(np.sum(off**2, axis=-1))), *np.nanquantile(most, [0.5, 0.95]), scatter
        yield SourceEffect(source, *(1e3 * float(value) for value in found))


class Left(NamedTuple):
    """How far a simulation is off at most and RMS [mm], and when it is off most [s]."""

    tracks: str
    most: float
    at_s: float
    rms: float


def left(case: Case, truth: pd.DataFrame) -> Iterator[Left]:
    """How far the simulation is off, as it is and with true rover or true start."""
    model = SceneModel(case.scene, sticking=case.simulated.sticking)
    rover, start = (_true_track(thin, truth) for thin in (case.rover_decimated, case.object_decimated))
    measured = case.rover_decimated, case.object_decimated
    for what, tracks in (
        ("as measured", measured),
        ("true start", (measured[0], start)),
        ("true rover", (rover, measured[1])),
        ("both true", (rover, start)),
    ):
        run = RunSimulation(case.scene, *tracks, case.simulated.time_s)
        run.model = model
        motion = run.motion(case.simulated.rung, SimulateSettings.tolerance_m)
        true = true_poses(truth, "object", motion.time_s)
        off = np.linalg.norm(pose_difference(motion.pose, true)[:, :2], axis=1)
        most, rms = 1e3 * off.max(), 1e3 * np.sqrt(np.mean(off**2))
        yield Left(what, float(most), float(motion.time_s[off.argmax()]), float(rms))


def _true_track(thin: DecimatedTrack, truth: pd.DataFrame) -> DecimatedTrack:
    times = truth.t_s.to_numpy()
    poses = true_poses(truth, thin.body, times)
    rates, nothing = np.gradient(poses, times, axis=0), np.zeros((len(times), 3, 3))
    return replace(thin, time_s=times, pose=poses, rate=rates, covariance=nothing)


class Directions(NamedTuple):
    """Shares of u_D's variance along its first principal directions [%], and what the tracks are off along these.

    This is in deviations, without a sign: a direction has none. ``larger`` is the share of draws than which the sum of
    squares over all directions is larger [%].
    """

    shares: list[float]
    errors: list[float]
    larger: float


def principal_directions(cases: Iterable[tuple[Case, pd.DataFrame]]) -> Directions:
    """The errors of the tracks of all runs beside their stated covariance."""
    cases = list(cases)
    errors: list[Array] = []
    moves: list[Array] = []
    for number, (case, truth) in enumerate(cases):
        bodies = (case.rover, case.rover_track), (case.towed, case.object_track)
        for i, (body, track) in enumerate(bodies):
            shared, own = _moves(case, body, track)
            heights, apart = np.zeros((len(own), 2)), np.zeros((len(own), 3 * 2 * len(cases)))
            place = 3 * (2 * number + i)
            heights[:, i], apart[:, place : place + 3] = shared[:, -1], own
            moves.append(np.concatenate([shared[:, :-1], heights, apart], axis=1))
            errors.append(_error(track, truth))
    found, root = np.concatenate(errors), np.concatenate(moves)
    values, directions = np.linalg.eigh(root @ root.T)
    largest = list(zip(values, directions.T, strict=True))[:-5:-1]
    squares = np.random.default_rng(1).standard_normal((20_000, len(values))) ** 2 @ values.clip(0)
    return Directions(
        [float(100 * value / values.sum()) for value, _ in largest],
        [float(abs(direction @ found) / np.sqrt(value)) for value, direction in largest],
        float(100 * np.mean(squares < found @ found)),
    )


def _rows(track: Track) -> Array:
    seen = np.flatnonzero(track.seen)
    return seen[np.linspace(0, len(seen) - 1, _PLACES).astype(int)]


def _error(track: Track, truth: pd.DataFrame) -> Array:
    """Error of a track at some places (2 k,) [m], each the mean over the half second around."""
    off = pose_difference(track.pose, true_poses(truth, track.body, track.time_s))[:, :2]
    half = max(1, round(0.25 / float(np.median(np.diff(track.time_s)))))
    return np.array([np.nanmean(off[max(0, row - half) : row + half + 1], axis=0) for row in _rows(track)]).ravel()


def _moves(case: Case, body: Body, track: Track) -> tuple[Array, Array]:
    """What one deviation of camera and height, and of the registration, moves a track by (2 k, 19), (2 k, 3) [m]."""
    pose = track.pose[_rows(track)]
    by_camera, by_height = pose_sensitivity(case.calibration.camera, case.calibration.floor, body, pose)
    values, vectors = np.linalg.eigh(case.calibration.covariance)
    root = vectors * np.sqrt(values.clip(0))
    shared = np.concatenate([by_camera @ root, body.height_std_m * by_height[:, :, None]], axis=2)
    turned = rotation(pose[:, 2]) @ np.linalg.cholesky(track.start_covariance + 1e-18 * np.eye(3))[:2]
    return shared[:, :2].reshape(2 * _PLACES, -1), turned.reshape(2 * _PLACES, 3)


@errors_reported()
def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaign", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("runs", nargs="+")
    parser.add_argument("--draws", type=int, default=256)
    given = parser.parse_args()
    cases = {run: case_of(given.campaign, given.results, run) for run in given.runs}
    truths = {run: pd.read_csv(file) for run in given.runs if (file := given.campaign / f"{run}_truth.csv").exists()}
    for run, case in cases.items():
        print(f"\n| {run}: source | u_D, mm | moves the simulation at most by, mm | 95 % | scatter of the error, mm |")
        print("|---|---|---|---|---|")
        for effect in source_effects(case, given.draws):
            print(f"| {effect.source} | " + " | ".join(f"{value:.2f}" for value in effect[1:]) + " |")
        if run in truths:
            print(f"\n| {run}: simulated − true | at most, mm | RMS, mm |\n|---|---|---|")
            for each in left(case, truths[run]):
                print(f"| {each.tracks} | {each.most:.2f} at {each.at_s:.1f} s | {each.rms:.2f} |")
    if truths:
        print("\n| share of u_D's variance | error of the tracks, deviations |\n|---|---|")
        directions = principal_directions((cases[run], truth) for run, truth in truths.items())
        for share, error in zip(directions.shares, directions.errors, strict=True):
            print(f"| {share:.0f} % | {error:.2f} |")
        print(f"| sum of squares: larger than in | {directions.larger:.0f} % of draws |")


if __name__ == "__main__":
    main()
