"""Pictures of a board that was held still: they count as one, whatever their number."""

from dataclasses import replace

import numpy as np
import pytest

from studies.real.jackknife import bent_fields
from studies.worlds.boards import calibration_set
from towval.calibration.alike import without_repeats
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.corners import BoardObservation

QUICK = CalibrateSettings(lens_models=("k1", "k1 k2"), folds=3)
SQUARE_PX = 40.0


def board(name, shift_px=0.0, **changes):
    """A chessboard seen from above, moved to the right."""
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    return BoardObservation(name, SQUARE_PX * grid + [100 + shift_px, 80], 0.04 * grid * [1, -1], **changes)


def observed(*boards, flat=()):
    return replace(calibration_set(0, views=3).seen, boards=boards, floor_boards=flat)


@pytest.mark.parametrize(("shift_px", "repeats"), [(0.0, True), (3.0, True), (5.0, False), (SQUARE_PX, False)])
def test_a_board_that_stays_within_a_tenth_of_a_square_repeats_itself(shift_px, repeats):
    seen, reasons = without_repeats(observed(board("a"), board("b", shift_px)))
    assert [each.name for each in seen.boards] == (["a"] if repeats else ["a", "b"])
    assert reasons == ({"b": "the board is where it is in a"} if repeats else {})


def test_of_boards_that_are_alike_the_sharpest_is_kept():
    boards = board("a", edge_px=5.0), board("b", 1.0, edge_px=3.0), board("c", 2.0)
    assert [each.name for each in without_repeats(observed(*boards[:2]))[0].boards] == ["b"]
    # How sharp one is need not be known.
    assert [each.name for each in without_repeats(observed(*boards))[0].boards] == ["c"]


def test_a_board_found_from_the_other_end_is_where_it_was():
    one = board("a")
    other = replace(one, name="b", corners_px=one.corners_px[::-1])
    assert [each.name for each in without_repeats(observed(one, other))[0].boards] == ["a"]


def test_the_first_board_on_the_floor_is_always_kept():
    flat = board("floor", edge_px=6.0), board("again", 1.0, edge_px=2.0), board("elsewhere", 300.0)
    seen, reasons = without_repeats(observed(board("held"), flat=flat))
    assert [each.name for each in seen.floor_boards] == ["floor", "elsewhere"]
    # One held where it lay is another view.
    assert [each.name for each in seen.boards] == ["held"]
    assert list(reasons) == ["again"]


def part(name, kept, shift_px=0.0, turned=False):
    """A ChArUco board of which some corners are seen."""
    whole = board(name, shift_px)
    corners = whole.corners_px[::-1] if turned else whole.corners_px
    pattern = (whole.board_m - whole.board_m.mean(axis=0)) / 0.16
    return BoardObservation(name, corners[kept], whole.board_m[kept], pattern[kept])


def test_boards_seen_in_part_are_compared_where_both_are_seen():
    every, most, half, few = np.arange(54), np.arange(45), np.arange(30), np.arange(40, 54)
    assert without_repeats(observed(part("a", every), part("b", half)))[1]
    assert without_repeats(observed(part("a", most), part("b", every)))[1]
    assert not without_repeats(observed(part("a", half), part("b", few)))[1]
    assert not without_repeats(observed(part("a", half), part("b", every)))[1], "it shows more"
    # Numbered corners tell which way round it is held.
    assert not without_repeats(observed(part("a", half), part("b", half, turned=True)))[1]


def test_a_calibration_is_no_surer_for_pictures_of_a_board_held_still():
    scene = calibration_set(9300, views=8, floor="boards", noise_px=0.05)
    once = bent_fields(scene.seen, np.random.default_rng(0), 0.2)
    rng = np.random.default_rng(1)
    more = tuple(
        replace(each, name=f"{each.name}, {i}", corners_px=each.corners_px + rng.normal(0, 0.05, each.corners_px.shape))
        for each in once.boards
        for i in range(4)
    )
    sound, found = (
        calibrate_observations(seen, QUICK, {}, heights_m=(0.35,)) for seen in (once, replace(once, boards=more))
    )
    assert found.quality["views_used"] == sound.quality["views_used"]
    assert found.quality["focal_length_std_px"] == pytest.approx(sound.quality["focal_length_std_px"], rel=0.1)
    assert "views-repeated" not in [each.code for each in sound.findings]
    (named,) = (each for each in found.findings if each.code == "views-repeated")
    assert named.text.startswith("24 pictures ")
    assert ": board 0, 1, board 0, 2, board 0, 3 and 21 more." in named.text
    assert not any(each.code == "view-dropped" for each in found.findings)
