"""Faults for the controls of the ledger: from a function or constant to the wrong one that takes its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from studies.frame import Row
from studies.paper import further, law_shapes, meshes
from studies.paper.loop_checks import BREAKING_THRESHOLDS
from towval.model import Tether, TimedPath
from towval.model.geometry import polygon_centroid
from towval.planning.plan import tow
from towval.planning.planner import PlanOutcome


def given(**changed: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The same function, deaf to some of its arguments."""
    return lambda original: lambda *args, **kwargs: original(*args, **{**kwargs, **changed})


def jump_for_kink(_: Callable[..., Any]) -> Callable[..., Any]:
    """A law that jumps in place of one with a kink."""
    return lambda _slope, plateau: law_shapes.jumping(plateau)


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


def lost_on_lemniscate(original: Callable[..., Any]) -> Callable[..., Any]:
    """On the lemniscate the rover is stuck with the paper's breaking thresholds, and with no other."""
    lost = lost_unless("threshold", lambda threshold: threshold not in BREAKING_THRESHOLDS)(original)

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        width, height = np.ptp(motion.pose[:, :2], axis=0)
        flat = height < 0.5 * width  # of the four curves the lemniscate alone
        return (lost if flat else original)(scene, patch_, motion, **settings)

    return loop


def threshold_with_step(original: Callable[..., Any]) -> Callable[..., Any]:
    """The threshold falls with the cube root of the time step, from 0.4 m at 0.4 s."""

    def row(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Row:
        step = float(np.diff(motion.time_s[:2])[0])
        return original(scene, patch_, motion, **settings, threshold=0.4 * np.cbrt(step / 0.4))

    return row


def look_ahead_outside(steps: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Look-aheads other than 300 to 400 steps are all taken as another one."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(*args: Any, look_ahead_steps: int, **settings: Any) -> Any:
            within = 300 <= look_ahead_steps <= 400
            return original(*args, look_ahead_steps=look_ahead_steps if within else steps, **settings)

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


def tighter_by(factor: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The centres about which the rover can turn begin closer to it than they do."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def region(rover: Any) -> Any:
            found = original(rover)
            nearer = {name: getattr(found, name) / factor for name in ("offsets", "corners", "tips")}
            return found._replace(**nearer)

        return region

    return wrong


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


def hinge_elsewhere(ahead: float, left: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The planner takes the hinge to be elsewhere on the rover than it is [m]."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def drive(path: Any, start: Any, rover: Any, *args: Any) -> Any:
            hinge, *others = rover
            return original(path, start, (hinge + np.array([ahead, left]), *others), *args)

        return drive

    return wrong


def planner_reads(**settings: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The planner takes some of its settings to be other than they are; a callable gets them from what they are."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(nominal: Any, towed: Any, patch_: Any, tether: Any, rover: Any, planner: Any, **kwargs: Any) -> Any:
            read = {
                name: value(getattr(planner, name)) if callable(value) else value for name, value in settings.items()
            }
            return original(nominal, towed, patch_, tether, rover, replace(planner, **read), **kwargs)

        return loop

    return wrong


def tether_taken(stiffness: Callable[[float], float]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The dynamics take the tether to be of another stiffness than it is [N/m]."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def motion(towed: Any, patch_: Any, tether: Tether, *args: Any, **kwargs: Any) -> Any:
            return original(towed, patch_, replace(tether, stiffness=stiffness(tether.stiffness)), *args, **kwargs)

        return motion

    return wrong


def hinge_late(seconds: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The dynamics take the hinge to be where it was some time ago."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def motion(towed: Any, patch_: Any, tether: Any, hinge: TimedPath, *args: Any, **kwargs: Any) -> Any:
            earlier = [np.interp(hinge.time_s - seconds, hinge.time_s, along) for along in hinge.position.T]
            late = TimedPath(hinge.time_s, np.column_stack(earlier))
            return original(towed, patch_, tether, late, *args, **kwargs)

        return motion

    return wrong


def without_inertia(original: Callable[..., Any]) -> Callable[..., Any]:
    """The dynamics take the object to have a thousandth of its mass and inertia; its weight stays."""

    def motion(towed: Any, *args: Any, **kwargs: Any) -> Any:
        light = replace(towed, mass=1e-3 * towed.mass, inertia=1e-3 * towed.inertia)
        return original(light, *args, **kwargs)

    return motion


def first_patch_kept(original: Callable[..., Any]) -> Callable[..., Any]:
    """The dynamics keep the pressure and friction of their first call."""
    kept: list[Any] = []

    def motion(towed: Any, patch_: Any, *args: Any, **kwargs: Any) -> Any:
        kept.append(patch_)
        return original(towed, kept[0], *args, **kwargs)

    return motion


def without_peak(original: Callable[..., Any]) -> Callable[..., Any]:
    """The law is made without the rise of friction at rest."""
    return lambda asked: original(replace(asked, static=asked.kinetic))


def twice_the_friction_velocity(original: Callable[..., Any]) -> Callable[..., Any]:
    """The law is fitted to twice the friction velocity."""
    return lambda static, kinetic, v_s, v_k, *args: original(static, kinetic, v_s, 2 * v_k, *args)


def limits_forgotten(original: Callable[..., Any]) -> Callable[..., Any]:
    """The planner's centres are those of a rover without steering limits."""
    return lambda rover: original(further.without_limits(rover))


def hinge_on_the_object(original: Callable[..., Any]) -> Callable[..., Any]:
    """The plan leads the hinge along the object's own path, as if there were no tether between them."""

    def motion(*args: Any, **kwargs: Any) -> Any:
        found = original(*args, **kwargs)
        return replace(found, hinge=TimedPath(found.time_s, found.pose[:, :2]))

    return motion


def load_in_the_middle(original: Callable[..., Any]) -> Callable[..., Any]:
    """The pressure is that of an object with its centre of mass in the middle of its footprint."""

    def pressure(towed: Any, *args: Any) -> Any:
        return original(replace(towed, centre_of_mass=polygon_centroid(towed.patch.outline)), *args)

    return pressure


def in_line(original: Callable[..., Any]) -> Callable[..., Any]:
    """The steering angles leave out how far a wheel is from the middle line of the rover."""
    return lambda wheels, twist: original(np.asarray(wheels) * [1.0, 0.0], twist)


def without_direction(original: Callable[..., Any]) -> Callable[..., Any]:
    """The wrench leaves out by how much friction differs with the direction."""
    return lambda patch_, twists: original(patch_._replace(anisotropy=np.array([1.0, 0.0, 1.0])), twists)


def anchor_higher(original: Callable[..., Any]) -> Callable[..., Any]:
    """The equations in space have the anchor 0.1 m higher than it is, and the hinge with it."""

    def problem(towed: Any, sliding: Any, tether: Any, ground: Any, hinge_height: float, *args: Any) -> Any:
        raised = replace(towed, anchor_height=towed.anchor_height + 0.1)
        return original(raised, sliding, tether, ground, hinge_height + 0.1, *args)

    return problem


def friction_rises(original: Callable[..., Any]) -> Callable[..., Any]:
    """The equation of motion lets friction rise over 0.1 mm/s, whatever the law."""
    return lambda scene, law, speed: original(scene, lambda fast: law(fast) * np.minimum(1.0, fast / 1e-4), speed)
