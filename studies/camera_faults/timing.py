"""Faults of time: what is lost, repeated or stamped wrongly between sensor and file."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from studies.camera_faults.film import Film, Luma, rounded
from towval.model import Array

Rng = np.random.Generator


def _chosen(film: Film, numbers: NDArray[np.intp], time_s: Array) -> Film:
    """Some of the pictures, by their numbers, with other times."""
    chosen = (lambda i: film.picture(int(numbers[i])), lambda i: film.chroma(int(numbers[i])))
    return Film(time_s, *chosen, film.lens)


def _lost(film: Film, percent: float, rng: Rng) -> NDArray[np.intp]:
    """Numbers of the pictures that are left; at least two are lost, none of the first ten."""
    count = max(2, round(percent / 100 * len(film)))
    return np.delete(np.arange(len(film)), rng.choice(np.arange(10, len(film)), count, replace=False))


def dropped(film: Film, percent: float, rng: Rng) -> Film:
    """Pictures are lost, and the rest is stamped as if none were."""
    left = _lost(film, percent, rng)
    return _chosen(film, left, film.time_s[: len(left)])


def lost_regularly(film: Film, every: float, _rng: Rng) -> Film:
    """Every so-many-th picture is lost, as on a line that carries no more, and the rest stamped as if none were."""
    left = np.flatnonzero((np.arange(len(film)) + 1) % int(every))
    return _chosen(film, left, film.time_s[: len(left)])


def variable_rate(film: Film, percent: float, rng: Rng) -> Film:
    """Pictures are left out and the others keep their true times."""
    left = _lost(film, percent, rng)
    return _chosen(film, left, film.time_s[left])


def repeated(film: Film, percent: float, rng: Rng) -> Film:
    """Pictures come late and the one before is written in their place."""
    numbers = np.arange(len(film))
    late = rng.choice(np.arange(5, len(film)), max(2, round(percent / 100 * len(film))), replace=False)
    for i in np.sort(late):
        numbers[i] = numbers[i - 1]
    return _chosen(film, numbers, film.time_s)


def wrong_rate(film: Film, percent: float, _rng: Rng) -> Film:
    """All stamps run fast."""
    return replace(film, time_s=film.time_s * (1 + percent / 100))


def jitter(film: Film, milliseconds: float, rng: Rng) -> Film:
    """Pictures are taken early or late under even stamps."""
    late = np.clip(rng.normal(0, milliseconds / 1e3 / film.step_s, len(film)), -0.9, 0.9)
    return replace(film, picture=lambda i: rounded(film.between(i, late[i])))


def bursts(film: Film, pictures: float, _rng: Rng) -> Film:
    """A network camera: so many pictures arrive at once and are stamped as they arrive."""
    n, count = len(film), int(pictures)
    last = np.minimum((np.arange(n) // count + 1) * count - 1, n - 1)
    return replace(film, time_s=film.time_s[last] - (last - np.arange(n)) * 1e-3)


def frozen(film: Film, seconds: float, _rng: Rng) -> Film:
    """The picture freezes for a time and jumps on."""
    begins = 0.5 * film.time_s[-1]
    still = int(np.searchsorted(film.time_s, begins))
    within = (film.time_s > begins) & (film.time_s < begins + seconds)
    return _chosen(film, np.where(within, still, np.arange(len(film))), film.time_s)


def frozen_to_the_end(film: Film, seconds: float, _rng: Rng) -> Film:
    """The picture freezes that long before the end, and stays."""
    last = max(len(film) - 1 - round(seconds / film.step_s), 0)
    return _chosen(film, np.minimum(np.arange(len(film)), last), film.time_s)


def torn(film: Film, percent: float, rng: Rng) -> Film:
    """In every third picture the upper part is that of the one before."""
    rows = round(percent / 100 * film.size_px[1])
    phase = int(rng.integers(3))

    def tear(i: int, luma: Luma) -> Luma:
        if i % 3 != phase or not i:
            return luma
        return np.concatenate([film.picture(i - 1)[:rows], luma[rows:]])

    return film.seen(tear)


def interlaced(film: Film, later: float, _rng: Rng) -> Film:
    """Odd rows were taken a share of a picture's time later."""

    def woven(i: int, luma: Luma) -> Luma:
        luma = luma.copy()
        luma[1::2] = rounded(film.between(i, later))[1::2]
        return luma

    return film.seen(woven)


def joined(film: Film, pictures: float, _rng: Rng) -> Film:
    """Two clips are joined under even stamps: between them the camera wrote to its card and lost so many pictures.

    Where it is less than none, the second clip begins before the first one ends.
    """
    middle, lost = len(film) // 2, int(pictures)
    left = np.concatenate([np.arange(middle), np.arange(middle + lost, len(film))])
    return _chosen(film, left, np.arange(len(left), dtype=np.float64) * film.step_s)


def clock_set(film: Film, milliseconds: float, _rng: Rng) -> Film:
    """In the middle of the run the camera's clock is set: all stamps from there on are late."""
    return replace(film, time_s=film.time_s + milliseconds / 1e3 * (2 * np.arange(len(film)) > len(film)))


def slower_in_low_light(film: Film, percent: float, _rng: Rng) -> Film:
    """From the middle of the run on the camera exposes longer, films more slowly, and stamps as before."""
    middle = len(film) // 2
    places = np.arange(len(film), dtype=np.float64)
    places[middle:] = middle + (places[middle:] - middle) * (1 + percent / 100)
    places = places[places < len(film) - 1]
    chosen = (lambda i: rounded(film.between(0, float(places[i]))), lambda i: film.chroma(int(places[i])))
    return Film(film.time_s[: len(places)], *chosen, film.lens)


def rounded_stamps(film: Film, milliseconds: float, _rng: Rng) -> Film:
    """Stamps are cut off to a coarse clock, as some containers have it."""
    tick_s = milliseconds / 1e3
    return replace(film, time_s=tick_s * np.floor(film.time_s / tick_s + 1e-6))


def fields_swapped(film: Film, later: float, rng: Rng) -> Film:
    """A field is lost in the middle of an interlaced run: from there on the even rows are the later ones."""
    before, after = interlaced(film, later, rng), interlaced(film, -later, rng)
    return film.seen(lambda i, _luma: (after if 2 * i > len(film) else before).picture(i))


def invented(film: Film, between: float, _rng: Rng) -> Film:
    """So many pictures between two real ones are invented from their optical flow, as smooth playback does."""
    every = int(between) + 1
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    v, u = np.indices(film.picture(0).shape, dtype=np.float32)
    last: dict[int, Array] = {}

    def smooth(i: int, luma: Luma) -> Luma:
        first = i - i % every
        share = np.float32((i % every) / every)
        if not share or first + every >= len(film):
            return luma
        if first not in last:
            last.clear()
            still = np.zeros((*luma.shape, 2), dtype=np.float32)
            last[first] = np.asarray(flow.calc(film.picture(first), film.picture(first + every), still))
        to_u, to_v = share * last[first][..., 0], share * last[first][..., 1]
        return np.asarray(cv2.remap(film.picture(first), u - to_u, v - to_v, cv2.INTER_CUBIC, borderMode=4))

    return film.seen(smooth)
