"""What the verdict must reach, measured on synthetic runs and printed as one table; exit code 1 where a line fails.

    python -m studies.tables.validation_must_reach [--runs 200] [--rendered 5] [--output results/validation]
                                               [--right results/lab_a/a results/lab_a/b]

Each run has its own scene, path, inputs and camera (``studies.worlds.towed_runs``); it is measured, simulated, sampled
and judged, once without a fault of the model and once with each planted fault. A fault counts where it moves the object
by more than 3 u_val, and by more than matters, at some time. Rows are kept in the output folder, and a second call
continues there. ``--right`` are folders of filmed runs in which nothing was planted.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from studies.tables.validation_rendered import rendered_rows
from studies.worlds.towed_runs import ROVER, TOWED, TrueCamera, nominal_calibration, planted, synthetic_run, true_motion
from towval.commands.console import errors_reported
from towval.io.records import read_comparison
from towval.model import Array, Comparison, Verdict
from towval.model.geometry import wrapped
from towval.validation.compare import TOLERANCE_M, compare
from towval.validation.decimate import decimate
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.simulate import simulate
from towval.validation.uncertainty import sample_uncertainty

FAULTS = ("stripe", "centre of mass", "tether")
HALF_WIDTH = 1.96
PARTS = ("measurement", "simulation", "validation")

Row = tuple[str, str, str, bool]


def judged_run(seed: int, samples: int) -> dict[str, Any]:
    """One synthetic run: coverage of its bands, its verdict, and the verdicts with each fault planted."""
    run, camera = synthetic_run(seed), TrueCamera(nominal_calibration(), seed)
    rover = camera.measured(ROVER, run.time_s, np.array([run.drive(t) for t in run.time_s]))
    thin, true = decimate(rover), true_motion(run, run.truth)

    def case_of(motion: Array) -> Case:
        track = camera.measured(TOWED, run.time_s, motion)
        thin_track = decimate(track)
        simulated = simulate(run.scene, thin, thin_track, run.time_s)
        given = (run.scene, run.deviations, camera.nominal, ROVER, TOWED)
        return Case(*given, rover, thin, track, thin_track, simulated)

    case, started = case_of(true), time.process_time()
    uncertainty = sample_uncertainty(case, UncertaintySettings(samples=samples))
    spent = time.process_time() - started
    result = compare(str(seed), case.simulated, case.object_track, uncertainty)
    errors = {
        "measurement": case.object_track.pose - true,
        "simulation": case.simulated.pose - true,
        "validation": result.error,
    }
    row: dict[str, Any] = {
        "seed": seed,
        "coverage": {part: coverage(errors[part], getattr(uncertainty, part)) for part in PARTS},
        "verdict": result.verdict.value,
        "u_val_m": result.u_val_m,
        "path_rms_m": result.path_rms_m,
        "cpu_s": spent,
        "reported": reason(result),
    }
    for fault in FAULTS:
        truth, begins = planted(run, true, fault, seed)
        wrong = true_motion(run, truth)
        # What is uncertain does not depend on how the object moved after its start: the draws are those from above.
        faulty = case_of(wrong)
        result = compare(str(seed), faulty.simulated, faulty.object_track, uncertainty)
        size = float(np.linalg.norm(wrong[:, :2] - true[:, :2], axis=1).max())
        place = place_reported(result)
        row[fault] = {
            "size_in_u_val": size / result.u_val_m,
            "verdict": result.verdict.value,
            "begins_m": begins,
            "reported_m": place,
        }
    return row


def coverage(error: Array, covariance: Array) -> list[float]:
    """Share of times at which x, y and heading lie within 1.96 deviations."""
    error = np.column_stack([error[:, :2], wrapped(error[:, 2])])
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return np.mean(np.abs(error) <= HALF_WIDTH * std, axis=0).tolist()


def reason(result: Comparison) -> str:
    """Text of the verdict."""
    return next(finding.text for finding in result.findings if finding.code == "verdict")


def place_reported(result: Comparison) -> list[float] | None:
    """Lengths of the path between which the verdict reports that the fault begins [m]."""
    place = [result.begins_m, result.ends_m]
    return place if np.isfinite(place).all() else None


def all_rows(runs: int, samples: int, file: Path) -> list[dict[str, Any]]:
    """Rows of the first ``runs`` seeds, those in the file read, the others computed and added to it."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {row["seed"] for row in rows}
    for seed in range(runs):
        if seed not in done:
            row = judged_run(seed, samples)
            rows.append(row)
            with file.open("a") as out:
                out.write(json.dumps(row) + "\n")
            print(f"run {seed}: {row['verdict']}", file=sys.stderr, flush=True)
    return [row for row in rows if row["seed"] < runs]


def coverage_rows(rows: list[dict[str, Any]]) -> Iterator[Row]:
    """Coverage of the 95 % bands."""
    for part in PARTS:
        shares = np.mean([row["coverage"][part] for row in rows], axis=0)
        text = ", ".join(f"{100 * share:.1f} %" for share in shares)
        name = {"measurement": "u_D", "simulation": "u_input", "validation": "u_val"}[part]
        good = bool(shares.min() >= 0.90 and shares.max() <= 0.98)
        yield f"95 % band of {name}: x, y, heading, {len(rows)} runs", text, "90 to 98 %", good


def verdict_rows(rows: list[dict[str, Any]]) -> Iterator[Row]:
    """Verdicts without a fault, and with each of them."""
    verdicts = [row["verdict"] for row in rows]
    counted = ", ".join(f"{verdicts.count(each)} {each}" for each in (Verdict.AGREES, Verdict.CANNOT_TELL))
    wrong = verdicts.count(Verdict.DISAGREES)
    yield f"no fault planted, {counted}: disagrees", f"{wrong} of {len(rows)}", "1 %", wrong <= 0.01 * len(rows)
    for fault in FAULTS:
        large = [row[fault] for row in rows if matters(row[fault], row["u_val_m"])]
        found = [entry for entry in large if entry["verdict"] == Verdict.DISAGREES]
        good = bool(large) and len(found) >= 0.95 * len(large)
        yield (
            f"{fault}, larger than 3 u_val and {1e3 * TOLERANCE_M:g} mm: disagrees",
            f"{len(found)} of {len(large)}",
            "95 %",
            good,
        )
        if fault == "stripe":
            named = sum(names_the_stripe(entry) for entry in found)
            yield "its place reported within 0.15 m", f"{named} of {len(found)}", "95 %", named >= 0.95 * len(found)


def matters(entry: dict[str, Any], u_val_m: float) -> bool:
    """Whether a planted fault is larger than 3 u_val and than the tolerance."""
    size = entry["size_in_u_val"]
    return bool(size > 3 and size * u_val_m > TOLERANCE_M)


def names_the_stripe(entry: dict[str, Any]) -> bool:
    """Whether a place is reported that contains where the fault begins, or ends within 0.15 m of it."""
    if entry["reported_m"] is None:
        return False
    low, high = entry["reported_m"]
    return bool(low - 0.15 <= entry["begins_m"] <= high + 0.15)


def time_row(runs: int) -> Row:
    """CPU time of 1,000 samples (1,024: the sequence wants a power of two), the longest of several runs."""
    longest = max(judged_run(seed, 1024)["cpu_s"] for seed in range(runs))
    return "uncertainty of one run, 1,024 samples", f"{longest:.0f} s CPU", "60 s on 2 cores", longest < 60


def right_rows(folders: list[Path]) -> Iterator[Row]:
    """A row for the results of a run that follows the model."""
    for folder in folders:
        result = read_comparison(folder / "compare.mcap")
        stated = f"{result.verdict.value}, E {1e3 * result.path_rms_m:.1f}, u_val {1e3 * result.u_val_m:.1f} mm"
        yield f"{folder.parent.name}, run {folder.name}", stated, "agrees", result.verdict == Verdict.AGREES


@errors_reported()
def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--rendered", type=int, default=1, help="filmed runs of each fault, and of none")
    parser.add_argument("--output", type=Path, default=Path("results/validation"))
    parser.add_argument("--right", type=Path, nargs="*", default=[])
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    rows = all_rows(given.runs, given.samples, given.output / f"runs_{given.samples}.jsonl")
    table = [*coverage_rows(rows), *verdict_rows(rows), time_row(2), *right_rows(given.right)]
    with tempfile.TemporaryDirectory() as folder:
        table += rendered_rows(given.rendered, Path(folder))
    print(f"| {'what':56} | {'measured':38} | {'required':16} | |\n|---|---|---|---|")
    for what, measured, required, good in table:
        print(f"| {what:56} | {measured:38} | {required:16} | {'' if good else 'MISSED'} |")
    return 0 if all(row[-1] for row in table) else 1


if __name__ == "__main__":
    sys.exit(main())
