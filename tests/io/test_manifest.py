"""The list of results: files of an earlier list that are made no more."""

import pytest

from towval.io.atomic import write_text
from towval.io.manifest import MANIFEST, replacing_files, write_manifest


@pytest.fixture
def figures(tmp_path):
    """Three figures of the last list, of which one was changed by hand, and one of somebody else."""
    folder = tmp_path / "figures"
    for name in ("agreement_a.svg", "agreement_b.svg", "repeats.svg"):
        write_text(folder / name, "of the last report")
    write_manifest(tmp_path / MANIFEST, folder.iterdir())
    write_text(folder / "repeats.svg", "changed by hand")
    write_text(folder / "mine.svg", "of somebody else")
    return folder


def test_files_that_are_made_no_more_go_and_all_else_stays(figures):
    """Figures of a run that was left out since were listed as made of the results."""
    write_text(figures.parent / ".figures" / "draft.svg", "of somebody else")
    with replacing_files(figures) as drawn:
        write_text(drawn / "agreement_a.svg", "of this report")
    assert {path.name for path in figures.iterdir()} == {"agreement_a.svg", "repeats.svg", "mine.svg"}
    assert (figures / "agreement_a.svg").read_text() == "of this report"
    assert {path.name for path in figures.parent.iterdir()} == {"figures", ".figures", MANIFEST}


def test_a_report_that_fails_leaves_the_figures_of_the_last_one(figures):
    before = {path.name: path.read_text() for path in figures.iterdir()}

    def fail():
        with replacing_files(figures) as drawn:
            write_text(drawn / "agreement_a.svg", "half of this report")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert {path.name: path.read_text() for path in figures.iterdir()} == before
    assert {path.name for path in figures.parent.iterdir()} == {"figures", MANIFEST}
