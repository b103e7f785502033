import numpy as np

from towval.model import locked


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
