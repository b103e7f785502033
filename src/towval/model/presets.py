"""Presets: what `preset` in config.yaml sets, one table. Keys stated in config.yaml override it.

"auto" as a value lets the stage choose by a quick probe on the campaign itself: the cheapest setting whose error stays
below a third of the measurement uncertainty.
"""

from typing import Any

STANDARD = "standard"

PRESETS: dict[str, dict[str, dict[str, Any]]] = {
    # A first look in about the time of decoding. Its draws are too coarse for a verdict: runs are not judged, see the
    # finding draft_settings.
    "draft": {
        "calibrate": {"lens_models": ["k1 k2"], "folds": 3},
        "simulate": {"rung_tolerance_m": 2e-3, "tolerance_m": 1e-5},
        "uncertainty": {"samples": 64, "tolerance_m": 1e-5},
        "report": {"overlay_width_px": 640},
    },
    # The stages' own defaults.
    STANDARD: {},
    # For publication: errors of the method should be negligible against the measurement.
    "fine": {
        "calibrate": {"folds": 12},
        "track": {"samples": 4096},
        "simulate": {"rung": "dynamics", "tolerance_m": 1e-9},
        "uncertainty": {"samples": 2048, "tolerance_m": 1e-7},
    },
    # As accurate as this campaign needs.
    "auto": {"track": {"samples": "auto"}, "simulate": {"rung_tolerance_m": "auto", "tolerance_m": "auto"}},
}
"""Settings by preset and stage; what is left out stays the stage's default."""


def settings_of(preset: str, stage: str, own: dict[str, Any] | None = None) -> dict[str, Any]:
    """Keys of a stage's section under a preset of :data:`PRESETS`, its ``own`` ones of config.yaml last."""
    return {**PRESETS[preset].get(stage, {}), **(own or {})}
