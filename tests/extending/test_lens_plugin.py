"""A lens model from outside the package: one registration line."""

import pytest

from studies.worlds.boards import calibration_set
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.lens import LENS_MODELS, NESTED
from towval.model.errors import InputError


@pytest.fixture
def registered(monkeypatch):
    """``k1 k3``, registered for one test."""
    monkeypatch.setattr(LENS_MODELS, "_values", dict(LENS_MODELS))
    LENS_MODELS.register("k1 k3", (4, 8))


def test_a_registered_lens_model_is_fitted_by_name(registered):
    scene = calibration_set(86)
    calibration = calibrate_observations(scene.seen, CalibrateSettings(lens_models=("k1 k3",), folds=3), {})
    assert calibration.camera.lens_model == "k1 k3"
    k1, k2, p1, p2, k3, *rational = calibration.camera.distortion
    assert k1 != 0
    assert k3 != 0
    assert [k2, p1, p2, *rational] == [0.0] * 6


def test_a_registered_lens_model_is_used_only_where_it_is_named(registered):
    assert CalibrateSettings().lens_models == NESTED
    assert "k1 k3" not in NESTED


def test_an_unknown_lens_model_is_refused_with_the_names_of_all():
    with pytest.raises(InputError, match="k1 k2 p1 p2 k3, rational") as caught:
        CalibrateSettings(lens_models=("k1 k3",))
    assert "TOWVAL_PLUGINS" in str(caught.value)
