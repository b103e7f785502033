"""A towed run with a known answer, for the tests of figures, overlay and report: no video, no solver.

The hinge of the rover follows a lemniscate; the object trails it on a tether that does not stretch (a tractrix, by
small steps); the "simulated" object is the same motion with an error that is known in closed form.
"""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

import av
import numpy as np

from towval.model import (
    Body,
    Calibration,
    Camera,
    Comparison,
    DecimatedTrack,
    Finding,
    Floor,
    RunUncertainty,
    Severity,
    SimulatedMotion,
    Track,
    TrackStatus,
    Verdict,
    View,
)
from towval.model.geometry import path_length
from towval.model.run_record import RunRecord

ROVER = Body("rover", 0.42, [[-0.375, -0.25], [0.375, -0.25], [0.375, 0.25], [-0.375, 0.25]])
TOWED = Body("object", 0.25, [[-0.25, -0.175], [0.25, -0.175], [0.25, 0.175], [-0.25, 0.175]])
HINGE, ANCHOR = np.array([-0.42, 0.0]), np.array([0.25, 0.0])
REST_LENGTH = 0.6
LOST = slice(60, 72)
SLACK = slice(0, 15)
ERROR_AMPLITUDE_M = 0.004
SMALL_SIZE_PX = (640, 360)
NUMBER_PX = 24


def towed_run(name: str = "a", n: int = 200, fps: float = 25.0, seed: int = 1, **changes: object) -> RunRecord:
    """A run of ``n`` frames; ``changes`` replace fields of the record."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(n) / fps
    rover, towed = _motion(n)
    simulated, comparison = _simulated(name, time_s, towed)
    fields: dict[str, object] = {
        "name": name,
        "rover": ROVER,
        "towed": TOWED,
        "hinge": HINGE,
        "anchor": ANCHOR,
        "rover_track": _track("rover", time_s, rover, rng, lost=slice(0, 0)),
        "object_track": _track("object", time_s, towed, rng, lost=LOST),
        "simulated": simulated,
        "comparison": comparison,
        "decimated": _decimated(time_s, rover),
    }
    return RunRecord(**(fields | changes))  # type: ignore[arg-type]


def simulated_up_to(run: RunRecord, frames: int) -> RunRecord:
    """The same run, of which the simulation and the comparison end after some frames."""

    def cut(one: SimulatedMotion | Comparison, *names: str) -> SimulatedMotion | Comparison:
        return dataclasses.replace(one, **{name: getattr(one, name)[:frames] for name in names})

    simulated = cut(run.simulated, "time_s", "pose", "twist", "tether_force", "tether_length")
    comparison = cut(run.comparison, "time_s", "error", "along_across", "ratio")
    return dataclasses.replace(run, simulated=simulated, comparison=comparison)


def uncertainty_of(run: RunRecord, std_m: float = 0.002) -> RunUncertainty:
    """An uncertainty for a run whose deviation across the floor's y axis is half of that along x."""
    n = len(run.comparison.time_s)
    validation = np.tile(np.diag([std_m, std_m / 2, 0.004]) ** 2, (n, 1, 1))
    return RunUncertainty(
        time_s=run.comparison.time_s,
        measurement=0.1 * validation,
        simulation=0.9 * validation,
        validation=validation,
        confidence=0.99,
        shares={"friction": 0.6, "camera": 0.1, "rest length": 0.25},
        samples=512,
        seed=1,
    )


def _motion(n: int) -> tuple[np.ndarray, np.ndarray]:
    # Half a lemniscate, after a rest of SLACK.stop frames.
    tau = np.concatenate([np.zeros(SLACK.stop), np.linspace(0, np.pi, n - SLACK.stop)]) + 0.6
    tow = np.stack([np.cos(tau) / (1 + np.sin(tau) ** 2), np.sin(tau) * np.cos(tau) / (1 + np.sin(tau) ** 2)], axis=1)
    ahead = tau + 1e-6
    x, y = np.cos(ahead) / (1 + np.sin(ahead) ** 2), np.sin(ahead) * np.cos(ahead) / (1 + np.sin(ahead) ** 2)
    heading = np.unwrap(np.arctan2(y - tow[:, 1], x - tow[:, 0]))
    c, s = np.cos(heading), np.sin(heading)
    rover = np.column_stack([tow - HINGE[0] * np.stack([c, s], axis=1), heading])
    centre = np.empty_like(tow)
    length = REST_LENGTH + ANCHOR[0]
    centre[0] = tow[0] - length * np.array([np.cos(heading[0] + 0.4), np.sin(heading[0] + 0.4)])
    for i in range(1, n):
        back = centre[i - 1] - tow[i]
        centre[i] = tow[i] + length * back / np.linalg.norm(back)
    pull = tow - centre
    return rover, np.column_stack([centre, np.unwrap(np.arctan2(pull[:, 1], pull[:, 0]))])


def _decimated(time_s: np.ndarray, rover: np.ndarray) -> DecimatedTrack:
    kept = np.unique(np.r_[0 : len(time_s) : 8, len(time_s) - 1])
    covariance = np.tile(np.diag([1e-4, 1e-4, 2e-4]) ** 2, (len(kept), 1, 1))
    rate = np.gradient(rover, time_s, axis=0)[kept]
    pauses = [[time_s[0], time_s[SLACK.stop]]]
    noise = [2e-4, 2e-4, 5e-4]
    return DecimatedTrack("rover", time_s[kept], rover[kept], rate, covariance, noise, pauses, len(time_s), [1, 1, 1])


def _track(body: str, time_s: np.ndarray, truth: np.ndarray, rng: np.random.Generator, lost: slice) -> Track:
    n = len(time_s)
    std = np.array([2e-4, 2e-4, 5e-4])
    pose = truth + rng.normal(0, std, truth.shape)
    covariance = np.tile(np.diag(std**2), (n, 1, 1))
    status = np.full(n, TrackStatus.TRACKED, dtype=np.uint8)
    status[lost] = TrackStatus.LOST
    pose[lost], covariance[lost] = np.nan, np.nan
    fraction = np.where(status == TrackStatus.TRACKED, 0.92 + 0.03 * np.sin(time_s), np.nan)
    residual = np.where(status == TrackStatus.TRACKED, 0.21 + 0.02 * rng.random(n), np.nan)
    findings = ()
    if lost.stop > lost.start:
        text = f"The {body} was lost in {lost.stop - lost.start} frames, from {time_s[lost][0]:.2f} s."
        findings = (Finding(Severity.WARNING, "frames_lost", text),)
    start = np.diag([4e-4, 4e-4, 1e-3]) ** 2
    return Track(body, time_s, pose, covariance, status, fraction, residual, start, None, findings, "synthetic")


def _simulated(name: str, time_s: np.ndarray, truth: np.ndarray) -> tuple[SimulatedMotion, Comparison]:
    n = len(time_s)
    ramp = np.linspace(0, 1, n)
    error = np.column_stack(
        [ERROR_AMPLITUDE_M * ramp, -0.5 * ERROR_AMPLITUDE_M * np.sin(4 * ramp) * ramp, np.deg2rad(0.4) * ramp]
    )
    pose = truth + error
    error = error.copy()
    error[LOST] = np.nan
    forward = np.stack([np.cos(truth[:, 2]), np.sin(truth[:, 2])], axis=1)
    tension = np.where(np.arange(n) < SLACK.stop, 0.0, 17.0 + np.sin(3 * time_s))
    simulated = SimulatedMotion(
        time_s=time_s,
        pose=pose,
        twist=np.gradient(pose, time_s, axis=0),
        tether_force=tension[:, None] * forward,
        tether_length=np.where(tension > 0, REST_LENGTH + 0.02, REST_LENGTH - 0.05),
        outcome="finished",
        advice="The integration reached the end of the run.",
        rung="boundary integral",
        statistics={"steps": 1234.0, "wrench_calls": 5678.0, "wall_time_s": 0.42},
    )
    shift = np.linalg.norm(error[:, :2], axis=1)
    comparison = Comparison(
        run=name,
        time_s=time_s,
        error=error,
        along_across=np.column_stack([(error[:, :2] * forward).sum(axis=1), error[:, 1]]),
        ratio=np.full(n, np.nan),
        path_rms_m=float(np.sqrt(np.nanmean(shift**2))),
        path_max_m=float(np.nanmax(shift)),
        final_error_m=float(shift[-1]),
        heading_rms_rad=float(np.sqrt(np.nanmean(error[:, 2] ** 2))),
        path_length_m=path_length(truth[:, :2]),
        u_num_m=1e-5,
        u_input_m=float("nan"),
        u_measurement_m=float("nan"),
        u_val_m=float("nan"),
        verdict=Verdict.NOT_JUDGED,
        tracked_frames=n - (LOST.stop - LOST.start),
        lost_frames=LOST.stop - LOST.start,
    )
    return simulated, comparison


def ceiling_calibration(seed: int = 2) -> Calibration:
    """A camera 4 m over the floor, twelve views of a board of which one was dropped, residuals of 0.15 px."""
    rng = np.random.default_rng(seed)
    matrix = [[1000.0, 0, 959.5], [0, 1000.0, 539.5], [0, 0, 1]]
    camera = Camera((1920, 1080), matrix, [-0.08, 0.01, 0, 0, 0, 0, 0, 0], "k1 k2")
    down = np.array([[1.0, 0, 0, 0.1], [0, -1, 0, 0.05], [0, 0, -1, 4.0], [0, 0, 0, 1]])
    views = tuple(_view(i, rng) for i in range(12))
    note = Finding(Severity.NOTE, "view_dropped", "View board_07 was dropped: its corners could not be found.")
    quality = {"reprojection_rms_px": 0.21, "camera_height_m": 4.0, "held_out_rms_px": 0.22, "condition_number": 155.0}
    return Calibration(camera, Floor(down), np.eye(18) * 1e-8, 0.15, views, (note,), quality)


def small_calibration() -> Calibration:
    """The ceiling camera at a third of its size, so that tests with films stay quick."""
    full = ceiling_calibration()
    matrix = np.array(full.camera.matrix)
    matrix[:2] /= 3
    matrix[0, 2], matrix[1, 2] = 319.5, 179.5
    camera = dataclasses.replace(full.camera, resolution_px=SMALL_SIZE_PX, matrix=matrix)
    return dataclasses.replace(full, camera=camera, views=())


def grey_film(path: Path, frames: int, size_px: tuple[int, int] = SMALL_SIZE_PX, first_pts: int = 0) -> Path:
    """An MP4 of 25 frames a second, evenly grey."""
    with av.open(path, "w") as film:
        stream = film.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = *size_px, "yuv420p"
        for i in range(frames):
            frame = av.VideoFrame.from_ndarray(np.full((size_px[1], size_px[0], 3), 128, np.uint8), format="rgb24")
            frame.pts = first_pts + i
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    return path


def quarter_turned(mp4: bytes, quarters: int = 1) -> bytes:
    """The film with a display matrix of quarter turns, as phones write it: 3 × 3 fixed-point numbers in ``tkhd``."""
    one = 0x00010000
    straight = struct.pack(">9i", one, 0, 0, 0, one, 0, 0, 0, 0x40000000)
    c, s = {1: (0, one), 2: (-one, 0), 3: (0, -one)}[quarters]
    turned = struct.pack(">9i", c, s, 0, -s, c, 0, 0, 0, 0x40000000)
    header = mp4.index(b"tkhd")
    at = mp4.index(straight, header)
    return mp4[:at] + turned + mp4[at + len(turned) :]


def _view(i: int, rng: np.random.Generator) -> View:
    board = np.stack(np.meshgrid(np.arange(9) * 0.04, np.arange(6) * 0.04), axis=-1).reshape(-1, 2)
    angle = rng.uniform(-0.6, 0.6)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corner = np.array([120 + 400 * (i % 4), 90 + 320 * (i // 4)])
    pixels = corner + (board @ turn.T) * rng.uniform(600, 1000)
    if i == 7:
        return View("board_07", np.empty((0, 2)), np.empty((0, 2)), np.empty((0, 2)), 0.0, dropped="corners not found")
    return View(f"board_{i:02d}", pixels, board, rng.normal(0, 0.15, pixels.shape), float(5 * i), on_floor=i >= 9)


def numbered_film(path: Path, frames: int, first_pts: int = 0, codec: str = "libx264", **options: str) -> Path:
    """An MP4 of 25 frames a second with their numbers in ten black or white squares at the lower left, lowest first."""
    width, height = SMALL_SIZE_PX
    path.parent.mkdir(exist_ok=True)
    with av.open(path, "w") as film:
        stream = film.add_stream(codec, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for i in range(frames):
            picture = np.full((height, width, 3), 128, np.uint8)
            for bit in range(10):
                picture[-NUMBER_PX:, bit * NUMBER_PX : (bit + 1) * NUMBER_PX] = 255 * (i >> bit & 1)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts = first_pts + i
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    return path
