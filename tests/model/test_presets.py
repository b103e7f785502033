"""Presets set keys that exist, to values that the schema and the stages take."""

import pytest
import yaml

from test_config import SECTIONS
from towval.commands.settings import settings_from, without_auto
from towval.io.schema import check
from towval.model.presets import PRESETS, settings_of
from towval.validation.simulate import SimulateSettings


@pytest.fixture(scope="module")
def schema(repository):
    return yaml.safe_load((repository / "src/towval/io/config.schema.yaml").read_text())


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_valid(schema, preset):
    base = {"campaign": "x", "results": "y", "preset": preset}
    sections = {stage: settings_of(preset, stage) for stage in SECTIONS}
    check({**base, **sections}, schema, "config")
    for stage, kind in SECTIONS.items():
        settings_from(kind, without_auto(sections[stage], *sections[stage])[0], stage)


def test_the_schema_names_the_presets(schema):
    assert schema["properties"]["preset"]["enum"] == list(PRESETS)


def test_what_the_configuration_says_counts_more_than_the_preset():
    keys = settings_of("fine", "simulate", {"tolerance_m": 1e-6})
    assert settings_from(SimulateSettings, keys, "simulate") == SimulateSettings("dynamics", tolerance_m=1e-6)


def test_auto_is_taken_out_only_where_it_can_be_chosen():
    keys, auto = without_auto({"rung": "auto", "tolerance_m": "auto"}, "tolerance_m")
    assert keys == {"rung": "auto"}
    assert auto == ("tolerance_m",)


def test_another_word_than_auto_is_refused(schema):
    with pytest.raises(Exception, match=r"track\.samples"):
        check({"campaign": "x", "results": "y", "track": {"samples": "many"}}, schema, "config")
