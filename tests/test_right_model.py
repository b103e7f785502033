"""From the pictures to the verdict, where the model is right and nothing is wrong with the film."""

import pytest

from studies.end_to_end import Pipeline
from studies.worlds.folder import write_campaign
from towval.io.campaign import load_campaign
from towval.model import Verdict
from towval.model.presets import PRESETS, STANDARD


@pytest.mark.parametrize("seed", [32, 33])
def test_a_right_model_agrees_within_millimetres_and_nothing_is_warned_of(tmp_path, seed):
    """In 3 s of a slow tow, 6 mm a pixel, with the codec's own rhythm of frames."""
    write_campaign(tmp_path, seed, frames=80)
    compared = Pipeline(load_campaign(tmp_path)).run(PRESETS[STANDARD]).comparison
    assert compared.verdict is Verdict.AGREES
    assert compared.error_upper_m < 6e-3
    assert compared.warnings == ""
