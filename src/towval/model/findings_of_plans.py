"""The rows of the table of findings about plans: the commands plan and tow."""

from towval.model.findings import NONE, NOTE, WARNING, FindingType, register

register(  # plan and tow
    FindingType(
        "root_lost", "plan", WARNING, NONE,
        "No heading rate balances the moment about the anchor at {count} of {total} times, first at {time_s:.3f} s; "
        "up to {moment_Nm:.3g} N m are left over. The tracked point cannot be drawn along this path from this "
        "anchor; move the point towards the anchor.",
    ),
    FindingType(
        "root_jumped", "plan", WARNING, NONE,
        "The heading rate jumped at {count} times, first at {time_s:.3f} s: the root nearest to the previous one was "
        "taken.",
    ),
    FindingType(
        "cable_would_push", "plan", WARNING, NONE,
        "At {count} of {total} times, first at {time_s:.3f} s, the force at the anchor points into the object: the "
        "cable would have to push, or lie across the object. Smooth the path or move the anchor.",
    ),
    FindingType(
        "path_not_followed", "plan", WARNING, NONE,
        "The hinge arrives but is {rms_mm:.0f} mm RMS off its path, more than {factor:g} times the arrival distance "
        "of {arrival_mm:.0f} mm: it cuts corners or swings. Use a smaller threshold, a shorter look-ahead or a path "
        "that bends less.",
    ),
    FindingType(
        "threshold_exceeds_path", "plan", WARNING, NONE,
        "The threshold d_t, {threshold_m:g} m, is longer than the path, {length_m:.3g} m: the rover drives straight "
        "for the end and does not follow what lies between. Use a smaller threshold.",
    ),
    FindingType(
        "look_ahead_exceeds_path", "plan", WARNING, NONE,
        "The orientation look-ahead, {look_ahead:g} steps, is longer than the path, {steps} steps: the planned "
        "heading is an average over the whole path. Use a shorter look-ahead.",
    ),
    FindingType(
        "path_too_tight", "plan", NOTE, NONE,
        "The path of the hinge bends with a radius of {radius_m:.3g} m, tighter than the rover's tightest turn of "
        "{tightest_m:.3g} m: the rover follows only by turning its body less than the path turns.",
    ),
    FindingType(
        "tow_gap", "plan", WARNING, NONE,
        "The recording has no pose of the rover for {gap_s:.1f} s from {time_s:.2f} s on, while its speed changed: the "
        "tether's hinge may have been {off_mm:.0f} mm ahead of or behind the curve that bridges the gap and draws the "
        "object.",
    ),
)  # fmt: skip
