"""Mutants of the tuned constants: what halving and doubling makes of them."""

import dataclasses

import numpy as np
import pytest

from studies.evidence.ledger import read_groups
from studies.tables.mutants import FACTORS, ROOMS, _scaled
from towval.model.constants import constants_of


@pytest.mark.parametrize(
    ("value", "doubled"), [(3, 6), (0.5, 1.0), (np.float64(0.2), 0.4), ((1, 0.5), (2, 1.0))]
)  # fmt: skip
def test_numbers_and_each_of_several_are_scaled(value, doubled):
    assert _scaled(value, 2.0) == doubled


def test_integers_stay_integers():
    assert _scaled(5, 0.5) == 2
    assert isinstance(_scaled(5, 0.5), int)


def test_every_tuned_constant_is_a_number_or_several():
    for room in ROOMS:
        for constants in constants_of(room).values():
            for field in dataclasses.fields(constants):
                value = getattr(constants, field.name)
                assert [_scaled(value, factor) != value for factor in FACTORS] == [value != 0] * 2, field.name


def test_the_ledger_counts_all_constants_that_there_are():
    stated = {row.name: row.stated for row in read_groups()["mutants"].statements}
    for room in ROOMS:
        for module, constants in constants_of(room).items():
            changes = len(FACTORS) * len(dataclasses.fields(constants))
            tried = stated[f"{room.rpartition('.')[2]}/{module}, noticed"]
            assert tried.endswith(f" of {changes}"), (module, tried)
