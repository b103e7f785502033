"""The floor of one picture, registered in others whatever their focus and light.

As it is; through a blur, and in even light, where that helps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from towval.model import Array, Camera, Floor
from towval.tracking.floor_registration import FloorRegistration, Hidden, Registered
from towval.tracking.focus import CONSTANTS as FOCUS
from towval.tracking.focus import blurred, width_px
from towval.tracking.light import evened
from towval.tracking.template import Luma


@dataclass(frozen=True)
class WatchedFloorConstants:
    """Tuned constants of when a blur is tried and when light is evened."""

    sure_px: float = 0.06  # [px] Deviation of a registration, 0.01 to 0.04 in even light, beyond which it is not sure.
    even_helps: float = 0.5  # Of a registration's deviation is left in even light: bands leave 0.1 to 0.4, noise 0.8.
    blur_helps: float = 0.8  # Of a registration's deviation is left through a blur that the picture has, too,
    blur_shows: float = 0.9  # and of a blur too narrow to matter to the floor so much.
    even_every: int = 25  # Pictures after which it is tried again where it did not help: it costs as much as all else.


CONSTANTS = WatchedFloorConstants()


class WatchedFloor:
    """The floor as the picture ``luma`` (height, width) shows it outside the outlines (n, 2) [m] that hide it."""

    def __init__(self, camera: Camera, floor: Floor, luma: Luma, hidden: Sequence[Array]):
        self.as_it_is = FloorRegistration(camera, floor, luma, tuple(hidden))
        self.in_even_light: FloorRegistration | None = None
        self.levels: dict[int, FloorRegistration] = {0: self.as_it_is}
        self.picture = camera, floor, luma, tuple(hidden)
        self.level, self.sharp_up_to_px = 0, 0.0
        self.last: tuple[Luma, Array, Hidden] | None = None
        self.last_px = np.inf
        self.last_blur_px: float | None = None
        self.as_it_is_until, self.registered = 0, 0

    @property
    def shows_texture(self) -> bool:
        """Whether the floor shows enough to be registered at all."""
        return self.as_it_is.template is not None

    @property
    def scattered_px(self) -> float:
        """As :attr:`FloorRegistration.scattered_px`, the larger of both lights."""
        return max(one.scattered_px for one in (self.as_it_is, self.in_even_light) if one and one.template)

    def register(self, luma: Luma, start: Array, hidden: Hidden) -> Registered | None:
        """As :meth:`FloorRegistration.register`, by the blur and in the light by which the floor is known better."""
        found = self._in_better_light(luma, start, hidden)
        self.registered += found is not None
        self.last, self.last_px = (luma, start if found is None else found.motion, hidden), _px(found)
        self.last_blur_px = None
        return found

    def blur_px(self) -> float:
        """Width of the blur that the floor shows in the picture registered last [px]; none where it was not found.

        Infinite, for all that is known, where the floor was found in no picture: too plain a floor.
        """
        if self.last is None or not self.registered:
            return np.inf
        if self.level:
            return width_px(self.level)
        if self.last_blur_px is None:
            self.last_blur_px = width_px(self._shown_level(*self.last))
        return self.last_blur_px

    def _shown_level(self, luma: Luma, motion: Array, hidden: Hidden) -> int:
        """The level at which the floor is known best of those that a rise from the sharp one leads to."""
        level, px = 0, CONSTANTS.blur_shows * self.last_px if np.isfinite(self.last_px) else 0.0
        while level < FOCUS.widths and self._at(level + 1).template is not None:
            wider_px = _px(self._at(level + 1).near(luma, motion, hidden))
            if wider_px >= px:
                break
            level, px = level + 1, wider_px
        return level

    def _at(self, level: int) -> FloorRegistration:
        if level not in self.levels:
            camera, floor, first, hidden = self.picture
            self.levels[level] = FloorRegistration(camera, floor, blurred(first, level), hidden)
        return self.levels[level]

    def _in_better_focus(self, luma: Luma, start: Array, hidden: Hidden) -> Registered | None:
        """The floor through the blur of the pictures before, or through another one where that knows it better."""
        at = self.level
        tried = {at: self._at(at).register(luma, start, hidden)}
        found = tried[at]
        # Where no blur helped none is tried until the floor is known still worse, or was surely known meanwhile.
        if _px(found) < CONSTANTS.sure_px:
            self.sharp_up_to_px = 0.0
        if at == 0 and _px(found) < max(CONSTANTS.sure_px, self.sharp_up_to_px):
            return found
        for level in sorted(range(FOCUS.widths + 1), key=lambda level: abs(level - at)):
            # Beyond the sharp floor and those beside it others are tried only where none of these is sure.
            if level and abs(level - at) > 1 and min(map(_px, tried.values())) < CONSTANTS.sure_px:
                continue
            if level not in tried and self._at(level).template is not None:
                tried[level] = self._at(level).near(luma, start, hidden)
        best = min(tried, key=lambda level: _px(tried[level]))
        sharp_px = _px(tried.get(0))
        if _px(tried[best]) > CONSTANTS.blur_helps * sharp_px:
            best, self.sharp_up_to_px = 0, sharp_px / CONSTANTS.blur_helps
        self.level = best
        return tried[best]

    def _in_better_light(self, luma: Luma, start: Array, hidden: Hidden) -> Registered | None:
        found = self._in_better_focus(luma, start, hidden)
        if found is not None and (found.std_px < CONSTANTS.sure_px or self.registered < self.as_it_is_until):
            return found
        # Bands of mains light, shadows and glare differ within a tile, too; to even all pictures would cost too much.
        if self.in_even_light is None:
            camera, floor, first, hidden_at_first = self.picture
            self.in_even_light = FloorRegistration(camera, floor, evened(first), hidden_at_first)
        even = None
        if self.in_even_light.template is not None:
            even = self.in_even_light.register(evened(luma), start, hidden)
        if found is not None and (even is None or even.std_px > CONSTANTS.even_helps * found.std_px):
            self.as_it_is_until = self.registered + CONSTANTS.even_every
        return min((seen for seen in (found, even) if seen is not None), key=lambda seen: seen.std_px, default=None)


def _px(found: Registered | None) -> float:
    """Deviation of a registration [px]; infinite where there is none."""
    return np.inf if found is None else found.std_px
