"""Files read whole: plain files only, and never more of one than its reader has room for."""

import errno
import os
import stat
from pathlib import Path

from towval.model.errors import InputError


def read_bytes(path: Path, most: int, remedy: str = "check the path, or copy the file there") -> bytes:
    """All bytes of a plain file; one of more than ``most`` bytes is refused before anything of it is read.

    Raises `InputError` when it is missing (and then names the ``remedy``), too long, cannot be read, or is a folder, a
    pipe or a device.
    """
    path = Path(path)
    try:
        # A pipe without a writer would block the call forever; Python's own open of a folder fails before fstat.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            os.close(handle)
            raise InputError(f"{path} is no plain file", got=kind_of(status.st_mode), remedy="give the path of a file")
        with open(handle, "rb") as stream:
            if status.st_size > most:
                raise InputError(f"{path} is too long", got=f"{status.st_size} bytes", allowed=f"at most {most} bytes")
            return stream.read()
    except FileNotFoundError:
        raise InputError(f"{path} is missing", remedy=remedy) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read", got=reason(error), remedy=remedy_of(error)) from None
    except ValueError as error:  # a zero byte in the name
        raise InputError(f"{path} cannot be read", got=reason(error), remedy="correct the name") from None


def is_plain_file(path: Path) -> bool:
    """Whether there is a plain file, a link to one included; whatever prevents an answer is no."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def check_name(path: Path, what: str) -> None:
    """Refuse a name with line breaks, other control characters or undecodable bytes: it could not be printed."""
    if not str(path).isprintable():
        raise InputError(f"{what} has a name that cannot be printed", got=repr(str(path)), remedy="rename it")


def is_folder(path: Path) -> bool:
    """Whether there is a folder; whatever prevents an answer is no."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def kind_of(mode: int) -> str:
    """The kind of a file that is not a plain one."""
    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    return kinds.get(stat.S_IFMT(mode), "a device")


_REMEDIES = {
    errno.ENOSPC: "make room and call again: what is finished stays",
    errno.EDQUOT: "make room and call again: what is finished stays",
    errno.EACCES: "change its rights, or choose another place",
    errno.EPERM: "change its rights, or choose another place",
    errno.EROFS: "choose a place that can be written",
    errno.EMFILE: "allow more open files: ulimit -n 1024",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.EISDIR: "move that folder, or choose another name",
    errno.ENOTDIR: "a part of that path is a file: choose another",
}


def remedy_of(error: OSError) -> str:
    """What to do about a refusal of the system, to read or to write."""
    return _REMEDIES.get(error.errno or 0, "check that place and its disk")


def reason(error: Exception) -> str:
    """Why the system refused, without the path that the message names anyway."""
    return getattr(error, "strerror", None) or str(error)
