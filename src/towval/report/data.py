"""Data of a report, the argument of :func:`towval.report.page.write_report`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from towval.model import Calibration, Finding, Identification, UncertaintyMap
from towval.model.checks import within
from towval.model.errors import InputError
from towval.model.repeats import Corridor
from towval.model.run_record import RunRecord

FORMATS = ("pdf", "svg", "png")
"""Formats in which figures can be saved, beside the page."""

# Browsers hold a page as one string of at most 512 MB.
_MOST_MB = 400


@dataclass(frozen=True)
class ReportSettings:
    """Keys of ``config["report"]``.

    ``overlay_width_px`` is the largest width of the overlay videos [px]; films of more than ``embed_mb`` [MB] in all
    are linked. Each figure is saved in the ``formats``, of :data:`FORMATS`.
    """

    overlay_width_px: int = 960
    embed_mb: float = 60.0
    formats: tuple[str, ...] = FORMATS

    def __post_init__(self) -> None:
        object.__setattr__(self, "formats", tuple(self.formats))
        if not set(self.formats) <= set(FORMATS) or len(set(self.formats)) < len(self.formats):
            raise InputError(
                "report.formats is out of range", got=list(self.formats), allowed=f"of {', '.join(FORMATS)}, each once"
            )
        within(self, "report", overlay_width_px=(160, 7680), embed_mb=(0, _MOST_MB))


@dataclass(frozen=True)
class InputRow:
    """An input of the simulation: name, value and standard deviation as text without unit, unit, and source.

    ``std`` is empty where the input is taken as exact.
    """

    name: str
    value: str
    unit: str = ""
    std: str = ""
    source: str = ""


@dataclass(frozen=True)
class Provenance:
    """Origin of the results.

    ``command`` reproduces them; ``versions`` of programs by name; ``input_hashes`` SHA-256 by file; ``configuration``
    is the campaign's description as text; ``settings`` those of each stage, by stage and runs.
    """

    command: str
    versions: Mapping[str, str] = field(default_factory=dict)
    input_hashes: Mapping[str, str] = field(default_factory=dict)
    configuration: str = ""
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RunReport:
    """A run of the report and its footage, if any; ``damaged`` allows showing the intact part of damaged footage."""

    record: RunRecord
    film: FilePath | None = None
    damaged: bool = False


@dataclass(frozen=True)
class ReportData:
    """All data of a report; the page leaves out the sections of parts that are missing.

    ``calibration`` and ``uncertainty`` are those of the campaign; ``repeats`` of groups of runs. ``findings`` are those
    of the whole campaign; others come from the results. Films of more than ``embed_mb`` [MB] in all are linked, and
    figures saved in the ``formats``.
    """

    campaign: str
    runs: tuple[RunReport, ...]
    provenance: Provenance
    calibration: Calibration | None = None
    uncertainty: UncertaintyMap | None = None
    inputs: tuple[InputRow, ...] = ()
    findings: tuple[Finding, ...] = ()
    identification: Identification | None = None
    repeats: tuple[Corridor, ...] = ()
    embed_mb: float = ReportSettings.embed_mb
    formats: tuple[str, ...] = FORMATS

    @property
    def records(self) -> tuple[RunRecord, ...]:
        """The runs without their videos."""
        return tuple(run.record for run in self.runs)
