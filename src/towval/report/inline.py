"""What a page holds within itself: figures as SVG with shared glyphs and styles, bytes as text, values as JSON."""

import base64
import json
import re
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

_GLYPH = re.compile(r'<path id="([\w.-]+-[0-9a-f]+)" d="[^"]*"(?: transform="[^"]*")?/>')
_HASHED = re.compile(r"m[0-9a-f]{10}")
_EMPTY = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>|<defs>\s*</defs>", re.DOTALL)
_PLACES = re.compile(r' (d|x|y)="([^"]*)"')
_PACKED = 7
# NUL, carriage return and "<" do not survive in a script element; each is replaced by a character above 127.
_UNSAFE = ((b"\x00", b"\xc2\x80"), (b"\r", b"\xc2\x8d"), (b"<", b"\xc2\xbc"))


class FigureSheet:
    """Figures of one page; each glyph and each style is stored once.

    ``glyphs`` and ``styles`` are what the page needs in addition to the figures; complete once all figures are inlined.
    """

    def __init__(self) -> None:
        self._glyphs: dict[str, tuple[str, str]] = {}
        self._styles: dict[str, str] = {}
        self._ids: dict[tuple[str, str], str] = {}

    def inline(self, svg: str, name: str) -> Markup:
        """A figure of matplotlib as an element without fixed size; ``name`` makes its ids unique on the page.

        Coordinates are rounded to a hundredth of a point.
        """
        svg = _GLYPH.sub(self._glyph, svg)
        svg = _EMPTY.sub("", _EMPTY.sub("", svg))
        svg = _PLACES.sub(_shortened, svg)
        svg = re.sub(r' style="([^"]*)"', self._style, svg)
        svg = re.sub(r'<g id="[^"]*"', "<g", svg).replace("xlink:href", "href")
        svg = re.sub(r'(\bid="|href="#|url\(#)([\w.-]+)', lambda at: at[1] + self._address(at[2], name), svg)
        head, _, rest = re.sub(r">\s+<", "><", svg).partition(">")
        head = re.sub(r'\s(width|height)="[^"]*"', "", head) + ' aria-hidden="true" focusable="false"'
        # Safe without escaping: matplotlib's own output, in which all text is outlines.
        return Markup(f"{head}>{rest}")

    @property
    def glyphs(self) -> Markup:
        """Outlines of all characters, for one hidden SVG."""
        return Markup("".join(outline for _, outline in self._glyphs.values()))

    @property
    def styles(self) -> Markup:
        """Style sheet of the figures."""
        base = ".drawing svg * { stroke-linejoin: round; stroke-linecap: butt; }"
        return Markup("\n".join([base, *(f".drawing .{name} {{ {style} }}" for style, name in self._styles.items())]))

    def _glyph(self, found: re.Match[str]) -> str:
        if _HASHED.fullmatch(found[1]):
            return found[0]
        name = f"g{len(self._glyphs)}"
        self._glyphs.setdefault(found[1], (name, found[0].replace(f'id="{found[1]}"', f'id="{name}"')))
        return ""

    def _style(self, found: re.Match[str]) -> str:
        return f' class="{self._styles.setdefault(found[1], f"s{len(self._styles)}")}"'

    def _address(self, target: str, name: str) -> str:
        if target in self._glyphs:
            return self._glyphs[target][0]
        return self._ids.setdefault((name, target), f"i{len(self._ids)}")


def _shortened(attribute: re.Match[str]) -> str:
    text = re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), attribute[2])
    text = re.sub(r"\s*([A-Za-z])\s*", r"\1", re.sub(r"\s+", " ", text)).strip()
    return f' {attribute[1]}="{text}"'


def data_uri(kind: str, content: bytes) -> str:
    """Bytes of a media type as an address that holds them."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def script_json(value: Any) -> Markup:
    """A value as JSON within a script element, which no text in it can end; `ValueError` for NaN and infinity."""
    return Markup(json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def packed(content: bytes) -> Markup:
    """Bytes as text of a script element: eight characters hold seven bytes, a sixth more than the bytes themselves.

    The page decodes them (`unpacked` in report.js). Base64 would take a third more.
    """
    padded = np.frombuffer(content + bytes(-len(content) % _PACKED), np.uint8).reshape(-1, _PACKED)
    step = 1 << 20
    text = b"".join(_seven_bits(padded[i : i + step]) for i in range(0, len(padded), step))
    for unsafe, safe in _UNSAFE:
        text = text.replace(unsafe, safe)
    return Markup(text.decode("utf-8"))


def _seven_bits(rows: NDArray[np.uint8]) -> bytes:
    number = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        number = (number << np.uint64(8)) | column
    shifts = np.arange(_PACKED, -1, -1, dtype=np.uint64) * np.uint64(_PACKED)
    return ((number[:, None] >> shifts) & np.uint64(127)).astype(np.uint8).tobytes()
