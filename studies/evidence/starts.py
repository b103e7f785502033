"""Checks of how bodies are found in the first frame: without clicks, and with wrong ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from studies.tables import starts
from towval.model.geometry import compose
from towval.tracking import start
from towval.tracking.clicks import Clicked

_SCENES, _CLICKED = range(850, 900), range(600, 610)


def _without_clicks() -> Values:
    counts = starts.found_of(_SCENES)
    return {
        f"tops of {counts.total()} right": counts["right"],
        f"tops of {counts.total()} silently wrong": counts[starts.WRONG],
    }


def _clicked() -> Values:
    found: dict[str, float] = {}
    for kind, counts in starts.checked_of(_CLICKED).items():
        found |= {
            f"{kind}, of {counts.total()} right": counts["right"],
            f"{kind}, silently wrong": counts[starts.WRONG],
        }
    return found


_TURNED = result_of(lambda found: ([compose(pose, np.array([0.0, 0.0, np.pi])) for pose in found[0]], found[1]))

_BESIDE = result_of(lambda found: (found[0] + np.array([0.01, 0.0, 0.0]), found[1]))

WITHOUT_CLICKS = Check(
    _without_clicks,
    {
        "half-turns are settled the wrong way": replaced(start, "_turned", _TURNED),
        "tops are settled 10 mm to one side": replaced(start, "settled", _BESIDE),
    },
)


def _as_clicked(_: Any) -> Any:
    def taken(_pictures: Any, _calibration: Any, bodies: Any, clicks_px: Any, _tow: Any) -> dict[str, Clicked]:
        return {body.name: Clicked(clicks_px[body.name], np.zeros((3, 3))) for body in bodies}

    return taken


def _silent(found: Mapping[str, Any]) -> dict[str, Any]:
    return {name: replace(each, findings=()) for name, each in found.items()}


def _aside(tracks: Mapping[str, Any]) -> dict[str, Any]:
    return {name: replace(each, pose=each.pose + np.array([0.02, 0.0, 0.0])) for name, each in _silent(tracks).items()}


WRONG_CLICKS = Check(
    _clicked,
    {
        "clicks are taken as they are": replaced(starts, "check_clicks", _as_clicked),
        "tracks are 20 mm to one side, and nothing is reported": both(
            replaced(starts, "check_clicks", result_of(_silent)), replaced(starts, "track", result_of(_aside))
        ),
    },
)
