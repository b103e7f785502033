"""The candidate tracker that holds on to no keyframe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from studies.comparators.frame_to_frame import FRAME_TO_FRAME
from studies.worlds import challenges
from studies.worlds.scenes import CeilingCamera, small_camera
from towval.tracking.track import TrackSettings, track


def test_it_follows_a_body_but_drifts_more_than_keyframes_do():
    scene = replace(challenges.metre(3, 2.0).scene, **small_camera())
    times = np.arange(50) * 0.04
    clicks = scene.clicks(np.random.default_rng(3))

    def drift(settings: TrackSettings) -> float:
        found = track(CeilingCamera(scene).frames(times), scene.calibration, scene.bodies, clicks, settings)["rover"]
        assert found.seen.all()
        error = found.pose[:, :2] - scene.truth(times)["rover"][:, :2]
        return float(np.linalg.norm(error[-5:].mean(axis=0) - error[:5].mean(axis=0)))

    assert drift(TrackSettings(method="klt")) < drift(FRAME_TO_FRAME) < 5e-3
