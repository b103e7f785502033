import importlib.util

import numpy as np
import pytest

from studies.comparators.mujoco_engine import mujoco_rows
from studies.comparators.tow_scenes import lap_scene


def test_four_points_are_off_and_spheres_less_so():
    """From elsewhere: 65 mm RMS and 0.2 m at most for a box on a lap of 40 s, whatever the time step."""
    pytest.importorskip("mujoco", reason="an optional peer to compare with: pip install 'towval[bench]'")
    box, spheres = mujoco_rows(lap_scene(40.0), (0.004,))
    assert box["outcome"] == "computed"
    assert box["rms_m"] == pytest.approx(0.065, abs=0.01)
    assert box["error_m"] == pytest.approx(0.2, abs=0.03)
    assert spheres["rms_m"] < 0.5 * box["rms_m"]


def test_missing_engine_is_skipped_with_the_reason(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    (row,) = mujoco_rows(lap_scene(40.0))
    assert row["outcome"] == "skipped: mujoco is not installed"
    assert np.isnan(row["error_m"])
