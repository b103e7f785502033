"""Faults put into a run on purpose: the smallest of each kind that its uncertainty leaves visible.

A fault is put into the scene and simulated; the shift of the path that it makes is added to the draws of a right
model's error, and its size is changed until nine in ten of them are rejected.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array, FloorRegion, MassSpread, SimulatedMotion, TowingScene
from towval.model.geometry import path_length, transform, wrapped
from towval.model.statement import VisibleFault
from towval.physics.mass import spread_over
from towval.validation.path_frame import PathFrame
from towval.validation.simulate_many import Batch, Drawn
from towval.validation.statistics import RightModel

POWER = 0.9
"""Share of the draws in which a visible fault is seen."""

STRIPE_M = 0.3
"""Length along the path of the floor on which the stripe's friction is another."""

_STRIPE_WIDTH_M = 2.0
_TIMES, _DRAWS = 200, 256  # of a run that the search uses: the size is then known to two digits
_ROUNDS, _HALVINGS, _GROWTH = 4, 12, 4.0


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault: how a size [unit] acts on a scene, where the search starts and where it ends."""

    name: str
    unit: str
    acts: Callable[[TowingScene, float], TowingScene]
    first: float
    most: float


def fault_kinds(motion: SimulatedMotion) -> tuple[FaultKind, ...]:
    """The kinds that are tried; the stripe lies half-way along a simulated motion."""
    return (
        FaultKind("rest length", "m", _longer, 0.01, 0.3),
        FaultKind("centre of mass, sideways", "m", _mass_moved, 0.01, 0.2),
        FaultKind(f"friction over {STRIPE_M:g} m of floor", "", _stripe(motion), 0.2, 3.0),
        FaultKind("tow height", "m", _raised, 0.1, 0.5),
    )


def _longer(scene: TowingScene, size: float) -> TowingScene:
    return replace(scene, tether=replace(scene.tether, rest_length=scene.tether.rest_length + size))


def _raised(scene: TowingScene, size: float) -> TowingScene:
    return replace(scene, hinge_height=scene.hinge_height + size, anchor_height=scene.anchor_height + size)


def _mass_moved(scene: TowingScene, size: float) -> TowingScene:
    """Moves the common centre of mass to the object's left."""
    spread = scene.spread or spread_over(scene.patch)
    shift = np.array([0.0, size * scene.mass / scene.body_mass])
    return replace(scene, spread=MassSpread(spread.centre + shift, spread.gyration))


def _stripe(motion: SimulatedMotion) -> Callable[[TowingScene, float], TowingScene]:
    length = np.array([path_length(motion.pose[: i + 1, :2]) for i in range(len(motion.pose))])
    middle = int(np.searchsorted(length, length[-1] / 2))
    ahead = motion.pose[min(len(length) - 1, int(np.searchsorted(length, length[middle] + 0.02))), :2]
    way = ahead - motion.pose[middle, :2]
    direction = float(np.arctan2(way[1], way[0]))

    def acts(scene: TowingScene, size: float) -> TowingScene:
        place = np.array([*motion.pose[middle, :2], direction])
        corners = transform(motion.pose[middle], scene.patch.corners)
        front = float(((corners - place[:2]) @ [np.cos(direction), np.sin(direction)]).max())
        half = 0.5 * _STRIPE_WIDTH_M
        ring = np.array([[front, -half], [front + STRIPE_M, -half], [front + STRIPE_M, half], [front, half]])
        region = FloorRegion(transform(place, ring), 1 + size)
        return replace(scene, ground=replace(scene.ground, regions=(*scene.ground.regions, region)))

    return acts


def visible_faults(
    scene: TowingScene,
    batch: Batch,
    rover: Array,
    motion: SimulatedMotion,
    draws: Array,
    inputs: Array,
    confidence: float,
    frame: PathFrame,
) -> tuple[VisibleFault, ...]:
    """The smallest fault of each kind that shows in :data:`POWER` of the draws.

    Parameters
    ----------
    batch : Batch
        How the run is simulated.
    rover : ndarray (m, 6)
        Its nominal poses and rates at the batch's times.
    motion : SimulatedMotion
        The nominal motion.
    draws : ndarray (k, n, 3)
        Of a right model's error at the times at which the object was seen, along and across the path.
    inputs : ndarray (k, d)
        That they come from.
    confidence : float
        Of the test of a right model.
    """
    times = slice(None, None, max(1, draws.shape[1] // _TIMES))
    # The test at these times: means over fewer times are others where the object sticks and slips.
    right = RightModel.of(draws[:, times], inputs, confidence)
    kept = draws[:: max(1, len(draws) // _DRAWS), times]

    def shifts(scenes: list[TowingScene]) -> list[Array]:
        start = motion.pose[0]
        nominal, *others = batch.simulate([Drawn(each, rover, start) for each in (scene, *scenes)])
        differences = (np.column_stack([o[:, :2] - nominal[:, :2], wrapped(o[:, 2] - nominal[:, 2])]) for o in others)
        return [frame.along_across(each)[frame.seen] for each in differences]

    def factor(shift: Array) -> float:
        """By how much a fault has to grow to be seen."""
        thin = shift[times]
        low, high = 0.0, _GROWTH
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if right.rejects(middle * thin - kept).mean() >= POWER else (middle, high)
        return high

    kinds = fault_kinds(motion)
    sizes = [kind.first for kind in kinds]
    found = [VisibleFault(kind.name, np.nan, kind.unit, np.nan, np.nan, kind.most) for kind in kinds]
    for _ in range(_ROUNDS):
        moved = shifts([kind.acts(scene, size) for kind, size in zip(kinds, sizes, strict=True)])
        for i, (kind, shift) in enumerate(zip(kinds, moved, strict=True)):
            if not np.isfinite(shift).all():  # it tips, or the simulation ends early
                sizes[i] *= 0.5
                continue
            grown = factor(shift)
            distance = grown * np.linalg.norm(shift[:, :2], axis=1)
            reached = grown * sizes[i] <= kind.most and grown < 0.999 * _GROWTH
            size, rms, largest = grown * sizes[i], float(np.sqrt(np.mean(distance**2))), float(distance.max())
            numbers = (size, kind.unit, rms, largest) if reached else (np.nan, kind.unit, np.nan, np.nan)
            found[i] = VisibleFault(kind.name, *numbers, kind.most)
            sizes[i] = min(size, kind.most)
    return tuple(found)
