"""The rows of the table of findings about the times of a video's pictures."""

from towval.model.findings import NONE, NOT_JUDGED, NOTE, WARNING, Consequence, FindingType, register

register(  # track
    FindingType(
        "pictures_missing", "track", NOTE, NONE,
        "By the stamps {count} pictures are missing (longest step {gap_s:.2f} s).",
    ),
    FindingType(
        "time_gap", "track", WARNING, NOT_JUDGED,
        "Between two pictures, at {time_s:.2f} s, the stamps leave a gap of {gap_s:.1f} s: what moved meanwhile was "
        "not seen. Cut the video there.",
    ),
    FindingType(
        "pictures_repeated", "track", WARNING, NONE,
        "{count} pictures repeat the one before (first at {time_s:.2f} s) and are left out: the camera or a converter "
        "filled up what it had lost.",
    ),
    FindingType(
        "stamps_contradicted", "track", WARNING, NOT_JUDGED,
        "At {count} pictures, between {first_s:.2f} s and {last_s:.2f} s, all bodies jump by the same share of a step: "
        "pictures were lost or repeated and the stamps written as if none were. The times of the run are unknown; use "
        "the camera's original file.",
    ),
    FindingType(
        "stamps_uneven", "track", WARNING, Consequence(widens=("tracking",)),
        "All bodies hurry and lag together by {jitter_ms:.1f} ms a picture: the stamps are less even than the "
        "exposures or hide that these are uneven. Use the camera's original file.",
    ),
    FindingType(
        "rate_contradicted", "track", WARNING, NOT_JUDGED,
        "The stamps give {found_hz:.2f} pictures a second, but {other}: the time scale of the run is unknown. Use the "
        "camera's original file, or correct camera.fps.",
    ),
    FindingType(
        "rate_unusual", "track", WARNING, NOT_JUDGED,
        "By the stamps there are {found_hz:.2f} pictures a second, a rate at which no camera films, and neither "
        "camera.fps nor a sound track confirms it: all speeds hang on it. State camera.fps.",
    ),
)  # fmt: skip
