"""One fault in one run: filmed, put through all stages, and judged against the truth."""

import contextlib
import io
import shutil
from collections.abc import Collection, Iterable, Set
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
import pandas as pd
import yaml

from studies.camera_faults.faults import Fault
from studies.camera_faults.film import Film, read_film
from studies.worlds.film import write_video
from towval.commands import calibrate, compare, decimate, simulate, track, uncertainty
from towval.io.records import read_calibration, read_comparison, read_tracks
from towval.model import Array, Finding, Severity, Track, TrackStatus, Verdict
from towval.model.errors import TowvalError
from towval.model.geometry import wrapped

MARGIN_M = 0.0005
"""Beyond three stated deviations, from which on a pose is wrong."""

COVERED_MM = 2.0
"""RMS error from which on poses that are within that are not corrected: their deviations merely cover it."""

MOST_LOST = 0.5
"""Share of the pictures in which a body may be lost; with more, poses are not corrected: there are none."""

_SAMPLES = 256
_CORNER_M = 0.3  # [m] From the middle of a top to its corner.
_HD = 1920 * 1080


@dataclass(frozen=True)
class Footage:
    """A run whose truth is known, cut short: ``campaign`` folder, ``run``, and the film of its first ``seconds``."""

    campaign: Path
    run: str
    film: Film
    truth: pd.DataFrame

    @property
    def name(self) -> str:
        """Campaign and run."""
        return f"{self.campaign.name} {self.run}"


def footage(campaign: Path, run: str, seconds: float, camera: Path) -> Footage:
    """The footage of a run; its lens is that of the calibration ``camera``, as nearly as another model can have it."""
    truth, found = pd.read_csv(campaign / f"{run}_truth.csv"), read_calibration(camera).camera
    focal, u, v, k1 = (float(each) for each in (found.matrix[0, 0], *found.matrix[:2, 2], found.distortion[0]))
    return Footage(campaign, run, read_film(campaign / f"{run}.mp4", seconds, (focal, u, v, k1)), truth)


@dataclass(frozen=True)
class Result:
    """How a fault ended.

    ``poses`` and ``verdict``: "corrected" (within the stated deviations; "covered" where poses are, and yet off by
    :data:`COVERED_MM`), "reported" (also where most poses are lost), or "silently wrong"; ``worst``: largest error of a
    pose over what is allowed; ``rms_mm`` of rover and object; ``codes`` of findings that are no notes; ``said``: the
    verdict, or the refusal.
    """

    poses: str
    verdict: str
    worst: float
    rms_mm: float
    codes: tuple[str, ...]
    said: str


def tried(
    source: Footage,
    fault: Fault,
    strength: float,
    folder: Path,
    sound_camera: Path | None = None,
    *,
    judged: bool = True,
    longer_m: float = 0.0,
) -> Result:
    """Plant a fault and run all stages in ``folder``.

    ``sound_camera`` serves where no picture of it is touched; without ``judged`` the stages after the tracking are left
    out; the model's tether is ``longer_m`` longer than the true one.
    """
    seed = crc32(f"{source.name} {fault.name} {strength}".encode())
    campaign = _planted(source, fault, strength, folder, np.random.default_rng(seed))
    if longer_m:
        _lengthen(campaign / "campaign.yaml", longer_m)
    camera, results = folder / "camera.mcap", folder / "results"
    results.mkdir()
    files = {stage: results / f"{stage}.mcap" for stage in ("track", "decimate", "simulate", "uncertainty", "compare")}
    said = ""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            if sound_camera is not None and not fault.campaign:
                shutil.copy(sound_camera, camera)
            else:
                calibrate.run(campaign, camera)
            track.run(campaign, source.run, camera, files["track"])
            if judged:
                _judge(campaign, source.run, camera, files)
        except TowvalError as error:
            said = f"refused: {str(error).splitlines()[0]}"
    return _result(source, fault, camera, files, said, right=not longer_m)


def _lengthen(file: Path, longer_m: float) -> None:
    """States another length of the tether at rest."""
    document = yaml.safe_load(file.read_text(encoding="utf-8"))
    document["tether"]["rest_length_m"] += longer_m
    file.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")


def _judge(campaign: Path, run: str, camera: Path, files: dict[str, Path]) -> None:
    """From the tracks to the verdict."""
    decimate.run(files["track"], files["decimate"])
    simulate.run(campaign, files["track"], files["decimate"], files["simulate"])
    uncertainty.run(campaign, run, camera, files["track"].parent, files["uncertainty"], {"samples": _SAMPLES})
    compare.run(run, files["track"], files["simulate"], files["uncertainty"], files["compare"])


def _planted(source: Footage, fault: Fault, strength: float, folder: Path, rng: np.random.Generator) -> Path:
    """A copy of the campaign with one run and the fault."""
    campaign = folder / source.campaign.name
    campaign.mkdir(parents=True)
    shutil.copytree(source.campaign / "calibration", campaign / "calibration")
    document = yaml.safe_load((source.campaign / "campaign.yaml").read_text(encoding="utf-8"))
    document["runs"] = {source.run: document["runs"][source.run]}
    film = source.film if fault.film is None else fault.film(source.film, strength, rng)
    if fault.campaign is not None:
        fault.campaign(campaign, document, strength, rng)
    width, height = film.size_px
    encoding = dict(fault.encoding(strength, width * height / _HD))
    write_video(campaign / f"{source.run}.mp4", film.frames(), rate=round(1 / film.step_s), **encoding)
    (campaign / "campaign.yaml").write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return campaign


def _result(source: Footage, fault: Fault, camera: Path, files: dict[str, Path], said: str, *, right: bool) -> Result:
    findings: list[Finding] = list(read_calibration(camera).findings) if camera.exists() else []
    worst, rms_mm, lost = np.nan, np.nan, 0.0
    if files["track"].exists():
        tracks = read_tracks(files["track"])
        late_s = lateness_s(tracks.values(), source.truth)
        errors = [pose_errors(each, source.truth, late_s) for each in tracks.values()]
        worst = float(np.nanmax([np.nanmax(over, initial=0.0) for over, _ in errors]))
        rms_mm = 1e3 * float(np.sqrt(np.nanmean(np.concatenate([off for _, off in errors]) ** 2)))
        lost = max(float(np.mean(each.status == TrackStatus.LOST)) for each in tracks.values())
        findings += [one for each in tracks.values() for one in each.findings]
    if files["compare"].exists():
        said = read_comparison(files["compare"]).verdict.value
    # A note says that all is well.
    warned = {one.code for one in findings if one.severity is not Severity.NOTE}
    poses, verdict = outcomes(worst, warned, said, fault.named_by, right=right)
    poses = reported_if_lost(covered_if_off(poses, rms_mm), lost)
    return Result(poses, verdict, worst, rms_mm, tuple(sorted(warned)), said)


def outcomes(
    worst: float, codes: Set[str], said: str, named_by: Collection[str], *, right: bool = True
) -> tuple[str, str]:
    """What became of the poses, and of the verdict on a model that is right, or off by more than matters.

    ``worst``: largest error of a pose over what is allowed, NaN without any; ``said``: the verdict, or a refusal.
    """
    if said.startswith("refused"):
        return "reported", "reported"
    poses = "corrected" if worst <= 1 else "reported" if codes & set(named_by) else "silently wrong"
    good, bad = (Verdict.AGREES, Verdict.DISAGREES) if right else (Verdict.DISAGREES, Verdict.AGREES)
    return poses, {bad.value: "silently wrong", good.value: "corrected"}.get(said, "reported")


def covered_if_off(poses: str, rms_mm: float) -> str:
    """What became of the poses, "covered" where they are "corrected" by their deviations alone."""
    return "covered" if poses == "corrected" and round(rms_mm, 1) >= COVERED_MM else poses


def reported_if_lost(poses: str, lost: float) -> str:
    """What became of the poses, "reported" where a body is lost in most pictures, of which a finding tells."""
    return "reported" if poses in ("corrected", "covered") and lost > MOST_LOST else poses


def lateness_s(tracks: Iterable[Track], truth: pd.DataFrame) -> float:
    """By how much all bodies are late [s]: where a clock begins is nobody's fault, and moves no path.

    Bodies that go one way look late as well where each is off by the same all the time, or by a share of its way. So
    what an offset and a scale of its own explain of each is left out first. Zero where a delay does not explain most of
    the rest.
    """
    apart, moved, squares = 0.0, 0.0, 0.0
    for each in tracks:
        true = _true(each, truth)
        velocity = np.gradient(true, each.time_s, axis=0)[each.seen, :2].ravel()
        error = (true - each.pose)[each.seen, :2].ravel()
        offset = np.tile(np.eye(2), (len(error) // 2, 1))
        others = np.column_stack([offset, true[each.seen, :2].ravel()])
        left, off = (values - others @ np.linalg.lstsq(others, values)[0] for values in (velocity, error))
        apart += float(left @ off)
        moved += float(left @ left)
        squares += float(off @ off)
    return apart / moved if apart**2 > 0.5 * moved * squares else 0.0


def _true(track: Track, truth: pd.DataFrame, late_s: float = 0.0) -> Array:
    """True poses (n, 3) at the times of a track, or so much earlier."""
    names = [f"{track.body}_x_m", f"{track.body}_y_m", f"{track.body}_heading_rad"]
    return np.column_stack([np.interp(track.time_s - late_s, truth.t_s, truth[name]) for name in names])


def pose_errors(track: Track, truth: pd.DataFrame, late_s: float = 0.0) -> tuple[Array, Array]:
    """Errors of the poses that were seen over what is allowed (n,), and their distances [m] (n,).

    Allowed are three deviations and :data:`MARGIN_M`; a heading counts by the way that it moves a corner of the top.
    """
    error, covariance = track.pose - _true(track, truth, late_s), track.total_covariance
    assert covariance is not None
    error, covariance = error[track.seen], covariance[track.seen]
    off, turned = np.linalg.norm(error[:, :2], axis=1), np.abs(wrapped(error[:, 2]))
    std = np.sqrt(np.linalg.eigvalsh(covariance[:, :2, :2])[:, -1])
    corner_m = _CORNER_M * turned / (3 * _CORNER_M * np.sqrt(covariance[:, 2, 2]) + MARGIN_M)
    return np.maximum(off / (3 * std + MARGIN_M), corner_m), off
