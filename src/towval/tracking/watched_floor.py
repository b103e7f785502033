"""The floor of one picture, registered in others whatever the light: as it is, and in even light where that helps."""

from collections.abc import Sequence
from dataclasses import dataclass

from towval.model import Array, Camera, Floor
from towval.tracking.floor_registration import FloorRegistration, Hidden, Registered
from towval.tracking.light import evened
from towval.tracking.template import Luma


@dataclass(frozen=True)
class WatchedFloorConstants:
    """Tuned constants of when light is evened."""

    sure_px: float = 0.06  # [px] Deviation of a registration, 0.01 to 0.04 in even light, beyond which it is not sure.
    even_helps: float = 0.5  # Of a registration's deviation is left in even light: bands leave 0.1 to 0.4, noise 0.8.
    even_every: int = 25  # Pictures after which it is tried again where it did not help: it costs as much as all else.


CONSTANTS = WatchedFloorConstants()


class WatchedFloor:
    """The floor as the picture ``luma`` (height, width) shows it outside the outlines (n, 2) [m] that hide it."""

    def __init__(self, camera: Camera, floor: Floor, luma: Luma, hidden: Sequence[Array]):
        self.as_it_is = FloorRegistration(camera, floor, luma, tuple(hidden))
        self.in_even_light: FloorRegistration | None = None
        self.picture = camera, floor, luma, tuple(hidden)
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
        """As :meth:`FloorRegistration.register`, in the light in which the floor is known better."""
        found = self._in_better_light(luma, start, hidden)
        self.registered += found is not None
        return found

    def _in_better_light(self, luma: Luma, start: Array, hidden: Hidden) -> Registered | None:
        found = self.as_it_is.register(luma, start, hidden)
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
