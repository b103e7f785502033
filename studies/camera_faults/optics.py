"""Faults of mount, lens and sensor, drawn in the pictures themselves.

Zoom and shifts of the picture are homographies from displaced corners of the image; where the camera turns, another
model of the lens is used than in the program.
"""

import cv2
import numpy as np

from studies.camera_faults.film import Film, Luma, rounded
from towval.model import Array

Rng = np.random.Generator


def _moved(luma: Luma, corners_px: Array) -> Luma:
    """The picture with its corners displaced by (4, 2) pixels."""
    height, width = luma.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
    H = cv2.getPerspectiveTransform(corners.astype(np.float32), (corners + corners_px).astype(np.float32))
    return np.asarray(cv2.warpPerspective(luma, H, (width, height), flags=cv2.INTER_LANCZOS4, borderMode=4))


def _displaced(film: Film, corners_px: Array) -> Film:
    """Corners displaced in each picture (n, 4, 2) [px of a picture 1920 wide]; pictures not moved stay as they are."""
    return film.seen(lambda i, luma: _moved(luma, film.px * corners_px[i]) if corners_px[i].any() else luma)


def _sagged(film: Film, shares: Array, px: float, rng: Rng) -> Film:
    """A mount that gives way: by shares (n,) of a turn that shifts the picture's middle by so much, and rolls a third.

    Each pixel is read where its ray was before, by the division model of the lens (Fitzgibbon 2001).
    """
    focal, u0, v0, bend = film.lens
    heading, roll = rng.uniform(0, 2 * np.pi), rng.choice([-1, 1]) * px / 3 / 960
    turn = np.array([*(px * film.px / focal * np.array([np.cos(heading), np.sin(heading)])), roll])
    width, height = film.size_px
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    x, y = (u - u0) / focal, (v - v0) / focal
    rays = np.stack([x, y, 1 + bend * (x * x + y * y)], axis=-1)

    def sagged(i: int, luma: Luma) -> Luma:
        if not shares[i]:
            return luma
        before = rays @ cv2.Rodrigues(shares[i] * turn)[0]
        # The ray (a, b, c) is seen at s (a, b), where c s = 1 + bend s² (a² + b²).
        radius2, c = before[..., 0] ** 2 + before[..., 1] ** 2, before[..., 2]
        scale = 2 / (c + np.sqrt(c * c - 4 * bend * radius2))
        at_u, at_v = (focal * scale * before[..., k] + (u0, v0)[k] for k in (0, 1))
        maps = at_u.astype(np.float32), at_v.astype(np.float32)
        return np.asarray(cv2.remap(luma, *maps, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT))

    return film.seen(sagged)


def _magnified(film: Film, shares: Array, rng: Rng) -> Film:
    """Magnified by shares (n,) about a place beside the middle."""
    size = np.array(film.size_px) / film.px
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
    centre = size * rng.uniform(0.45, 0.55, 2)
    return _displaced(film, shares[:, None, None] * (corners - centre))


def creep(film: Film, px: float, rng: Rng) -> Film:
    """The mount sags slowly."""
    return _sagged(film, np.linspace(0, 1, len(film)), px, rng)


def shake(film: Film, px: float, rng: Rng) -> Film:
    """A stabiliser's coil, or a floor that trembles: shifts that keep a third from picture to picture."""
    shift = rng.normal(0, px, (len(film), 2))
    for i in range(1, len(film)):
        shift[i] = 0.33 * shift[i - 1] + 0.94 * shift[i]
    return _displaced(film, np.repeat(shift[:, None], 4, axis=1))


def zoom_step(film: Film, percent: float, rng: Rng) -> Film:
    """The focus jumps and magnifies."""
    after = film.time_s > 0.6 * film.time_s[-1]
    return _magnified(film, np.where(after, percent / 100, 0.0), rng)


def breathing(film: Film, percent: float, rng: Rng) -> Film:
    """The focus hunts slowly; the picture breathes."""
    return _magnified(film, percent / 100 * np.sin(2 * np.pi * film.time_s / 3), rng)


def other_zoom(film: Film, percent: float, rng: Rng) -> Film:
    """The whole video is cropped and magnified, as another mode of the camera is."""
    return _magnified(film, np.full(len(film), percent / 100), rng)


def knock(film: Film, px: float, rng: Rng) -> Film:
    """Somebody hits the mount: it rings and stays displaced."""
    since = film.time_s - 0.55 * film.time_s[-1]
    after = np.where(since > 0, 1 - np.exp(-since / 0.1) * np.cos(20 * since), 0.0)
    return _sagged(film, after, px, rng)


def rotation(film: Film, degrees: float, rng: Rng) -> Film:
    """The picture turns slowly about one of its corners."""
    size = np.array(film.size_px) / film.px
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
    pivot = corners[rng.integers(4)]
    angles = np.radians(degrees) * np.linspace(0, 1, len(film))
    turn = np.array([[[np.cos(a) - 1, np.sin(a)], [-np.sin(a), np.cos(a) - 1]] for a in angles])
    return _displaced(film, (corners - pivot) @ turn)


def jello(film: Film, px: float, _rng: Rng) -> Film:
    """A motor shakes a camera that reads row by row: rows are displaced sideways in waves."""
    width, height = film.size_px
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))

    def bent(i: int, luma: Luma) -> Luma:
        wave = px * film.px * np.sin(2 * np.pi * (1.7 * v[:, 0] / height + 0.31 * i))
        return np.asarray(cv2.remap(luma, u + wave[:, None].astype(np.float32), v, cv2.INTER_CUBIC, borderMode=4))

    return film.seen(bent)


def rolling_shutter(film: Film, readout_ms: float, _rng: Rng) -> Film:
    """Rows are read one after another, the middle one at the picture's time."""
    height = film.size_px[1]
    late = (np.arange(height) / (height - 1) - 0.5) * readout_ms / 1e3 / film.step_s

    def read(i: int, luma: Luma) -> Luma:
        before, after = film.picture(max(i - 1, 0)), film.picture(min(i + 1, len(film) - 1))
        other = np.where((late < 0)[:, None], before, after)
        return rounded(luma + np.abs(late)[:, None] * (other.astype(np.float32) - luma))

    return film.seen(read)


def defocus(film: Film, px: float, _rng: Rng) -> Film:
    """Out of focus all along."""
    return film.seen(lambda _i, luma: np.asarray(cv2.GaussianBlur(luma, (0, 0), px * film.px)))


def focus_hunting(film: Film, px: float, rng: Rng) -> Film:
    """The focus goes out and back twice, and the picture breathes with it by 0.3 %."""
    out = np.clip(np.sin(4 * np.pi * film.time_s / film.time_s[-1]), 0, 1)
    breathing_film = _magnified(film, 0.003 * out, rng)
    blur = film.px * px * out
    return breathing_film.seen(
        lambda i, luma: luma if blur[i] < 0.2 else np.asarray(cv2.GaussianBlur(luma, (0, 0), blur[i]))
    )


def motion_blur(film: Film, exposure_ms: float, _rng: Rng) -> Film:
    """Long exposure: the mean of what was to be seen meanwhile."""
    half = exposure_ms / 2e3 / film.step_s
    return film.seen(lambda i, _l: rounded(np.mean([film.between(i, x) for x in np.linspace(-half, half, 5)], axis=0)))


def low_resolution(film: Film, factor: float, _rng: Rng) -> Film:
    """Sent by a messenger: made smaller, and enlarged again."""
    size = film.size_px
    small = round(size[0] / factor), round(size[1] / factor)
    return film.seen(
        lambda _i, luma: np.asarray(
            cv2.resize(cv2.resize(luma, small, interpolation=cv2.INTER_AREA), size, interpolation=cv2.INTER_CUBIC)
        )
    )


def mirrored(film: Film, kind: float, _rng: Rng) -> Film:
    """Turned over sideways (1), top to bottom (2), or both (3)."""
    return film.seen(lambda _i, luma: np.ascontiguousarray(cv2.flip(luma, {1: 1, 2: 0, 3: -1}[int(kind)])))


def noise(film: Film, grey_levels: float, rng: Rng) -> Film:
    """High gain: noise, in a dark place of fixed rows, too."""
    height, width = film.size_px[1], film.size_px[0]
    sheets = [rng.normal(0, grey_levels, (height, width)).astype(np.float32) for _ in range(5)]
    rows = rng.normal(0, grey_levels / 4, (height, 1)).astype(np.float32)

    def noisy(i: int, luma: Luma) -> Luma:
        turned = np.roll(sheets[i % 5], (7 * i, 13 * i), axis=(0, 1))
        return rounded(luma + turned + rows)

    return film.seen(noisy)


def temporal_denoising(film: Film, kept: float, _rng: Rng) -> Film:
    """A phone's noise reduction: each picture keeps a share of the one before, which keeps one of the one before."""

    def smoothed(i: int, luma: Luma) -> Luma:
        weights = kept ** np.arange(min(i + 1, 6))
        before = [share * film.picture(i - k) for k, share in enumerate(weights / weights.sum())]
        return rounded(np.sum(before, axis=0))

    return film.seen(smoothed)


def sharpening(film: Film, amount: float, _rng: Rng) -> Film:
    """Edges are overdrawn."""

    def sharper(_i: int, luma: Luma) -> Luma:
        soft = cv2.GaussianBlur(luma, (0, 0), 2.0 * film.px)
        return np.asarray(cv2.addWeighted(luma, 1 + amount, soft, -amount, 0))

    return film.seen(sharper)


def dust(film: Film, count: float, rng: Rng) -> Film:
    """Dust on the sensor and dead pixels: they stand still in the picture."""
    width, height = film.size_px
    shade = np.ones((height, width), dtype=np.float32)
    for _ in range(int(count)):
        at = int(rng.uniform(0, width)), int(rng.uniform(0, height))
        cv2.circle(shade, at, max(2, round(rng.uniform(3, 12) * film.px)), float(rng.uniform(0.4, 0.8)), -1)
    shade = np.asarray(cv2.GaussianBlur(shade, (0, 0), 2 * film.px))
    dead = rng.integers(0, height, 20 * int(count)), rng.integers(0, width, 20 * int(count))
    shade[dead] = 0.0
    return film.seen(lambda _i, luma: rounded(luma * shade))
