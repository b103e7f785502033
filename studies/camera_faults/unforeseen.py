"""Faults that nobody had in mind when the tracking was written: of the camera's processing, of optics, of the room."""

from collections.abc import Mapping

import cv2
import numpy as np

from studies.camera_faults.film import Film, Luma, rounded
from studies.camera_faults.light import middle_of_motion, spot
from towval.model import Array

Rng = np.random.Generator


def _grid(film: Film) -> tuple[Array, Array]:
    width, height = film.size_px
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return np.asarray(u), np.asarray(v)


def _remapped(luma: Luma, u: Array, v: Array) -> Luma:
    maps = u.astype(np.float32), v.astype(np.float32)
    return np.asarray(cv2.remap(luma, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT))


def _free_places(film: Film, size: tuple[int, int]) -> list[tuple[int, int]]:
    """Where something so wide and high [px] hides nothing that moves, the quietest first (u, v of its top left)."""
    width, height = film.size_px
    pictures = [film.picture(i).astype(np.float32) for i in np.linspace(0, len(film) - 1, 9).astype(int)]
    change = cv2.blur(np.ptp(pictures, axis=0), (9, 9))
    places = [(int(u), int(v)) for u in np.linspace(0, width - size[0], 7) for v in np.linspace(0, height - size[1], 5)]
    return sorted(places, key=lambda at: float(change[at[1] : at[1] + size[1], at[0] : at[0] + size[0]].max()))


def hdr_ghosts(film: Film, share: float, _rng: Rng) -> Film:
    """Two exposures, the darker one half a picture later, are fused: bright things come from the later one."""

    def fused(i: int, luma: Luma) -> Luma:
        late = film.between(i, 0.5)
        weight = share * np.clip((late - 60) / 120, 0, 1)
        return rounded((1 - weight) * luma + weight * late)

    return film.seen(fused)


def local_tone(film: Film, amount: float, _rng: Rng) -> Film:
    """Shadows are lifted and lights lowered by their surroundings, so that bodies carry halos with them."""

    def mapped(_i: int, luma: Luma) -> Luma:
        around = cv2.GaussianBlur(luma.astype(np.float32), (0, 0), 60 * film.px)
        return rounded(luma + amount * (128 - around))

    return film.seen(mapped)


def stabiliser(film: Film, px: float, rng: Rng) -> Film:
    """An electronic stabiliser follows what moves, lets go, and snaps back, in steps of a quarter of a pixel."""
    heading, u_v = rng.uniform(0, 2 * np.pi), _grid(film)
    drift = px * film.px * ((film.time_s / 2.7) % 1.0)
    shift = np.round(4 * drift[:, None] * np.array([np.cos(heading), np.sin(heading)])) / 4
    return film.seen(lambda i, luma: _remapped(luma, u_v[0] - shift[i, 0], u_v[1] - shift[i, 1]))


def sun_patch(film: Film, percent: float, rng: Rng) -> Film:
    """The sun shines through a window: a patch with sharp sides slides over the bodies and clips."""
    width, height = film.size_px
    middle, heading = middle_of_motion(film), rng.uniform(0, 2 * np.pi)
    way = np.array([np.cos(heading), np.sin(heading)])

    def lit(i: int, luma: Luma) -> Luma:
        at = (middle + (film.time_s[i] / film.time_s[-1] - 0.5) * 0.3 * way) * [width, height]
        box = cv2.boxPoints(((float(at[0]), float(at[1])), (0.18 * width, 0.3 * height), 25.0))
        patch = np.zeros((height, width), dtype=np.float32)
        cv2.fillConvexPoly(patch, np.rint(box).astype(np.int32), 1.0, cv2.LINE_AA)
        return rounded(luma * (1 + percent / 100 * cv2.GaussianBlur(patch, (0, 0), 2 * film.px)))

    return film.seen(lit)


def cable(film: Film, px: float, rng: Rng) -> Film:
    """A cable hangs from the ceiling before the bodies' way, and swings a little."""
    width, height = film.size_px
    u, v = middle_of_motion(film) * [width, height]
    slant = rng.uniform(-0.4, 0.4)

    def hung(i: int, luma: Luma) -> Luma:
        luma, swing = luma.copy(), 6 * film.px * np.sin(2 * np.pi * film.time_s[i] / 2.1)
        top = round(u - slant * v), 0
        bottom = round(u + slant * (height - v) + swing), height
        cv2.line(luma, top, bottom, 25, max(1, round(px * film.px)), cv2.LINE_AA)
        return luma

    return film.seen(hung)


def drop(film: Film, percent: float, _rng: Rng) -> Film:
    """A drop of water on the lens magnifies and blurs a part of the picture where bodies pass."""
    (u, v), patch = _grid(film), spot(film, middle_of_motion(film), 0.07, 0.3)
    at = middle_of_motion(film) * film.size_px
    scale = 1 - percent / 100 * patch
    places = at[0] + (u - at[0]) * scale, at[1] + (v - at[1]) * scale

    def wet(_i: int, luma: Luma) -> Luma:
        bent = _remapped(luma, *places).astype(np.float32)
        soft = cv2.GaussianBlur(bent, (0, 0), 3 * film.px)
        return rounded(bent + 0.5 * patch * (soft - bent))

    return film.seen(wet)


def twin(film: Film, kind: float, _rng: Rng) -> Film:
    """A copy of what moves stands by, turned by half, where nothing moves: at the quietest place (1), or another."""
    change = cv2.GaussianBlur(cv2.absdiff(film.picture(0), film.picture(len(film) - 1)), (0, 0), 10 * film.px)
    rows, columns = np.nonzero(change > 0.3 * change.max())
    top, left = (int(np.percentile(each, 3)) for each in (rows, columns))
    bottom, right = (int(np.percentile(each, 97)) for each in (rows, columns))
    patch = np.ascontiguousarray(film.picture(0)[top:bottom, left:right][::-1, ::-1])
    u, v = _free_places(film, (patch.shape[1], patch.shape[0]))[int(kind) - 1]

    def doubled(_i: int, luma: Luma) -> Luma:
        luma = luma.copy()
        luma[v : v + patch.shape[0], u : u + patch.shape[1]] = patch
        return luma

    return film.seen(doubled)


def kicked_board(film: Film, kind: float, _rng: Rng) -> Film:
    """A large board lies on the floor; in the middle of the run somebody kicks it 10 (1), 40 (2) or 150 px (3) away."""
    width, height = film.size_px
    side = max(4, round(45 * film.px))
    squares = 255 * (np.indices((6 * side, 8 * side)) // side).sum(axis=0) % 2
    board = np.where(squares, 235, 20).astype(np.uint8)
    room = 2 * np.array(board.shape[::-1]) // 10
    at = _free_places(film, (int(board.shape[1] + room[0]), int(board.shape[0] + room[1])))[0]
    kick = {1: 10, 2: 40, 3: 150}[int(kind)] * film.px * np.array([0.8, 0.6])

    def lying(i: int, luma: Luma) -> Luma:
        x, y = np.array(at) + kick * (2 * i > len(film))
        M = np.array([[1.0, 0.1, x], [-0.1, 1.0, y + 0.1 * board.shape[1]]])
        there = cv2.warpAffine(np.full_like(board, 255), M, (width, height))
        seen = cv2.warpAffine(board, M, (width, height))
        return np.where(there > 127, seen, luma).astype(np.uint8)

    return film.seen(lying)


def deinterlaced(film: Film, later: float, _rng: Rng) -> Film:
    """Half of the rows, taken later, are made up from those above and below; which half alternates."""

    def bobbed(i: int, _luma: Luma) -> Luma:
        field = film.between(i, later * (i % 2))
        kept = field[i % 2 :: 2]
        rows = (np.arange(len(field)) - i % 2) / 2
        places = np.clip(rows, 0, len(kept) - 1).astype(np.float32)
        u = np.arange(field.shape[1], dtype=np.float32)
        maps = np.meshgrid(u, places)
        return rounded(np.asarray(cv2.remap(kept, *maps, cv2.INTER_LINEAR), dtype=np.float64))

    return film.seen(bobbed)


def blended(film: Film, pictures: float, _rng: Rng) -> Film:
    """From 30 to 25 pictures a second by blending: every fifth is sharp, the others mix two moments."""

    def mixed(i: int, luma: Luma) -> Luma:
        apart = pictures * ((i + 2) % 5) / 4
        return rounded(0.5 * (film.between(i, -apart / 2) + film.between(i, apart / 2))) if apart else luma

    return film.seen(mixed)


def haze(film: Film, px: float, rng: Rng) -> Film:
    """Warm air before the lens: places of the picture swim against each other."""
    width, height = film.size_px
    u, v = _grid(film)
    coarse = rng.normal(0, 1, (len(film) + 8, 2, 5, 8)).astype(np.float32)
    smooth = np.stack([coarse[i : i + 8].mean(axis=0) * np.sqrt(8) for i in range(len(film))])

    def swimming(i: int, luma: Luma) -> Luma:
        by_u, by_v = (cv2.resize(each, (width, height), interpolation=cv2.INTER_CUBIC) for each in smooth[i])
        return _remapped(luma, u + px * film.px * by_u, v + px * film.px * by_v)

    return film.seen(swimming)


def lost_slice(film: Film, seconds: float, _rng: Rng) -> Film:
    """A part of the stream is lost: a band of the picture stays as it was until the next whole picture."""
    height = film.size_px[1]
    middle = int(middle_of_motion(film)[1] * height)
    rows = slice(max(0, middle - height // 12), middle + height // 12)
    begins = 0.5 * film.time_s[-1]
    still = int(np.searchsorted(film.time_s, begins))

    def torn(i: int, luma: Luma) -> Luma:
        if not begins < film.time_s[i] < begins + seconds:
            return luma
        luma = luma.copy()
        luma[rows] = film.picture(still)[rows]
        return luma

    return film.seen(torn)


def stretched(film: Film, percent: float, _rng: Rng) -> Film:
    """The video has other pixels than the pictures of the board: it is wider by so much."""
    (u, v), middle = _grid(film), film.size_px[0] / 2
    return film.seen(lambda _i, luma: _remapped(luma, middle + (u - middle) / (1 + percent / 100), v))


def lens_correction(film: Film, percent: float, _rng: Rng) -> Film:
    """The camera straightens its videos and not its pictures: the corners are drawn outwards by so much."""
    (u, v), (width, height) = _grid(film), film.size_px
    x, y = u - width / 2, v - height / 2
    inwards = 1 - percent / 100 * (x * x + y * y) / (width**2 + height**2) * 4
    return film.seen(lambda _i, luma: _remapped(luma, width / 2 + x * inwards, height / 2 + y * inwards))


def balance_steps(film: Film, percent: float, rng: Rng) -> Film:
    """The white balance is set anew every second: coloured things change their grey."""
    width, height = film.size_px
    steps = percent / 100 * rng.uniform(-1, 1, 1000)

    def tinted(i: int, luma: Luma) -> Luma:
        blue, red = (cv2.resize(plane, (width, height)).astype(np.float32) - 128 for plane in film.chroma(i))
        bright, share = luma.astype(np.float32), steps[int(film.time_s[i])]
        # ITU-R BT.601.
        return rounded(bright + share * (0.299 * (bright + 1.402 * red) - 0.114 * (bright + 1.772 * blue)))

    return film.seen(tinted)


def overexposed(film: Film, gain: float, _rng: Rng) -> Film:
    """The exposure rises slowly until light things clip."""
    rise = np.linspace(1, gain, len(film))
    return film.seen(lambda i, luma: rounded(luma * rise[i]))


def replenished(film: Film, levels: float, _rng: Rng) -> Film:
    """A surveillance camera sends only blocks of 16 px that changed by so much, and all of them every two seconds."""
    width, height = film.size_px
    every, sent = max(1, round(2 / film.step_s)), _Sent()

    def kept(i: int, luma: Luma) -> Luma:
        if i % every == 0 or sent.number != i - 1:
            start = i - i % every
            sent.number, sent.luma = start, film.picture(start).copy()
        while sent.number < i:
            sent.number += 1
            now = film.picture(sent.number)
            change = cv2.absdiff(now, sent.luma).astype(np.float32)
            blocks = cv2.resize(change, (-(-width // 16), -(-height // 16)), interpolation=cv2.INTER_AREA) > levels
            new = cv2.resize(blocks.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
            sent.luma = np.where(new, now, sent.luma)
        return sent.luma

    return film.seen(kept)


class _Sent:
    """The picture that was sent last, and its number."""

    number, luma = -2, np.zeros((0, 0), dtype=np.uint8)


def double_image(film: Film, share: float, _rng: Rng) -> Film:
    """A window before the camera mirrors the picture once more, 7 px beside itself."""
    M = np.array([[1.0, 0, 7 * film.px], [0, 1, 3 * film.px]])

    def mirrored(_i: int, luma: Luma) -> Luma:
        again = cv2.warpAffine(luma.astype(np.float32), M, film.size_px, borderMode=cv2.BORDER_REFLECT)
        return rounded((luma + share * again) / (1 + share))

    return film.seen(mirrored)


def posterised(film: Film, levels: float, _rng: Rng) -> Film:
    """Few grey levels, as a screen recorder or an animated picture has them."""
    step = 256 / levels
    return film.seen(lambda _i, luma: rounded((np.floor(luma / step) + 0.5) * step))


def lines_skipped(film: Film, factor: float, _rng: Rng) -> Film:
    """The sensor reads only some of its rows and columns, without a filter: fine texture aliases."""
    width, height = film.size_px
    small = round(width / factor), round(height / factor)

    def skipped(_i: int, luma: Luma) -> Luma:
        read = cv2.resize(luma, small, interpolation=cv2.INTER_NEAREST)
        return np.asarray(cv2.resize(read, (width, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)

    return film.seen(skipped)


def pointer(film: Film, px: float, _rng: Rng) -> Film:
    """A recorded screen: the mouse pointer lies over what moves, follows it for a while, and rests."""
    arrow = px * film.px * np.array([[0, 0], [0, 1], [0.28, 0.78], [0.6, 0.75]])
    change = [cv2.GaussianBlur(cv2.absdiff(film.picture(i), film.picture(0)), (0, 0), 12 * film.px)
              for i in range(0, len(film), 5)]  # fmt: skip
    at = np.array([np.unravel_index(int(np.argmax(each)), each.shape)[::-1] for each in change], dtype=np.float64)

    def pointed(i: int, luma: Luma) -> Luma:
        place = at[min(i, len(film) // 2) // 5 : min(i, len(film) // 2) // 5 + 1] + arrow
        shape = [np.rint(16 * place).astype(np.int32)]
        luma = luma.copy()
        cv2.fillPoly(luma, shape, 255, cv2.LINE_AA, 4)
        cv2.polylines(luma, shape, True, 0, 1, cv2.LINE_AA, 4)
        return luma

    return film.seen(pointed)


def insect(film: Film, percent: float, _rng: Rng) -> Film:
    """An insect crawls over the lens, out of focus, where bodies pass."""
    width, height = film.size_px
    middle = middle_of_motion(film) * film.size_px
    blot = np.asarray(spot(film, np.array([0.5, 0.5]), percent / 100, 0.3), dtype=np.float32)

    def crawled(i: int, luma: Luma) -> Luma:
        way = 0.1 * width * np.array([np.sin(0.9 * film.time_s[i]), np.cos(1.3 * film.time_s[i])])
        shift = middle + way - [width / 2, height / 2]
        dark = cv2.warpAffine(blot, np.column_stack([np.eye(2), shift]), (width, height))
        return rounded(luma * (1 - 0.85 * dark))

    return film.seen(crawled)


def hood(film: Film, percent: float, _rng: Rng) -> Film:
    """From the middle of the run on the lens hood hangs into the picture from one side, out of focus."""
    width, height = film.size_px
    mask = np.zeros((height, width), dtype=np.float32)
    mask[:, : round(percent / 100 * width)] = 1
    soft = cv2.GaussianBlur(mask, (0, 0), 40 * film.px)
    return film.seen(lambda i, luma: rounded(luma * (1 - soft)) if 2 * i > len(film) else luma)


def pulsing(crf: float, _pixels: float) -> Mapping[str, str]:
    """Whole pictures every half second, far better than those between: the picture breathes from group to group."""
    groups = "ipratio=3:keyint=12:scenecut=0:mbtree=0"
    return {"crf": f"{crf:g}", "preset": "veryfast", "g": "12", "x264-params": groups}
