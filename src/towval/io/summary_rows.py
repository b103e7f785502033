"""Reads ``summary.csv`` without pandas, whose import takes as long as all else that `towval run` does itself."""

import csv
import io
from pathlib import Path

_TEXTS = ("run", "verdict")


def read_summary(path: Path) -> dict[str, dict[str, str | float]]:
    """Rows of a campaign's summary by run, by column, but for the findings; NaN where a cell is empty."""
    rows = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))
    return {
        row["run"]: {key: text if key in _TEXTS else _number(text) for key, text in row.items() if key != "findings"}
        for row in rows
    }


def _number(text: str) -> float:
    return int(text) if text.isdigit() else float(text or "nan")
