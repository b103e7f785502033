"""config.yaml, its schema and the settings of the stages say the same."""

import dataclasses

import pytest
import yaml

from towval.calibration.calibrate import CalibrateSettings
from towval.commands.settings import settings_from
from towval.io.schema import check, with_plain_values, without_defaults
from towval.io.yaml_text import read_value
from towval.model.errors import InputError
from towval.report.data import ReportSettings
from towval.tracking.track import TrackSettings
from towval.validation.compare import CompareSettings
from towval.validation.decimate import DecimateSettings
from towval.validation.identify import IdentifySettings
from towval.validation.sampler import UncertaintySettings
from towval.validation.simulate import SimulateSettings

SECTIONS = {
    "calibrate": CalibrateSettings,
    "track": TrackSettings,
    "decimate": DecimateSettings,
    "simulate": SimulateSettings,
    "uncertainty": UncertaintySettings,
    "compare": CompareSettings,
    "identify": IdentifySettings,
    "report": ReportSettings,
}


@pytest.fixture(scope="module")
def schema(repository):
    return yaml.safe_load((repository / "src/towval/io/config.schema.yaml").read_text())


@pytest.fixture(scope="module")
def config(repository):
    return yaml.safe_load((repository / "config.yaml").read_text())


@pytest.mark.parametrize("section", SECTIONS)
def test_the_schema_has_every_setting_and_no_other(schema, section):
    keys = schema["properties"][section]["properties"]
    assert set(keys) == {field.name for field in dataclasses.fields(SECTIONS[section])}
    assert all("description" in key for key in keys.values())
    assert all("unit" in keys[name] for name in keys if name.endswith(("_m", "_s", "_px")))


def test_the_choices_of_the_schema_are_those_of_the_code(schema):
    sections = schema["properties"]
    assert sections["simulate"]["properties"]["rung"]["registered"] == "towval.physics.ladder:RUNGS"


def test_the_configuration_is_valid_and_gives_the_defaults(schema, config):
    check(config, schema, "config")
    for section, kind in SECTIONS.items():
        assert settings_from(kind, config.get(section), section) == kind()


@pytest.mark.parametrize("section", SECTIONS)
def test_the_defaults_of_the_schema_are_those_of_the_code(schema, section):
    keys = schema["properties"][section]["properties"]
    stated = {
        name: tuple(key["default"]) if isinstance(key["default"], list) else key["default"]
        for name, key in keys.items()
        if "default" in key
    }
    fields = dataclasses.fields(SECTIONS[section])
    assert stated == {field.name: field.default for field in fields if field.default is not None}


def test_a_default_that_is_stated_is_left_out():
    assert without_defaults("decimate", {"excess": 3, "pause_s": 0.4}) == {"pause_s": 0.4}
    # No default, and a key of a later version.
    assert without_defaults("compare", {"tolerance_m": 0.02, "other": None}) == {"tolerance_m": 0.02, "other": None}


def test_a_mistyped_setting_is_told_with_the_right_one():
    with pytest.raises(InputError, match=r"did you mean decimate\.excess\?"):
        settings_from(DecimateSettings, {"exces": 2}, "decimate")


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("calibrate", "folds", 0),
        ("calibrate", "position_limit_m", float("nan")),
        ("calibrate", "threads", "abc"),
        ("track", "samples", 2.5),
        ("track", "coast_s", float("nan")),
        ("track", "method", ["plane"]),
        ("decimate", "excess", "three"),
        ("simulate", "sticking", "false"),
        ("uncertainty", "seed", 1.5),
        ("compare", "tolerance_m", True),
        ("identify", "parameters", "friction"),
        ("report", "overlay_width_px", None),
    ],
)
def test_a_stage_alone_keeps_the_limits_of_the_schema(section, key, value):
    """As ``towval STAGE --set`` does, without the workflow that checks the whole of config.yaml."""
    with pytest.raises(InputError, match=rf"{section}: {key} is "):
        settings_from(SECTIONS[section], {key: value}, section)


@pytest.mark.parametrize(
    ("section", "key", "value", "allowed"),
    [
        ("uncertainty", "samples", 1.5, "a whole number or auto"),
        ("uncertainty", "samples", "many", "a whole number or auto"),
        ("uncertainty", "samples", 10, "at least 64 and at most 65536 or auto"),
        ("simulate", "tolerance_m", [1], "a number or auto"),
        ("simulate", "sticking", "maybe", "one of auto, true, false"),
        ("report", "formats", ["png", "png"], "each entry once"),
        ("calibrate", "lens_models", [], "at least one entry"),
    ],
)
def test_what_is_allowed_is_told_in_words(section, key, value, allowed):
    """Not as the schema states it: ['integer', 'string'], or a text that matches ^auto$."""
    with pytest.raises(InputError, match=rf"{key} is .*; allowed: {allowed} \("):
        settings_from(SECTIONS[section], {key: value}, section)


@pytest.mark.parametrize("text", ["1e-7", "1E-7", "1.0e-7", ".1e-6", "+1e-07"])
def test_a_number_with_an_exponent_is_a_number_with_or_without_a_point(text, schema, config):
    assert read_value(text) == pytest.approx(1e-7, rel=1e-12)
    # As Snakemake hands it over.
    sections = {**config, "simulate": with_plain_values({"tolerance_m": text})}
    check(sections, schema, "config")
    assert settings_from(SimulateSettings, sections["simulate"], "simulate").tolerance_m == pytest.approx(
        1e-7, rel=1e-12
    )


def test_texts_stay_texts():
    assert [read_value(text) for text in ("'1e-7'", "1e", "e7", "k1 k2", "1e5m")] == [
        "1e-7",
        "1e",
        "e7",
        "k1 k2",
        "1e5m",
    ]
    assert with_plain_values({"method": "plane", "list": ["k1", 3, True, None]}) == {
        "method": "plane",
        "list": ["k1", 3, True, None],
    }


def test_values_within_braces_on_snakemakes_command_line_are_what_they_look_like():
    given = {"samples": "256", "coast_s": "0.5", "method": "plane", "on": "true", "list": ["7", "{odd", "k1: k2"]}
    assert with_plain_values(given) == {
        "samples": 256,
        "coast_s": 0.5,
        "method": "plane",
        "on": True,
        "list": [7, "{odd", "k1: k2"],
    }


def test_a_mistyped_key_of_the_configuration_is_told(schema, config):
    with pytest.raises(InputError, match=r"unknown key decimate\.pause; did you mean pause_s\?"):
        check({**config, "decimate": {"pause": 1}}, schema, "config")


def test_a_whole_number_with_a_point_counts():
    folds = settings_from(CalibrateSettings, {"folds": 6.0}, "calibrate").folds
    assert (folds, type(folds)) == (6, int)
