"""Pictures of what lies in a laboratory that an engine renders: its floor, the tops of the bodies, a chessboard."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array

Picture = NDArray[np.uint8]
"""Colours (height, width, 3), red first."""

_FLOOR_PX, _TOP_PX, _SQUARE_PX = 4096, 1024, 160


def _grain(rng: np.random.Generator, side: int, sizes: Sequence[float], steepness: float) -> Array:
    """Noise (side, side, 1) of unit deviation: spots of several ``sizes`` [px], the larger the stronger."""
    total = np.zeros((side, side), np.float32)
    for size in sizes:
        cells = rng.standard_normal((max(4, int(side / size)),) * 2).astype(np.float32)
        total += cv2.resize(cells, (side, side), interpolation=cv2.INTER_CUBIC) * size**steepness
    return np.asarray((total / total.std())[..., None], dtype=np.float64)


def _concrete(rng: np.random.Generator, base: Array) -> Array:
    side = len(base)
    picture = (base + _grain(rng, side, (3, 8, 30, 200), 0.5) * rng.uniform(5, 12)).astype(np.float32)
    for _ in range(rng.integers(5, 30)):
        start = rng.integers(0, side, 2)
        end, grey = start + rng.integers(-300, 300, 2), float(base.mean() - rng.uniform(10, 50))
        cv2.line(picture, start.tolist(), end.tolist(), (grey,) * 3, int(rng.integers(1, 5)))
    return np.asarray(picture, dtype=np.float64)


def _tiles(rng: np.random.Generator, base: Array) -> Array:
    side, step = len(base), int(rng.choice([200, 240, 300]))
    picture = base + _grain(rng, side, (3, 10, 60), 0.3) * 4
    for row in range(0, side, step):
        for column in range(0, side, step):
            picture[row : row + step, column : column + step] += rng.normal(0, 6)
    for line in range(0, side, step):
        picture[line : line + 4] -= 40
        picture[:, line : line + 4] -= 40
    return picture


def _wood(rng: np.random.Generator, base: Array) -> Array:
    side, width, length = len(base), 90, 800
    picture = base.copy()
    for row in range(0, side, width):
        for start in range(-int(rng.integers(0, length)), side, length):
            plank = picture[row : row + width, max(start, 0) : start + length]
            plank += rng.normal(0, 9)
            plank[:, :2] -= 35
        picture[row : row + 2] -= 35
    fibres = rng.standard_normal((side, side // 40)).astype(np.float32)
    return np.asarray(picture + 7 * cv2.resize(fibres, (side, side), interpolation=cv2.INTER_CUBIC)[..., None])


def _carpet(rng: np.random.Generator, base: Array) -> Array:
    side = len(base)
    return np.asarray(base + _grain(rng, side, (2, 4), 0.2) * 14 + _grain(rng, side, (300,), 0.5) * 4)


FLOORS: dict[str, Callable[[np.random.Generator, Array], Array]] = {
    "concrete": _concrete, "tiles": _tiles, "wood": _wood, "carpet": _carpet,
}  # fmt: skip
"""Kinds of floor by name; concrete is nearly without texture."""


def _colour(rng: np.random.Generator, low: float = 0, high: float = 255) -> tuple[float, ...]:
    return tuple(float(value) for value in rng.uniform(low, high, 3))


def _plain(rng: np.random.Generator, picture: Picture) -> None:
    for place in rng.integers(80, _TOP_PX - 80, (rng.integers(3, 9), 2)):
        cv2.circle(picture, place.tolist(), int(rng.integers(8, 25)), _colour(rng), -1, cv2.LINE_AA)


def _printed(rng: np.random.Generator, picture: Picture) -> None:
    for x, y in rng.integers(0, _TOP_PX - 200, (rng.integers(6, 18), 2)).tolist():
        text, size = "".join(rng.choice(list("ABCDEFGHKLMNPRSTXYZ0123456789"), 5)), float(rng.uniform(1, 4))
        cv2.putText(picture, text, (x, y + 80), 0, size, _colour(rng), int(rng.integers(2, 9)), cv2.LINE_AA)


def _parts(rng: np.random.Generator, picture: Picture) -> None:
    for place in rng.integers(0, _TOP_PX, (rng.integers(12, 40), 2)):
        far = place + rng.integers(20, 240, 2)
        cv2.rectangle(picture, place.tolist(), far.tolist(), _colour(rng, 10, 240), -1)


TOPS: dict[str, Callable[[np.random.Generator, Picture], None]] = {"plain": _plain, "print": _printed, "parts": _parts}
"""What is drawn on a top, by name; a plain one carries a few dots."""


def floor_texture(rng: np.random.Generator, kind: str) -> Picture:
    """A square of floor of one of :data:`FLOORS`."""
    tint = rng.uniform(90, 170) * rng.uniform(0.9, 1.1, 3)
    return _whole(FLOORS[kind](rng, np.ones((_FLOOR_PX, _FLOOR_PX, 1)) * tint))


def top_texture(rng: np.random.Generator, kind: str) -> Picture:
    """A top of one of :data:`TOPS`, squared: it is stretched over the body's."""
    picture = np.empty((_TOP_PX, _TOP_PX, 3), np.uint8)
    picture[:] = rng.uniform(60, 220, 3)
    TOPS[kind](rng, picture)
    return _whole(picture + _grain(rng, _TOP_PX, (4, 20, 120), 0.6) * rng.uniform(2, 5))


def board_texture(inner_corners: tuple[int, int], square_m: float) -> tuple[Picture, Array]:
    """A chessboard with a margin of 0.7 squares, and the size (2,) of its sheet [m]."""
    margin = int(0.7 * _SQUARE_PX)
    columns, rows = (np.arange(count + 1).repeat(_SQUARE_PX) for count in inner_corners)
    grey = np.where(np.add.outer(rows, columns) % 2 == 0, 25, 235).astype(np.uint8)
    grey = np.pad(grey, margin, constant_values=235)
    return np.repeat(grey[..., None], 3, axis=-1), np.array(grey.shape[::-1]) * square_m / _SQUARE_PX


def _whole(picture: Array) -> Picture:
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)
