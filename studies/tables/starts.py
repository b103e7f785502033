"""Starts of synthetic tows: found without clicks, and with wrong clicks.

    python -m studies.tables.starts --scenes 50 --first-seed 300 --wrong 10

A start is right within 1.5 px of any corner, half-turns included, without a doubt; doubted where the search says so;
else silently wrong. Wrong clicks are right where the body, tracked from them as they are after the check, is within
1 px (RMS of the corner that is farthest off) and within three stated deviations and 0.5 mm; reported where it is not
and a warning or a refusal says so; else silently wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from studies.worlds.scenes import CeilingCamera, FilmedScene
from studies.worlds.tows import off_px, spread, towed
from towval.commands.console import errors_reported
from towval.model import Array, Severity, Track
from towval.model.errors import InputError, TowvalError
from towval.model.geometry import transform
from towval.optics.projection import project
from towval.tracking.clicks import check_clicks
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.start import Tow, find_starts
from towval.tracking.template import Luma
from towval.tracking.track import track

PICTURES, LAST_S, RATE_HZ = 9, 4.0, 12.5
RIGHT_PX, TRACKED_PX = 1.5, 1.0
STATED, BESIDE_M = 3.0, 5e-4
WRONG = "SILENTLY WRONG"


def found(seed: int) -> list[str]:
    """What became of rover and object of a scene without clicks."""
    scene, tow = towed(seed)
    try:
        starts = find_starts(spread(scene, np.linspace(0, LAST_S, PICTURES)), scene.calibration, scene.bodies, tow)
    except InputError:
        return ["doubted"] * len(scene.bodies)
    outcomes = []
    for index, body in enumerate(scene.bodies):
        start = starts[body.name]
        off = off_px(scene, index, start.pose)
        outcomes.append("doubted" if start.doubt else "right" if off < RIGHT_PX else WRONG)
        if outcomes[-1] != "right":
            print(f"seed {seed} {body.name}: {off:.1f} px off, {start.doubt or 'no doubt'}", file=sys.stderr)
    return outcomes


def wrong_clicks(scene: FilmedScene, index: int, seed: int) -> Iterator[tuple[str, Array]]:
    """Kinds of wrong clicks on one body, as clicked (n, 2) [px]; good ones first."""
    rng, body = np.random.default_rng([seed, index]), scene.bodies[index]
    good = scene.clicks(rng)[body.name]
    yield "good", good
    for shift_px in (8, 25, 40):
        angle = rng.uniform(0, 2 * np.pi)
        step = shift_px * np.array([np.cos(angle), np.sin(angle)])
        yield f"shifted {shift_px} px", good + step
        yield f"a corner {shift_px} px", good + step * (np.arange(len(good)) == rng.integers(len(good)))[:, None]
    yield "half a turn", np.roll(good, len(good) // 2, axis=0)
    corners = transform(scene.motions[index](0.0), body.top_corners_m)
    yield "base for top", project(scene.camera, scene.floor, np.column_stack([corners, np.zeros(len(corners))]))


@dataclass(frozen=True)
class Filmed:
    """A scene with its tow, its pictures (first and last for the check, all for the tracker) and true poses."""

    scene: FilmedScene
    tow: Tow
    pictures: list[tuple[float, Luma]]
    truth: dict[str, Array]


def filmed(seed: int) -> Filmed:
    """The first seconds of a scene."""
    scene, tow = towed(seed)
    times = np.arange(0.0, LAST_S, 1 / RATE_HZ)
    return Filmed(scene, tow, list(CeilingCamera(scene).frames(times)), scene.truth(times))


def checked(film: Filmed, clicks: dict[str, Array], index: int) -> str:
    """What became of clicks on one body."""
    scene, body = film.scene, film.scene.bodies[index]
    ends = [film.pictures[k][1] for k in (0, -1)]
    try:
        seen = check_clicks(ends, scene.calibration, scene.bodies, clicks, film.tow)[body.name]
        found = track(iter(film.pictures), scene.calibration, [body], {body.name: seen.corners_px})[body.name]
    except TowvalError:
        return "reported"
    off_m, std_m = _off(found, film.truth[body.name], scene.target(index))
    pixel_m = scene.target(index).metres_per_pixel(film.truth[body.name][0])
    if off_m <= min(TRACKED_PX * pixel_m, STATED * std_m + BESIDE_M):
        return "right"
    warned = any(each.severity is not Severity.NOTE for each in (*seen.findings, *found.findings))
    return "reported" if warned else WRONG


def _off(found: Track, truth: Array, target: PlanarTarget) -> tuple[float, float]:
    """RMS error of the farthest corner and its stated deviation, that of the registration included [m]."""
    apart = [target.apart_m(true, pose) for true, pose in zip(truth[found.seen], found.pose[found.seen], strict=True)]
    variances = np.diag(found.covariance[found.seen].mean(axis=0) + found.start_covariance)
    return float(np.sqrt(np.mean(np.square(apart)))), float(np.sqrt(variances @ [1.0, 1.0, target.reach_m**2]))


def found_of(seeds: Iterable[int]) -> Counter[str]:
    """How many tops of these scenes are right, doubted or silently wrong without clicks."""
    return Counter(outcome for seed in tqdm(seeds, unit="scene", file=sys.stderr) for outcome in found(seed))


def checked_of(seeds: Iterable[int]) -> dict[str, Counter[str]]:
    """What became of clicks on the tops of these scenes, by their kind."""
    by_kind: dict[str, Counter[str]] = {}
    for seed in tqdm(seeds, unit="scene", file=sys.stderr):
        film = filmed(seed)
        others = film.scene.clicks(np.random.default_rng(seed))
        for index, body in enumerate(film.scene.bodies):
            for kind, clicks in wrong_clicks(film.scene, index, seed):
                outcome = checked(film, others | {body.name: clicks}, index)
                by_kind.setdefault(kind, Counter())[outcome] += 1
                if outcome == WRONG:
                    print(f"seed {seed} {body.name}, {kind}: silently wrong", file=sys.stderr)
    return by_kind


@errors_reported()
def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=50)
    parser.add_argument("--wrong", type=int, default=10, help="scenes for wrong clicks")
    parser.add_argument("--first-seed", type=int, default=300)
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.scenes)
    print(f"without clicks, seeds {seeds.start} to {seeds.stop - 1}: {dict(found_of(seeds))}", flush=True)
    for kind, counts in checked_of(seeds[: arguments.wrong]).items():
        print(f"{kind:18s} {dict(counts)}")


if __name__ == "__main__":
    main()
