"""The findings that stages can report: one table, one row per code, from which every :class:`Finding` is made.

A new finding is a :class:`FindingType` handed to :func:`register`, and a call of :func:`finding` where it arises.
docs/findings.md is this table in print.
"""

import enum
from dataclasses import dataclass

from towval.model.errors import InputError
from towval.model.plugins import Registry


class Severity(enum.StrEnum):
    """How much a :class:`Finding` should worry its reader."""

    NOTE = "note"
    WARNING = "warning"
    REFUSAL = "refusal"


@dataclass(frozen=True)
class Finding:
    """A stage's remark on its input or result; created by :func:`finding`.

    ``code`` is a row of the table, ``text`` a full sentence with numbers and what to do.
    """

    severity: Severity
    code: str
    text: str


@dataclass(frozen=True)
class Consequence:
    """What a finding means for the verdict of a run.

    ``judged`` is false where the comparison cannot say anything about the model; ``widens`` names the inputs (keys of
    :data:`towval.model.inputs.INPUTS`, or "tracking" for the tracks' own noise) whose stated deviations are too small
    once the finding is there; ``excuses`` is true where a difference may come from what the finding says instead of
    from the model.
    """

    judged: bool = True
    widens: tuple[str, ...] = ()
    excuses: bool = False

    def __str__(self) -> str:
        if not self.judged:
            return "not judged"
        if self.excuses:
            return "excuses a difference"
        return f"widens {', '.join(self.widens)}" if self.widens else "none"


@dataclass(frozen=True)
class FindingType:
    """A row of the table.

    ``stage`` that reports it; ``severities`` it can have, the usual one first; ``text`` a template for ``str.format``.
    """

    code: str
    stage: str
    severities: tuple[Severity, ...]
    consequence: Consequence
    text: str


NOTE, WARNING = (Severity.NOTE,), (Severity.WARNING,)
_WARNING_OR_REFUSAL = (Severity.WARNING, Severity.REFUSAL)
NOTE_OR_WARNING = (Severity.NOTE, Severity.WARNING)
NONE, NOT_JUDGED, EXCUSES = Consequence(), Consequence(judged=False), Consequence(excuses=True)
WIDENS_CAMERA, WIDENS_TRACKING = Consequence(widens=("camera",)), Consequence(widens=("tracking",))
_REGISTRATION = Consequence(widens=("rover_registration", "object_registration"))

FINDINGS: Registry[FindingType] = Registry("finding")
"""The table, by code."""


def register(*rows: FindingType) -> None:
    """Add rows to the table; :class:`InputError` where a code is taken."""
    for row in rows:
        FINDINGS.register(row.code, row)


def finding(code: str, severity: Severity | None = None, /, **values: object) -> Finding:
    """A finding by its ``code`` in :data:`FINDINGS`, with the ``values`` that the row's text names.

    ``severity`` is one of the row's, by default the first. Raises `InputError` for an unknown code or another severity.

    Examples
    --------
    >>> finding("compare_cut", count=3).text
    '3 measured frames have no simulated counterpart.'
    """
    row = FINDINGS.require(code, "finding()")
    severity = severity or row.severities[0]
    if severity not in row.severities:
        raise InputError(f"finding {code}: unknown severity", got=severity, allowed=", ".join(row.severities))
    return Finding(severity, code, row.text.format(**values))


def leaves_unjudged(found: Finding) -> bool:
    """Whether a finding leaves its run without a verdict."""
    return not FINDINGS.require(found.code, "leaves_unjudged()").consequence.judged


register(  # calibrate
    FindingType("view-dropped", "calibrate", (Severity.WARNING, Severity.NOTE), NONE, "{name} was left out: {reason}."),
    FindingType(
        "views-repeated", "calibrate", NOTE, NONE,
        "{count} pictures show the board where another one does, and add no view: {names}. Move or tilt it in between.",
    ),
    FindingType(
        "lens-undetermined", "calibrate", NOTE, NONE,
        'The lens model "{model}" predicts held-out views better ({score_px:.2f} px against {chosen_px:.2f} px of '
        '"{chosen}"), but the views do not determine its coefficients (condition number {condition:.0e}): they cancel, '
        "and beyond the corners anything can happen.",
    ),
    FindingType(
        "no-tilt", "calibrate", _WARNING_OR_REFUSAL, NONE,
        "The boards are hardly tilted: half of the {held} held views are within {tilt_deg:.1f}° of the image plane. "
        "Focal length and distance cannot be separated; the focal length is uncertain by {focal_percent:.1f} %, "
        "though the boards fit well. Instead, {remedy}.",
    ),
    FindingType(
        "focal-length-uncertain", "calibrate", _WARNING_OR_REFUSAL, NONE,
        "The views leave the camera uncertain: the focal length is uncertain by {focal_percent:.1f} %. Film more "
        "views: {remedy}, nearer to the camera.",
    ),
    FindingType(
        "lens-fisheye", "calibrate", WARNING, WIDENS_CAMERA,
        'The lens is that of a fisheye: "{model}" predicts held-out views to {fisheye_px:.2f} px, "{chosen}" to '
        "{chosen_px:.2f} px, and the latter is wrong beyond the boards. Name only the models of a fisheye "
        "in config.yaml: calibrate: {{lens_models: [fisheye, fisheye k1, fisheye k1 k2, fisheye k1 k2 k3]}}.",
    ),
    FindingType(
        "centre-only", "calibrate", WARNING, WIDENS_CAMERA,
        "The boards were held only in a part of the picture, {covered_percent:.0f} % of it: the lens is extrapolated "
        "to the rest, and the predicted deviations do not include that error. Instead, {remedy}.",
    ),
    FindingType(
        "few-views", "calibrate", WARNING, NONE,
        "Too few views: {held} held boards are used, at least {least} are needed and 12 are good. For the others, "
        "{remedy}.",
    ),
    FindingType(
        "halves-disagree", "calibrate", WARNING, WIDENS_CAMERA,
        "Two halves of the views, calibrated separately, differ by {found_mm:.1f} mm on the plane at {height_m:.2f} "
        "m where the corner noise explains {expected_mm:.1f} mm. An assumption is violated: a bent board, a focus or "
        "zoom that changed, a board moved during the exposure, a lens that no lens model here describes.",
    ),
    FindingType(
        "floor-extrapolated", "calibrate", WARNING, NONE,
        "The floor is known from {covered_percent:.0f} % of the picture and extrapolated to the rest: positions on "
        "the plane at {height_m:.2f} m are uncertain by {rms_mm:.1f} mm over the picture, and by {worst_mm:.1f} mm "
        "at pixel ({u:.0f}, {v:.0f}). Lay the board down at more places, far apart and towards the picture's "
        "corners, or survey marks there.",
    ),
    FindingType(
        "marks-noisy", "calibrate", WARNING, NONE,
        "The surveyed marks scatter by {found_px:.1f} px where {stated_px:.1f} px are stated; the larger figure is "
        "used. Measure them again, or state their real deviation.",
    ),
    FindingType(
        "board-bent", "calibrate", WARNING, NONE,
        "The board is bent: its middle stands {bow_mm:.1f} ± {std_mm:.1f} mm off its ends. The bow is corrected; a "
        "board on a stiff plate is better.",
    ),
    FindingType(
        "board-stretched", "calibrate", WARNING, NONE,
        "The board's squares are {percent:+.2f} ± {std_percent:.2g} % longer along its longer side than across, "
        "and {skew_deg:+.2f}° askew. That is corrected; measure whole rows both ways, and state their mean.",
    ),
    FindingType(
        "board-size", "calibrate", WARNING, NONE,
        "By the surveyed marks the board's size is {percent:+.2f} ± {std_percent:.2f} % off camera.board.square_m. The "
        "marks are used; measure a whole row of squares.",
    ),
    FindingType(
        "board-thickness", "calibrate", WARNING, NONE,
        "By the surveyed marks the board's printed face lies {thicker_mm:+.1f} ± {std_mm:.1f} mm off "
        "floor.board_thickness_m. The marks are used.",
    ),
    FindingType(
        "held-differ", "calibrate", WARNING, NONE,
        "Taken with another zoom or crop than the first picture of the floor: {names} (magnified by {percent:+.2f} ± "
        "{std_percent:.2g} %, shifted by ({u:.1f}, {v:.1f}) px). If one camera took them all, that is corrected: the "
        "zoom is that of the floor's first picture, and must be that of the videos. Of another camera they leave the "
        "picture's centre wrong; marks with pixels of a smaller picture look the same. Use one camera, zoom and focus.",
    ),
    FindingType(
        "floor-turned", "calibrate", WARNING, NONE,
        "The camera was turned after the floor's first picture: {names} show what stands still {by_px:.0f} px away. "
        "They are left out, since they would tilt the floor. Fix the camera, and take them all again.",
    ),
    FindingType(
        "held-flipped", "calibrate", (Severity.REFUSAL,), NOT_JUDGED,
        "Pictures of the held board are {flip} against those of the floor: {names} ({by}). Save all pictures as the "
        "camera films, without mirroring or turning.",
    ),
    FindingType(
        "views-blurred", "calibrate", WARNING, NONE,
        "Blurred pictures of the board: {names} (edges up to {edge_px:.0f} px wide in {worst}; sharp: 2 to 3 px). "
        "Hold the board still and in focus, in more light.",
    ),
    FindingType(
        "pictures-squeezed", "calibrate", WARNING, NONE,
        "The calibration pictures are stretched along their width by {percent:+.2f} ± {std_percent:.2g} % against "
        "their height, but sensors have square pixels: they were saved at another aspect ratio, or a camera films so. "
        "Places on the floor are right only in videos that are stretched alike, and otherwise {moved_mm:.0f} mm off "
        "(RMS over the picture). Take the pictures from a film in the mode of the runs (docs/calibration.md).",
    ),
    FindingType(
        "boards-alike", "calibrate", NOTE, NONE,
        "{count} pictures ({names}) show two chessboards with these numbers of corners. In the first picture of the "
        "floor the one at floor.origin_corner_px counts, elsewhere the one that is not where other pictures show one, "
        "too. Take the other one away.",
    ),
    FindingType(
        "pictures-tagged", "calibrate", NOTE, NONE,
        "{count} of {pictures} pictures ({first} the first of them) carry a tag for orientation (EXIF), by which "
        "viewers turn them. They are used as they are stored, as the sensor saw them. Pixels in campaign.yaml (of the "
        "floor's origin and axis, of surveyed marks) count as stored, too: see check/start.html, or take them from a "
        "viewer that leaves the tag aside.",
    ),
    FindingType(
        "marks-alone", "calibrate", WARNING, NONE,
        "Calibrated from {count} surveyed marks alone: places on the floor are good to {left_out_mm:.2f} mm (each mark "
        "predicted from the others), but marks on one plane tell the focal length only to {focal_percent:.0f} %, and "
        "places above the floor accordingly. For bodies of any height film a board, too.",
    ),
    FindingType(
        "mark-misfit", "calibrate", WARNING, WIDENS_CAMERA,
        "The surveyed mark at {at_m} m is {distance_px:.1f} px from where the others put it (stated deviation of a "
        "mark: {stated_px:.1f} px). Check its pixel and its coordinates.",
    ),
    FindingType(
        "mark-left-out", "calibrate", WARNING, NONE,
        "The surveyed mark at {at_m} m is {distance_px:.0f} px from where the others put it, and was left out. Check "
        "its pixel and its coordinates.",
    ),
)  # fmt: skip

_TOPS_APART = (
    "Compared with the other body, the outline of the top of {name} is {percent:+.2f} ± {std_percent:.2f} % off the "
    "size of its top_corners_m at its tracked_plane_height_m: as if that height were {height_mm:.0f} mm off. "
    "Measure that height (of the edges of the top above the floor) and the corners again."
)

register(  # track
    FindingType(
        "video_damaged", "track", WARNING, NONE,
        "{name} is damaged or truncated ({reason}): {good}; the rest was left out.",
    ),
    FindingType(
        "few_points", "track", WARNING, WIDENS_TRACKING,
        "Tracked with {samples} points: so few let a pose drift by more than its stated deviation, and a correct "
        "model can be judged wrong. Set track.samples to {enough} or more.",
    ),
    FindingType(
        "edges_not_found", "track", WARNING, NOT_JUDGED,
        "The edges of {name} could not be found around the clicks; its frame rests on the clicks ({std_mm:.1f} mm). "
        "Check the clicks and top_corners_m.",
    ),
    FindingType(
        "edges_unsure", "track", WARNING, NONE,
        "The edges of {name} do not fix its place in one direction: its frame is known to {std_mm:.1f} mm at best "
        "there. They must be sharp in some pictures and stand out from the floor (begin the run at rest, use a shorter "
        "exposure), and as far apart as top_corners_m says: length {length_mm:+.1f} mm, width {width_mm:+.1f} mm.",
    ),
    FindingType(
        "lengths_differ", "track", WARNING, WIDENS_CAMERA,
        "The size of the tops of {names} is {percent:+.2f} ± {std_percent:.2f} % off what is stated: the scale of the "
        "calibration (camera.board.square_m: a board printed at another size; another zoom) contradicts top_corners_m "
        "and tracked_plane_height_m. Measure the board and the tops again.",
    ),
    FindingType(
        "lengths_wrong", "track", WARNING, NOT_JUDGED,
        "The size of the tops of {names} is {percent:+.2f} ± {std_percent:.2f} % off what is stated: the scale of the "
        "calibration (camera.board.square_m: a board printed at another size; another zoom) or top_corners_m and "
        "tracked_plane_height_m are wrong. Measure the board and the tops again.",
    ),
    FindingType("tops_differ", "track", WARNING, EXCUSES, _TOPS_APART),
    FindingType("tops_scale", "track", WARNING, NOT_JUDGED, _TOPS_APART),
    FindingType(
        "sides_wrong", "track", WARNING, NOT_JUDGED,
        "Edges and clicks both show the {side} of the top of {name} {percent:+.1f} % off top_corners_m: the outline "
        "cannot lie on both edges, and its poses may be off by half of the difference. Measure the top again.",
    ),
    FindingType(
        "clicks_misfit", "track", WARNING, _REGISTRATION,
        "The clicks of {name} miss its corners by up to {misfit_px:.1f} px. Check them, its top_corners_m and "
        "tracked_plane_height_m.",
    ),
    FindingType(
        "clicks_scale", "track", WARNING, NOT_JUDGED,
        "Compared with the other body, the clicks show the top of {name} {percent:+.1f} ± {std_percent:.1f} % off "
        "the size of its top_corners_m at its tracked_plane_height_m. Check that height (of the clicked corners above "
        "the floor), the corners, and the clicks.",
    ),
    FindingType(
        "covered_at_start", "track", WARNING, NONE,
        "In the first picture something that does not move with it (a banner, a time stamp) covers {percent:.0f} % of "
        "the top of {name}: that part was not tracked. Film without overlays.",
    ),
    FindingType(
        "start_found", "track", NOTE, NONE,
        "{name} was not clicked: its start was found from its outline, what moves, and the tether. Check the outline "
        "over the film in the report.",
    ),
    FindingType(
        "clicks_corrected", "track", WARNING, NONE,
        "The clicks of {name} are {off_px:.0f} px off the nearest edges that fit its outline. The track starts from "
        "these edges. Check the outline in check/start.html (towval check CAMPAIGN), and save it there.",
    ),
    FindingType(
        "clicks_reordered", "track", WARNING, NOT_JUDGED,
        "The clicks of {name} fit its outline in another order than that of top_corners_m alone: they go round the "
        "other way (mirrored), or begin at another corner. The track starts as they fit, perhaps half a turn off. "
        "Click its corners in the order of top_corners_m.",
    ),
    FindingType(
        "clicks_exchanged", "track", WARNING, NOT_JUDGED,
        "The clicks of rover and object have the size of each other's top: they are exchanged. Exchange them in "
        "first_frame_clicks_px, or top_corners_m and tracked_plane_height_m of rover and object.",
    ),
    FindingType(
        "clicks_turned", "track", WARNING, EXCUSES,
        "The clicks of {name} lie the wrong way round: the tether would not reach. The track starts turned; click its "
        "corners in the order of top_corners_m, or correct the sign of tether_hinge_m or tether_anchor_m: then the "
        "clicks are right, and {name} is half a turn off.",
    ),
    FindingType(
        "tether_too_short", "track", WARNING, NOT_JUDGED,
        "The tether's ends are {span_m:.2f} m apart, which is more than it can stretch to ({longest_m:.2f} m). Check "
        "the clicks of both bodies, tether_hinge_m, tether_anchor_m, rest_length_m and stiffness_N_per_m (its unit); "
        "and on the video whether the tether came off.",
    ),
    FindingType(
        "start_unsure", "track", WARNING, NONE,
        "The outline of {name} fits in more than one place at the start; its frame is known to {std_mm:.1f} mm. "
        "Check its corners in the first picture and top_corners_m.",
    ),
    FindingType(
        "not_seen", "track", WARNING, NONE,
        "{name} was not observed in {count} of {frames} pictures ({lost} lost, {bridged} bridged), between "
        "{first_s:.2f} s and {last_s:.2f} s. Look at the video there: something hid it, it left the picture, or its "
        "top is too plain.",
    ),
    FindingType(
        "lookalike", "track", WARNING, NONE,
        "{name} cannot be distinguished from something that looks like it, or from itself turned round: a match was "
        "rejected {count} times for that reason. Put a different pattern on each body.",
    ),
    FindingType(
        "low_texture", "track", WARNING, NONE,
        "The top of {name} shows too little texture for the noise of the video (deviation {std_mm:.2f} mm where "
        "observed). Put a pattern on it: print, stickers, tape.",
    ),
)  # fmt: skip
register(  # uncertainty, compare, identify
    FindingType(
        "main_input", "uncertainty", NOTE, NONE,
        "{percent:.0f} % of the path error's expected variance comes from: {label}.",
    ),
    FindingType(
        "draws_left_out", "uncertainty", WARNING, NONE,
        "{count} draws could not be simulated and were left out. Of the first: {reason}.",
    ),
    FindingType(
        "draws_fail", "uncertainty", WARNING, NOT_JUDGED,
        "{count} of {drawn} draws could not be simulated, more than {percent:.0f} %: the bounds hold for the others "
        "only. Check the deviations in campaign.yaml. Of the first: {reason}.",
    ),
    FindingType(
        "draft_settings", "uncertainty", WARNING, NOT_JUDGED,
        "The draws were simulated with errors of up to {tolerance_mm:g} mm a step (preset draft: 0.01 mm): they miss "
        "break-aways, so that limits and bounds are not those of a right model. A draft shows whether the footage can "
        "be used; for a verdict and for figures take preset standard.",
    ),
    FindingType(
        "widened", "uncertainty", WARNING, NONE,
        "The deviation of {input} is taken to be {factor:g} times as large, because of: {codes}.",
    ),
    FindingType(
        "slip", "uncertainty", WARNING, NONE,
        "A slip in campaign.yaml would explain the difference of {error_mm:.1f} mm RMS (in brackets what it leaves of "
        "it): {slips}. Check these keys.",
    ),
    FindingType("verdict", "compare", NOTE_OR_WARNING, NONE, "{statement}."),
    FindingType("statement", "compare", NOTE, NONE, "{off}. {model}. {visible}."),
    FindingType("campaign_verdict", "campaign", NOTE_OR_WARNING, NONE, "{sentence}"),
    FindingType(
        "footage_twice", "campaign", WARNING, NONE,
        "Runs {runs} show the same film, which counts more than once where all runs are taken together. Give each run "
        "its own video, or leave all but one out (left_out).",
    ),
    FindingType("runs_left_out", "campaign", WARNING, NONE, "Left out of the campaign: {runs}."),
    FindingType(
        "repeats", "campaign", NOTE, NONE,
        "Runs {runs} repeat one drive (measured paths at most {apart_mm:.1f} mm apart): the error common to all is "
        "{common_mm:.1f} mm RMS, and a run scatters by {scatter_mm:.1f} mm about it, of {u_val_mm:.1f} mm that the "
        "deviations allow.",
    ),
    FindingType(
        "repeats_apart", "campaign", WARNING, NONE,
        "Runs {runs} are no repeats of one drive: their measured paths are up to {apart_mm:.0f} mm apart (common error "
        "{common_mm:.1f} mm RMS, scatter {scatter_mm:.1f} mm, u_val {u_val_mm:.1f} mm). Correct repeats in "
        "campaign.yaml.",
    ),
    FindingType(
        "repeats_scatter", "campaign", WARNING, NONE,
        "Runs {runs} repeat one drive (measured paths at most {apart_mm:.1f} mm apart): the error common to all is "
        "{common_mm:.1f} mm RMS, but a run scatters by {scatter_mm:.1f} mm about it, where the deviations allow "
        "{u_val_mm:.1f} mm. An input changes from run to run; state its deviation, or what changed.",
    ),
    FindingType("explanation", "compare", NOTE, NONE, "{text}."),
    FindingType(
        "tolerance_default", "compare", NOTE, NONE,
        "No tolerance was stated, so {tolerance_mm:g} mm was used. State the error that matters to you, in metres: "
        "towval run CAMPAIGN --set compare.tolerance_m=..., or compare.tolerance_m in config.yaml.",
    ),
    FindingType(
        "changed_unseen", "compare", WARNING, EXCUSES,
        "Most of the difference came about between {first_s:.2f} and {last_s:.2f} s, where the object was not seen: "
        "there simulated minus measured changes by {moved_mm:.1f} mm and {turned_deg:.2f}°. Look at the film: somebody "
        "may have moved it.",
    ),
    FindingType(
        "compare_lost", "compare", WARNING, NONE,
        "{count} frames in which the object was not observed are left out of the comparison.",
    ),
    FindingType("compare_cut", "compare", WARNING, NONE, "{count} measured frames have no simulated counterpart."),
    FindingType(
        "identify_one_run", "identify", WARNING, NONE,
        "One run only: no other run is left for the identified values to predict.",
    ),
    FindingType(
        "identify_left_out", "identify", WARNING, NONE,
        "Run {run} was left out of the identification, because it cannot be judged: {reason}",
    ),
    FindingType("not_identifiable", "identify", WARNING, NONE, "Not identifiable: {names}; {reason}."),
    FindingType(
        "identify_misfit", "identify", (Severity.WARNING, Severity.NOTE), NONE,
        "The fitted inputs leave {misfit:.1f} deviations of the measurement (RMS), and {left:.1f} where the inputs "
        "that are not fitted are off as far as stated: {meaning}.",
    ),
)  # fmt: skip
