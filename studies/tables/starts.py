"""Starts of synthetic tows: found without clicks, and with wrong clicks.

    python -m studies.tables.starts --scenes 50 --first-seed 300 --wrong 10

A start is right within 1.5 px of any corner, half-turns included, without a doubt; doubted where the search says so;
else silently wrong. Wrong clicks are right where what is left after the check is within 2 px, corrected or not;
reported where a finding or a refusal says that it may not be; else silently wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Iterator

import numpy as np
from tqdm import tqdm

from studies.worlds.scenes import FilmedScene
from studies.worlds.tows import off_px, spread, towed
from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import compose, transform
from towval.optics.projection import project
from towval.tracking.clicks import check_clicks
from towval.tracking.follow import judge_clicks
from towval.tracking.outline import observe_outline, pose_from_clicks
from towval.tracking.start import Tow, find_starts
from towval.tracking.template import Luma

PICTURES, LAST_S = 9, 4.0
RIGHT_PX, CHECKED_PX = 1.5, 2.0
WRONG = "SILENTLY WRONG"
SPEAKING = {"start_unsure", "clicks_misfit", "tether_too_short", "clicks_turned"}


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


def checked(scene: FilmedScene, tow: Tow, pictures: list[Luma], clicks: dict[str, Array], index: int) -> str:
    """What became of clicks on one body."""
    body, target = scene.bodies[index], scene.target(index)
    seen = check_clicks(pictures, scene.calibration, scene.bodies, clicks, tow)[body.name]
    pose, _, misfit_px = pose_from_clicks(target, seen.corners_px)
    try:
        said = (*seen.findings, *judge_clicks(body, misfit_px, target.metres_per_pixel(pose)))
    except InputError:
        return "reported"
    fit = observe_outline(pictures[0], target, pose)
    off = off_px(scene, index, pose if fit is None else compose(pose, fit.correction))
    return "right" if off < CHECKED_PX else "reported" if SPEAKING & {each.code for each in said} else WRONG


def found_of(seeds: Iterable[int]) -> Counter[str]:
    """How many tops of these scenes are right, doubted or silently wrong without clicks."""
    return Counter(outcome for seed in tqdm(seeds, unit="scene", file=sys.stderr) for outcome in found(seed))


def checked_of(seeds: Iterable[int]) -> dict[str, Counter[str]]:
    """What became of clicks on the tops of these scenes, by their kind."""
    by_kind: dict[str, Counter[str]] = {}
    for seed in tqdm(seeds, unit="scene", file=sys.stderr):
        scene, tow = towed(seed)
        pictures, others = spread(scene, np.array([0.0, LAST_S])), scene.clicks(np.random.default_rng(seed))
        for index, body in enumerate(scene.bodies):
            for kind, clicks in wrong_clicks(scene, index, seed):
                outcome = checked(scene, tow, pictures, others | {body.name: clicks}, index)
                by_kind.setdefault(kind, Counter())[outcome] += 1
                if outcome == WRONG:
                    print(f"seed {seed} {body.name}, {kind}: silently wrong", file=sys.stderr)
    return by_kind


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
