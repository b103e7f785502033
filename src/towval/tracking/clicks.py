"""Clicks on the corners of bodies, checked against outlines, what moves, and the tether."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Body, Calibration, Finding, Track
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import compose, inverse_transform
from towval.tracking.co_moving import co_moving
from towval.tracking.finished_track import CONSTANTS as FINISH
from towval.tracking.middle import registration_of
from towval.tracking.outline import CONSTANTS as OUTLINE
from towval.tracking.outline import observe_outline, observe_sides, pose_from_clicks, settled
from towval.tracking.overlay import standing_still
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import step_between
from towval.tracking.rectified import View
from towval.tracking.start import CONSTANTS, Place, Tow, around, joined_orientations, targets_in_view
from towval.tracking.template import Luma

_OTHER_UNIT = 2.0
"""Times as large that no measurement is by mistake, but a length in another unit: inches for centimetres are 2.54."""

_OF_ITS_SHAPE = 0.1
"""Deviation of a top's size, of that size, below which its clicks have the shape of the top."""


@dataclass(frozen=True)
class Clicked:
    """A body's clicks, checked: ``corners_px`` (n, 2); ``spread`` (3, 3) over places that fit as well; findings."""

    corners_px: Array
    spread: Array
    findings: tuple[Finding, ...] = ()


def check_clicks(
    pictures: Sequence[Luma],
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    tow: Tow,
) -> dict[str, Clicked]:
    """Check clicks on the corners of bodies against their outlines and the tether, and correct what clearly is wrong.

    ``pictures`` are the first, then others, in which what moves with a body shows its extent; ``bodies`` rover and
    object, in this order; ``clicks_px`` (n, 2) pixels of ``top_corners_m`` by the body's name: a body without is left
    out of the result. With both bodies clicked, a half-turn by which alone the tether is long enough is corrected.
    Raises `InputError` as :func:`towval.tracking.start.targets_in_view`.
    """
    tow = tow.about_middles(*bodies)
    targets = targets_in_view([body for body in bodies if body.name in clicks_px], calibration)
    found = _checked_together(targets, pictures, clicks_px, tow, all_clicked=len(targets) == len(bodies))
    own = {body.name: body for body in bodies}
    return {name: replace(one, spread=registration_of(own[name], one.spread)) for name, one in found.items()}


def _checked_together(
    targets: Sequence[PlanarTarget],
    pictures: Sequence[Luma],
    clicks_px: Mapping[str, ArrayLike],
    tow: Tow,
    *,
    all_clicked: bool,
) -> dict[str, Clicked]:
    """As :func:`check_clicks`, in frames at the middles of the tops."""
    _check_unit(targets, clicks_px)
    checked = {target.body.name: _checked(target, pictures, clicks_px[target.body.name]) for target in targets}
    if not all_clicked:
        return checked
    given = {target.body.name: np.asarray(clicks_px[target.body.name], dtype=np.float64) for target in targets}
    if _exchanged(targets, given):
        return {name: replace(one, findings=(finding("clicks_exchanged"),)) for name, one in checked.items()}
    return _right_way_round(targets, _of_one_scale(targets, given, checked), tow)


def _checked(target: PlanarTarget, pictures: Sequence[Luma], clicks_px: ArrayLike) -> Clicked:
    """Clicks (n, 2) [px] on the corners of a target, moved where its outline clearly stands elsewhere."""
    given_px = np.asarray(clicks_px, dtype=np.float64)
    clicks_px, name = _in_order(target, given_px), target.body.name
    clicked, _, _ = pose_from_clicks(target, clicks_px)
    pixel = target.metres_per_pixel(clicked)
    near_m = CONSTANTS.near_px * pixel
    turn = CONSTANTS.capture_turn
    at_first = around(target, clicked, [(pictures[0], np.zeros(3))]).found(clicked[2], turn, CONSTANTS.most_near)
    search = around(target, clicked, co_moving(target, at_first[0][1] if at_first else clicked, pictures))
    here, beside = search.sharpened(clicked, 2 * pixel)
    found = _with_edges(target, search.views, clicked, search.found(clicked[2], turn))
    best, place = next(iter(found), (0.0, clicked))
    clear = Place(best, place, tuple(search.views)).clear
    pose, of_place = settled(target, search.views, place)
    # At the foot of a side, or at a line inside, clicks know better than either.
    off_m, nearest = min(((target.apart_m(clicked, each), each) for each in (place, pose)), key=lambda each: each[0])
    findings = [] if clicks_px is given_px else [finding("clicks_reordered", name=name)]
    clearly = target.apart_m(beside, place) <= near_m or here < CONSTANTS.as_good * best
    far_m = CONSTANTS.reported_px * pixel
    elsewhere = (other for score, other in found[1:] if score >= CONSTANTS.as_good * best)
    # Where the outline fits as well in a third place, the clicks are as good a reason as any to stay.
    alone = all(target.apart_m(place, other) <= far_m for other in elsewhere)
    corrected = clear and off_m > near_m and clearly and alone and not _misled(target, pictures, clicked, pose)
    # Contrast alone finds a blurred top within some pixels, no better than clicks do; and these are known to theirs.
    corrected = corrected and (off_m > far_m or observe_outline(pictures[0], target, pose) is not None)
    if corrected and off_m > far_m:
        findings.append(finding("clicks_corrected", name=name, off_px=off_m / pixel))
    else:
        findings += _size_findings(target, clicks_px) or _side_findings(target, pictures[0], clicks_px)
    if corrected:
        clicked, clicks_px = pose, target.pixels(target.body.top_corners_m, pose)
    places = [(best, nearest), *found[1:]][: len(found)]
    as_good = [other for score, other in places if score >= CONSTANTS.as_good * max(best, here)]
    rivals = [step_between(clicked, other) for other in as_good if target.apart_m(clicked, other) > near_m]
    spread = np.array(rivals).reshape(-1, 3)
    spread = spread.T @ spread / (len(rivals) + 1) + (of_place if corrected else 0.0)
    if spread.any():
        findings.append(unsure_start(name, spread))
    return Clicked(clicks_px, spread, tuple(findings))


def unsure_start(name: str, spread: Array) -> Finding:
    """That the outline of a body fits in several places, with the ``spread`` (3, 3) of its pose over them."""
    return finding("start_unsure", name=name, std_mm=1000 * float(np.sqrt(np.trace(spread[:2, :2]))))


def _with_edges(
    target: PlanarTarget, views: Sequence[View], clicked: Array, found: Sequence[tuple[float, Array]]
) -> list[tuple[float, Array]]:
    """Those of the places found, with their scores, that show the top's edges, where the clicks surely do.

    A search looks at contrast along the whole outline, of which light on the top may make more elsewhere. So does the
    body's own shadow, which has the shape of the top, and the way along a sledge, whose ends are but a small part of
    its outline: there the edges are seen, but not as surely. Clicks may also lie on lines of the floor: these stay
    behind where the body moves, so edges count that all views show.
    """
    least_m = FINISH.unsure_edges_px * target.metres_per_pixel(clicked)
    at_clicks = (observe_outline(luma, target, compose(step, clicked)) for luma, step in views)
    stds_m = [fit.largest_std_m for fit in at_clicks if fit is not None]
    if len(stds_m) < len(views) or max(stds_m) > least_m:
        return list(found)
    first = ((entry, observe_outline(views[0][0], target, entry[1])) for entry in found)
    sure = (each for each, fit in first if fit is not None and fit.largest_std_m < OUTLINE.nearly_as_sure * stds_m[0])
    return [
        entry
        for entry in sure
        if all(observe_outline(luma, target, compose(step, entry[1])) is not None for luma, step in views[1:])
    ]


def _misled(target: PlanarTarget, pictures: Sequence[Luma], clicked: Array, place: Array) -> bool:
    """Whether a search may have found, at a place, what is drawn over the film instead of the top.

    The border of a banner looks like an edge of the top and stands out more. Letters have more contrast than the top,
    but no edges of its length: those are seen at the clicks, however unsurely, and not at the place. What stands still
    at clicks that are wrong is floor: the top shows its edges at the place alone, and all of it moves.
    """
    at_clicks, there = (observe_outline(pictures[0], target, each) for each in (clicked, place))
    if at_clicks is None and there is not None and not standing_still(pictures[0], pictures[-1], target, place):
        return False
    is_covered = bool(standing_still(pictures[0], pictures[-1], target, clicked))
    return is_covered or (at_clicks is not None and there is None)


def _size_findings(target: PlanarTarget, clicks_px: Array) -> list[Finding]:
    """A finding where clicks (n, 2) [px] near the outline have another size than the top's.

    Edges of something else may lie as far apart as those of a top of the stated size; clicks know the corners.
    """
    scale, std = _scale(target, clicks_px)
    size, corners = scale - 1, target.body.top_corners_m
    outward_m = abs(size) * float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max())
    least_m = CONSTANTS.size_px * target.metres_per_pixel(np.array([*target.floor_xy(clicks_px).mean(axis=0), 0.0]))
    if abs(size) < CONSTANTS.size_deviations * std or outward_m < least_m:
        return []
    return [finding("lengths_wrong", names=target.body.name, percent=100 * size, std_percent=100 * std)]


def _side_findings(target: PlanarTarget, luma: Luma, clicks_px: Array) -> list[Finding]:
    """Findings where length or width of a top are other than stated both by its edges and by clicks (n, 2) [px].

    Where its width is wrong, an outline that is held to it lies on one of two edges, and all fits agree on that one.
    Edges alone do not tell, since the foot of a side may be found instead: clicks know which of them is the top's.
    """
    pose, _, _ = pose_from_clicks(target, clicks_px)
    by_edges = observe_sides(luma, target, pose)
    if by_edges is None:
        return []
    corners = target.body.top_corners_m - target.body.top_corners_m.mean(axis=0)
    stated, square = np.ptp(corners, axis=0), np.sum(corners**2, axis=0)
    clicked = inverse_transform(pose, target.floor_xy(clicks_px))
    by_clicks = (np.sum(corners * clicked, axis=0) / square - 1) * stated
    left = clicked - clicked.mean(axis=0) - corners * (1 + by_clicks / stated)
    free = max(1, 2 * len(corners) - 5)
    click_m = max(OUTLINE.click_noise_px * target.metres_per_pixel(pose), np.sqrt(np.sum(left**2) / free))
    std_m = click_m * stated / np.sqrt(square)
    # What clicks speak for the edges' sides against the stated ones: a difference of squared deviations.
    for_edges = (by_clicks**2 - (by_clicks - by_edges) ** 2) / std_m**2
    return [
        finding("sides_wrong", name=target.body.name, side=side, percent=100 * edges / length)
        for side, edges, length, odds in zip(("length", "width"), by_edges, stated, for_edges, strict=True)
        if odds > CONSTANTS.scales_apart**2
    ]


def _in_order(target: PlanarTarget, clicks_px: Array) -> Array:
    """Clicks (n, 2) [px] in the order of the target's corners: in another, where they fit only so.

    They may go round the other way, as on a mirrored body, or begin at another corner. Of orders that fit as well (half
    a turn of a rectangle) it is the first.
    """
    if clicks_px.shape != target.body.top_corners_m.shape:
        return clicks_px
    orders = [np.roll(each, k, axis=0) for each in (clicks_px, clicks_px[::-1]) for k in range(len(clicks_px))]
    misfit, *others = (pose_from_clicks(target, each)[2] for each in orders)
    wrong = misfit > OUTLINE.misfit_of_clicks_px and min(others) < min(OUTLINE.misfit_of_clicks_px, misfit / 4)
    return orders[1 + int(np.argmin(others))] if wrong else clicks_px


def _of_one_scale(
    targets: Sequence[PlanarTarget], given: Mapping[str, Array], checked: Mapping[str, Clicked]
) -> dict[str, Clicked]:
    """The clicks, with a finding where two tops differ in scale: one has another height or size than stated.

    A scale that both share is the camera's, or another zoom of the video, and is judged where the floor is seen. Clicks
    that were far off and are corrected tell nothing.
    """
    if any(each.code == "clicks_corrected" for one in checked.values() for each in one.findings):
        return dict(checked)
    (one, one_std), (other, other_std) = (
        _scale(target, _in_order(target, given[target.body.name])) for target in targets
    )
    apart, std = one / other - 1, float(np.hypot(one_std, other_std))
    if abs(apart) <= CONSTANTS.scales_apart * std:
        return dict(checked)
    worse = int(abs(other - 1) > abs(one - 1))
    name = targets[worse].body.name
    larger = (1 + apart) ** (1 - 2 * worse) - 1
    found = finding("clicks_scale", name=name, percent=100 * larger, std_percent=100 * std)
    return {**checked, name: replace(checked[name], findings=(*checked[name].findings, found))}


def _check_unit(targets: Sequence[PlanarTarget], clicks_px: Mapping[str, ArrayLike]) -> None:
    """Refuse clicks that have the shapes of two tops of quite another size: no slip of a click explains that."""
    given = [np.asarray(clicks_px[target.body.name], dtype=np.float64) for target in targets]
    if len(targets) < 2 or any(
        clicks.shape != target.body.top_corners_m.shape for clicks, target in zip(given, targets, strict=True)
    ):
        return
    scales = [_scale(target, _in_order(target, clicks)) for target, clicks in zip(targets, given, strict=True)]
    sizes = [size for size, _ in scales]
    alike = all(std < _OF_ITS_SHAPE * size for size, std in scales)
    if alike and (min(sizes) > _OTHER_UNIT or max(sizes) < 1 / _OTHER_UNIT):
        names = [f"{target.body.name} {size:.3g} times" for target, size in zip(targets, sizes, strict=True)]
        raise InputError(
            "the clicked tops are of quite another size than stated",
            got=f"{' and '.join(names)} as large",
            allowed="camera.board.square_m, top_corners_m and tracked_plane_height_m, all in metres",
            remedy="measure a square of the board again, and a side of each top",
        )


def _exchanged(targets: Sequence[PlanarTarget], given: Mapping[str, Array]) -> bool:
    """Whether each body's clicks (n, 2) [px] have the size of the other's top and not that of its own."""
    one, other = targets
    if one.body.top_corners_m.shape != other.body.top_corners_m.shape:
        return False  # Clicks of another number of corners have been refused.
    pairs = [(one, other), (other, one)]
    own = np.array([_scale(target, _in_order(target, given[target.body.name])) for target, _ in pairs])
    others = np.array([_scale(target, _in_order(target, given[rival.body.name])) for target, rival in pairs])
    off, off_exchanged = np.abs(np.log(own[:, 0])), np.abs(np.log(others[:, 0]))
    return bool((off > CONSTANTS.size_deviations * own[:, 1]).all() and off_exchanged.max() < off.min() / 4)


def _scale(target: PlanarTarget, clicks_px: Array) -> tuple[float, float]:
    """Size of a clicked top over the stated one, on the plane of its stated height, and the deviation of that.

    That of a click is what the clicks themselves scatter by, if that is more than usual: then none of it is the size.
    """
    corners = target.body.top_corners_m, target.floor_xy(clicks_px)
    stated, seen = (each - each.mean(axis=0) for each in corners)
    stated, seen = stated @ [1, 1j], seen @ [1, 1j]
    square = np.sum(np.abs(stated) ** 2)
    turned = np.vdot(stated, seen) / square
    free = max(1, 2 * len(seen) - 4)
    scatter_m = np.sqrt(np.sum(np.abs(seen - turned * stated) ** 2) / free)
    pixel_m = target.metres_per_pixel(np.array([*target.floor_xy(clicks_px).mean(axis=0), 0.0]))
    click_m = max(OUTLINE.click_noise_px * pixel_m, scatter_m)
    length = OUTLINE.length_std_m / np.sqrt(square)
    return float(np.abs(turned)), float(np.hypot(click_m / np.sqrt(square), length))


def _right_way_round(targets: Sequence[PlanarTarget], checked: dict[str, Clicked], tow: Tow) -> dict[str, Clicked]:
    """The clicks of rover and object, turned where only so the tether is long enough; with findings."""
    poses = [pose_from_clicks(target, checked[target.body.name].corners_px)[0] for target in targets]
    if tow.span_m(*poses) <= tow.longest_m:
        return checked
    joined = list(joined_orientations(targets, poses, tow))
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
