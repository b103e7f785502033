"""The rows of the table of findings about the simulation: of the stages decimate and simulate, and of the physics."""

from towval.model.findings import (
    EXCUSES,
    NONE,
    NOT_JUDGED,
    NOTE,
    NOTE_OR_WARNING,
    WARNING,
    WIDENS_TRACKING,
    Consequence,
    FindingType,
    register,
)

_ENDED = "The simulation ended with: {outcome}, at {time_s:.3f} s. {advice}"

register(  # decimate
    FindingType("decimated", "decimate", NOTE, NONE, "{body}: {kept} of {frames} tracked poses kept."),
    FindingType(
        "decimate_outlier", "decimate", WARNING, WIDENS_TRACKING,
        "{body}: at {time_s:.2f} s the measured pose is {deviations:.1f} deviations off the smoothed track; look at "
        "that frame of the film.",
    ),
    FindingType(
        "decimate_bridged", "decimate", WARNING, WIDENS_TRACKING,
        "{body}: {count} frames were not observed; the smoothed track bridges them (longest gap {gap_s:.2f} s).",
    ),
    FindingType(
        "bridge_unsure", "decimate", WARNING, NOT_JUDGED,
        "The rover was not observed for {gap_s:.1f} s from {time_s:.2f} s on, while its speed or turning changed: it, "
        "or the tether's hinge, may have been {off_mm:.0f} mm ahead of or behind the curve that bridges the gap and "
        "drives the simulation. Film it all along, or cut the video there.",
    ),
    FindingType(
        "pictures_sparse", "decimate", WARNING, EXCUSES,
        "From one picture to the next, {gap_s:.2f} s later, the rover changes its speed or turning so much, most at "
        "{time_s:.2f} s, that it, or the tether's hinge, may have been {off_mm:.0f} mm ahead of or behind the curve "
        "that drives the simulation. Film more pictures a second, or let the rover start and stop more slowly.",
    ),
)  # fmt: skip
register(  # simulate; those from slack_all_along on are of towval.physics
    FindingType("rung", "simulate", NOTE_OR_WARNING, NONE, "Model: {rung}; {changes} (allowed: {allowed_mm:.2f} mm)."),
    FindingType(
        "numerical_error", "simulate", WARNING, NONE,
        "A hundred times tighter tolerance moves the path by {u_num_mm:.2f} mm (allowed: {allowed_mm:.2f} mm). Set a "
        "smaller simulate.tolerance_m.",
    ),
    FindingType(
        "creep", "simulate", NOTE_OR_WARNING, NONE,
        "The object creeps {crept_mm:.1f} mm in total at speeds below the stiction velocity, {parked_mm:.1f} mm of it "
        "while the rover stands, where a real one would stick now and then: that much of its path depends on "
        "friction.stiction_velocity_m_per_s. With simulate.sticking: true it stays.",
    ),
    FindingType("simulate_outcome", "simulate", WARNING, NOT_JUDGED, "{outcome}: {advice}"),
    FindingType(
        "friction_law", "simulate", WARNING, Consequence(widens=("friction",)),
        "The friction law misses the stated coefficients by up to {percent:.1f} %. Take another friction.law: makkar "
        "has both, coulomb the kinetic one alone.",
    ),
    FindingType(
        "simulate_cut", "simulate", WARNING, NONE,
        "{count} frames lie outside the rover's track and are not simulated.",
    ),
    FindingType(
        "taut_start", "simulate", WARNING, NOT_JUDGED,
        "At the start the tether is {longer_mm:.0f} mm longer than friction could hold: check tether.rest_length_m, "
        "hinge and anchor.",
    ),
    FindingType(
        "start_nearer", "simulate", NOTE_OR_WARNING, NONE,
        "By the stated lengths the tether would pull the object at rest with more than friction holds: it starts "
        "{nearer_mm:.1f} mm nearer to the rover than measured. Check tether.rest_length_m, hinge and anchor.",
    ),
    FindingType(
        "moving_start", "simulate", WARNING, NOT_JUDGED,
        "The object moves in the first picture, at {speed_mm_per_s:.0f} mm/s; the simulation starts it from rest, "
        "which leads its path off by up to {off_mm:.0f} mm. Begin the video while all bodies rest.",
    ),
    FindingType(
        "moved_while_slack", "simulate", WARNING, NOT_JUDGED,
        "Between {first_s:.1f} s and {last_s:.1f} s the object moved by {moved_mm:.0f} mm, farther than it coasts, "
        "while its tether was slack ({length_m:.3f} m of {rest_m:.3f} m): something else moved it. See on the video "
        "what touched it: the rover, a hand, a cable. If nothing did, check tether.rest_length_m, hinge and anchor, "
        "and state the heights of both: a tether that rises is longer than it looks from above.",
    ),
    FindingType(
        "tether_across", "simulate", NOTE_OR_WARNING, NOT_JUDGED,
        "From {first_s:.1f} s on, for {percent:.0f} % of the time, the taut tether would pass through the object, "
        "along up to {chord_mm:.0f} mm, while this moves by {moved_mm:.0f} mm: a real one bears on an edge or winds "
        "round it, which the model leaves out. See on the video where it lies; if it runs above the top, state "
        "object.tether_anchor_height_m.",
    ),
    FindingType(
        "tether_on_floor", "simulate", WARNING, NONE,
        "For {percent:.0f} % of the time the tether would hang {depth_mm:.0f} mm below the floor: there it lies on the "
        "floor, which the model of a hanging tether leaves out.",
    ),
    *(
        FindingType(name, "simulate", WARNING, NOT_JUDGED, _ENDED)
        for name in ("slack_all_along", "step_limit", "step_too_small", "not_finite", "tips_over", "lifted")
    ),
    FindingType(
        "not_balanced", "simulate", WARNING, NOT_JUDGED,
        "At {count} steps of the rung '{rung}' no balance was found; the previous twist was kept.",
    ),
    FindingType(
        "open_loop", "simulate", WARNING, NONE,
        "{percent:.1f} % more force moves the object by up to {apart_mm:.3g} mm: a force given over time does not "
        "determine its path. Prescribe the path of the hinge instead.",
    ),
)  # fmt: skip
