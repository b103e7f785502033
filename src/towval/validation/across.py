"""A tether that lies across the object: the model draws it through, a real one bears on an edge or winds round."""

import numpy as np
import shapely

from towval.model import Body, Finding, Severity, SimulatedMotion, TowingScene
from towval.model.findings import finding
from towval.model.geometry import rotation

_CHORD_SHARE = 0.05
"""Chord of the straight tether over the top, as a share of the top's size, from which on it lies across: a hook that is
measured a centimetre inside the edge is no such thing, and a tether past a corner hardly bends there."""

_MOVED_M = 0.005
"""Way of the object under such a pull that counts: a quarter of the default tolerance."""

_AT_THE_EDGE_M = 5e-3
"""An anchor farther inside the top's outline than this is fastened on the top or under it, not to a side."""


def tether_across(scene: TowingScene, towed: Body, motion: SimulatedMotion) -> list[Finding]:
    """A finding where the taut tether of a simulated motion would pass through the object.

    The tether is a straight line from anchor to hinge in the model. Where the anchor is at a side of the object and
    below its top, and the line passes over the top's outline, a real tether bears on an edge: it pulls elsewhere, and
    in another direction. Nothing is said of an anchor at the top's height or above, or within its outline. An object
    that stands on several feet is open below, where the tether may pass: there it is a note.
    """
    top = np.asarray(towed.top_corners_m)
    around = shapely.Polygon(top)
    within = around.buffer(-_AT_THE_EDGE_M)
    if scene.anchor_height >= towed.tracked_plane_height_m or within.contains(shapely.Point(scene.anchor)):
        return []
    pull = np.hypot(*motion.tether_force.T)
    taut = np.flatnonzero(pull > 0)
    turn = rotation(motion.pose[taut, 2])
    direction = np.einsum("nji,nj->ni", turn, motion.tether_force[taut] / pull[taut, None])
    rise = scene.hinge_height - scene.anchor_height
    reach = np.sqrt(np.maximum(motion.tether_length[taut] ** 2 - rise**2, 0.0))
    # Most tethers lead away from the object all along, which costs nothing to see.
    back = np.flatnonzero(direction @ (top.mean(axis=0) - scene.anchor) > 0)
    ends = scene.anchor + reach[back, None] * direction[back]
    lines = shapely.linestrings(np.stack([np.broadcast_to(scene.anchor, ends.shape), ends], axis=1))
    chord = shapely.length(shapely.intersection(lines, around))
    size = float(np.linalg.norm(np.ptp(top, axis=0)))
    across = np.zeros(len(motion.time_s), dtype=bool)
    across[taut[back[chord > _CHORD_SHARE * size]]] = True
    if not across.any():
        return []
    steps = np.hypot(*np.diff(motion.pose[:, :2], axis=0).T)
    moved_m = float(steps[across[1:]].sum())
    if moved_m <= _MOVED_M:
        return []
    severity = Severity.NOTE if scene.patch.further else Severity.WARNING
    return [
        finding(
            "tether_across", severity, percent=100 * np.mean(across), first_s=motion.time_s[across][0],
            chord_mm=1000 * float(chord.max()), moved_mm=1000 * moved_m,
        )
    ]  # fmt: skip
