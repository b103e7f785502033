"""Tracking rows of the must-reach table: synthetic scenes, medians over seeds.

    python benchmarks/tracking_accuracy.py --seeds 10 --first-seed 100

A row gives, for rover and object, the root mean square position [mm] and heading [deg] error over the frames called
tracked, the drift [mm/m], the share of frames tracked, the largest error of a frame called tracked [mm], and the ratio
of predicted to actual deviation, registration included, root mean square over the seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from towval.geometry import path_length, wrapped
from towval.synthetic.challenges import ACCURATE, FLAGGED, HARD, Challenge
from towval.synthetic.scenes import CeilingCamera
from towval.track import TrackSettings, track
from towval.types import Track


def film_and_track(challenge: Challenge, seed: int, method: str) -> dict[str, tuple[Track, np.ndarray]]:
    """Tracks of rover and object with their true poses."""
    scene = challenge.scene
    clicks = scene.clicks(np.random.default_rng(seed))
    bodies = [body for body in scene.bodies if body.name in ("rover", "object")]
    frames = CeilingCamera(scene).frames(challenge.times)
    tracks = track(frames, scene.calibration, bodies, clicks, TrackSettings(method=method))
    truth = scene.truth(challenge.times)
    return {name: (found, truth[name]) for name, found in tracks.items()}


def judge(found: Track, truth: np.ndarray) -> dict[str, float]:
    """Errors of one track."""
    error = found.pose - truth
    error[:, 2] = wrapped(error[:, 2])
    seen = found.seen
    distance = np.linalg.norm(error[:, :2], axis=1)
    if seen.sum() < 3:
        return {"tracked": float(seen.mean()), "findings": float(len(found.findings))}
    # Own noise and registration, as the types keep them apart.
    predicted = found.covariance[seen] + _in_floor(found.start_covariance, found.pose[seen])
    variance = np.trace(predicted[:, :2, :2], axis1=1, axis2=2)
    third = max(1, seen.sum() // 3)
    drift = np.linalg.norm(error[seen][-third:, :2].mean(axis=0) - error[seen][:third, :2].mean(axis=0))
    return {
        "position_mm": 1e3 * np.sqrt(np.mean(distance[seen] ** 2)),
        "heading_deg": np.rad2deg(np.sqrt(np.mean(error[seen, 2] ** 2))),
        "drift_mm_per_m": 1e3 * drift / max(path_length(truth[seen, :2]), 0.3),
        "tracked": float(seen.mean()),
        "worst_mm": 1e3 * distance[seen].max(),
        "predicted_position_variance": float(variance.mean()),
        "actual_position_variance": float(np.mean(distance[seen] ** 2)),
        "predicted_heading_variance": float(predicted[:, 2, 2].mean()),
        "actual_heading_variance": float(np.mean(error[seen, 2] ** 2)),
        "findings": float(len(found.findings)),
    }


def _in_floor(covariance: np.ndarray, poses: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(poses[:, 2]), np.sin(poses[:, 2]), np.zeros(len(poses)), np.ones(len(poses))
    turn = np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]).transpose(2, 0, 1)
    return turn @ covariance @ turn.transpose(0, 2, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--method", default="plane")
    parser.add_argument("--only", default="", help="part of a row's name")
    arguments = parser.parse_args()
    rows: dict[str, Callable[[int], Challenge]] = {**ACCURATE, **HARD, **FLAGGED}
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    print(
        f"method {arguments.method}, seeds {seeds.start} to {seeds.stop - 1}, medians (worst of all seeds for worst_mm)"
    )
    for name, make in rows.items():
        if arguments.only not in name:
            continue
        results: dict[str, list[dict[str, float]]] = {"rover": [], "object": []}
        for seed in seeds:
            for body, (found, truth) in film_and_track(make(seed), seed, arguments.method).items():
                results[body].append(judge(found, truth))
        for body, found in results.items():
            print(f"{name:18s} {body:7s}", _summary(found), flush=True)


def _summary(results: list[dict[str, float]]) -> str:
    parts = []
    for key in dict.fromkeys(key for result in results for key in result if not key.endswith("variance")):
        values = [result[key] for result in results if key in result]
        parts.append(f"{key} {max(values) if key == 'worst_mm' else np.median(values):.3f}")
    for kind in ("position", "heading"):
        predicted = [
            result[f"predicted_{kind}_variance"] for result in results if f"predicted_{kind}_variance" in result
        ]
        actual = [result[f"actual_{kind}_variance"] for result in results if f"actual_{kind}_variance" in result]
        if predicted:
            parts.append(f"ratio_{kind} {np.sqrt(np.mean(predicted) / np.mean(actual)):.2f}")
    return "  ".join(parts)


if __name__ == "__main__":
    main()
