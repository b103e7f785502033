"""Footage in memory: the pictures that faults are planted into."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array

Luma = NDArray[np.uint8]
Picture = Callable[[int], Luma]


@dataclass(frozen=True)
class Film:
    """Times (n,) that will be written [s], and a function from a picture's number to its luma (height, width).

    ``chroma`` gives the planes U and V, at half the size (2, height / 2, width / 2); ``lens``:
    focal length and optical centre [px], and the coefficient of a division model, to which motions of the camera are
    drawn.
    """

    time_s: Array
    picture: Picture
    chroma: Callable[[int], Luma]
    lens: tuple[float, float, float, float]

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def step_s(self) -> float:
        """Usual time between pictures [s]."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        height, width = self.picture(0).shape
        return width, height

    @property
    def px(self) -> float:
        """A pixel of a picture 1920 wide, in which faults are stated."""
        return self.size_px[0] / 1920

    def seen(self, change: Callable[[int, Luma], Luma]) -> "Film":
        """The film with each picture changed by a function of its number and itself."""
        return replace(self, picture=lambda i: change(i, self.picture(i)))

    def between(self, i: int, later: float) -> Array:
        """What was to be seen ``later`` pictures after the i-th, a blend of its neighbours (height, width) float32."""
        place = float(np.clip(i + later, 0, len(self) - 1))
        first = min(int(place), len(self) - 2)
        share = place - first
        blend = cv2.addWeighted(self.picture(first), 1 - share, self.picture(first + 1), share, 0, dtype=cv2.CV_32F)
        return np.asarray(blend)

    def frames(self) -> Iterator[tuple[float, Luma]]:
        """Times and pictures."""
        return ((float(time_s), self.picture(i)) for i, time_s in enumerate(self.time_s))


def read_film(path: Path, seconds: float, lens: tuple[float, float, float, float]) -> Film:
    """The first seconds of a video."""
    times: list[float] = []
    planes: list[Luma] = []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        for frame in container.decode(stream):
            time_s = float((frame.pts or 0) * (frame.time_base or 0))
            if time_s > seconds:
                break
            times.append(time_s)
            planes.append(np.asarray(frame.to_ndarray(format="yuv420p"), dtype=np.uint8))
    height = 2 * len(planes[0]) // 3

    def chroma(i: int) -> Luma:
        return planes[i][height:].reshape(2, height // 2, -1)

    return Film(np.array(times), lambda i: planes[i][:height], chroma, lens)


def rounded(values: NDArray[np.floating[Any]]) -> Luma:
    """Grey values as a sensor gives them."""
    return np.asarray(np.clip(np.rint(values), 0, 255), dtype=np.uint8)
