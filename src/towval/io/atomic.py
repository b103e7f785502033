"""Writes files whole or not at all: under a temporary name in the same folder, then renamed."""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from towval.io.reading import is_plain_file, kind_of
from towval.model.errors import InputError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends without an error.

    The temporary file keeps the suffix, for writers that choose a format by it. On an error it is removed and what
    stood at ``path`` stays as it was. A link is replaced, not what it leads to.

    Raises `InputError` where a folder or a device stands at ``path``, `OSError` where the system refuses; it names
    ``path``, not the temporary file, which nobody knows.
    """
    path = Path(path)
    check_plain(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        error.filename = str(path)
        raise
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files that only their owner reads; give the result the rights a plain open would give.
        umask = os.umask(0)
        os.umask(umask)
        with suppress(OSError):  # network drives, and those of Windows, may refuse to change rights
            temporary.chmod(0o666 & ~umask)
        os.replace(temporary, path)
    except OSError as error:
        if error.filename in (None, name, temporary):  # a write that fails, as on a full disk, knows no name
            error.filename = str(path)
        raise
    finally:
        temporary.unlink(missing_ok=True)


def check_plain(path: Path) -> None:
    """Refuse to write where something stands that is neither a plain file nor a link."""
    try:
        mode = path.lstat().st_mode
    except (OSError, ValueError):
        return
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        raise InputError(
            f"{path} cannot be written", got=f"{kind_of(mode)} of that name", remedy="choose another name, or move it"
        )


def check_own(path: Path, mark: str) -> None:
    """Refuse to replace a file that lacks our mark near its beginning: it is somebody else's of the same name.

    Raises `InputError`; nothing is checked where there is no file.
    """
    if is_plain_file(path):
        with path.open("rb") as stream:
            if mark.encode() not in stream.read(_BEGIN_BYTES):
                raise not_ours(path)


_BEGIN_BYTES = 4096


def not_ours(path: Path) -> InputError:
    """The error for a file that towval did not make and therefore does not replace."""
    return InputError(
        f"{path} is not replaced", got="a file that towval did not make", remedy="choose another name, or move it"
    )


def write_text(path: Path, text: str, *, own: str = "") -> None:
    """Write a UTF-8 text file, whole or not at all; ``own``, if given, is the mark of files it may replace."""
    check_own(path, own)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file of bytes, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)
