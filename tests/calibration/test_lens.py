"""The choice of a lens model: by held-out error, for the smallest, against coefficients that cancel."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.boards import calibration_set
from towval.calibration import lens
from towval.calibration.blocks import Estimate
from towval.calibration.bundle_adjustment import adjust
from towval.calibration.lens import (
    LENS_MODELS,
    LensTrial,
    active_parameters,
    choose_lens,
    families,
    try_lens,
    try_lenses,
)
from towval.calibration.observations import first_guess

NOTHING = Estimate(np.zeros(18), ())


def trial(model: str, rms_px: list[float], condition: float = 1e3) -> LensTrial:
    return LensTrial(model, np.array(rms_px), NOTHING, condition)


@pytest.mark.parametrize("family", families(tuple(LENS_MODELS)))
def test_each_model_of_a_family_contains_the_one_before(family):
    models = [set(LENS_MODELS[name]) for name in family]
    assert all(small < large for small, large in itertools.pairwise(models))


def test_the_smallest_within_one_standard_error_wins():
    poor, good, best = trial("none", [0.5, 0.6]), trial("k1", [0.20, 0.23]), trial("k1 k2", [0.21, 0.21])
    assert choose_lens([poor, good, best]) is good


def test_a_clear_gain_pays_for_a_coefficient():
    assert choose_lens([trial("none", [0.30, 0.31, 0.30]), trial("k1", [0.20, 0.20, 0.21])]).model == "k1"


def test_coefficients_that_cancel_lose_whatever_they_predict():
    assert choose_lens([trial("k1", [0.3, 0.3]), trial("rational", [0.1, 0.1], condition=1e12)]).model == "k1"


def test_models_are_tried_until_two_in_a_row_do_not_help():
    scene = calibration_set(21, views=8)
    start = adjust(scene.seen.blocks, first_guess(scene.seen), active_parameters("none", with_floor=True))
    pinholes, _ = families(tuple(LENS_MODELS))
    trials = try_lenses(scene.seen.blocks, start, pinholes, 4)
    scores = [t.score_px2 for t in trials]
    assert scores[1] < scores[0]
    assert len(trials) == len(pinholes) or min(scores[-2:]) >= min(scores[:-2])


def test_a_model_too_small_for_the_lens_does_not_lead_the_next_astray(monkeypatch):
    scene = calibration_set(21, views=8)
    start = adjust(scene.seen.blocks, first_guess(scene.seen), active_parameters("k1 k2", with_floor=True))
    collapsed, begun = replace(start, shared=start.shared * [1e-3, 1e-3, *[1.0] * 16]), []

    def tried(blocks, begin, model, folds, doubts):
        begun.append(begin)
        return LensTrial(model, np.array([1.0]), collapsed if model == "none" else begin, 1e3)

    monkeypatch.setattr(lens, "try_lens", tried)
    try_lenses(scene.seen.blocks, start, ("none", "k1"), 4)
    assert begun == [start, start]


def test_held_out_error_of_the_true_model_is_the_noise():
    scene = calibration_set(22, noise_px=0.2)
    start = adjust(scene.seen.blocks, first_guess(scene.seen), active_parameters("k1", with_floor=True))
    held_out = np.sqrt(try_lens(scene.seen.blocks, start, "k1 k2", folds=4).score_px2)
    # The place of a held-out board is fitted, which takes 6 of its 108 residuals.
    assert held_out == pytest.approx(0.2, rel=0.1)
