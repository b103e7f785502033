"""Where bodies are in the first picture: found by outlines and what moves, or clicked and checked against these."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Body, Calibration, Finding, TowingScene, Track
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import compose, transform, wrapped
from towval.tracking.outline import observe_outline, pose_from_clicks
from towval.tracking.outline_search import OutlineSearch, alike
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.relocalisation import visible_part
from towval.tracking.template import Luma


@dataclass(frozen=True)
class StartConstants:
    """Tuned constants of the start; lengths in pixels are measured on the planar target."""

    clear: float = 0.65  # Score of an outline that stands on edges: tops reach 0.83 to 0.98, other places 0.4 to 0.83.
    as_good: float = 0.95  # Of the best score: another place fits as well.
    differs: float = 5.0  # Of the usual difference of two pictures: a change that noise does not make,
    least_difference: float = 6.0  # [grey levels] as much, where a video holds no noise.
    capture_px: float = 45.0  # [px] Around the clicks, in which the outline is searched,
    capture_turn: float = np.deg2rad(15.0)  # [rad] and as far turned: one of four corners clicked 40 px off.
    near_px: float = 2.0  # [px] Clicks as good as that are only refined.
    reported_px: float = 6.0  # [px] More than 0.7 px of noise can explain.
    jerks: float = 0.02  # Of the pictures, in which the tether may seem too short: a jerk, a picture that is off.
    slack: float = 0.02  # Of a tether's length, and
    slack_m: float = 0.015  # [m] as much that measured ends may be too far apart.
    pull_m_per_s2: float = 9.81  # [m/s²] Of the tether over the object's mass, at most: its weight.
    most_covered: float = 0.3  # Of a top over another body.
    went: float = 0.3  # Of a body's reach: a displacement that tells its sense of motion,
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
        """The tether of a scene, stretched by the object's weight: friction holds less, a jerk pulls more than that."""
        stretch = scene.mass * CONSTANTS.pull_m_per_s2 / scene.tether.stiffness
        length = scene.tether.rest_length * (1 + CONSTANTS.slack) + stretch + CONSTANTS.slack_m
        return cls(scene.hinge, scene.anchor, float(length))

    def span_m(self, rover: Array, towed: Array) -> Array:
        """Distance (...) of the tether's ends on the floor for poses (..., 3) [m]."""
        return np.asarray(np.linalg.norm(_point(rover, self.hinge) - _point(towed, self.anchor), axis=-1))


def _point(pose: Array, own: Array) -> Array:
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    point: Array = pose[..., :2] + np.stack([c * own[0] - s * own[1], s * own[0] + c * own[1]], axis=-1)
    return point


@dataclass(frozen=True)
class Start:
    """Where a body is in the first picture.

    ``pose`` (3,) [m, m, rad]; ``corners_px`` (n, 2) of its top, to be given to ``track`` as clicks; ``score``, from 0
    to 1, how far its outline stands on edges; ``doubt`` why the pose is not certain, empty where it is.
    """

    pose: Array
    corners_px: Array
    score: float
    doubt: str = ""


def find_starts(
    pictures: Sequence[Luma], calibration: Calibration, bodies: Sequence[Body], tow: Tow | None = None
) -> dict[str, Start]:
    """Find the tops of bodies in the first picture, without clicks.

    Outlines of known size are searched on their known planes at all headings; of places that fit, those count where
    something moved, that do not overlap, and that the tether joins. Which way round a symmetric outline lies is settled
    by the tether, else by the sense of motion: the hinge trails the rover, the anchor leads the object.

    Parameters
    ----------
    pictures : sequence of ndarray (height, width) uint8
        The first picture, then others spread over the video (none: what moves is not known).
    bodies : sequence of Body
        What to find; with ``tow`` rover and object, in this order.
    tow : Tow, optional
        The tether's ends.

    Returns
    -------
    dict of str to Start
        By the body's name. A start with a ``doubt`` is the best guess.
    """
    targets = [PlanarTarget(body, calibration.camera, calibration.floor) for body in bodies]
    found = _candidates(targets, pictures[0], _moved(pictures))
    choice, doubts = _together(targets, found, tow)
    poses, turn_doubt = _turned(targets, [pose for _, pose in choice], tow, pictures)
    starts = {}
    for target, (score, _), pose, doubt in zip(targets, choice, poses, doubts, strict=True):
        fit = observe_outline(pictures[0], target, pose)
        placed = pose if fit is None else compose(pose, fit.correction)
        corners = target.pixels(target.body.top_corners_m, placed)
        starts[target.body.name] = Start(placed, corners, score, doubt or turn_doubt)
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


def _candidates(
    targets: Sequence[PlanarTarget], luma: Luma, moved: NDArray[np.bool_] | None
) -> list[list[tuple[float, Array]]]:
    """Places whose outline stands on edges and where something moved: for each target scores and poses, best first.

    What is clearly one body is left out of what moved for the others, which are searched again.
    """
    found: list[list[tuple[float, Array]]] = [[] for _ in targets]
    clear: list[int] = []
    for i in (*range(len(targets)), *range(len(targets) - 1)):
        if i in clear:
            continue
        rest = None if moved is None else moved.astype(np.uint8)
        if rest is not None:
            for j in clear:
                corners = targets[j].pixels(targets[j].body.top_corners_m, found[j][0][1])
                cv2.fillPoly(rest, [np.round(corners).astype(np.int32)], 0)
        searched = OutlineSearch(targets[i], luma, *visible_part(targets[i]), None if rest is None else rest > 0)
        found[i] = searched.found()
        if found[i] and found[i][0][0] >= CONSTANTS.clear:
            clear.append(i)
    return found


def _together(
    targets: Sequence[PlanarTarget], found: Sequence[list[tuple[float, Array]]], tow: Tow | None
) -> tuple[tuple[tuple[float, Array], ...], list[str]]:
    """The places that fit best together, and for each body why it is not certain."""
    ranked = []
    for trial in itertools.product(*found):
        covered = any(
            target.covered_by(pose, transform(other, beside.body.top_corners_m)) > CONSTANTS.most_covered
            for (target, (_, pose)), (beside, (_, other)) in itertools.permutations(zip(targets, trial, strict=True), 2)
        )
        joined = tow is None or any(True for _ in _joined(targets, [pose for _, pose in trial], tow))
        if not covered:
            ranked.append((joined, sum(log(max(score, 1e-9)) for score, _ in trial), trial))
    if not ranked:
        absent = [target.body.name for target, places in zip(targets, found, strict=True) if not places]
        names = " and ".join(absent or [target.body.name for target in targets])
        raise InputError(
            f"where {names} starts is not found",
            remedy="start with both bodies in view, or click their corners (first_frame_clicks_px)",
        )
    ranked.sort(key=lambda entry: (-entry[0], -entry[1]))
    joined, best, choice = ranked[0]
    rivals = [trial for other, score, trial in ranked[1:] if other == joined and score > best + log(CONSTANTS.as_good)]
    doubts = []
    for i, (score, pose) in enumerate(choice):
        if score < CONSTANTS.clear:
            doubts.append(f"no outline of its size stands out (score {score:.2f}, {CONSTANTS.clear} needed)")
        elif any(trial[i][1] is not pose for trial in rivals):
            doubts.append("its outline fits in more than one place")
        elif not joined:
            doubts.append("the tether does not reach from the rover to the object")
        else:
            doubts.append("")
    return choice, doubts


def _joined(targets: Sequence[PlanarTarget], poses: Sequence[Array], tow: Tow) -> Iterator[list[Array]]:
    """The ways round of symmetric outlines at which the tether is long enough."""
    for trial in itertools.product(
        *(alike(t.body.top_corners_m, pose) for t, pose in zip(targets, poses, strict=True))
    ):
        if tow.span_m(*trial[:2]) <= tow.longest_m:
            yield list(trial)


def _turned(
    targets: Sequence[PlanarTarget], poses: list[Array], tow: Tow | None, pictures: Sequence[Luma]
) -> tuple[list[Array], str]:
    """The poses the right way round, and why that is not certain."""
    ways = [alike(target.body.top_corners_m, pose) for target, pose in zip(targets, poses, strict=True)]
    if all(len(way) == 1 for way in ways):
        return poses, ""
    if tow is None:
        return poses, "a symmetric outline does not show which way round it lies"
    joined = list(_joined(targets, poses, tow))
    if len(joined) == 1:
        return joined[0], ""
    if not joined:
        return poses, "the tether does not reach from the rover to the object"
    directions = np.array([-tow.hinge, tow.anchor])
    steps = [_displacement(target, pose, pictures) for target, pose in zip(targets, poses, strict=True)]
    forwards = []
    for trial in joined:
        cosines = [_forwards(pose, way, step) for pose, way, step in zip(trial, directions, steps, strict=True)]
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
    ahead = _point(np.array([0.0, 0.0, pose[2]]), own)
    return float(ahead @ step / (np.linalg.norm(ahead) * np.linalg.norm(step)))


def _displacement(target: PlanarTarget, pose: Array, pictures: Sequence[Luma]) -> Array | None:
    """Where (2,) a body goes first [m]: to the first of the other pictures in which it is found farther on."""
    least = CONSTANTS.went * target.reach_m
    for luma in pictures[1:]:
        near = OutlineSearch(target, luma, pose[:2] - 2 * target.reach_m, pose[:2] + 2 * target.reach_m)
        score, other = next(iter(near.found()), (0.0, pose))
        if score >= CONSTANTS.clear and np.linalg.norm(other[:2] - pose[:2]) > least:
            return np.asarray(other[:2] - pose[:2])
    return None


@dataclass(frozen=True)
class Clicked:
    """A body's clicks, checked: ``corners_px`` (n, 2); ``spread`` (3, 3) over places that fit as well; findings."""

    corners_px: Array
    spread: Array
    findings: tuple[Finding, ...] = ()


def check_clicks(
    luma: Luma, calibration: Calibration, bodies: Sequence[Body], clicks_px: Mapping[str, ArrayLike], tow: Tow
) -> dict[str, Clicked]:
    """Check clicks on the corners of bodies against their outlines and the tether, and correct what clearly is wrong.

    Parameters
    ----------
    luma : ndarray (height, width) uint8
        The first picture.
    bodies : sequence of Body
        Rover and object, in this order.
    clicks_px : mapping of str to array_like (n, 2)
        Pixels of ``top_corners_m``, by the body's name; a body without is left out of the result.
    tow : Tow
        The tether's ends: with both bodies clicked, a half-turn by which alone it is long enough is corrected.
    """
    targets = [PlanarTarget(body, calibration.camera, calibration.floor) for body in bodies if body.name in clicks_px]
    checked = {target.body.name: _checked(target, luma, clicks_px[target.body.name]) for target in targets}
    return _right_way_round(targets, checked, tow) if len(targets) == len(bodies) else checked


def _checked(target: PlanarTarget, luma: Luma, clicks_px: ArrayLike) -> Clicked:
    """Clicks (n, 2) [px] on the corners of a target, moved where its outline clearly stands elsewhere."""
    clicks_px = np.asarray(clicks_px, dtype=np.float64)
    clicked, _, _ = pose_from_clicks(target, clicks_px)
    pixel, name = target.metres_per_pixel(clicked), target.body.name
    reach, near_m = CONSTANTS.capture_px * pixel, CONSTANTS.near_px * pixel
    search = OutlineSearch(target, luma, clicked[:2] - reach, clicked[:2] + reach)
    here, beside = search.sharpened(clicked, 2 * pixel)
    found = search.found(clicked[2], CONSTANTS.capture_turn)
    best, pose = next(iter(found), (0.0, clicked))
    off_m, findings = target.apart_m(clicked, pose), []
    clearly = target.apart_m(beside, pose) <= near_m or here < CONSTANTS.as_good * best
    if best >= CONSTANTS.clear and off_m > near_m and clearly:
        clicked, clicks_px = pose, target.pixels(target.body.top_corners_m, pose)
        if off_m > CONSTANTS.reported_px * pixel:
            findings.append(finding("clicks_corrected", name=name, off_px=off_m / pixel))
    as_good = [other for score, other in found if score >= CONSTANTS.as_good * max(best, here)]
    rivals = [_step(clicked, other) for other in as_good if target.apart_m(clicked, other) > near_m]
    spread = np.array(rivals).reshape(-1, 3)
    spread = spread.T @ spread / (len(rivals) + 1)
    if rivals:
        findings.append(finding("start_unsure", name=name, std_mm=1000 * float(np.sqrt(np.trace(spread[:2, :2])))))
    return Clicked(clicks_px, spread, tuple(findings))


def _step(pose: Array, other: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = other[:2] - pose[:2]
    return np.array([c * x + s * y, c * y - s * x, wrapped(other[2] - pose[2])])


def _right_way_round(targets: Sequence[PlanarTarget], checked: dict[str, Clicked], tow: Tow) -> dict[str, Clicked]:
    """The clicks of rover and object, turned where only so the tether is long enough; with findings."""
    poses = [pose_from_clicks(target, checked[target.body.name].corners_px)[0] for target in targets]
    if tow.span_m(*poses) <= tow.longest_m:
        return checked
    joined = list(_joined(targets, poses, tow))
    settled = dict(checked)
    for i, target in enumerate(targets):
        name, span_m = target.body.name, float(tow.span_m(*poses))
        place = checked[name]
        if len(joined) != 1:
            found = finding("tether_too_short", span_m=span_m, longest_m=tow.longest_m)
            settled[name] = replace(place, findings=(*place.findings, found))
        elif target.apart_m(poses[i], joined[0][i]) > target.reach_m / 2:
            corners_px = target.pixels(target.body.top_corners_m, joined[0][i])
            turned = (*place.findings, finding("clicks_turned", name=name))
            settled[name] = Clicked(corners_px, place.spread, turned)
    return settled


def overstretched(rover: Track, towed: Track, tow: Tow) -> tuple[Finding, ...]:
    """A finding where the tracks leave the tether's ends too far apart: a top the wrong way round, wrong lengths."""
    span_m = tow.span_m(rover.pose, towed.pose)[rover.seen & towed.seen]
    if not len(span_m) or np.mean(span_m > tow.longest_m) <= CONSTANTS.jerks:
        return ()
    return (finding("tether_too_short", span_m=float(span_m.max()), longest_m=tow.longest_m),)
