"""Where the camera stands at a video's first picture, against the pictures of the floor of its calibration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array, Calibration, Camera, Finding, Floor
from towval.model.conventions import VIEW_MOTION
from towval.model.findings import finding, leaves_unjudged
from towval.optics.moved_view import parameters_by_motion
from towval.optics.view_motion import view_before
from towval.tracking.camera_motion import CONSTANTS as MOTION
from towval.tracking.floor_registration import FloorRegistration, Learned, Registered
from towval.tracking.lens_of_video import lens_of_video
from towval.tracking.light import evened
from towval.tracking.template import Luma


@dataclass(frozen=True)
class ViewAtStartConstants:
    """Tuned constants of the view at the start."""

    referred_px: float = 0.1  # [px] Of the floor between its pictures and the video's first: less is not corrected.
    other_lens_px: float = 0.5  # [px] Of places against each other: a video 1 % wider has 0.6 to 0.9.
    wider_px: float = 0.2  # [px] Of the video at its sides: 0.05 where it is not, 0.4 to 0.7 where it is 0.1 % wider.


CONSTANTS = ViewAtStartConstants()

_SIZE = len(VIEW_MOTION)
_REFERRED = 2  # Rounds: the second one knows where the first picture's points are.


def calibration_at_start(
    calibration: Calibration, luma: Luma, floor: Sequence[tuple[str, Luma]]
) -> tuple[Calibration, tuple[Finding, ...]]:
    """The calibration for a video whose camera may have moved since the pictures of the floor were taken.

    Parameters
    ----------
    luma : ndarray (height, width) uint8
        The video's first picture. Bodies in it, and boards in the others, are few enough not to count.
    floor : sequence of (str, ndarray (height, width) uint8)
        Names and pictures of the floor that the calibration rests on.

    Returns
    -------
    calibration : Calibration
        As given where the floor's texture is where it was, else with the view, and the lens, of the first picture.
    findings : tuple of Finding
    """
    if not floor or any(picture.shape != luma.shape for _, picture in floor):
        return calibration, ()
    names, pictures = [name for name, _ in floor], [evened(picture) for _, picture in floor]
    even = evened(luma)
    seen = _as_seen(calibration.camera, calibration.floor, even)
    if seen.template is None:
        return calibration, ()
    other = lens_of_video(seen, luma, pictures)
    if other is not None:
        even = evened(other.as_in_pictures(luma, calibration.floor))
    found, findings = _referred(calibration, even, names, pictures)
    if other is None or any(map(leaves_unjudged, findings)):
        return found, findings
    covariance = found.covariance + other.added(found.floor)
    corner_px, std_px = other.corner_px()
    findings = (*findings, finding("other_lens", corner_px=corner_px, std_px=std_px))
    return replace(found, camera=other.of(found.camera), covariance=covariance), findings


def _referred(
    calibration: Calibration, luma: Luma, names: Sequence[str], pictures: Sequence[Luma]
) -> tuple[Calibration, tuple[Finding, ...]]:
    """As :func:`calibration_at_start`, in even light and by one lens."""
    camera, plane = calibration.camera, calibration.floor
    for _ in range(_REFERRED):
        seen = _as_seen(camera, plane, luma)
        if seen.template is None:
            return calibration, ()
        found, enough = _found(seen, pictures), (len(pictures) + 1) // 2
        if len(found) < enough:
            return calibration, (_not_recognised(seen, luma, pictures, len(found)),)
        findings = _moved_between(seen, found, names)
        # The first one holds the floor frame; where the camera stood still, all of them tell where it was.
        at = list(found.values())[: 1 if findings else None]
        back = np.mean([one.motion for one in at], axis=0)
        covariance = np.asarray(np.mean([one.covariance for one in at], axis=0), dtype=np.float64)
        scatter = np.zeros((_SIZE, _SIZE))
        if len(found) > 1:
            scatter = np.cov([one.motion for one in found.values()], rowvar=False) / len(found)
        # Motions that differ say nothing of what the first one confounds.
        back, covariance = seen.no_larger_than_seen(back, covariance + (0 if findings else scatter))
        covariance = covariance + (scatter if findings else 0)
        has_moved = seen.shift_px(back) >= CONSTANTS.referred_px
        if not has_moved:
            if seen.std_px(covariance) < CONSTANTS.referred_px:
                return calibration, tuple(findings)
            camera, plane = calibration.camera, calibration.floor
            break
        # The pictures of the floor are where the calibration holds: the video's first comes before that motion.
        camera, plane = view_before(calibration.camera, calibration.floor, back)
    by_motion = parameters_by_motion(camera, plane)
    widened = calibration.covariance + by_motion @ covariance @ by_motion.T
    if has_moved:
        std_px = seen.std_px(covariance)
        findings.append(finding("camera_moved_before", shift_px=seen.shift_px(back), std_px=std_px))
    return replace(calibration, camera=camera, floor=plane, covariance=widened), tuple(findings)


def _moved_between(seen: FloorRegistration, found: Mapping[int, Registered], names: Sequence[str]) -> list[Finding]:
    """A finding where the first of the floor's pictures, which have ``names``, shows it elsewhere than others."""
    shifts_px = {}
    for i, one in found.items() if 0 in found else ():
        noise_px = MOTION.significant * seen.std_px(one.covariance + found[0].covariance)
        shift_px = seen.shift_px(one.motion - found[0].motion)
        if shift_px > max(MOTION.reported_px, noise_px):
            shifts_px[names[i]] = shift_px
    numbers = {"names": ", ".join(shifts_px), "first": names[0], "shift_px": max(shifts_px.values(), default=0.0)}
    return [finding("camera_moved_between", **numbers)] if shifts_px else []


def _as_seen(camera: Camera, floor: Floor, luma: Luma) -> FloorRegistration:
    """The floor of a picture, to be recognised in others however uncertain its place: that widens the calibration."""
    return FloorRegistration(camera, floor, luma, (), worst_std_px=np.inf)


def _not_recognised(seen: FloorRegistration, luma: Luma, pictures: Sequence[Luma], found: int) -> Finding:
    """Why the floor of a video's first picture ``seen`` is found in few of its own pictures."""
    # A phone that lies flat guesses which way is up, separately for each recording.
    turned = _as_seen(seen.camera, seen.floor, np.ascontiguousarray(luma[::-1, ::-1]))
    if len(_found(turned, pictures)) >= (len(pictures) + 1) // 2:
        return finding("video_upside_down")
    if _too_plain(seen.camera, seen.floor, pictures):
        return finding("floor_too_plain")
    return finding("floor_not_recognised", found=found, pictures=len(pictures))


def _too_plain(camera: Camera, floor: Floor, pictures: Sequence[Luma]) -> bool:
    """Whether the floor's own pictures, which one camera took, are not recognised in one another either."""
    first, *others = pictures
    seen = _as_seen(camera, floor, first)
    if not others or seen.template is None:
        return False
    # Each by itself: the camera may have moved between them.
    return 2 * sum(seen.anywhere(picture) is not None for picture in others) < len(others)


@dataclass(frozen=True)
class _Recognised:
    """Picture ``number`` shows the floor: where, what its residuals scatter by, and by how much it is wider [px]."""

    number: int
    registered: Registered
    left: float
    wider_px: float
    wider_std_px: float


def _found(seen: FloorRegistration, pictures: Sequence[Luma]) -> dict[int, Registered]:
    """Registrations of the pictures in which the floor is found near its calibrated view, by their numbers.

    None where its places are displaced against each other: by other pixels (a video made wider), by another lens.
    """
    places: list[Array] = []
    for one in map(seen.anywhere, pictures):
        if one and all(seen.shift_px(one.motion - place) > CONSTANTS.referred_px for place in places):
            places.append(one.motion)
    if not places:
        return {}
    # One camera took them all, so one place is near all of theirs: alone a picture may fit better beside it.
    found, learned = max(
        (_found_near(seen, pictures, place) for place in places),
        key=lambda tried: (len(tried[0]), -sum(np.log(one.left) for one in tried[0])),
    )
    if not found:
        return {}
    seen.learned = learned
    other_lens = seen.scattered_px > CONSTANTS.other_lens_px
    # The first picture's noise is the same in all of them.
    most_px = max(CONSTANTS.wider_px, MOTION.significant * float(np.median([one.wider_std_px for one in found])))
    wider_px = float(np.median([one.wider_px for one in found]))
    if other_lens or abs(wider_px) > most_px:
        return {}
    near = {one.number: one.registered for one in found}
    # The first one holds the floor frame: where it is not near the others, the camera moved between them.
    first = None if 0 in near else seen.anywhere(pictures[0])
    return near if first is None else {0: first} | near


def _found_near(seen: FloorRegistration, pictures: Sequence[Luma], place: Array) -> tuple[list[_Recognised], Learned]:
    """The pictures in which the floor is found from a ``place`` (9,) on, and what they teach."""
    seen.learned = Learned()
    found = []
    for number, picture in enumerate(pictures):
        registered = seen.near(picture, place, []) or seen.unmoved(picture)
        if registered is not None:
            found.append(_Recognised(number, registered, seen.learned.last[2], *seen.stretch_px()))
    return found, seen.learned
