"""What a file names stays in its order."""

from towval.io.mcap_file import read_mcap, write_mcap


def test_names_are_read_in_the_order_in_which_they_were_written(tmp_path):
    """The first of the inputs that explain an error is blamed for it."""
    moved = {"rest_length": 6.0, "anchor": -2.5, "hinge_height": 3.0}
    write_mcap(tmp_path / "some.mcap", [], {"moved": moved}, {})
    assert list(read_mcap(tmp_path / "some.mcap").details["moved"]) == list(moved)
