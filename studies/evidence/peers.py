"""Check of what this package and other programs reach side by side."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, replaced, result_of
from studies.tables import peers
from studies.worlds.scenes import FilmedScene

_SEEDS = 10


def _peers() -> Values:
    """Medians, quartiles and CPU times, by task and program."""
    rows = [
        *peers.calibration_rows(range(7000, 7000 + _SEEDS)),
        *peers.tracking_rows(range(40, 40 + _SEEDS)),
        *peers.lap_rows(),
    ]
    found: dict[str, float] = {}
    for row in rows:
        name = f"{row.task.partition(':')[0].partition(' ')[0]}, {row.program}"
        found |= {f"{name}: error": row.error_mm, f"{name}: CPU": row.cpu_s}
        found |= {f"{name}: lower quartile": row.low_mm, f"{name}: upper quartile": row.high_mm}
    return found


def _later(original: Callable[..., Any]) -> Callable[..., Any]:
    """The truth is that of a frame later."""
    return lambda scene, times: original(scene, times + 0.04)


def _longer(original: Callable[..., Any]) -> Callable[..., Any]:
    """The truth's tether is 15 cm longer."""
    return lambda box, hinge, tether, *rest, **keys: original(box, hinge, (tether[0] + 0.15, tether[1]), *rest, **keys)


def _tenfold(clock: Any) -> Any:
    return SimpleNamespace(process_time=lambda: 10 * clock.process_time())


PEERS = Check(
    _peers,
    {
        "corners are three times as noisy, the films' truth is a frame late, that of the lap has a longer tether": both(
            replaced(peers, "calibration_set", given(noise_px=0.45)),
            replaced(FilmedScene, "truth", _later),
            replaced(peers, "towed_box", _longer),
        ),
        "the clock counts tenfold": both(
            replaced(peers, "time", _tenfold),
            replaced(peers, "cpu_seconds", lambda original: lambda call: 10 * original(call)),
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
