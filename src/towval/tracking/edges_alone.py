"""A body whose texture is there but does not hold its place: faint, or taken away by a codec. Its edges hold it.

An alignment with hardly any texture agrees with the picture all along the way, and never settles. The long edges of
the top are as sharp as before. So where the tracker finds nothing near the predicted place, the outline is fitted
there, and taken where the top's texture lies inside it: edges of something that hides the body hold something else.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from towval.model import Array, Finding
from towval.model.findings import finding
from towval.model.geometry import compose, inverse, turned_covariance
from towval.tracking.alignment import CONSTANTS as ALIGNMENT
from towval.tracking.alignment import correlation_of_tiles
from towval.tracking.outline import CONSTANTS as OUTLINE
from towval.tracking.outline import OutlineFit, combine_fits, observe_outline
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import CONSTANTS as TRACKER
from towval.tracking.pose import Measurement, step_between
from towval.tracking.template import Luma, Template
from towval.tracking.two_measurements import by_size, edges


@dataclass(frozen=True)
class EdgesAloneConstants:
    """Tuned constants of following by edges alone; lengths in pixels are measured on the planar target."""

    most_std_px: float = 0.3  # [px] Deviation of a place, and over that of the fits where the texture held:
    as_sure: float = 3.0  # other edges are taken for some of the top's where fits are less sure.
    faint: float = 15.0  # [grey levels] Deviation of a template: what has more is found by it, or else hidden.
    changed: float = 45.0  # [grey levels] Of a tile: codecs and light made up to 35 of bare tops, glints from 53 on.


CONSTANTS = EdgesAloneConstants()


@dataclass(frozen=True)
class ByEdges(Measurement):
    """A pose that the edges tell; the texture tells no more than that the body is there.

    ``to_outline`` (3,): from it to where the outline was found, by which a place of edges is taken for one of texture.
    """

    to_outline: Array = field(default_factory=lambda: np.zeros(3))


class EdgesAlone:
    """Finds one body by its outline where its texture, the ``template``, does not hold its place.

    ``pictures``: numbers of those in which it was found so, with what led ``to_outline`` (3,) there.
    """

    def __init__(self, target: PlanarTarget, template: Template | None):
        self.target, self.template = target, template
        self.pictures: list[int] = []
        self.to_outline: list[Array] = []

    def keep(self, number: int, found: ByEdges) -> None:
        """Take in what counts as an observation of a picture."""
        self.pictures.append(number)
        self.to_outline.append(found.to_outline)

    def measure(self, luma: Luma, predicted: Array, registered: Sequence[OutlineFit], sizes: Array) -> ByEdges | None:
        """The pose (3,) by the edges near a ``predicted`` one, or None where they are not sure or not the top's.

        ``registered``: fits of the outline at the texture's poses, by which a place of the one becomes one of the
        other; ``sizes`` (m, 2): by how much the outline was found longer and wider than stated so far [m].
        """
        if self.template is None or np.std(self.template.values) > CONSTANTS.faint:
            return None
        if not registered or not len(sizes):
            return None
        pixel_m, to_outline = self.target.metres_per_pixel(predicted), combine_fits(registered).correction
        usual_m = float(np.median([each.largest_std_m for each in registered]))
        most_m = min(CONSTANTS.most_std_px * pixel_m, CONSTANTS.as_sure * usual_m)
        off, expected = OUTLINE.beside_px * pixel_m, compose(predicted, to_outline)
        for turn in (0.0, off / self.target.reach_m, -off / self.target.reach_m):
            steps = itertools.product((0.0, off, -off), (0.0, off, -off), (turn,))
            places = [compose(expected, np.array(step)) for step in steps]
            begun = [(place, observe_outline(luma, self.target, place, wide=True)) for place in places]
            sure = [(place, fit) for place, fit in begun if fit is not None and fit.largest_std_m < most_m]
            if not sure:
                continue
            place, fit = min(sure, key=lambda each: each[1].largest_std_m)
            end = compose(place, fit.correction)
            if self.target.apart_m(end, expected) > off:
                # The right place is as sure from where it is; edges of something else often are not.
                again = observe_outline(luma, self.target, end, wide=True)
                if again is None or again.largest_std_m >= most_m:
                    return None
                end, fit = compose(end, again.correction), again
            pose = compose(end, step_between(to_outline, np.zeros(3)))
            if not self._shows(self.template, luma, pose, all_sides=fit.all_sides):
                return None
            covariance = fit.covariance + edges(self.target, pose) + by_size(fit.size - np.median(sizes, axis=0))
            return ByEdges(pose, turned_covariance(covariance, pose[2]), inlier_fraction=0.0, to_outline=to_outline)
        return None

    def steps(self, registration: OutlineFit | None) -> Array:
        """Steps (k, 3) of these poses that lead to the outline once the ``registration`` is applied."""
        steps = np.array(self.to_outline).reshape(-1, 3)
        return steps if registration is None else compose(steps, inverse(registration.correction))

    def findings(self, frames: int) -> list[Finding]:
        """What is reported where pictures of so many ``frames`` were measured so."""
        name, count = self.target.body.name, len(self.pictures)
        return [finding("edges_alone", name=name, count=count, frames=frames)] if count else []

    def _shows(self, template: Template, luma: Luma, pose: Array, *, all_sides: bool) -> bool:
        """Whether a picture shows the template at a ``pose`` (3,): all as bright, and enough of its texture.

        Where edges were not found on ``all_sides``, nothing confirms the one opposite. Then what the template leaves of
        the picture has to scatter less than the template does: a strip of floor beside the top scatters more.
        """
        values = self.target.grey_values(luma, template.points, pose)
        known = values >= 0
        count = np.bincount(template.tile[known], minlength=template.tiles)
        left_over = (values - template.values)[known]
        change = np.bincount(template.tile[known], left_over, template.tiles)
        if (np.abs(change) > CONSTANTS.changed * np.maximum(count, 1)).any():
            return False
        share = template.tile_share if template.is_concentrated else np.ones(template.tiles)
        limits = ALIGNMENT.least_of_tile, ALIGNMENT.visible_tiles
        correlation = correlation_of_tiles(values, template.values, template.tile, share, *limits)
        if correlation < TRACKER.least_correlation:
            return False
        # A shadow is not left over, as in the alignment: each tile has its light.
        left_over -= (change / np.maximum(count, 1))[template.tile[known]]
        return all_sides or bool(np.std(left_over) < np.std(template.values[known]))
