"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FilePath


@contextmanager
def replacing(path: FilePath) -> Iterator[FilePath]:
    """A temporary file beside ``path`` that takes its place when the block ends well, and is removed when it does not.

    Parameters
    ----------
    path : path
        The file to write; its folder is made if it is not there.

    Yields
    ------
    path
        Where to write.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
