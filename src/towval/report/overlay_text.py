"""Small text on video frames, in the font that ships with matplotlib."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from towval.io.film import Picture

Colour = tuple[int, int, int]

_SHADE = 0.35
"""Brightness of the footage under the text, relative to the rest."""


class TextPainter:
    """Writes single lines on darkened strips; digits have equal widths, so that changing numbers do not move.

    ``size_px``: font size [px].
    """

    def __init__(self, size_px: int):
        self._font = ImageFont.truetype(_font_file(), size_px)
        self._padding = round(0.5 * size_px)
        ascent, descent = self._font.getmetrics()
        self.height_px = ascent + descent + self._padding
        """Height of a strip [px]."""

    def write(self, picture: Picture, corner_px: tuple[int, int], parts: Sequence[tuple[str, Colour]]) -> None:
        """Write texts with their colours one after another from the top left ``corner_px`` (u, v) of an RGB picture.

        In place; text that does not fit is cut off.
        """
        u, v = corner_px
        width = round(sum(self._font.getlength(text) for text, _ in parts)) + 2 * self._padding
        strip = picture[v : v + self.height_px, u : u + width]
        image = Image.fromarray((strip * _SHADE).astype(np.uint8))
        draw = ImageDraw.Draw(image)
        at = float(self._padding)
        for text, colour in parts:
            draw.text((at, self._padding / 2), text, font=self._font, fill=colour)
            at += self._font.getlength(text)
        strip[...] = np.asarray(image)


def _font_file() -> Path:
    """DejaVu Sans as shipped with matplotlib, found without importing matplotlib, which would take longer."""
    spec = find_spec("matplotlib")
    assert spec is not None  # a dependency of this package
    assert spec.origin is not None
    return Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
