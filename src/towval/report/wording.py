"""Numbers as text for figures and report: units, digits, and "not computed" for missing values."""

import math

from towval.model.statement import rounded_up

NOT_COMPUTED = "not computed"
NOT_JUDGED = "none: not judged"

_UNITS = {"px": "px", "px2": "px²", "mm": "mm", "m": "m", "deg": "°", "rad": "rad", "s": "s", "N": "N"}


def decimal(value: float) -> str:
    """A number with one decimal from 10 on, two from 0.1 on, two significant digits below that; 0 below a millionth."""
    if not math.isfinite(value):
        return NOT_COMPUTED
    if 0 < abs(value) < 1e-6:
        return "0"
    if abs(value) >= 0.1 or value == 0:
        return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"
    exponent = int(f"{value:.1e}".partition("e")[2])
    return f"{value:.{1 - exponent}f}"


def millimetres(value_m: float) -> str:
    """A length in mm."""
    return f"{decimal(1e3 * value_m)} mm" if math.isfinite(value_m) else NOT_COMPUTED


def at_most(value_m: float) -> str:
    """A bound in mm, rounded up: what is cited holds. From 1 mm on it has one decimal, as in a verdict's sentences."""
    return _bound(1e3 * value_m, " mm", 1 if value_m >= 1e-3 else None)


def at_most_degrees(value_rad: float) -> str:
    """A bound of an angle in degrees, rounded up like :func:`at_most`."""
    return _bound(math.degrees(value_rad), "°")


def _bound(value: float, unit: str, decimals: int | None = None) -> str:
    text = decimal(value)
    digits = len(text.partition(".")[2]) if decimals is None else decimals
    return f"{rounded_up(value, digits):.{digits}f}{unit}" if math.isfinite(value) else text


def signed(value: float) -> str:
    """A number with its sign and two decimals."""
    # Adding zero removes the sign of -0.
    return f"{round(value, 2) + 0.0:+.2f}".replace("-", "−")


def degrees(value_rad: float) -> str:
    """An angle in degrees."""
    return f"{decimal(math.degrees(value_rad))}°" if math.isfinite(value_rad) else NOT_COMPUTED


def _plain_number(value: float) -> str:
    """A count unchanged; other numbers with decimals, or to two significant digits from 1000 on."""
    if float(value).is_integer():
        return f"{value:.0f}"
    return f"{float(f'{value:.1e}'):.0f}" if abs(value) >= 1000 else decimal(value)


def named_scalar(name: str, value: float) -> tuple[str, str]:
    """Label, and value with its unit, of a scalar whose key ends with the unit (``rms_mm at 0.25 m``).

    The key is words joined by underscores, the last one a unit, ``share`` or neither; `` at`` and a place may follow.
    Shares are in percent, counts without decimals.
    """
    stem, at, place = name.partition(" at ")
    words = stem.split("_")
    unit = _UNITS[words.pop()] if words[-1] in _UNITS else ""
    if not math.isfinite(value):
        text = NOT_COMPUTED
    elif unit == "m" and abs(value) < 0.1:
        text = millimetres(value)
    elif unit:
        text = decimal(value) + ("" if unit == "°" else " ") + unit
    elif words[-1] == "share":
        text = f"{100 * value:.0f} %"
    else:
        text = _plain_number(value)
    return " ".join(words) + at + place, text
