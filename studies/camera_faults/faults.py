"""All faults by name, with three strengths each, and the findings that name them: one line a fault."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studies.camera_faults import campaigns, light, optics, timing, unforeseen
from studies.camera_faults.film import Film

InFilm = Callable[[Film, float, np.random.Generator], Film]
InCampaign = Callable[[Path, dict[str, Any], float, np.random.Generator], None]
Encoding = Callable[[float, float], Mapping[str, str]]

SOUND_ENCODING: Mapping[str, str] = {"crf": "18", "preset": "veryfast"}


def _sound(_strength: float, _pixels: float) -> Mapping[str, str]:
    return SOUND_ENCODING


@dataclass(frozen=True)
class Fault:
    """One fault.

    ``strengths`` weakest first, in ``unit``; ``named_by`` are codes of findings that say what it is: where the poses
    are wrong, one of them has to be there. ``film`` plants it into the pictures, ``encoding`` into the encoder's
    options (of the strength and the number of pixels over that of 1920 × 1080), ``campaign`` into a copied folder.
    """

    name: str
    strengths: tuple[float, float, float]
    unit: str
    named_by: tuple[str, ...]
    film: InFilm | None = None
    encoding: Encoding = _sound
    campaign: InCampaign | None = None

    @property
    def refilmed(self) -> bool:
        """Whether the video is another."""
        return self.campaign is None or self.film is not None

    @property
    def is_none(self) -> bool:
        """Whether nothing is planted."""
        return self.film is None and self.campaign is None and self.encoding is _sound


def _crf(crf: float, _pixels: float) -> Mapping[str, str]:
    return {"crf": f"{crf:g}", "preset": "veryfast"}


def _rate(kbit: float, pixels: float) -> Mapping[str, str]:
    rate = f"{round(1000 * kbit * pixels**0.5)}"
    return {"b": rate, "maxrate": rate, "bufsize": rate, "preset": "veryfast", "threads": "1"}


def _mjpeg(q: float, _pixels: float) -> Mapping[str, str]:
    return {"codec": "mjpeg", "pixel_format": "yuvj420p", "qmin": f"{q:g}", "qmax": f"{q:g}"}


def _hevc(crf: float, _pixels: float) -> Mapping[str, str]:
    return {"codec": "libx265", "crf": f"{crf:g}", "preset": "ultrafast", "x265-params": "log-level=none:pools=1"}


_MOVED = ("camera_moved", "camera_moved_before", "camera_not_registered", "floor_not_recognised", "picture_warped")
_TIME = (
    "jumped",
    "stamps_contradicted",
    "stamps_uneven",
    "fields_apart",
    "pictures_invented",
    "pictures_repeated",
    "pictures_missing",
    "time_gap",
)
_CODED = (
    "low_texture",
    "texture_unsure",
    "picture_warped",
    "edges_unsure",
    "edges_not_found",
    "start_unsure",
    "not_seen",
)
_HIDDEN = ("not_seen", "camera_not_registered", "lookalike", "covered_at_start")
_SCALE = ("lengths_differ", "lengths_wrong", "board-size", "board-thickness", "held-differ")
_CLICKS = ("clicks_misfit", "clicks_corrected", "clicks_turned", "start_unsure", "tether_too_short", "edges_not_found")

FAULTS = (
    Fault("none", (1, 2, 3), "", ()),
    # Mount and lens
    Fault("creep", (2, 5, 10), "px", _MOVED, optics.creep),
    Fault("shake", (0.3, 1, 3), "px", _MOVED, optics.shake),
    Fault("zoom step", (0.3, 1, 3), "%", _MOVED, optics.zoom_step),
    Fault("breathing", (0.1, 0.5, 1), "%", _MOVED, optics.breathing),
    Fault("knock", (10, 25, 60), "px", _MOVED, optics.knock),
    Fault("rotation", (0.1, 0.5, 2), "°", _MOVED, optics.rotation),
    Fault("other zoom of video", (1, 3, 10), "%", (*_MOVED, *_SCALE), optics.other_zoom),
    Fault("mirrored video", (1, 2, 3), "", (*_MOVED, "video_upside_down"), optics.mirrored),
    Fault("jello", (0.3, 1, 3), "px", _MOVED, optics.jello),
    Fault("rolling shutter", (10, 20, 30), "ms", _MOVED, optics.rolling_shutter),
    Fault("defocus", (1.5, 3, 6), "px", _CODED, optics.defocus),
    Fault("focus hunting", (1.5, 3, 6), "px", (*_MOVED, *_CODED), optics.focus_hunting),
    Fault("motion blur", (20, 40, 80), "ms", _CODED, optics.motion_blur),
    # Sensor and processing
    Fault("noise", (5, 10, 20), "levels", _CODED, optics.noise),
    Fault("temporal denoising", (0.2, 0.5, 0.7), "", (*_CODED, "pictures_mixed"), optics.temporal_denoising),
    Fault("sharpening", (0.5, 1, 2), "", _CODED, optics.sharpening),
    Fault("dust, dead pixels", (10, 40, 160), "spots", (*_CODED, *_HIDDEN, *_MOVED), optics.dust),
    Fault("low resolution", (1.5, 2, 3), "×", _CODED, optics.low_resolution),
    Fault("tone curve", (0.8, 1.5, 2.2), "", _CODED, light.tone),
    Fault("colour range", (1, 2, 3), "", _CODED, light.colour_range),
    Fault("white balance", (10, 30, 60), "%", _CODED, light.white_balance),
    Fault("interlacing", (0.25, 0.5, 1), "pictures", (*_CODED, *_TIME), timing.interlaced),
    Fault("tearing", (10, 40, 70), "%", (*_CODED, *_TIME), timing.torn),
    Fault("HDR ghosts", (0.3, 0.6, 1), "", (*_CODED, *_TIME), unforeseen.hdr_ghosts),
    Fault("local tone mapping", (0.2, 0.5, 0.9), "", _CODED, unforeseen.local_tone),
    Fault("stabiliser drift", (3, 10, 40), "px", _MOVED, unforeseen.stabiliser),
    Fault("deinterlaced", (0, 0.5, 1), "pictures", (*_CODED, *_TIME, *_MOVED), unforeseen.deinterlaced),
    Fault("blended to another rate", (0.5, 1, 1.5), "pictures", (*_CODED, *_TIME), unforeseen.blended),
    Fault("lost slice", (0.3, 0.6, 1.5), "s", (*_CODED, *_TIME, *_MOVED), unforeseen.lost_slice),
    Fault("stretched video", (0.3, 1, 3), "%", (*_MOVED, *_SCALE), unforeseen.stretched),
    Fault("lens corrected in video", (0.3, 1, 3), "%", ("other_lens", *_MOVED, *_SCALE), unforeseen.lens_correction),
    Fault("white balance steps", (10, 30, 60), "%", _CODED, unforeseen.balance_steps),
    Fault("overexposed", (1.2, 1.6, 2.5), "×", _CODED, unforeseen.overexposed),
    Fault("replenished", (3, 6, 12), "levels", _CODED, unforeseen.replenished),
    Fault("double image", (0.1, 0.2, 0.4), "", _CODED, unforeseen.double_image),
    Fault("posterised", (32, 16, 8), "levels", _CODED, unforeseen.posterised),
    Fault("lines skipped", (1.3, 1.7, 2.5), "×", _CODED, unforeseen.lines_skipped),
    # Light and what is in the way
    Fault("flicker", (5, 15, 30), "%", _CODED, light.flicker),
    Fault("fine flicker", (5, 15, 30), "%", _CODED, light.fine_flicker),
    Fault("exposure steps", (10, 30, 50), "%", _CODED, light.exposure_steps),
    Fault("glint in the way", (1, 3, 6), "%", _HIDDEN, light.glint),
    Fault("glint at the start", (1, 3, 6), "%", _HIDDEN, light.glint_at_start),
    Fault("shadow", (20, 40, 60), "%", _HIDDEN, light.shadow),
    Fault("person", (4, 8, 16), "%", _HIDDEN, light.person),
    Fault("banner", (3, 6, 12), "%", _HIDDEN, light.banner),
    Fault("clock", (2, 4, 8), "%", _HIDDEN, light.clock),
    Fault("sun patch", (30, 60, 120), "%", (*_HIDDEN, *_CODED), unforeseen.sun_patch),
    Fault("hanging cable", (4, 10, 25), "px", (*_HIDDEN, *_CODED), unforeseen.cable),
    Fault("drop on the lens", (2, 5, 15), "%", (*_CODED, *_HIDDEN, *_MOVED), unforeseen.drop),
    Fault("pointer", (20, 40, 80), "px", (*_HIDDEN, *_CODED), unforeseen.pointer),
    Fault("insect", (1, 2, 4), "%", (*_HIDDEN, *_CODED), unforeseen.insect),
    Fault("hood slips", (10, 20, 40), "%", _HIDDEN, unforeseen.hood),
    Fault("twin standing by", (1, 2, 3), "", (*_HIDDEN, *_CLICKS), unforeseen.twin),
    Fault("board kicked", (1, 2, 3), "", _MOVED, unforeseen.kicked_board),
    Fault("warm air", (0.2, 0.5, 1.5), "px", _MOVED, unforeseen.haze),
    # Time
    Fault("dropped", (1, 5, 15), "%", _TIME, timing.dropped),
    Fault("lost regularly", (8, 6, 3), "th", _TIME, timing.lost_regularly),
    Fault("repeated", (2, 10, 33), "%", _TIME, timing.repeated),
    Fault("wrong rate", (1, 4, 20), "%", ("rate_contradicted",), timing.wrong_rate),
    Fault("wrong rate, none stated", (1, 4, 20), "%", ("rate_contradicted", "rate_unusual", "rate_unconfirmed"),
          timing.wrong_rate, campaign=campaigns.rate_not_stated),
    Fault("jitter", (2, 5, 10), "ms", _TIME, timing.jitter),
    Fault("variable rate", (5, 15, 40), "%", _TIME, timing.variable_rate),
    Fault("bursts of stamps", (2, 5, 10), "pictures", _TIME, timing.bursts),
    Fault("frozen", (0.3, 1, 2), "s", (*_TIME, "not_seen"), timing.frozen),
    Fault("frozen to the end", (0.3, 1, 2), "s", (*_TIME, "not_seen"), timing.frozen_to_the_end),
    Fault("clips joined", (1, 3, 10), "pictures", _TIME, timing.joined),
    Fault("clips overlap", (-1, -3, -10), "pictures", _TIME, timing.joined),
    Fault("clock set", (20, 100, 500), "ms", _TIME, timing.clock_set),
    Fault("slower in low light", (2, 8, 20), "%", (*_TIME, "rate_contradicted"), timing.slower_in_low_light),
    Fault("stamps rounded", (10, 25, 35), "ms", _TIME, timing.rounded_stamps),
    Fault("fields swapped", (0.25, 0.5, 1), "pictures", (*_CODED, *_TIME), timing.fields_swapped),
    Fault("pictures invented", (1, 3, 7), "a picture", (*_CODED, *_TIME), timing.invented),
    # Coding
    Fault("H.264, crf", (33, 38, 44), "", _CODED, encoding=_crf),
    Fault("H.264, capped", (700, 300, 150), "kbit/s", _CODED, encoding=_rate),
    Fault("MJPEG, q", (8, 16, 31), "", _CODED, encoding=_mjpeg),
    Fault("HEVC, crf", (28, 36, 44), "", _CODED, encoding=_hevc),
    Fault("pulsing groups of pictures", (28, 33, 38), "", _CODED, encoding=unforeseen.pulsing),
    # Board and campaign
    Fault("board smaller", (0.3, 1, 3), "%", _SCALE, campaign=campaigns.board_size),
    Fault("board stretched", (0.3, 1, 3), "%", (*_SCALE, "board-stretched"), campaign=campaigns.stretched_print),
    Fault("bumped after the first floor", (3, 10, 30), "px", (*_MOVED, "floor-turned"),
          campaign=campaigns.bumped_after_first),
    Fault("board thinner", (1, 3, 10), "mm", _SCALE, campaign=campaigns.board_thickness),
    Fault("tops smaller", (0.3, 1, 3), "%", _SCALE, campaign=campaigns.top_size),
    Fault("other zoom of held boards", (1, 3, 10), "%", (*_SCALE, "held-flipped"), campaign=campaigns.held_zoom),
    Fault("other zoom of every second", (1, 3, 10), "%", _SCALE, campaign=campaigns.some_held_zoom),
    Fault("other crop of held boards", (2, 5, 15), "%", _SCALE, campaign=campaigns.held_crop),
    Fault("other zoom of all boards", (1, 3, 10), "%", (*_MOVED, *_SCALE), campaign=campaigns.set_zoom),
    Fault("held boards mirrored", (1, 2, 3), "", ("held-flipped", "held-differ"), campaign=campaigns.held_mirrored),
    Fault("every second mirrored", (1, 2, 3), "", ("held-flipped",), campaign=campaigns.some_held_flipped),
    Fault("held boards skewed", (1, 3, 10), "px", ("view-dropped", "halves-disagree"), campaign=campaigns.held_skew),
    Fault("boards blurred", (5, 10, 20), "px", ("views-blurred", "view-dropped"), campaign=campaigns.blurred_boards),
    Fault("boards compressed", (50, 20, 5), "quality", ("views-blurred", "view-dropped"),
          campaign=campaigns.compressed_boards),
    Fault("fewer boards", (8, 5, 3), "left", ("few-views", "focal-length-uncertain", "centre-only", "no-tilt"),
          campaign=campaigns.fewer_boards),
    Fault("corners miscounted", (1, 2, 3), "", ("view-dropped",), campaign=campaigns.corner_count),
    Fault("clicks shifted", (10, 25, 40), "px", _CLICKS, campaign=campaigns.shifted_clicks),
    Fault("one corner clicked wrong", (10, 25, 40), "px", _CLICKS, campaign=campaigns.corner_clicked_wrong),
    Fault("clicks half a turn off", (1, 2, 3), "", _CLICKS, campaign=campaigns.turned_clicks),
)  # fmt: skip
