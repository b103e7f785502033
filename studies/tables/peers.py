"""This package beside what else one would use, side by side in one run: error against truth, and CPU time.

    python -m studies.tables.peers [--seeds 10] [--markdown]

Each program as its users use it: OpenCV's calibration of all boards with its default lens, and a floor from the one at
the origin; OpenCV's pyramidal Lucas-Kanade from picture to picture, begun at the clicks and also
where this package begins; MuJoCo as it comes, and with what was best on this lap; evo for the error
of a path. The ellipsoidal limit surface and the LuGre patch are published models, implemented here. Truth: synthetic
cameras and films, whose camera model all share; for the lap a computation by quadrature and SciPy's Radau, accurate to
1e-3 mm; for evo the number itself.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies.comparators import mujoco_engine
from studies.comparators.lugre_patch import LuGre, lugre_places
from studies.comparators.opencv_peers import clicked_pose, klt_motions, opencv_calibration, rms_error_m
from studies.comparators.tow_scenes import lap_scene
from studies.costs import cpu_seconds
from studies.machine import program_path
from studies.tables.calibration_table import position_errors_m
from studies.tradeoff.dynamics import FRICTION, INERTIA, MASS, SIDE, STICTION, lemniscate
from studies.worlds.boards import calibration_set
from studies.worlds.challenges import metre
from studies.worlds.filming import filmed
from studies.worlds.reference import Box, towed_box
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.commands.console import errors_reported
from towval.model import Array, Calibration
from towval.model.geometry import compose
from towval.physics.dynamics import feedback
from towval.physics.friction_laws import Coulomb
from towval.physics.trailing import trail
from towval.tracking.track import track
from towval.validation.metrics import aligned_rms
from towval.validation.statistics import error_sizes

LAP_S = 40.0
BEST_IMPEDANCE = ".2 .2 .001"
"""Of MuJoCo's contacts: the best on this very lap of 0.05, 0.2, 0.5 and 0.9, with 4 × 4 to 16 × 16 feet, steps of 0.5
to 2 ms and cones of ratio 1 to 100. Smaller steps and more feet do not help."""


@dataclass(frozen=True)
class PeerRow:
    """What a program reaches in a task: median error, its quartiles [mm] and CPU time [s]; ``note`` where it is out."""

    task: str
    program: str
    error_mm: float
    low_mm: float
    high_mm: float
    cpu_s: float
    note: str = ""


def _row(task: str, program: str, errors_mm: list[float], cpu_s: list[float], note: str = "") -> PeerRow:
    low, middle, high = np.nanpercentile(errors_mm, [25, 50, 75])
    return PeerRow(task, program, float(middle), float(low), float(high), float(np.median(cpu_s)), note)


def calibration_rows(seeds: range) -> Iterator[PeerRow]:
    """Positions on the plane at 0.35 m over the picture, from 12 held boards and boards on the floor."""
    errors: dict[str, list[float]] = {"towval": [], "OpenCV": []}
    spent: dict[str, list[float]] = {"towval": [], "OpenCV": []}
    for seed in seeds:
        scene, found = calibration_set(seed, floor="boards"), {}

        def ours() -> None:
            found["towval"] = calibrate_observations(scene.seen, CalibrateSettings(), {})  # noqa: B023 — called at once

        def opencv() -> None:
            camera, floor = opencv_calibration(scene)  # noqa: B023
            found["OpenCV"] = Calibration(camera, floor, np.zeros((18, 18)), 0.0)  # noqa: B023

        for name, call in (("towval", ours), ("OpenCV", opencv)):
            spent[name].append(cpu_seconds(call))
            errors[name].append(1e3 * position_errors_m(found[name], scene, 0.35)[0])
    task = "camera and floor: position at 0.35 m"
    yield _row(task, "towval: seven boards on the floor, lens selected", errors["towval"], spent["towval"])
    yield _row(
        task,
        "OpenCV: calibrateCamera of all boards, solvePnP of the one at the origin",
        errors["OpenCV"],
        spent["OpenCV"],
    )


def tracking_rows(seeds: range) -> Iterator[PeerRow]:
    """Poses of two bodies over a metre at 1080p, from a film that is encoded; times are those of the pass.

    The first pose of OpenCV's is that of the clicks, or ours: what a pass of its own adds to that is the difference.
    """
    errors: dict[str, list[float]] = {"towval": [], "KLT": [], "KLT from ours": []}
    spent: dict[str, list[float]] = {"towval": [], "KLT": []}
    for seed in seeds:
        challenge = metre(seed, 2.0)
        scene = challenge.scene
        clicks, truth = scene.clicks(np.random.default_rng(seed)), scene.truth(challenge.times)
        with filmed(scene, challenge.times) as film:
            start = time.process_time()
            tracks = track(film(), scene.calibration, scene.bodies, clicks)
            spent["towval"].append(time.process_time() - start)
            start = time.process_time()
            pictures = list(film())
            motions = {
                body.name: klt_motions(pictures, scene.calibration, body, clicks[body.name]) for body in scene.bodies
            }
            spent["KLT"].append(time.process_time() - start)
        for body in scene.bodies:
            ours, motion = tracks[body.name].pose, motions[body.name]
            first = {"KLT": clicked_pose(scene.calibration, body, clicks[body.name]), "KLT from ours": ours[0]}
            poses = {"towval": ours} | {name: compose(motion, pose) for name, pose in first.items()}
            for name, found in poses.items():
                errors[name].append(1e3 * rms_error_m(found, truth[body.name]))
    task = "poses over a metre, two bodies, 1080p"
    yield _row(task, "towval: `plane`", errors["towval"], spent["towval"])
    yield _row(task, "OpenCV: goodFeaturesToTrack, calcOpticalFlowPyrLK", errors["KLT"], spent["KLT"])
    yield _row(task, "the same, begun at towval's first pose", errors["KLT from ours"], [np.nan])  # not timed


def lap_rows() -> Iterator[PeerRow]:
    """The path of a towed cube on a lap of 40 s: RMS error against quadrature and Radau."""
    scene = lap_scene(LAP_S)
    box = Box((SIDE, SIDE), MASS, (0.0, 0.0), INERTIA, (SIDE / 2, 0.0), FRICTION, STICTION)
    tether = (scene.tether.rest_length, scene.tether.stiffness)
    hinge = partial(lemniscate, period_s=LAP_S)
    numerics: dict[str, Any] = {"panels": (12, 12), "order": 4, "tolerance": 1e-8, "longest_step_s": 0.1}
    truth = towed_box(box, hinge, tether, scene.start_pose, scene.times, **numerics)
    given = (scene.towed, Coulomb(FRICTION, STICTION), scene.tether, scene.hinge, scene.start_pose, scene.times)
    lugre = LuGre(FRICTION, FRICTION, STICTION)
    programs: dict[str, Callable[[], Array]] = {
        "towval: boundary integral, Rodas5P": lambda: feedback(*given).pose[:, :2],
        "ellipsoidal limit surface, quasi-static, ours": lambda: trail("limit surface", *given).pose[:, :2],
        "LuGre patch, ours, 20 × 20 cells, 0.1 ms": lambda: lugre_places(scene, lugre, 20, 1e-4),
    }
    for places in programs.values():
        places()  # compiles
    if mujoco_engine.is_installed():
        engine = mujoco_engine.mujoco_places
        programs["MuJoCo: 8 × 8 feet, elliptic cone, impedance 0.2, 1 ms"] = lambda: engine(
            scene, 1e-3, 8, BEST_IMPEDANCE
        )
        programs["MuJoCo: a box, 2 ms"] = lambda: engine(scene, 2e-3, 0)
    for program, places in programs.items():
        start = time.process_time()
        found = places()
        spent = time.process_time() - start
        apart = np.linalg.norm(found - truth[:, :2], axis=1)
        yield _row("path of a towed cube, a lap of 40 s", program, [1e3 * float(np.sqrt(np.mean(apart**2)))], [spent])


def evo_rows() -> Iterator[PeerRow]:
    """The RMS distance of a path from another at equal times, by evo and by ours: what they differ by."""
    task = "RMS distance of two paths: difference of the results"
    command = program_path("evo_ape")
    if command is None:
        yield PeerRow(task, "evo", np.nan, np.nan, np.nan, np.nan, "not installed")
        return
    rng, times = np.random.default_rng(4), np.arange(600) / 25
    first = np.column_stack([np.cumsum(rng.normal(2e-3, 1e-3, (600, 2)), axis=0), np.zeros(600)])
    second = first + [*rng.normal(0, 5e-3, 2), 0.0] + rng.normal(0, 2e-3, (600, 3)) * [1, 1, 0]
    ours = float(error_sizes(first - second)[0]), aligned_rms(first[:, :2], second[:, :2])
    with TemporaryDirectory() as folder:
        files = [str(Path(folder) / name) for name in ("measured.tum", "simulated.tum")]
        for file, pose in zip(files, (second, first), strict=True):
            rows = np.column_stack([times, pose[:, :2], np.zeros((600, 4)), np.ones(600)])
            np.savetxt(file, rows, fmt="%.12f")
        for name, options, value in (("as they are", [], ours[0]), ("after the best rigid motion", ["-a"], ours[1])):
            start = time.perf_counter()
            done = subprocess.run([command, "tum", *files, *options], capture_output=True, text=True, check=True)
            found = re.search(r"rmse\s+([\d.eE+-]+)", done.stdout)
            error = abs(float(found[1]) - value) if found else np.nan
            yield _row(task, f"evo, {name}", [1e3 * error], [time.perf_counter() - start])


def rows(seeds: int) -> Iterator[PeerRow]:
    """All rows, over so many seeds where a task has any."""
    yield from calibration_rows(range(7000, 7000 + seeds))
    yield from tracking_rows(range(40, 40 + seeds))
    yield from lap_rows()
    yield from evo_rows()


def over_ours(found: Iterable[PeerRow]) -> Iterator[tuple[PeerRow, float]]:
    """Rows with their CPU time over that of the first row of their task, which is this package's."""
    first_s: dict[str, float] = {}
    for row in found:
        yield row, row.cpu_s / first_s.setdefault(row.task, row.cpu_s)


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--markdown", action="store_true", help="as README has it")
    given = parser.parse_args()
    if given.markdown:
        print("| task | program | error, median (quartiles) | CPU over ours |\n|---|---|---|---|")
    for row, over in over_ours(rows(given.seeds)):
        spread = "" if row.low_mm == row.high_mm else f" ({row.low_mm:.2g} to {row.high_mm:.2g})"
        error = row.note or f"{row.error_mm:.2g} mm{spread}"
        if given.markdown:
            print(f"| {row.task} | {row.program} | {error} | {'' if np.isnan(over) else f'{over:.2g}'} |", flush=True)
        else:
            print(f"{row.task:55}{row.program:55}{error:>26}{row.cpu_s:10.3g} s", flush=True)


if __name__ == "__main__":
    main()
