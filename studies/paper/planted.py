"""Faults for the controls of the ledger: from a function or constant to the wrong one that takes its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from studies.frame import Row
from studies.paper import further, law_shapes, meshes
from studies.paper.loop_checks import BREAKING_THRESHOLDS
from towval.model import TimedPath
from towval.planning.plan import tow
from towval.planning.planner import PlanOutcome


def given(**changed: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The same function, deaf to some of its arguments."""
    return lambda original: lambda *args, **kwargs: original(*args, **{**kwargs, **changed})


def first_centre(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every object has its centre of mass at G1."""
    return lambda scene, curve, _: original(scene, curve, "G1")


def steep(_: Callable[..., Any]) -> Callable[..., Any]:
    """A law that rises over 1e-4 m/s in place of one that jumps."""
    return lambda plateau: law_shapes.kinked(plateau / 1e-4, plateau)


def jump_for_kink(_: Callable[..., Any]) -> Callable[..., Any]:
    """A law that jumps in place of one with a kink."""
    return lambda _slope, plateau: law_shapes.jumping(plateau)


def curve(names: Mapping[str, str]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The motion on another curve than asked for."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def on_other(scene: Any, patch_: Any, curve: str, *args: Any, **kwargs: Any) -> Any:
            return original(scene, patch_, names.get(curve, curve), *args, **kwargs)

        return on_other

    return wrong


def one_mesh(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every element size gives the coarsest mesh."""
    coarsest = meshes.SIDES_PER_ELEMENT_SIZE * max(meshes.PAPER_TABLE_1)
    return lambda footprint, loads, _: original(footprint, loads, coarsest)


def towed_as_planned(original: Callable[..., Any]) -> Callable[..., Any]:
    """The object is towed along the nominal path of the hinge, wherever the rover is."""

    def loop(motion: Any, towed: Any, patch_: Any, tether: Any, *args: Any, **settings: Any) -> Any:
        found = original(motion, towed, patch_, tether, *args, **settings)
        start = {"start_pose": motion.pose[0], "start_twist": motion.twist[0]}
        hinge = motion.hinge
        behind = tow(hinge.time_s, hinge.position, towed, patch_, tether, stride=settings["report_stride"], **start)
        return replace(found, towed=behind)

    return loop


def lost_unless(setting: str, good: Callable[[float], bool]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The rover arrives with good values of a setting of the planner; with others it is stuck, the object 1 m off."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(*args: Any, **settings: Any) -> Any:
            found = original(*args, **settings)
            if good(settings[setting]):
                return replace(found, rover=replace(found.rover, outcome=PlanOutcome.ARRIVED))
            return replace(found, rover=replace(found.rover, outcome=PlanOutcome.STUCK), object_rms=1.0)

        return loop

    return wrong


def hinge_elsewhere(original: Callable[..., Any]) -> Callable[..., Any]:
    """The planner takes the hinge to be 0.02 m ahead of where it is."""

    def drive(path: Any, start: Any, rover: Any, *args: Any) -> Any:
        hinge, *others = rover
        return original(path, start, (hinge + np.array([0.02, 0.0]), *others), *args)

    return drive


def lost_on_lemniscate(original: Callable[..., Any]) -> Callable[..., Any]:
    """On the lemniscate the rover is stuck with the paper's breaking thresholds, and with no other."""
    lost = lost_unless("threshold", lambda threshold: threshold not in BREAKING_THRESHOLDS)(original)

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        width, height = np.ptp(motion.pose[:, :2], axis=0)
        flat = height < 0.5 * width  # of the four curves the lemniscate alone
        return (lost if flat else original)(scene, patch_, motion, **settings)

    return loop


def aside(original: Callable[..., Any]) -> Callable[..., Any]:
    """The rover is given a path that is 0.3 m beside its own."""

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        beside = TimedPath(motion.time_s, motion.hinge.position + np.array([0.3, 0.0]))
        return original(scene, patch_, replace(motion, hinge=beside), **settings)

    return loop


def threshold_with_step(original: Callable[..., Any]) -> Callable[..., Any]:
    """The threshold falls with the cube root of the time step, from 0.4 m at 0.4 s."""

    def row(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Row:
        step = float(np.diff(motion.time_s[:2])[0])
        return original(scene, patch_, motion, **settings, threshold=0.4 * np.cbrt(step / 0.4))

    return row


def thresholds_times(factor: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The rover drives with other thresholds than stated."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *args, threshold, **settings: original(*args, threshold=factor * threshold, **settings)

    return wrong


def look_ahead_outside(steps: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Look-aheads other than 300 to 400 steps are all taken as another one."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(*args: Any, look_ahead_steps: int, **settings: Any) -> Any:
            within = 300 <= look_ahead_steps <= 400
            return original(*args, look_ahead_steps=look_ahead_steps if within else steps, **settings)

        return loop

    return wrong


def wheelbase(length: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The rover has another wheelbase."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(scene: Any, *args: Any, **settings: Any) -> Any:
            wheels = scene.rover.wheel_positions
            longer = replace(scene.rover, wheel_positions=wheels * [length / np.ptp(wheels[:, 0]), 1.0])
            return original(replace(scene, rover=longer), *args, **settings)

        return loop

    return wrong


def with_peak(original: Callable[..., Any]) -> Callable[..., Any]:
    """Friction has its peak at rest."""
    return lambda scene: original(replace(scene, friction=scene.peaked_friction))


def too_strong(original: Callable[..., Any]) -> Callable[..., Any]:
    """The tow force is 2 % above what friction takes."""

    def motion(towed: Any, patch_: Any, force: TimedPath, *args: Any, **kwargs: Any) -> Any:
        return original(towed, patch_, TimedPath(force.time_s, 1.02 * force.position), *args, **kwargs)

    return motion


def stronger_by_the_step(original: Callable[..., Any]) -> Callable[..., Any]:
    """The tow force errs in proportion to the time step: by 2 % at half a second."""

    def motion(towed: Any, patch_: Any, force: TimedPath, *args: Any, **kwargs: Any) -> Any:
        share = 0.04 * float(np.diff(force.time_s).min())
        return original(towed, patch_, TimedPath(force.time_s, (1 + share) * force.position), *args, **kwargs)

    return motion


def hinge_on_the_object(original: Callable[..., Any]) -> Callable[..., Any]:
    """The rover is led along the object's own path, as if there were no tether between them."""

    def motion(*args: Any, **kwargs: Any) -> Any:
        found = original(*args, **kwargs)
        return replace(found, hinge=TimedPath(found.time_s, found.pose[:, :2]))

    return motion


def without_tether_of_its_own(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every tether has the stiffness of the plan."""
    return lambda scene, patch_, motion, **kwargs: original(scene, patch_, motion, **{**kwargs, "tether": None})


def hundred_times_stiffer(original: Callable[..., Any]) -> Callable[..., Any]:
    """The tether is a hundred times as stiff."""

    def motion(scene: Any, patch_: Any, planned: Any, **kwargs: Any) -> Any:
        tether = replace(scene.tether, stiffness=100 * scene.tether.stiffness)
        return original(scene, patch_, planned, **{**kwargs, "tether": tether})

    return motion


def stiffness_not_heeded(original: Callable[..., Any]) -> Callable[..., Any]:
    """A tether keeps the stiffness that it has, whatever is asked for."""
    return lambda tether, stiffness: original(tether)


def tighter_by(factor: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The centres about which the rover can turn begin closer to it than they do."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def region(rover: Any) -> Any:
            found = original(rover)
            nearer = {name: getattr(found, name) / factor for name in ("offsets", "corners", "tips")}
            return found._replace(**nearer)

        return region

    return wrong


def wide_turn(original: Callable[..., Any]) -> Callable[..., Any]:
    """The turn is a hundred times as wide."""
    return lambda rover: original(rover)._replace(tips=100 * original(rover).tips)


def narrow_steering(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every wheel steers by as little to one side as to the other."""

    def pieces(rover: Any, extent: float) -> Any:
        least = np.abs(rover.steering_ranges).min()
        return original(replace(rover, steering_ranges=np.tile([-least, least], (4, 1))), extent)

    return pieces


def either_flank(original: Callable[..., Any]) -> Callable[..., Any]:
    """Both flanks are taken for one."""

    def piece(rover: Any, _: Any) -> Any:
        flanks = [original(rover, (side,) * 4) for side in (1, -1)]
        return SimpleNamespace(contains=lambda points: flanks[0].contains(points) | flanks[1].contains(points))

    return piece


def twice_the_friction_velocity(original: Callable[..., Any]) -> Callable[..., Any]:
    """The law is made for twice the friction velocity."""
    return lambda asked: original(replace(asked, friction_velocity=2 * asked.friction_velocity))


def high_tow(original: Mapping[str, Any]) -> Mapping[str, Any]:
    """Anchor and hinge are 0.1 m above the floor."""
    return {**original, "plane": lambda scene, **_: further.plane_rows(scene, heights=0.1)}
