"""The rows of the table of findings about a video: its camera, its coding, the times of its pictures."""

from towval.model.findings import (
    EXCUSES,
    NONE,
    NOT_JUDGED,
    NOTE,
    WARNING,
    WIDENS_CAMERA,
    WIDENS_TRACKING,
    FindingType,
    register,
)

register(  # track
    FindingType(
        "texture_unsure", "track", WARNING, WIDENS_TRACKING,
        "Texture and outline of the top of {name} disagree by {std_mm:.1f} mm: compression, focus, or something in the "
        "way. The texture's poses are used; the difference is added to their deviations. Film at a higher bit rate, "
        "with the focus fixed.",
    ),
    FindingType(
        "edges_alone", "track", WARNING, NONE,
        "The texture of the top of {name} did not hold its place in {count} of {frames} pictures: compression, or too "
        "plain a top. Its edges say where it was, and their deviations are stated there. Film at a higher bit rate, or "
        "with a pattern of strong contrast on the top.",
    ),
    FindingType(
        "focus_changed", "track", NOTE, NONE,
        "The top of {name} is less sharp than in the first picture, by a blur of up to {blur_px:.1f} px: focus or "
        "compression. The poses account for it. Lock the focus, or film at a higher bit rate.",
    ),
    FindingType(
        "pictures_mixed", "track", WARNING, WIDENS_TRACKING,
        "Each picture keeps {percent:.0f} % or more of the one before: noise reduction over time, or a codec short of "
        "bits. Poses lag by up to {late_ms:.0f} ms, slow bodies most; the lag is added to their deviations. Switch "
        "noise reduction off, and film at a higher bit rate.",
    ),
    FindingType(
        "fields_apart", "track", WARNING, WIDENS_TRACKING,
        "Every second row of a picture was taken {apart_ms:.0f} ms before or after the others: interlaced video, or a "
        "sensor that exposes them apart. Poses may be those of either; half of it is added to their deviations. Film "
        "progressively, or make a picture of each field.",
    ),
    FindingType(
        "floor_moved", "track", WARNING, NOT_JUDGED,
        "From {time_s:.2f} s on the floor is displaced in the picture, by {by_mm:.0f} mm where the bodies are, but the "
        "bodies are not: the floor moved under them (a mat, a carpet), or light on it did, and not the camera. Poses "
        "are relative to it. Fix the floor and film again.",
    ),
    FindingType(
        "top_lifted", "track", WARNING, NOT_JUDGED,
        "The size of the top of {name} about {time_s:.2f} s is {percent:+.1f} % off that in the rest of the run, as if "
        "it were {by_mm:.0f} mm higher or lower: it was lifted, or it climbed on something. Its poses then are not on "
        "the floor, and no model of a tow moves it so.",
    ),
    FindingType(
        "picture_warped", "track", WARNING, WIDENS_TRACKING,
        "Places {place} are displaced against each other by {scattered_px:.2f} px: a camera that shakes while it reads "
        "its rows, compression, or a drop on the lens. This is added to the deviations of the poses. Damp the mount, "
        "clean the lens, and film at a higher bit rate.",
    ),
    FindingType(
        "camera_moved", "track", NOTE, NONE,
        "The camera moved: the floor is displaced by up to {shift_px:.1f} px, from {time_s:.2f} s on. The poses are "
        "corrected by it (deviation of the correction {std_px:.2f} px).",
    ),
    FindingType(
        "camera_moved_before", "track", NOTE, NONE,
        "The camera moved between the pictures of the floor and the video: the floor is displaced by {shift_px:.1f} "
        "px. The poses are corrected by it (deviation of the correction {std_px:.2f} px).",
    ),
    FindingType(
        "other_lens", "track", WARNING, WIDENS_CAMERA,
        "The video's lens is not that of the pictures of the floor: at the corners it shows the floor "
        "{corner_px:+.1f} px farther out (deviation {std_px:.1f} px). The poses are corrected by it. Take pictures and "
        "videos in one mode of the camera, its lens correction on in both or in neither.",
    ),
    FindingType(
        "camera_moved_between", "track", WARNING, WIDENS_CAMERA,
        "The camera moved, or its zoom changed, between the pictures of the floor: in {names} the floor is displaced "
        "by up to {shift_px:.1f} px against {first}. The poses are referred to {first}, which holds the floor frame; "
        "but the plane of the floor rests on all of them. Fix the camera, and photograph the floor board anew in all "
        "its places.",
    ),
    FindingType(
        "floor_not_recognised", "track", WARNING, NOT_JUDGED,
        "The floor of the video's first picture is found in {found} of {pictures} pictures of the floor: camera or "
        "zoom changed since the calibration, or the floor did, or compression took the floor's grain from the video. "
        "Poses may be off by any amount; film at a higher bit rate, or photograph the floor board again with the "
        "camera as it films.",
    ),
    FindingType(
        "floor_too_plain", "track", WARNING, NONE,
        "The floor shows too little texture to tell whether the camera moved since the pictures of the floor were "
        "taken: these are not recognised in one another either. Poses are right only if it stood still; before the "
        "next calibration, put marks on the floor, such as crosses of tape.",
    ),
    FindingType(
        "video_upside_down", "track", WARNING, NOT_JUDGED,
        "The video shows the floor turned by 180° against the pictures of the floor, and cannot be used turned back. "
        "Poses are wrong; turn the pixels of the video, or photograph the floor board again with the camera as it "
        "films.",
    ),
    FindingType(
        "video_turned", "track", NOTE, NONE,
        "The video was turned by {degrees}° counter-clockwise against how players show it, so that it lies as the "
        "pictures of the calibration do. Tags for rotation do not tell how the camera hung. Pixels of the first frame "
        "count in the picture thus turned, which check/start.html shows.",
    ),
    FindingType(
        "camera_not_registered", "track", WARNING, NOT_JUDGED,
        "In {percent:.1f} % of the pictures the floor could not be found again (longest time {gap_s:.2f} s, from "
        "{time_s:.2f} s on): the camera moved too far, or the floor was hidden, or compression changed what a faint "
        "floor looks like. Poses there are not known; fix the camera, and film again at a higher bit rate.",
    ),
    FindingType(
        "camera_not_watched", "track", NOTE, NONE,
        "The floor shows too little texture to detect a motion of the camera. Poses are right only if it stood still.",
    ),
    FindingType(
        "jumped", "track", WARNING, NOT_JUDGED,
        "{name} jumps {count} times from one picture that shows it to the next, by up to {by_mm:.0f} mm, first at "
        "{time_s:.2f} s: more than wheels or a tether can make it. Either a part of the picture stood still before "
        "(lost packets), or pictures were lost, cut out (joined takes) or left out (a time lapse), or something else "
        "was taken for {name}. Look at the video there, and use it up to there or record it again.",
    ),
    FindingType(
        "pictures_missing", "track", NOTE, NONE,
        "According to the time stamps {count} pictures are missing (longest step {gap_s:.2f} s).",
    ),
    FindingType(
        "time_gap", "track", WARNING, NOT_JUDGED,
        "Between two pictures, at {time_s:.2f} s, the stamps leave a gap of {gap_s:.1f} s: what moved meanwhile was "
        "not seen. Cut the video there.",
    ),
    FindingType(
        "pictures_repeated", "track", WARNING, NONE,
        "{count} pictures repeat the one before (first at {time_s:.2f} s) and are left out: the camera or a converter "
        "filled up what it had lost, or the picture froze.",
    ),
    FindingType(
        "stamps_contradicted", "track", WARNING, NOT_JUDGED,
        "At {count} pictures, between {first_s:.2f} s and {last_s:.2f} s, all bodies jump by the same share of a step: "
        "pictures were lost or repeated and the stamps written as if none were. The times of the run are unknown; use "
        "the camera's original file.",
    ),
    FindingType(
        "stamps_uneven", "track", WARNING, WIDENS_TRACKING,
        "All bodies run ahead and lag together, by {jitter_ms:.1f} ms from picture to picture: the time stamps do not "
        "say when the pictures were taken. Use the camera's original file.",
    ),
    FindingType(
        "pictures_invented", "track", WARNING, WIDENS_TRACKING,
        "All bodies move in straight lines over {period} pictures at a time: those between were made up by smooth "
        "playback or by a converter to another frame rate. How far the bodies may have strayed from these lines is "
        "added to the deviations of the poses. Use the camera's original file.",
    ),
    FindingType(
        "rate_contradicted", "track", WARNING, NOT_JUDGED,
        "The time stamps give {found_hz:.2f} pictures a second, but {other}: the time scale of the run is unknown. Use "
        "the camera's original file, or correct camera.fps.",
    ),
    FindingType(
        "rate_unusual", "track", WARNING, NOT_JUDGED,
        "The time stamps give {found_hz:.2f} pictures a second, an unusual rate for a camera, and neither "
        "camera.fps nor a sound track confirms it. All speeds depend on it: state camera.fps.",
    ),
    FindingType(
        "rate_divided", "track", WARNING, EXCUSES,
        "camera.fps, {stated_hz:g}, is {times} times the {found_hz:.2f} pictures a second of the time stamps, and no "
        "sound track confirms these: either one picture in {times} was kept, or this is slow motion and all speeds are "
        "{times} times too low. Use the camera's original file; where one in {times} was kept, state "
        "camera.fps: {found_hz:.4g}.",
    ),
    FindingType(
        "rate_unconfirmed", "track", WARNING, EXCUSES,
        "Neither camera.fps nor a sound track confirms the {found_hz:.2f} pictures a second of the time stamps. If a "
        "video was filmed at 24 and stamped as 25, all speeds are 4 % too high. State camera.fps.",
    ),
)  # fmt: skip
