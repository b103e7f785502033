import re

import numpy as np
import pytest

from towval.model import Features, locked
from towval.model.checks import increasing
from towval.model.errors import InputError


def test_what_can_be_written_is_copied():
    given = np.arange(3.0)
    kept = locked(given, "numbers", (3,))
    given[0] = 7.0
    assert kept[0] == 0.0
    assert not kept.flags.writeable


def test_what_is_locked_is_handed_on():
    kept = locked(np.arange(3.0), "numbers", (3,))
    assert locked(kept, "the same", (None,)) is kept


def test_a_read_only_view_of_what_is_locked_is_handed_on():
    whole = locked(np.arange(6.0), "numbers", (6,))
    view = whole[2:].reshape(2, 2)
    assert locked(view, "the same", (2, 2)) is view


def test_a_read_only_view_of_what_can_be_written_is_copied():
    given = np.arange(3.0)
    view = given[:]
    view.setflags(write=False)
    kept = locked(view, "numbers", (3,))
    given[0] = 7.0
    assert kept[0] == 0.0


@pytest.mark.parametrize(
    ("values", "shape", "got"), [([[1, 2], [3, np.nan]], (2, 2), "nan at [1, 1]"), (-np.inf, (), "-inf")]
)
def test_the_first_value_that_is_not_finite_is_told(values, shape, got):
    with pytest.raises(InputError, match=rf"numbers holds values(.|\n)*got: {re.escape(got)}\n"):
        locked(values, "numbers", shape)


@pytest.mark.parametrize(
    ("times_s", "least", "got"),
    [([0.0, 1.0, 1.0], 0, "1 s after 1 s"), ([1.7e9 + 0.04, 1.7e9 + 0.02], 2, "1700000000.02 s after 1700000000.04 s"),
     ([5.0], 2, "1 of them")],
)  # fmt: skip
def test_times_that_are_too_few_or_do_not_increase_are_told(times_s, least, got):
    with pytest.raises(InputError, match=rf"the times(.|\n)*got: {got}\n"):
        increasing(np.array(times_s), "the times", least)


def test_times_that_increase_and_none_at_all_are_taken():
    increasing(np.array([0.0, 0.5]), "the times", 2)
    increasing(np.zeros(0), "the times")


def test_whole_numbers_have_a_shape_too():
    with pytest.raises(InputError, match=r"Features\.frame has the wrong shape\n  got: \(2, 2\)\n  allowed: any"):
        Features(np.zeros((2, 2)), np.zeros((2, 3)), np.ones(2))
