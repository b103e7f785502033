"""Checks of the tracker on synthetic films, and of what it costs."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, flawed, moved, repeated, replaced, result_of
from studies.evidence.tracker_faults import REFUSING, UNDOUBTING, UNDOUBTING_SAYS, scattered
from studies.tables import tracking_accuracy, tracking_cpu, tracking_memory
from studies.worlds.challenges import ACCURATE, FLAGGED, HARD
from towval.io.video import Luma
from towval.tracking import finished_track
from towval.tracking.plane_tracker import PlaneTracker

_HERE = sys.modules[__name__]
_SEEDS = range(26900, 26910)


def _metre() -> Values:
    """The first row of the table, a metre of path: medians over ten seeds, the mean share tracked, the worst frame."""
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


_SCENES = {
    "arm and tether": "arm and tether pass over",
    "light x 0.65": "light × 0.65 in one step",
    "shadow edge": "moving edge of a shadow",
    "every 10th frame": "every 10th frame",
    "motion blur 10 px": "motion blur of 10 px",
    "full occlusion": "object fully hidden for a second",
    "swapped": "another body takes the hidden object's place",
    "twin in view": "the object is moved while hidden, a lookalike in view",
    "leaving the image": "the rover leaves the image",
    "low texture": "targets almost plain",
}
"""Rows of the table, as the documents call them."""

_SHOWN = {
    "position_mm": "position",
    "scatter_mm": "without the registration",
    "heading_deg": "heading",
    "worst_mm": "worst frame",
    "position_ratio": "predicted / actual",
    "heading_ratio": "predicted / actual, heading",
    "warned": "warned",
}


def _scenes() -> Values:
    """The table's rows of scenes with disturbances, by scene and body."""
    found: dict[str, float] = {}
    for name, make in {**HARD, **FLAGGED}.items():
        judged: dict[str, list[dict[str, float]]] = {"rover": [], "object": []}
        for seed in _SEEDS:
            for body, (track, truth) in tracking_accuracy.film_and_track(make(seed), seed, "plane").items():
                judged[body].append(tracking_accuracy.judge(track, truth))
        for body, each in judged.items():
            whole = tracking_accuracy.summary(each)
            found |= {f"{_SCENES[name]}, {body}, {shown}": whole[key] for key, shown in _SHOWN.items()}
            found[f"{_SCENES[name]}, {body}, tracked"] = 100 * whole["tracked"]
    return found


SCENES = Check(
    _scenes,
    {
        "measured poses scatter by 0.4 mm and 0.1°, those of every twentieth picture do not count, and any top is too "
        "plain": both(
            scattered(4e-4, 2e-3),
            REFUSING,
            replaced(finished_track, "CONSTANTS", lambda c: replace(c, low_texture_px=0.0)),
        ),
        UNDOUBTING_SAYS: UNDOUBTING,
        "outlines are stated to be half as uncertain, in every tenth frame alone": both(
            replaced(
                finished_track,
                "registration",
                result_of(lambda fit: fit and replace(fit, covariance=fit.covariance / 4)),
            ),
            replaced(_HERE, "HARD", lambda scenes: {name: scenes[name] for name in ("every 10th frame",)}),
            replaced(_HERE, "FLAGGED", lambda _: {}),
        ),
    },
)


def _cost() -> Values:
    with tracking_cpu.synthetic(300) as films:
        found = {"over decoding": tracking_cpu.ratio(films[0].measured(3))}
    lab = tracking_cpu.of_campaign(shared_folder() / "footage" / "lab_a")
    return found | {f"over decoding, lab_a {film.path.stem}": tracking_cpu.ratio(film.measured(3)) for film in lab}


COST = Check(
    _cost,
    {"every frame is measured four times": replaced(PlaneTracker, "measure", repeated(4))},
    needs=("footage/lab_a",),
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
