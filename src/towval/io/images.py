"""Pictures read from files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.io.atomic import replacing
from towval.model.errors import InputError


def read_gray(path: Path, resolution_px: tuple[int, int]) -> NDArray[np.uint8]:
    """A picture as grey levels (height, width), as stored: an orientation tag does not turn it.

    Raises `InputError` when the file is no picture, or not of the resolution asked for.
    """
    data = np.fromfile(path, dtype=np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION) if data.size else None
    if image is None:
        raise InputError(
            f"{path} is no picture that can be read",
            got=f"{data.size} bytes",
            allowed="JPEG, PNG, TIFF, BMP or WebP",
            remedy="copy the file again, or take it out of the folder",
        )
    size = image.shape[1], image.shape[0]
    if size != tuple(resolution_px):
        raise InputError(
            f"{path} has another size than camera.resolution_px",
            got=f"{size[0]} × {size[1]}",
            allowed=f"{resolution_px[0]} × {resolution_px[1]}",
            remedy="calibrate with pictures from the camera mode that filmed the runs",
        )
    return np.asarray(image, dtype=np.uint8)


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
