"""How often the statement and the verdict hold in worlds that are not the model's: one table, one map, by seeds.

    python -m studies.tables.verdict_worlds [--runs 20] [--first 0] [--samples 256] [--worlds ...] [--output ...]

``--runs`` of each world of :mod:`studies.worlds.verdict_worlds` from seed ``--first`` on; each has its own scene and is
measured by its own camera, drawn from the covariance, simulated, sampled and judged. Then the smallest visible fault
of each kind that the run states is put into its truth, and three times it. ``--worlds`` takes some of them only. Rows
are kept in the output folder, and a second call continues there. Shares come with the interval in which they lie with
95 % (Clopper and Pearson); the runs of a row are independent, a run and its faults share their camera. A fault of which
no size is visible, and one with which the run cannot be measured or simulated, have no verdict: the map counts them.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

from studies.worlds.towed_runs import ROVER, TOWED, TrueCamera, nominal_calibration
from studies.worlds.verdict_worlds import WORLDS, WorldRun, half_way, number_of, scene_of, world_run
from towval.commands.console import errors_reported
from towval.model import Array, Body, Comparison, RunUncertainty, Verdict
from towval.model.errors import TowvalError
from towval.model.geometry import wrapped
from towval.validation.compare import CompareSettings, compare
from towval.validation.decimate import decimate
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.simulate import simulate
from towval.validation.uncertainty import UncertaintySampling

TOLERANCE_M = 0.01
FAULTS = {
    "rest length": ("rest", np.array(1.0)),
    "centre of mass, sideways": ("load_at", np.array([0.0, 1.0])),
    "friction over 0.3 m of floor": ("region", np.array(1.0)),
}
"""Kinds of visible faults that the truth can have: which number, and in which direction."""

GROWTH = (1.0, 3.0)
"""Sizes at which faults are put in, in those of the smallest visible one."""

Row = tuple[str, str, str, bool]


def judged_run(name: str, seed: int, samples: int) -> dict[str, Any]:
    """One run of a world: what was stated of it, what was true, and how faults in its truth are judged."""
    world, number = WORLDS[name], number_of(name, seed)
    run = world_run(world, number)
    case_of, true = cases(run, TrueCamera(nominal_calibration(), number), f"{name} {seed}"), run.truth()
    case, started = case_of(true), time.process_time()
    sampling = UncertaintySampling(case, UncertaintySettings(samples=samples))
    known = sampling.with_faults(sampling.describe(samples))
    result = judged(case, known)
    if result.tested_ratio > 1:
        result = judged(case, sampling.explained(known))
    spent = time.process_time() - started
    row = {"world": name, "seed": seed, "cpu_s": spent, "run": row_of(result, case.simulated.pose, true)}
    row["off"] = run.off()
    row["model_error_m"] = largest(model_error(run, true))
    # A world with a region has no other, and one by an engine has none.
    kinds = list(FAULTS)[: 2 if world.region or world.engine else 3]
    sizes = {fault.kind: fault.size for fault in known.faults}
    planted = [each for kind in kinds for each in fault_rows(run, case_of, known, kind, sizes[kind])]
    row["faults"] = [each for each in planted if "lost" not in each]
    row["lost"] = [each for each in planted if "lost" in each]
    return row


def cases(
    run: WorldRun, camera: TrueCamera, name: str, bodies: tuple[Body, Body] = (ROVER, TOWED)
) -> Callable[[Array], Case]:
    """What is stated and measured of a run by the motion (n, 3) of its object."""
    rover, towed = bodies
    track = camera.measured(rover, run.time_s, np.array([run.drive(t) for t in run.time_s]))
    thin = decimate(track)

    def case_of(motion: Array) -> Case:
        seen = camera.measured(towed, run.time_s, motion)
        thin_seen = decimate(seen)
        simulated = simulate(run.scene, thin, thin_seen, run.time_s)
        given = (run.scene, run.deviations, camera.nominal, rover, towed)
        return Case(*given, track, thin, seen, thin_seen, simulated, name)

    return case_of


def judged(case: Case, known: RunUncertainty) -> Comparison:
    """The comparison of a run at the tolerance of the table."""
    return compare(case.run, case.simulated, case.object_track, known, CompareSettings(tolerance_m=TOLERANCE_M))


def row_of(result: Comparison, simulated: Array, true: Array) -> dict[str, Any]:
    """What the table needs of a comparison."""
    explanation = result.explanation
    return {
        "verdict": result.verdict.value,
        "rejected": result.tested_ratio > 1,
        "off_m": largest(simulated - true),
        "upper_m": result.error_upper_m,
        "model_m": [result.model_error_lower_m, result.model_error_upper_m],
        "path_rms_m": result.path_rms_m,
        "detectable_m": result.detectable_m,
        "named": {}
        if explanation is None
        else dict([*list(explanation.moved.items())[:1], *explanation.instead.items()]),
        "explained": explanation is not None and explanation.explained,
        "factor": 1.0 if explanation is None else explanation.factor,
    }


def largest(difference: Array) -> float:
    """Largest shift of poses (n, 3) [m]."""
    return float(np.linalg.norm(difference[:, :2], axis=1).max())


def model_error(run: WorldRun, true: Array) -> Array:
    """Simulated minus true poses (n, 3) with all inputs at their true values."""
    camera = TrueCamera(nominal_calibration(), 0)
    exact = replace(camera.measured(ROVER, run.time_s, true), pose=np.array([run.drive(t) for t in run.time_s]))
    towed = replace(exact, body="object", pose=true)
    found = simulate(scene_of(run.true, run), decimate(exact), decimate(towed), run.time_s)
    difference = found.pose - true
    difference[:, 2] = wrapped(difference[:, 2])
    return np.asarray(difference)


def fault_rows(run: WorldRun, case_of: Any, known: RunUncertainty, kind: str, size: float) -> Iterator[dict[str, Any]]:
    """The verdict with faults of a kind in the truth; "lost" says why there is none."""
    if not np.isfinite(size):
        yield from ({"kind": kind, "growth": growth, "lost": "not visible"} for growth in GROWTH)
        return
    number, direction = FAULTS[kind]
    # A load moves the common centre of mass by its share of the mass.
    share = float(run.true["load"] / (run.true["load"] + run.true["mass"])) if number == "load_at" else 1.0
    side = 1.0 if run.time_s.size % 2 or number == "region" else -1.0
    if number == "region":
        run = replace(run, stripe=half_way(run))
    for growth in GROWTH:
        try:
            wrong = run.truth({number: side * growth * size / share * direction})
            case = case_of(wrong)
        except TowvalError:
            yield {"kind": kind, "growth": growth, "lost": "refused"}
            continue
        result = judged(case, known)
        yield {"kind": kind, "growth": growth} | row_of(result, case.simulated.pose, wrong)


def all_rows(worlds: list[str], seeds: range, samples: int, file: Path) -> list[dict[str, Any]]:
    """Rows of the seeds of worlds, those in the file read, the others computed and added to it."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {(row["world"], row["seed"]) for row in rows}
    for seed in seeds:
        for name in worlds:
            if (name, seed) in done:
                continue
            try:
                row = judged_run(name, seed, samples)
            except TowvalError as error:
                row = {"world": name, "seed": seed, "refused": str(error).splitlines()[0]}
            rows.append(row)
            with file.open("a") as out:
                out.write(json.dumps(row) + "\n")
            print(name, seed, row.get("run", row).get("verdict", row.get("refused")), file=sys.stderr, flush=True)
    return rows


def shares(rows: list[dict[str, Any]]) -> Iterator[tuple[str, list[bool], float, float]]:
    """What is counted: its name, whether it held in each run or fault, the least and the largest share asked for."""
    honest = [row for row in rows if WORLDS[row["world"]].stated == 1.0]
    faulty = [each for row in honest for each in row["faults"]]
    right = [row["run"] for row in honest]
    for what, each_of in (("as stated", right), ("with a fault", faulty)):
        held = [each["off_m"] <= each["upper_m"] for each in each_of]
        yield f"first bound holds, {what}", held, 0.93, 0.97
    # MuJoCo's points and cones are another model: a rejection is no false alarm there, nor does it show the fault.
    ours = [row for row in honest if not WORLDS[row["world"]].engine]
    right, planted = [row["run"] for row in ours], [each for row in ours for each in row["faults"]]
    second = [run["run"]["model_m"][0] <= run["model_error_m"] <= run["run"]["model_m"][1] for run in honest]
    yield "second bound holds", second, 0.95, 1.0
    yield "right model: disagrees", [each["verdict"] == Verdict.DISAGREES for each in right], 0.0, 0.01
    yield "right model: rejected by the test", [each["rejected"] for each in right], 0.0, 0.02
    every = [row["run"] for row in rows] + [fault for row in rows for fault in row["faults"]]
    wrong = [e["verdict"] == Verdict.AGREES and e["off_m"] > TOLERANCE_M for e in every]
    yield "agrees though off by more than the tolerance", wrong, 0.0, 0.01
    of_agreeing = [e["off_m"] > TOLERANCE_M for e in every if e["verdict"] == Verdict.AGREES]
    yield "of those that agree: off by more than the tolerance", of_agreeing, 0.0, 0.01
    for kind in FAULTS:
        smallest = [each["rejected"] for each in planted if each["kind"] == kind and each["growth"] == 1.0]
        yield f"smallest visible fault seen: {kind}", smallest, 0.85, 0.95
    small = [row for row in rows if WORLDS[row["world"]].stated < 1.0]
    yield "deviations 2 × too small: rejected", [row["run"]["rejected"] for row in small], 0.0, 1.0
    large = [row for row in rows if WORLDS[row["world"]].stated > 1.0]
    yield "deviations 2 × too large: rejected", [row["run"]["rejected"] for row in large], 0.0, 0.01
    caught = [row for row in small if row["run"]["rejected"]]
    explained = [row["run"]["explained"] for row in caught]
    yield "of the rejected with deviations too small: explained by named inputs", explained, 0.8, 1.0
    rightly = list(map(named, caught))
    yield "of these, a named input is off by two deviations, in the stated direction", rightly, 0.8, 1.0
    same = [(row, other) for row in caught for other in caught if row["world"] == other["world"] and row is not other]
    by_chance = [named(a, b["off"]) for a, b in same]
    yield "the same by chance: compared with the inputs of the other runs", by_chance, 0.0, 1.0


def table(rows: list[dict[str, Any]]) -> Iterator[Row]:
    """Rows of what must be reached."""
    for each in shares(rows):
        yield share(*each)


def named(row: dict[str, Any], off: dict[str, list[float]] | None = None) -> bool:
    """Whether one of the named inputs is beyond two of its stated deviations, to the stated side."""
    known = row["off"] if off is None else off
    found = row["run"]["named"].items()
    return any(part * np.sign(value) > 2 for name, value in found for part in known.get(name, [0.0]))


def share(what: str, held: list[bool], least: float, most: float) -> Row:
    """A count and its share, with its interval of 95 %, and what is asked for."""
    n, k = len(held), sum(held)
    value = k / n if n else float("nan")
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    measured = f"{k} of {n}: {100 * value:.1f} % ({100 * low:.1f} to {100 * high:.1f})"
    return what, measured, f"{100 * least:g} to {100 * most:g} %", bool(held) and least <= value <= most


COLUMNS = ("as stated", *(f"fault × {growth:g}" for growth in GROWTH))
"""Of the map: what was put into the truth, in sizes of the smallest visible fault."""


def counts(rows: list[dict[str, Any]]) -> dict[str, list[Counter[str]]]:
    """World → counts of right, unsure and wrong verdicts, in the order of :data:`COLUMNS`.

    Right: agrees where the simulation was within the tolerance, disagrees where a fault put it beyond. Wrong: agrees
    although it was beyond, disagrees although nothing was put in. Faults without a verdict count by their reason.
    """
    found = {}
    for name in WORLDS:
        of = [row for row in rows if row["world"] == name]
        found[name] = [Counter(kind_of(row["run"], planted=False) for row in of)]
        for growth in GROWTH:
            faults = [each for row in of for each in row["faults"] if each["growth"] == growth]
            lost = [each["lost"] for row in of for each in row.get("lost", ()) if each["growth"] == growth]
            found[name].append(Counter([*(kind_of(each, planted=True) for each in faults), *lost]))
    return found


def verdict_map(rows: list[dict[str, Any]]) -> Iterator[str]:
    """World × size of fault → counts of right, unsure and wrong verdicts, as a table in Markdown."""
    yield f"| world | {' | '.join(COLUMNS)} |"
    yield "|---" * (1 + len(COLUMNS)) + "|"
    for name, cells in counts(rows).items():
        yield f"| {name} | " + " | ".join(cell_text(cell) for cell in cells) + " |"


def kind_of(each: dict[str, Any], *, planted: bool) -> str:
    """Right, unsure or wrong."""
    if each["verdict"] in (Verdict.CANNOT_TELL, Verdict.NOT_JUDGED):
        return "unsure"
    if each["verdict"] == Verdict.AGREES:
        return "right" if each["off_m"] <= TOLERANCE_M else "wrong"
    return "right" if planted else "wrong"


def cell_text(cell: Counter[str]) -> str:
    """Counts of right, unsure and wrong, and of what has no verdict."""
    lost = "".join(f", {cell[reason]} {reason}" for reason in ("not visible", "refused") if cell[reason])
    return f"{cell['right']} / {cell['unsure']} / {cell['wrong']}{lost}"


@errors_reported()
def main() -> int:
    """Print the table and the map."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--worlds", nargs="*", choices=WORLDS, default=list(WORLDS), metavar="world")
    parser.add_argument("--output", type=Path, default=Path("results/verdict"))
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    rows = all_rows(
        given.worlds,
        range(given.first, given.first + given.runs),
        given.samples,
        given.output / f"worlds_{given.samples}.jsonl",
    )
    refused = [row for row in rows if "refused" in row]
    rows = [row for row in rows if "refused" not in row]
    found = list(table(rows))
    print(f"{len(rows)} runs, {sum(len(row['faults']) for row in rows)} with a fault, {len(refused)} refused\n")
    print("| what | measured | required | |\n|---|---|---|---|")
    for what, measured, required, good in found:
        print(f"| {what} | {measured} | {required} | {'' if good else 'MISSED'} |")
    print("\nright / unsure / wrong\n")
    print("\n".join(verdict_map(rows)))
    return 0 if all(row[-1] for row in found) else 1


if __name__ == "__main__":
    sys.exit(main())
