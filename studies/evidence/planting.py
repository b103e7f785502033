"""Ways to plant a fault: a function in a module's place that is wrong, or a value."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np

from studies.evidence.ledger import Values
from towval.model import Array, TowingScene, Track
from towval.model.tracks import TrackStatus

Planting = Callable[[], AbstractContextManager[object]]


def replaced(where: Any, name: str, wrong: Callable[[Any], Any]) -> Planting:
    """Plant ``wrong(original)`` in the place of ``name`` in a module, class or instance."""
    return lambda: patch.object(where, name, wrong(getattr(where, name)))


def result_of(change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function whose result is changed."""
    return lambda original: lambda *args, **kwargs: change(original(*args, **kwargs))


def given(**changed: Any) -> Callable[[Any], Any]:
    """A function that is deaf to some of its keywords."""
    return lambda original: lambda *args, **kwargs: original(*args, **{**kwargs, **changed})


def repeated(times: int) -> Callable[[Any], Any]:
    """A function that does its work several times, for what is said of costs."""

    def wrong(original: Any) -> Any:
        def again(*args: Any, **kwargs: Any) -> Any:
            for _ in range(times - 1):
                original(*args, **kwargs)
            return original(*args, **kwargs)

        return again

    return wrong


def moved(*by: float) -> Callable[[Any], Any]:
    """A tracker's ``measure`` whose poses are off by so much [m, m, rad]."""
    return result_of(lambda found: found and replace(found, pose=found.pose + np.array(by)))


def tethered_longer(by_m: float) -> Callable[[Any], Any]:
    """What takes a scene first, with a tether that is so much longer [m]."""

    def wrong(original: Any) -> Any:
        def longer(scene: TowingScene, *args: Any, **kwargs: Any) -> Any:
            tether = replace(scene.tether, rest_length=scene.tether.rest_length + by_m)
            return original(replace(scene, tether=tether), *args, **kwargs)

        return longer

    return wrong


def both(*faults: Planting) -> Planting:
    """Several faults at once."""

    @contextmanager
    def planted() -> Iterator[None]:
        with ExitStack() as stack:
            for fault in faults:
                stack.enter_context(fault())
            yield

    return planted


def flawed(position_m: float, heading_rad: float) -> Callable[[Any], Any]:
    """What tracks bodies: poses of each scatter by so much, and every twentieth is lost."""

    def wrong(tracks: Mapping[str, Track]) -> dict[str, Track]:
        rng = np.random.default_rng(1)
        return {
            body: _scattered(track, rng.normal(size=track.pose.shape) * [position_m, position_m, heading_rad])
            for body, track in tracks.items()
        }

    return result_of(wrong)


def _scattered(track: Track, by: Array) -> Track:
    by[10::20] = np.nan
    status = np.where(np.isnan(by[:, 0]), TrackStatus.LOST, track.status).astype(np.uint8)
    return replace(track, pose=track.pose + by, status=status)


def numbers_of(rows: Iterable[tuple[str, str, str, bool]]) -> Values:
    """Numbers in the lines of a must-reach table: the first by the line's name, the others with their place."""
    found: dict[str, float | str] = {}
    for what, _, measured, _ in rows:
        for k, text in enumerate(re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", measured)):
            found[what.strip() if k == 0 else f"{what.strip()}, {k + 1}"] = float(text)
    return found
