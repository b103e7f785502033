"""Results as pandas tables, with units in the names of the columns; what :func:`towval.load` returns."""

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from towval.io.chain import check_together, read_origin
from towval.io.records import read_calibration, read_comparison, read_simulated, read_tracks, read_uncertainty
from towval.io.results_index import current_runs
from towval.io.summary import summary_table
from towval.model import Array, Finding, TrackStatus
from towval.model.checks import instance_of
from towval.model.errors import InputError


@dataclass(frozen=True)
class Results:
    """The results of a campaign as tables, each with the columns ``campaign`` and ``run``.

    ``summary`` one row a run, with errors, uncertainties and verdict, as in ``summary.csv``; ``tracks`` measured poses
    of rover and object with standard deviations, one row a body and frame, NaN where lost; ``simulated`` motion of the
    object, tether force and length; ``errors`` simulated minus measured, in floor axes and along and across the path,
    with the uncertainty u_val of the position; ``findings`` of all stages but decimate. ``left_out`` names the runs
    that have no comparison, as ``lab_a/b``.
    """

    summary: pd.DataFrame
    tracks: pd.DataFrame
    simulated: pd.DataFrame
    errors: pd.DataFrame
    findings: pd.DataFrame
    left_out: tuple[str, ...] = ()

    def __repr__(self) -> str:
        tables = (
            f"{name} ({len(table)} × {table.shape[1]})" for name, table in vars(self).items() if name != "left_out"
        )
        runs = (f"{row.campaign}/{row.run} {row.verdict}" for row in self.summary.itertuples())
        without = f" Without a comparison: {', '.join(self.left_out)}." if self.left_out else ""
        return f"Results of {', '.join(runs)}.{without} Tables, with rows × columns: {', '.join(tables)}"


def load(*folders: Path | str) -> Results:
    """The results of one or several campaigns: one table of each kind over all campaigns and runs.

    ``folders`` of results are such as ``results/lab_a``, with ``camera.mcap`` and a folder for each run. Runs without a
    comparison are left out with a `UserWarning`: a stage refused, or they are not made yet. Raises `InputError` when a
    folder is missing or holds no result of a run, two have one name, or files of a run are of another run, or made of a
    file that is gone or has been replaced since.

    Examples
    --------
    >>> import towval
    >>> results = towval.load("results/lab_small")  # doctest: +SKIP
    >>> results.errors.groupby("run").along_m.max()  # doctest: +SKIP
    """
    if not folders:
        raise InputError("no folder of results is given", allowed='towval.load("results/my_lab")')
    for folder in folders:
        instance_of(folder, "the folder of results", str, Path)
        if not Path(folder).is_dir():
            raise InputError(f"{folder} is no folder", remedy="give the folder of results, as results/my_lab")
    names = [_campaign(Path(folder)) for folder in folders]
    if len(set(names)) < len(names):
        raise InputError(
            "two folders of results have one name, by which their rows could not be told apart",
            got=", ".join(map(str, folders)),
            remedy="load them one by one",
        )
    runs, left_out = _found_runs([Path(folder) for folder in folders])
    if left_out:
        # A mean over the other runs is one over those that no stage refused.
        say = f"left out, since they have no comparison: {', '.join(left_out)}; see the logs of these runs"
        warnings.warn(say, UserWarning, stacklevel=_CALLERS)
    parts = [_Part(campaign, name, folder) for campaign, name, folder in runs]
    findings = [row for folder in folders for row in _camera_findings(Path(folder))]
    return Results(
        summary=_stacked(parts, lambda part: summary_table([part.comparison]).drop(columns="run")),
        tracks=_stacked(parts, _Part.tracks),
        simulated=_stacked(parts, _Part.simulated),
        errors=_stacked(parts, _Part.errors),
        findings=pd.DataFrame(
            [*findings, *(row for part in parts for row in part.findings())],
            columns=["campaign", "run", "stage", "severity", "code", "text"],
        ),
        left_out=left_out,
    )


_CALLERS = 3
"""Frames of the stack between a warning and who called :func:`towval.load`."""


def _found_runs(folders: Sequence[Path]) -> tuple[list[tuple[str, str, Path]], tuple[str, ...]]:
    """Campaign, name and folder of each run with a comparison; and those without one, as ``lab_a/b``."""
    found, left_out = [], []
    for folder in folders:
        runs = [(_campaign(folder), run.name, run) for run in current_runs(folder)]
        compared = [run for run in runs if (run[2] / "compare.mcap").is_file()]
        if not compared:
            raise InputError(
                f"{folder} holds no results of a run",
                allowed="a folder with RUN/compare.mcap, as results/lab_a",
                remedy="run the campaign first: towval run",
            )
        found += compared
        left_out += [f"{campaign}/{name}" for campaign, name, path in runs if (campaign, name, path) not in compared]
    return found, tuple(left_out)


def _campaign(folder: Path) -> str:
    """By its name as it is given: of two links what they lead to may have the same name."""
    return Path(os.path.abspath(folder)).name


_FILES = ("track.mcap", "simulate.mcap", "uncertainty.mcap", "compare.mcap")


class _Part:
    """The result files of one run."""

    def __init__(self, campaign: str, name: str, folder: Path):
        self.campaign, self.name = campaign, name
        files = {each: folder / each for each in _FILES}
        # The workflow takes a file away before it makes it anew: where that fails, what was made of it stays.
        made_of = {origin for path in files.values() for origin in read_origin(path).inputs}
        further = (folder / "decimate.mcap", folder.parent / "camera.mcap")
        check_together(files | {path.name: path for path in further if path.name in made_of}, run=name)
        self.comparison = read_comparison(folder / "compare.mcap")
        self._tracks = read_tracks(folder / "track.mcap")
        self._simulated = read_simulated(folder / "simulate.mcap")
        self._uncertainty = read_uncertainty(folder / "uncertainty.mcap", draws=False)

    def tracks(self) -> pd.DataFrame:
        return pd.concat([
            pd.DataFrame({
                "body": body,
                "time_s": track.time_s,
                **_columns(("x_m", "y_m", "heading_rad"), track.pose),
                **_columns(("std_x_m", "std_y_m", "std_heading_rad"), track.std),
                "status": [TrackStatus(value).name.lower() for value in track.status],
            })
            for body, track in self._tracks.items()
        ])  # fmt: skip

    def simulated(self) -> pd.DataFrame:
        motion = self._simulated
        return pd.DataFrame({
            "time_s": motion.time_s,
            **_columns(("x_m", "y_m", "heading_rad"), motion.pose),
            **_columns(("velocity_x_m_s", "velocity_y_m_s", "turn_rate_rad_s"), motion.twist),
            **_columns(("tether_force_x_n", "tether_force_y_n"), motion.tether_force),
            "tether_length_m": motion.tether_length,
        })  # fmt: skip

    def errors(self) -> pd.DataFrame:
        found = self.comparison
        u_val = np.sqrt(np.trace(self._uncertainty.validation[:, :2, :2], axis1=1, axis2=2))
        return pd.DataFrame({
            "time_s": found.time_s,
            **_columns(("x_m", "y_m", "heading_rad"), found.error),
            **_columns(("along_m", "across_m"), found.along_across),
            "u_val_m": np.interp(found.time_s, self._uncertainty.time_s, u_val),
            "ratio": found.ratio,
        })  # fmt: skip

    def findings(self) -> Iterator[tuple[str, ...]]:
        by_stage: dict[str, Iterable[Finding]] = {
            "track": dict.fromkeys(found for track in self._tracks.values() for found in track.findings),
            "simulate": self._simulated.findings,
            "uncertainty": self._uncertainty.findings,
            "compare": self.comparison.findings,
        }
        for stage, found in by_stage.items():
            yield from ((self.campaign, self.name, stage, each.severity.value, each.code, each.text) for each in found)


def _camera_findings(folder: Path) -> Iterator[tuple[str, ...]]:
    camera = folder / "camera.mcap"
    if camera.is_file():
        for each in read_calibration(camera).findings:
            yield (_campaign(folder), "", "calibrate", each.severity.value, each.code, each.text)


def _columns(names: Sequence[str], values: Array) -> dict[str, Any]:
    return dict(zip(names, values.T, strict=True))


def _stacked(parts: Sequence[_Part], table: Callable[[_Part], pd.DataFrame]) -> pd.DataFrame:
    tables = []
    for part in parts:
        found = table(part)
        found.insert(0, "campaign", part.campaign)
        found.insert(1, "run", part.name)
        tables.append(found)
    return pd.concat(tables, ignore_index=True)
