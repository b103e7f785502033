"""Checks of the tracker on synthetic films, and of what it costs."""

from __future__ import annotations

import sys
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import flawed, moved, repeated, replaced
from studies.tables import tracking_accuracy, tracking_cpu, tracking_memory
from studies.worlds.challenges import ACCURATE
from studies.worlds.film import write_video
from studies.worlds.scenes import CeilingCamera, standard_scene
from towval.io.video import Luma
from towval.tracking.plane_tracker import PlaneTracker

_SEEDS = range(900, 910)


def _metre() -> Values:
    """The first row of the table: a metre of path, medians over ten seeds."""
    make = next(iter(ACCURATE.values()))
    found: dict[str, float] = {}
    judged: dict[str, list[dict[str, float]]] = {"rover": [], "object": []}
    for seed in _SEEDS:
        for body, (track, truth) in tracking_accuracy.film_and_track(make(seed), seed, "plane").items():
            judged[body].append(tracking_accuracy.judge(track, truth))
    for body, each in judged.items():
        for name, key in (("position", "position_mm"), ("heading", "heading_deg"), ("drift", "drift_mm_per_m")):
            found[f"{body}, {name}"] = float(np.median([one[key] for one in each]))
        found |= {f"{body}, worst frame": max(one["worst_mm"] for one in each)}
        found |= {f"{body}, frames tracked": float(np.mean([one["tracked"] for one in each]))}
        pairs = np.mean([(one["predicted_position"], one["actual_position"]) for one in each], axis=0)
        found |= {f"{body}, predicted / actual": float(np.sqrt(pairs[0] / pairs[1]))}
    return found


METRE = Check(
    _metre,
    {
        "poses are 0.28 mm and 0.02° off": replaced(PlaneTracker, "measure", moved(2e-4, 2e-4, 4e-4)),
        "poses scatter by 0.3 mm and 0.03°, every twentieth is lost": replaced(
            tracking_accuracy, "track", flawed(3e-4, 5e-4)
        ),
    },
)


def _cost() -> Values:
    scene = standard_scene(77)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.mp4"
        write_video(path, CeilingCamera(scene).frames(np.arange(300) / 25), crf="20", preset="veryfast")
        results = tracking_cpu.measure(path, scene, 3)
    decoding, whole = np.median(results, axis=0) / 300 * 1e3
    return {
        "over decoding": float(np.median([b / a for a, b in results])),
        "decoding, a frame": float(decoding),
        "the pass, a frame": float(whole),
    }


COST = Check(
    _cost,
    {
        "every frame is measured four times": replaced(PlaneTracker, "measure", repeated(4)),
        "video is decoded, and tracked, three times": replaced(
            tracking_cpu, "cpu_seconds", lambda original: lambda call: original(repeated(3)(call))
        ),
    },
)


def _memory() -> Values:
    """Peak memory [MB] by kind of video and number of frames."""
    return {
        f"{each.kind}, {each.frames} frames": each.peak_mb for each in tracking_memory.peaks(tracking_memory.LENGTHS)
    }


def measure_keeping(kind: str, path: str, frames: int) -> None:
    """What the study runs in a process of its own, with a pass that keeps its last 200 pictures."""
    kept: deque[Luma] = deque(maxlen=200)

    def keeping(pictures: Iterable[tuple[float, Luma]]) -> Iterator[tuple[float, Luma]]:
        for time_s, luma in pictures:
            kept.append(luma.copy())
            yield time_s, luma

    def wrong(original: Any) -> Any:
        return lambda pictures, *args: original(keeping(pictures), *args)

    with replaced(tracking_memory, "track", wrong)():
        tracking_memory.measure(kind, Path(path), frames)


def _command_keeping(_: Any) -> Any:
    call = "from studies.evidence.tracking import measure_keeping; measure_keeping({!r}, {!r}, {})"
    return lambda kind, path, frames: [sys.executable, "-c", call.format(kind, str(path), frames)]


MEMORY = Check(
    _memory, {"the pass keeps its last 200 pictures": replaced(tracking_memory, "command", _command_keeping)}
)
