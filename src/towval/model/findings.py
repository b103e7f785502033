"""What a stage says about itself in words."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Severity(enum.StrEnum):
    """How much a :class:`Finding` should worry its reader."""

    NOTE = "note"
    WARNING = "warning"
    REFUSAL = "refusal"


@dataclass(frozen=True)
class Finding:
    """Something a stage noticed about its input or its result, in words.

    ``code`` is a short stable name for tests and tables, ``text`` a full sentence with numbers and what to do.
    """

    severity: Severity
    code: str
    text: str
