"""Check of what this package and other programs reach side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, repeated, replaced, result_of
from studies.tables import peers
from studies.worlds.scenes import FilmedScene

_SEEDS = 10


def _peers() -> Values:
    """Medians, quartiles and CPU times over ours, by task and program; ours in seconds."""
    rows = [
        *peers.calibration_rows(range(7000, 7000 + _SEEDS)),
        *peers.tracking_rows(range(40, 40 + _SEEDS)),
        *peers.lap_rows(),
    ]
    found: dict[str, float] = {}
    for row, over in peers.over_ours(rows):
        name = f"{row.task.partition(':')[0].partition(' ')[0]}, {row.program}"
        found |= {f"{name}: error": row.error_mm}
        found |= {f"{name}: lower quartile": row.low_mm, f"{name}: upper quartile": row.high_mm}
        found |= {f"{name}: CPU": row.cpu_s, f"{name}: CPU over ours": over}
    return found


def _later(original: Callable[..., Any]) -> Callable[..., Any]:
    """The truth is that of a frame later."""
    return lambda scene, times: original(scene, times + 0.04)


def _longer(original: Callable[..., Any]) -> Callable[..., Any]:
    """The truth's tether is 15 cm longer."""
    return lambda box, hinge, tether, *rest, **keys: original(box, hinge, (tether[0] + 0.15, tether[1]), *rest, **keys)


def _ten_times(original: Callable[..., Any]) -> Callable[..., Any]:
    """Bodies are tracked ten times in pictures that are decoded once."""
    return lambda pictures, *rest: repeated(10)(original)(list(pictures), *rest)


PEERS = Check(
    _peers,
    {
        "corners are three times as noisy, the films' truth is a frame late, that of the lap has a longer tether": both(
            replaced(peers, "calibration_set", given(noise_px=0.45)),
            replaced(FilmedScene, "truth", _later),
            replaced(peers, "towed_box", _longer),
        ),
        "this package calibrates and simulates four times, and tracks the decoded pictures ten times": both(
            replaced(peers, "calibrate_observations", repeated(4)),
            replaced(peers, "feedback", repeated(4)),
            replaced(peers, "track", _ten_times),
        ),
    },
    needs=("mujoco",),
)


def _evo() -> Values:
    """What evo and this package differ by in the RMS distance of two paths [mm]."""
    return {row.program.partition(", ")[2]: row.error_mm for row in peers.evo_rows()}


EVO = Check(
    _evo,
    {
        "ours is 0.1 % too large": both(
            replaced(peers, "error_sizes", result_of(lambda sizes: 1.001 * sizes)),
            replaced(peers, "aligned_rms", result_of(lambda apart: 1.001 * apart)),
        )
    },
    needs=("evo_ape",),
)
