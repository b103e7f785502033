"""Pictures read from files."""

import re
import struct
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from towval.io.atomic import replacing
from towval.io.reading import read_bytes
from towval.model.errors import InputError


def read_gray(path: Path, resolution_px: tuple[int, int]) -> NDArray[np.uint8]:
    """A picture as grey levels (height, width), as stored: an orientation tag does not turn it.

    Raises `InputError` when the file is no picture, or not of the resolution asked for.
    """
    most = _MOST_BYTES + _MOST_BYTES_A_PIXEL * resolution_px[0] * resolution_px[1]
    data = read_bytes(path, most, "copy the file again, or take it out of the folder")
    size = _stated_size(BytesIO(data))
    image = _decoded(data) if size == tuple(resolution_px) else None
    if size is None or (image is None and size == tuple(resolution_px)):
        heic = data[4:8] == b"ftyp" and data[8:12] in _HEIC
        raise InputError(
            f"{path} is no picture that can be read",
            got="HEIC, as phones write it" if heic else f"{len(data)} bytes",
            allowed="JPEG, PNG, TIFF, BMP or WebP",
            remedy="export it as JPEG" if heic else "copy the file again, or take it out of the folder",
        )
    if image is None or image.shape[::-1] != size:
        remedy = "take the pictures in the mode that filmed the runs; of a phone, from a film (docs/calibration.md)"
        if size[::-1] == tuple(resolution_px):
            remedy = (
                f"state {list(size)} as camera.resolution_px where all pictures have that size (videos are turned as "
                "they lie), or turn its pixels; a tag for orientation in the file is not applied"
            )
        raise InputError(
            f"{path} has another size than camera.resolution_px",
            got=f"{size[0]} × {size[1]}",
            allowed=f"{resolution_px[0]} × {resolution_px[1]}",
            remedy=remedy,
        )
    return image


def stated_size(path: Path) -> tuple[int, int] | None:
    """Width and height [px] that a picture states, as stored; None for what is none."""
    try:
        with path.open("rb") as file:
            return _stated_size(file)
    except OSError:
        return None


def turned_by_tag(path: Path) -> bool:
    """Whether a picture carries a tag (EXIF) by which viewers turn or mirror it; :func:`read_gray` does neither.

    False, too, where it cannot be read, which :func:`read_gray` reports.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of damaged tags.
            with Image.open(path) as picture:
                return bool(picture.getexif().get(ExifTags.Base.Orientation, _UPRIGHT) != _UPRIGHT)
    except _UNREADABLE:
        return False


_UPRIGHT = 1
_HEIC = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")
"""Brands of HEIC files; films have others."""
_UNREADABLE = (
    Image.DecompressionBombError, OSError, SyntaxError, ValueError, ArithmeticError, LookupError, TypeError,
    struct.error,
)  # fmt: skip
"""What Pillow raises of bytes that are no picture, or a damaged one."""

_MOST_BYTES = 64 * 2**20
_MOST_BYTES_A_PIXEL = 8
"""Of a file, above what its pixels take without compression in colour at 16 bits."""


def _stated_size(data: BinaryIO) -> tuple[int, int] | None:
    """Width and height that a picture claims, before anything is unpacked; None for what is no picture."""
    try:
        with warnings.catch_warnings():
            # The size that is read here is compared with that of the camera.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(data) as picture:
                return picture.size
    except _UNREADABLE:
        return None


def _decoded(data: bytes) -> NDArray[np.uint8] | None:
    """Grey levels as stored, an orientation tag left aside; None where they cannot be unpacked."""
    try:
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        image = None if _is_cut_off(data) else cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, dtype=np.uint8)


_JPEG_MARK = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
"""Begins a segment whose length follows; bytes of a scan that look like it are stuffed with a zero."""
_JPEG_END = 0xD9
_PNG_END = b"IEND\xaeB`\x82"


def _is_cut_off(data: bytes) -> bool:
    """Whether the end mark is missing: decoders fill up with grey what is not there.

    What follows the mark is no part of the picture: phones append a film to it, or leave what a cropped one was.
    """
    if data.startswith(b"\xff\xd8"):
        at = 2
        while mark := _JPEG_MARK.search(data, at):
            at = mark.end()
            if mark[0][1] == _JPEG_END:
                return False
            at += int.from_bytes(data[at : at + 2], "big")
        return True
    return data.startswith(b"\x89PNG") and _PNG_END not in data


@dataclass(frozen=True)
class GrayPictures(Sequence[tuple[str, NDArray[np.uint8]]]):
    """Pictures of files by name and grey levels, each read when it is asked for: see :func:`read_gray`."""

    paths: tuple[Path, ...]
    resolution_px: tuple[int, int]

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        if isinstance(index, slice):
            return GrayPictures(self.paths[index], self.resolution_px)
        return self.paths[index].name, read_gray(self.paths[index], self.resolution_px)


def write_picture(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write a picture (height, width, 3), blue, green, red; the kind of file by its suffix."""
    with replacing(path) as temporary:
        temporary.write_bytes(cv2.imencode(path.suffix, picture)[1].tobytes())
