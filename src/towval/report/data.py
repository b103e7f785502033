"""What a report is made of: the data that :func:`towval.report.page.write_report` takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from towval.model import Calibration, Finding, Identification, UncertaintyMap
from towval.model.errors import InputError
from towval.model.run_record import RunRecord


@dataclass(frozen=True)
class ReportSettings:
    """Keys of ``config["report"]``: ``overlay_width_px``, the largest width of the overlay videos [px]."""

    overlay_width_px: int = 960

    def __post_init__(self) -> None:
        if not 160 <= self.overlay_width_px <= 7680:
            raise InputError(
                "report.overlay_width_px is out of range", got=self.overlay_width_px, allowed="160 to 7680"
            )


@dataclass(frozen=True)
class InputRow:
    """A quantity that the simulation was given: what it is, its value in words, its deviation and where it is from.

    ``value`` and ``std`` carry no unit; an ``std`` that nobody gave is empty.
    """

    name: str
    value: str
    unit: str = ""
    std: str = ""
    source: str = ""


@dataclass(frozen=True)
class StageFinding:
    """A finding of a stage whose result holds none itself, such as ``campaign``.

    ``run`` is empty where it concerns all runs.
    """

    stage: str
    finding: Finding
    run: str = ""


@dataclass(frozen=True)
class Provenance:
    """Where the results come from: enough to get them again.

    ``command`` the line that made them; ``versions`` of programs by name; ``input_hashes`` SHA-256 by file;
    ``configuration`` the campaign's description as text; ``settings`` what each stage was set to, by stage and runs.
    """

    command: str
    versions: Mapping[str, str] = field(default_factory=dict)
    input_hashes: Mapping[str, str] = field(default_factory=dict)
    configuration: str = ""
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RunReport:
    """One run of the report: what is known of it and its overlay video, if there is one."""

    record: RunRecord
    overlay: FilePath | None = None


@dataclass(frozen=True)
class ReportData:
    """What a report is made of; parts that are left out are left out of the page, too.

    ``calibration`` and ``uncertainty`` are those of the campaign; ``findings`` those that no typed result carries.
    Findings of the calibration, the tracks, the simulation and the comparison are collected from them.
    """

    campaign: str
    runs: tuple[RunReport, ...]
    provenance: Provenance
    calibration: Calibration | None = None
    uncertainty: UncertaintyMap | None = None
    inputs: tuple[InputRow, ...] = ()
    findings: tuple[StageFinding, ...] = ()
    identification: Identification | None = None
