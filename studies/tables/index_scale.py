"""Cost of the index of many runs: ``python -m studies.tables.index_scale [--runs 10000] [--keep FOLDER]``.

Result files of five stages a run are written with the details and provenance of real ones and few messages, since the
index does not read messages. Prints wall and CPU seconds to read them and to write both files, and the sizes;
``--keep`` keeps the page.
"""

import argparse
import json
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

from towval.commands.console import errors_reported
from towval.io.mcap_file import write_mcap
from towval.io.results_index import read_results, write_index
from towval.io.summary import COLUMNS
from towval.model import Verdict
from towval.model.conventions import STAGES_OF_RUN
from towval.report.index_page import write_index_page

RUNS_A_CAMPAIGN = 4
INPUTS = ("stiffness", "rest_length", "friction", "anchor", "hinge", "load_mass")


def write_runs(folder: Path, count: int, seed: int) -> None:
    """Result files of ``count`` synthetic runs, four a campaign."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        campaign = folder / f"lab_{k // RUNS_A_CAMPAIGN:04d}"
        run = campaign / "abcd"[k % RUNS_A_CAMPAIGN]
        if not (campaign / "camera.mcap").is_file():
            write_mcap(campaign / "camera.mcap", [], {"findings": []}, _provenance(rng, "calibrate"))
        for stage in STAGES_OF_RUN:
            write_mcap(run / f"{stage}.mcap", [], _details(rng, stage, run.name), _provenance(rng, stage))


def _provenance(rng: np.random.Generator, stage: str) -> dict[str, str]:
    hashes = {"campaign.yaml": rng.bytes(32).hex(), f"{stage}.mp4": rng.bytes(32).hex()}
    version = f"0.{rng.integers(1, 4)}.0"
    return {
        "inputs_sha256": json.dumps(hashes),
        "settings": json.dumps({"samples": int(rng.choice([512, 1024]))}),
        "versions": json.dumps({"towval": version}),
    }


def _details(rng: np.random.Generator, stage: str, run: str) -> dict[str, object]:
    codes = ["creep", "few_points", "blur"]
    findings = [{"severity": "warning", "code": code, "text": f"{code} " * 20} for code in codes if rng.random() < 0.1]
    if stage in ("track", "decimate"):
        body = {"findings": findings, "time_ns": list(range(600))}
        return {"object": body, "rover": {**body, "findings": []}}
    details: dict[str, object] = {"findings": findings}
    if stage == "uncertainty":
        details |= {"shares": dict(zip(INPUTS, rng.dirichlet(np.ones(len(INPUTS))).tolist(), strict=True))}
        details |= {"signature": rng.normal(size=(90, 3, 3)).tolist()}
    if stage == "compare":
        error = np.abs(rng.normal(0, 0.004, len(COLUMNS)))
        details |= dict(zip(COLUMNS, error.tolist(), strict=True)) | {"findings": findings}
        details |= {"run": run, "verdict": str(rng.choice(list(Verdict))), "lost_frames": int(rng.integers(9))}
    return details


def measured(count: int, folder: Path) -> dict[str, float]:
    """CPU and wall times [s] to index synthetic runs, sizes of both files [MB], and the number of findings."""
    results, output = folder / "results", folder / "index.sqlite"
    write_runs(results, count, seed=1)
    start = time.perf_counter(), time.process_time()
    index = read_results([results])
    read = time.perf_counter(), time.process_time()
    write_index(output, index)
    write_index_page(output.with_suffix(".html"), index)
    end = time.perf_counter(), time.process_time()
    found: dict[str, float] = {}
    for what, begin, done in (("read", start, read), ("written", read, end)):
        found |= {f"{what}, CPU": done[1] - begin[1], f"{what}, wall": done[0] - begin[0]}
    found |= {path.name: path.stat().st_size / 1e6 for path in (output, output.with_suffix(".html"))}
    return found | {"findings": len(index.findings)}


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        for what, value in measured(given.runs, Path(temporary)).items():
            print(f"{given.runs} runs, {what:14} {value:8.3g}")
        if given.keep:
            for ending in ("sqlite", "html"):
                shutil.copy(Path(temporary) / f"index.{ending}", given.keep)


if __name__ == "__main__":
    main()
