"""Files that cannot be read or written: the message says which, and the remedy that helps."""

import errno
import os

import pytest

from towval.io.atomic import replacing, write_text
from towval.io.mcap_file import read_mcap
from towval.io.yaml_text import read_yaml
from towval.model.errors import InputError


@pytest.mark.parametrize("read", [read_mcap, read_yaml])
def test_a_folder_in_place_of_a_file_is_not_to_be_made_again(read, tmp_path):
    with pytest.raises(InputError, match="got: a folder\n  what to do: give the path of a file"):
        read(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="got: Not a directory\n  what to do: a part of that path is a file"):
        read(tmp_path / "file" / "track.mcap")


def test_a_file_without_rights_is_not_to_be_made_again(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)  # root may read everything
    with pytest.raises(InputError, match="got: Permission denied\n  what to do: change its rights"):
        read_mcap(tmp_path / "track.mcap")


def test_a_write_that_fails_is_told_with_the_name_of_the_file(tmp_path):
    path = tmp_path / "track.mcap"
    with pytest.raises(OSError, match="No space") as error, replacing(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert error.value.filename == str(path)
    assert not list(tmp_path.iterdir())


def test_a_place_whose_rights_cannot_be_changed_is_written_to(tmp_path, monkeypatch):
    """A network drive, or one of Windows below Linux: every file was refused."""

    def refuse(*_, **__):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "chmod", refuse)
    write_text(tmp_path / "page.html", "new")
    assert (tmp_path / "page.html").read_text() == "new"
