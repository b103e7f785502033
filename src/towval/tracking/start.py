"""Where bodies are in the first picture: found by outlines and what moves."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body, Calibration, TowingScene
from towval.model.errors import InputError
from towval.model.geometry import compose, transform
from towval.tracking.co_moving import co_moving, moving_along
from towval.tracking.middle import about_middle, middle_of, pose_of, registration_of
from towval.tracking.outline import settled
from towval.tracking.outline_search import OutlineSearch, alike, symmetry_of
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.rectified import View
from towval.tracking.relocalisation import visible_part
from towval.tracking.template import Luma


@dataclass(frozen=True)
class StartConstants:
    """Tuned constants of the start; lengths in pixels are measured on the planar target."""

    most_followed: int = 4  # Places, a top apart, that are looked for in other pictures,
    most_near: int = 6  # and as many around each of them that are compared there.
    clear_followed: float = 0.57  # As ``clear``, where the limit of what moves counts: tops 0.60 to 0.7, others 0.56.
    clear: float = 0.65  # Score of an outline that stands on edges: tops reach 0.83 to 0.98, other places 0.4 to 0.83.
    as_good: float = 0.95  # Of the best score: another place fits as well.
    differs: float = 5.0  # Of the usual difference of two pictures: a change that noise does not make,
    least_difference: float = 6.0  # [grey levels] as much, where a video holds no noise.
    capture_px: float = 45.0  # [px] Around the clicks, in which the outline is searched,
    capture_turn: float = np.deg2rad(15.0)  # [rad] and as far turned: one of four corners clicked 40 px off.
    near_px: float = 2.0  # [px] Clicks as good as that are only refined.
    size_deviations: float = 4.0  # Of the size of clicked corners: by chance once in 16,000 tops,
    size_px: float = 1.5  # [px] and so far outwards: who clicks beside an edge does so by one.
    reported_px: float = 6.0  # [px] More than 0.7 px of noise can explain.
    scales_apart: float = 3.5  # Deviations between the sizes of two clicked tops, or of a side: 1 in 2,000 sound runs.
    jerks: float = 0.02  # Of the pictures, in which the tether may seem too short: a jerk, a picture that is off.
    slack: float = 0.02  # Of a tether's length, and
    slack_m: float = 0.015  # [m] as much that measured ends may be too far apart.
    pull_m_per_s2: float = 9.81  # [m/s²] Of the tether over the object's mass, at most: its weight.
    most_covered: float = 0.3  # Of a top over another body.
    went: float = 0.3  # Of a body's reach: a displacement that shows its sense of motion,
    forwards: float = 0.5  # within 60° of the direction of the pull.


CONSTANTS = StartConstants()

_COLOURS = ((60, 60, 230), (230, 160, 40))


@dataclass(frozen=True)
class Tow:
    """The ends of the tether: ``hinge`` (2,) in the rover's frame, ``anchor`` (2,) in the object's [m].

    ``longest_m`` is how far apart they can be on the floor, stretch included [m].
    """

    hinge: Array
    anchor: Array
    longest_m: float

    @classmethod
    def of(cls, scene: TowingScene) -> "Tow":
        """The tether of a scene, stretched by the object's weight: friction holds less, a jerk pulls more than that.

        Between two heights it reaches less far over the floor.
        """
        stretch = scene.mass * CONSTANTS.pull_m_per_s2 / scene.tether.stiffness
        length = scene.tether.rest_length * (1 + CONSTANTS.slack) + stretch + CONSTANTS.slack_m
        rise = scene.hinge_height - scene.anchor_height
        return cls(scene.hinge, scene.anchor, float(np.sqrt(max(length**2 - rise**2, 0.0))))

    def about_middles(self, rover: Body, towed: Body) -> "Tow":
        """The same ends in frames at the middles of the tops of ``rover`` and ``towed``."""
        return replace(self, hinge=self.hinge - middle_of(rover), anchor=self.anchor - middle_of(towed))

    def span_m(self, rover: Array, towed: Array) -> Array:
        """Distance (...) of the tether's ends on the floor for poses (..., 3) [m]."""
        return np.asarray(np.linalg.norm(transform(rover, self.hinge) - transform(towed, self.anchor), axis=-1))


@dataclass(frozen=True)
class Start:
    """Where a body is in the first picture.

    ``pose`` (3,) [m, m, rad]; ``corners_px`` (n, 2) of its top, to be given to ``track`` as clicks; ``score``, from 0
    to 1, how far its outline stands on edges; ``spread`` (3, 3) of the pose over places nearby that are as good;
    ``doubt`` why the pose is not certain, empty where it is.
    """

    pose: Array
    corners_px: Array
    score: float
    spread: Array
    doubt: str = ""


def targets_in_view(bodies: Sequence[Body], calibration: Calibration) -> list[PlanarTarget]:
    """Targets in frames at the middles of the tops of bodies.

    Raises `InputError`, with the key of campaign.yaml, for a plane that is not below the camera and a top that reaches
    farther than the picture shows of its plane. A search for such a top would look at any number of places.
    """
    for target in (PlanarTarget(body, calibration.camera, calibration.floor) for body in bodies):
        name, camera_m = target.body.name, float(target.floor.camera_position_m[2])
        if target.height >= camera_m:
            raise InputError(
                f"{name}.tracked_plane_height_m is not below the camera",
                got=f"{target.height:g} m, where the calibration puts the camera {camera_m:.2f} m above the floor",
                allowed=f"below {camera_m:.2f} m",
                remedy="give the height in metres; check camera.board.square_m, in metres, on which the camera's rests",
            )
        seen_m = float(np.linalg.norm(np.subtract(*visible_part(target)[::-1])))
        if target.reach_m > seen_m:
            raise InputError(
                f"{name}.top_corners_m reaches farther than the camera sees",
                got=f"a corner {target.reach_m:.3g} m from the origin of the body's frame",
                allowed=f"at most {seen_m:.2f} m, the diagonal of what the picture shows at the height of the top",
                remedy="give the corners in metres, in a frame whose origin is on the body",
            )
    return [PlanarTarget(about_middle(body), calibration.camera, calibration.floor) for body in bodies]


def find_starts(
    pictures: Sequence[Luma], calibration: Calibration, bodies: Sequence[Body], tow: Tow | None = None
) -> dict[str, Start]:
    """Find the tops of bodies in the first picture, without clicks; a start with a ``doubt`` is the best guess.

    Outlines of known size are searched on their known planes at all headings; of places that fit, those count where
    something moved, that do not overlap, and that the tether joins. Which way round a symmetric outline lies is settled
    by the tether, else by the sense of motion: the hinge trails the rover, the anchor leads the object.

    ``pictures`` are the first, then others spread over the video (none: what moves is not known); with ``tow``,
    ``bodies`` are rover and object, in this order. Raises `InputError` as :func:`targets_in_view`.
    """
    targets = targets_in_view(bodies, calibration)
    tow = tow and tow.about_middles(*bodies)
    found = _candidates(targets, pictures)
    choice, doubts = _together(targets, found, tow)
    poses, turn_doubt = _turned(targets, choice, tow)
    starts = {}
    for body, target, place, pose, doubt in zip(bodies, targets, choice, poses, doubts, strict=True):
        placed, spread = settled(target, place.views, pose)
        corners, spread = target.pixels(target.body.top_corners_m, placed), registration_of(body, spread)
        starts[body.name] = Start(pose_of(body, placed), corners, place.score, spread, doubt or turn_doubt)
    return starts


def starts_drawn(luma: Luma, starts: Mapping[str, Start]) -> NDArray[np.uint8]:
    """The first picture (height, width, 3; blue, green, red) with the tops at their starts, corners numbered."""
    picture = np.asarray(cv2.cvtColor(luma, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    for (name, start), colour in zip(starts.items(), itertools.cycle(_COLOURS)):
        corners = np.round(start.corners_px).astype(np.int32)
        cv2.polylines(picture, [corners], True, colour, 2, cv2.LINE_AA)
        for label, (u, v) in [(name, corners.mean(axis=0)), *((str(i + 1), each) for i, each in enumerate(corners))]:
            cv2.putText(picture, label, (int(u), int(v)), cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, 2)
    return picture


@dataclass(frozen=True)
class Place:
    """Where a body may be: ``score`` of its outline at ``pose`` (3,) and the ``views`` in which it was read."""

    score: float
    pose: Array
    views: tuple[View, ...]

    @property
    def least(self) -> float:
        """The score of an outline that stands on edges."""
        return CONSTANTS.clear if len(self.views) == 1 else CONSTANTS.clear_followed

    @property
    def clear(self) -> bool:
        """Whether the outline clearly stands on edges."""
        return self.score >= self.least


def _moved(pictures: Sequence[Luma]) -> NDArray[np.bool_] | None:
    """Where (height, width) the first picture differs from half of the others; None without others."""
    if len(pictures) < 2:
        return None
    first = cv2.GaussianBlur(pictures[0], (0, 0), 2.0)
    counts = np.zeros(first.shape, np.uint8)
    for other in pictures[1:]:
        difference = cv2.absdiff(first, np.asarray(cv2.GaussianBlur(other, (0, 0), 2.0)))
        limit = max(CONSTANTS.differs * float(np.median(difference)), CONSTANTS.least_difference)
        counts += difference > limit
    return np.asarray(2 * counts >= len(pictures) - 1)


def _candidates(targets: Sequence[PlanarTarget], pictures: Sequence[Luma]) -> list[list[Place]]:
    """Places whose outline stands on edges and where something moved: for each target the best first.

    What is clearly one body is left out of what moved for the others, which are searched again.
    """
    found: list[list[Place]] = [[] for _ in targets]
    clear: list[int] = []
    moved = _moved(pictures)
    for i in (*range(len(targets)), *range(len(targets) - 1)):
        if i in clear:
            continue
        rest = None if moved is None else moved.astype(np.uint8)
        if rest is not None:
            for j in clear:
                corners = targets[j].pixels(targets[j].body.top_corners_m, found[j][0].pose)
                cv2.fillPoly(rest, [np.round(corners).astype(np.int32)], 0)
        view = (pictures[0], np.zeros(3))
        search = OutlineSearch(targets[i], [view], *visible_part(targets[i]), None if rest is None else rest > 0)
        found[i] = _followed(targets[i], [Place(*one, (view,)) for one in search.found()], pictures)
        if found[i] and found[i][0].clear:
            clear.append(i)
    return found


def _followed(target: PlanarTarget, places: Sequence[Place], pictures: Sequence[Luma]) -> list[Place]:
    """Places searched again in all pictures to which what is there has moved; those where nothing has, if nothing did.

    A line of the floor beside a body looks like its edge in one picture; it does not go with the body to the next.
    """
    followed: list[Place] = []
    heads: list[Place] = []
    for place in places:
        if any(np.linalg.norm(place.pose[:2] - known.pose[:2]) < target.reach_m for known in heads):
            continue
        settled = any(one.clear for one in followed) and place.score < CONSTANTS.as_good * heads[0].score
        if settled or len(heads) == CONSTANTS.most_followed:
            break
        heads.append(place)
        search = around(target, place.pose, co_moving(target, place.pose, pictures))
        if len(search.views) > 1:
            near = search.found(place.pose[2], CONSTANTS.capture_turn, CONSTANTS.most_near)
            followed += [Place(score, pose, tuple(search.views)) for score, pose in near]
    return sorted(followed, key=lambda place: -place.score) or list(places)


def around(target: PlanarTarget, pose: Array, views: Sequence[View]) -> OutlineSearch:
    """A search of the capture range around a pose (3,) in views among which the body moved, or in one picture."""
    reach = CONSTANTS.capture_px * target.metres_per_pixel(pose)
    low, high = pose[:2] - reach, pose[:2] + reach
    beyond = 1.5 * target.reach_m
    going = moving_along(target, views, low - beyond, high + beyond) if len(views) > 1 else None
    return OutlineSearch(target, views, low, high, moving_along=going)


def _together(
    targets: Sequence[PlanarTarget], found: Sequence[list[Place]], tow: Tow | None
) -> tuple[tuple[Place, ...], list[str]]:
    """The places that fit best together, and for each body why it is not certain."""
    ranked = []
    for trial in itertools.product(*found):
        covered = any(
            target.covered_by(place.pose, transform(other.pose, beside.body.top_corners_m)) > CONSTANTS.most_covered
            for (target, place), (beside, other) in itertools.permutations(zip(targets, trial, strict=True), 2)
        )
        joined = tow is None or any(True for _ in joined_orientations(targets, [place.pose for place in trial], tow))
        if not covered:
            ranked.append((joined, sum(log(max(place.score, 1e-9)) for place in trial), trial))
    if not ranked:
        absent = [target.body.name for target, places in zip(targets, found, strict=True) if not places]
        names = " and ".join(absent or [target.body.name for target in targets])
        raise InputError(
            f"where {names} starts is not found",
            remedy="click their corners (first_frame_clicks_px), or start with both bodies in view, neither at rest "
            "for most of the run: they are looked for among what moves",
        )
    ranked.sort(key=lambda entry: (-entry[0], -entry[1]))
    joined, best, choice = ranked[0]
    rivals = [trial for other, score, trial in ranked[1:] if other == joined and score > best + log(CONSTANTS.as_good)]
    doubts = []
    for i, place in enumerate(choice):
        if not place.clear:
            doubts.append(f"no outline of its size stands out (score {place.score:.2f}, {place.least} needed)")
        elif any(trial[i] is not place for trial in rivals):
            doubts.append("its outline fits in more than one place")
        elif not joined:
            doubts.append("the tether does not reach from the rover to the object")
        else:
            doubts.append("")
    return choice, doubts


def joined_orientations(targets: Sequence[PlanarTarget], poses: Sequence[Array], tow: Tow) -> Iterator[list[Array]]:
    """Poses of symmetric outlines, turned onto themselves, at which the tether is long enough."""
    turned = (alike(target.body.top_corners_m, pose) for target, pose in zip(targets, poses, strict=True))
    for trial in itertools.product(*turned):
        if tow.span_m(*trial[:2]) <= tow.longest_m:
            yield list(trial)


def _turned(targets: Sequence[PlanarTarget], choice: Sequence[Place], tow: Tow | None) -> tuple[list[Array], str]:
    """The poses the right way round, and why that is not certain."""
    poses = [place.pose for place in choice]
    if all(symmetry_of(target.body.top_corners_m)[0] == 1 for target in targets):
        return poses, ""
    if tow is None:
        return poses, "a symmetric outline does not show which way round it lies"
    joined = list(joined_orientations(targets, poses, tow))
    if len(joined) == 1:
        return joined[0], ""
    if not joined:
        return poses, "the tether does not reach from the rover to the object"
    ahead = np.array([-tow.hinge, tow.anchor])
    steps = [_displacement(target, place) for target, place in zip(targets, choice, strict=True)]
    forwards = []
    for trial in joined:
        cosines = [_forwards(pose, own, step) for pose, own, step in zip(trial, ahead, steps, strict=True)]
        if min(cosines) > CONSTANTS.forwards:
            forwards.append(trial)
    if len(forwards) == 1:
        return forwards[0], ""
    nearest = min(forwards or joined, key=lambda trial: float(tow.span_m(*trial)))
    return nearest, "neither the tether nor the sense of motion shows which way round it lies"


def _forwards(pose: Array, own: Array, step: Array | None) -> float:
    """Cosine of the angle from a direction (2,) in the body's frame to a step (2,) on the floor; one where unknown."""
    if step is None:
        return 1.0
    ahead = transform(np.array([0.0, 0.0, pose[2]]), own)
    return float(ahead @ step / (np.linalg.norm(ahead) * np.linalg.norm(step)))


def _displacement(target: PlanarTarget, place: Place) -> Array | None:
    """Where (2,) a body goes first [m]: to the first of the other pictures in which it is found farther on."""
    steps = (compose(step, place.pose)[:2] - place.pose[:2] for _, step in place.views)
    return next((step for step in steps if np.linalg.norm(step) > CONSTANTS.went * target.reach_m), None)
