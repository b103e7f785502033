"""Faults of light, of what stands or walks between camera and floor, and of what programs draw into a picture."""

import cv2
import numpy as np

from studies.camera_faults.film import Film, Luma, rounded
from towval.model import Array

Rng = np.random.Generator


def flicker(film: Film, percent: float, _rng: Rng) -> Film:
    """Mains light and a rolling shutter: bands that move through the picture."""
    return _banded(film, percent, 1.4)


def fine_flicker(film: Film, percent: float, _rng: Rng) -> Film:
    """The same with a slower readout: bands as narrow as a body."""
    return _banded(film, percent, 3.3)


def _banded(film: Film, percent: float, bands: float) -> Film:
    rows = np.arange(film.size_px[1]) / film.size_px[1]

    def lit(i: int, luma: Luma) -> Luma:
        band = 1 + percent / 100 * np.sin(2 * np.pi * (bands * rows + 0.37 * i))
        return rounded(luma * band[:, None])

    return film.seen(lit)


def exposure_steps(film: Film, percent: float, rng: Rng) -> Film:
    """The camera sets its exposure anew every second."""
    steps = 1 + percent / 100 * rng.uniform(-1, 1, 1000)
    return film.seen(lambda i, luma: rounded(luma * steps[int(film.time_s[i])]))


def white_balance(film: Film, percent: float, _rng: Rng) -> Film:
    """Red grows and blue falls slowly, so that coloured things change their grey."""
    share = percent / 100 * np.linspace(0, 1, len(film))

    def tinted(i: int, luma: Luma) -> Luma:
        width, height = film.size_px
        blue, red = (cv2.resize(plane, (width, height)).astype(np.float32) - 128 for plane in film.chroma(i))
        bright = luma.astype(np.float32)
        # ITU-R BT.601.
        return rounded(bright + share[i] * (0.299 * (bright + 1.402 * red) - 0.114 * (bright + 1.772 * blue)))

    return film.seen(tinted)


def tone(film: Film, gamma: float, _rng: Rng) -> Film:
    """Another tone curve from the middle of the run on."""
    table = rounded(255 * (np.arange(256) / 255) ** gamma)
    return film.seen(lambda i, luma: table[luma] if 2 * i > len(film) else luma)


def colour_range(film: Film, kind: float, _rng: Rng) -> Film:
    """Full range written as limited (1), limited stretched to full and cut off (2), squeezed twice (3)."""
    levels = np.arange(256.0)
    squeezed = 16 + levels * 219 / 255
    table = rounded({1: squeezed, 2: (levels - 16) * 255 / 219, 3: 16 + squeezed * 219 / 255}[int(kind)])
    return film.seen(lambda _i, luma: table[luma])


def spot(film: Film, centre: Array, radius: float, softness: float) -> Array:
    """A disc (height, width) of 0 to 1; ``centre`` (2,) in shares of the picture, radius in shares of its width."""
    width, height = film.size_px
    mask = np.zeros((height, width), dtype=np.float32)
    at = int(centre[0] * width), int(centre[1] * height)
    cv2.ellipse(mask, at, (round(radius * width), round(0.7 * radius * width)), 20, 0, 360, 1.0, -1)
    return np.asarray(cv2.GaussianBlur(mask, (0, 0), max(1.0, softness * radius * width)))


def middle_of_motion(film: Film) -> Array:
    """Where the pictures change most between first and last, in shares of the picture (2,)."""
    change = cv2.GaussianBlur(cv2.absdiff(film.picture(0), film.picture(len(film) - 1)), (0, 0), 40 * film.px)
    v, u = np.unravel_index(int(np.argmax(change)), change.shape)
    return np.array([u / film.size_px[0], v / film.size_px[1]])


def glint(film: Film, percent: float, _rng: Rng) -> Film:
    """A lamp mirrored at a place of the picture where bodies pass."""
    bright = 230 * spot(film, middle_of_motion(film), percent / 100, 0.5)
    return film.seen(lambda _i, luma: rounded(luma + bright))


def glint_at_start(film: Film, percent: float, _rng: Rng) -> Film:
    """A lamp mirrored where something that moves later stands in the first picture."""
    moved = cv2.GaussianBlur(cv2.absdiff(film.picture(0), film.picture(len(film) - 1)), (0, 0), 20 * film.px)
    texture = cv2.GaussianBlur(cv2.absdiff(film.picture(0), cv2.blur(film.picture(0), (9, 9))), (0, 0), 20 * film.px)
    v, u = np.unravel_index(int(np.argmax(moved.astype(np.float32) * texture)), moved.shape)
    place = np.array([u / film.size_px[0], v / film.size_px[1]])
    bright = 230 * spot(film, place, percent / 100, 0.5)
    return film.seen(lambda _i, luma: rounded(luma + bright))


def shadow(film: Film, percent: float, rng: Rng) -> Film:
    """A person's shadow passes over the bodies."""
    middle, way = middle_of_motion(film), rng.uniform(-1, 1, 2)

    def shaded(i: int, luma: Luma) -> Luma:
        place = middle + (i / len(film) - 0.5) * 1.6 * way / np.linalg.norm(way)
        return rounded(luma * (1 - percent / 100 * spot(film, place, 0.15, 0.15)))

    return film.seen(shaded)


def person(film: Film, percent: float, rng: Rng) -> Film:
    """Somebody walks through the picture, over bodies and floor."""
    width, height = film.size_px
    middle, way = middle_of_motion(film), rng.uniform(-1, 1, 2)
    cloth = cv2.GaussianBlur(rng.uniform(0, 255, (height, width)).astype(np.float32), (0, 0), 6 * film.px)
    cloth = (cloth - cloth.mean()) * 8 + 90
    begins = 0.35 * film.time_s[-1]

    def hidden(i: int, luma: Luma) -> Luma:
        gone = (film.time_s[i] - begins) * 0.4 - 0.5
        place = middle + gone * way / np.linalg.norm(way)
        shift = np.round((place - middle) * [width, height]).astype(int)
        mask = spot(film, place, percent / 100, 0.03)
        return rounded(luma + mask * (np.roll(cloth, shift[::-1], axis=(0, 1)) - luma))

    return film.seen(hidden)


def banner(film: Film, percent: float, _rng: Rng) -> Film:
    """A caption stands still over what moves."""
    width, height = film.size_px
    top = int(np.clip(middle_of_motion(film)[1] - percent / 200, 0, 1 - percent / 100) * height)
    strip = np.full((max(8, round(percent / 100 * height)), width), 40, dtype=np.uint8)
    scale = len(strip) / 40
    words = "LAB CAMERA 1   CEILING   " * 4
    cv2.putText(strip, words, (5, round(0.75 * len(strip))), cv2.FONT_HERSHEY_SIMPLEX, scale, 255, max(1, round(scale)))

    def captioned(_i: int, luma: Luma) -> Luma:
        luma = luma.copy()
        luma[top : top + len(strip)] = strip
        return luma

    return film.seen(captioned)


def clock(film: Film, percent: float, _rng: Rng) -> Film:
    """A time stamp whose digits change, over what moves."""
    width, height = film.size_px
    u, v = middle_of_motion(film)
    scale = percent / 100 * height / 22

    def stamped(i: int, luma: Luma) -> Luma:
        luma = luma.copy()
        text = f"2026-11-22 09:00:{film.time_s[i]:06.3f}"
        at = int(max(0.0, u - 0.2) * width), int(v * height)
        cv2.putText(luma, text, at, cv2.FONT_HERSHEY_PLAIN, scale, 255, max(1, round(scale)))
        return luma

    return film.seen(stamped)
