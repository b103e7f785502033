"""identify.mcap and identify.csv hold what was identified."""

import numpy as np
import pandas as pd
import pytest

from towval.io.mcap_file import write_mcap
from towval.io.records.identification import identified_table, read_identification, write_identification
from towval.model import Finding, Identification, Prediction, Severity
from towval.model.errors import InputError
from towval.report.facts import identified_rows, predicted_rows

FOUND = Identification(
    parameters=("friction", "rest length [m]"),
    runs=("a", "b"),
    given=[0.35, 0.6],
    given_std=[0.005, 0.001],
    values=[0.36, 0.63],
    covariance=[[1e-4, 1e-6], [1e-6, 4e-6]],
    identifiable=(True, False),
    predictions=(
        Prediction("a", [0.37, 0.62], [0.0, 0.04], [[0.1, 0.2, 3.1], [0.1, 0.2, 3.2]], 0.02, 0.001),
        Prediction("b", [0.35, 0.64], [0.0, 0.04], [[0.3, 0.4, -1.0], [0.3, 0.5, -1.1]], 0.03, 0.002),
    ),
    findings=(Finding(Severity.WARNING, "not_identifiable", "why"),),
)


def test_round_trip(tmp_path):
    write_identification(tmp_path / "identify.mcap", FOUND, {"versions": "{}"})
    found = read_identification(tmp_path / "identify.mcap")
    for name in ("parameters", "runs", "identifiable", "findings"):
        assert getattr(found, name) == getattr(FOUND, name)
    for name in ("given", "given_std", "values", "covariance"):
        np.testing.assert_array_equal(getattr(found, name), getattr(FOUND, name))
    for got, expected in zip(found.predictions, FOUND.predictions, strict=True):
        assert (got.run, got.given_rms_m, got.predicted_rms_m) == (
            expected.run,
            expected.given_rms_m,
            expected.predicted_rms_m,
        )
        np.testing.assert_allclose(got.pose, expected.pose, atol=1e-12)


def test_a_covariance_that_is_not_known_stays_missing(tmp_path):
    unknown = Identification(("friction",), ("a",), [0.35], [0.005], [0.35], [[np.nan]], (False,), ())
    write_identification(tmp_path / "identify.mcap", unknown, {})
    assert np.isnan(read_identification(tmp_path / "identify.mcap").covariance).all()


def test_table_has_a_row_a_parameter(tmp_path):
    (tmp_path / "identify.csv").write_text(identified_table(FOUND))
    table = pd.read_csv(tmp_path / "identify.csv")
    assert table.identified.tolist() == [0.36, 0.63]
    assert table.identified_std.tolist() == [0.01, 0.002]
    assert table.without_b.tolist() == [0.35, 0.64]


def test_a_file_of_another_stage_is_refused(tmp_path):
    write_mcap(tmp_path / "other.mcap", [], {"outcome": "converged"}, {})
    with pytest.raises(InputError, match="made by another stage"):
        read_identification(tmp_path / "other.mcap")


def test_the_report_gives_values_to_the_second_digit_of_their_deviation():
    assert identified_rows(FOUND) == (
        ("friction", "0.3500 ± 0.0050", "0.360 ± 0.010", "yes"),
        ("rest length, m", "0.6000 ± 0.0010", "0.6300 ± 0.0020", "no"),
    )
    assert predicted_rows(FOUND)[0] == ("run a", "0.370; 0.6200", "20.0 mm", "1.00 mm")
