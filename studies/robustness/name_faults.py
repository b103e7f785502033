"""The whole workflow with names that a file system allows: in the checkout, the campaign, its files and its runs."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import yaml

from studies.robustness.workflow_faults import Workplace, fault_of

_REPOSITORY = Path(__file__).resolve().parents[2]
_NEEDED = ("Snakefile", "config.yaml", "workflow", "src", "studies", "profiles")

NAMES = (
    "two words", "it's \"quoted\"", "Überfahrt Nr. 5", "[ab]", "{b}", "$x^$", "-lead", "1", "True", "figures", "null",
    "1e3", "2026-11-22", "a,b;c", "#5", "~", "`id`", "$(id)", "%41&amp;", "<script>alert(1)</script>".replace("/", "|"),
    "back\\slash", "*", "..x", "x" * 200, "\u202etxt", "new\nline",
)  # fmt: skip


def name_trials(base: Path) -> Iterator[tuple[str, str]]:
    """What was named so, and the fault of the workflow there; works and verifies, or is refused with a message.

    A name that is refused for a run is tried for all the rest.
    """
    plain = Workplace.made(base)
    for i, name in enumerate(NAMES):
        for run in (name, "a"):
            place = _named(base / f"{i}", plain.campaign, name, run)
            place.fresh()
            code, text = place.run()
            shown = f"{name[:30]!r}, run {run[:30]!r}"
            if code:
                message = next((line for line in text.splitlines() if "towval: " in line), "")
                yield f"named {shown}: {message[:300]}", (fault := fault_of(text)) and f"{fault}\n{text}"
            else:
                yield f"named {shown}", _unverified(place)
            shutil.rmtree(base / f"{i}")
            if not code:
                break


def _named(base: Path, campaign: Path, name: str, run: str) -> Workplace:
    """A copy of the checkout and of the campaign, and all in them that a user names, with this name, but the run."""
    checkout = base / name / "checkout"
    checkout.mkdir(parents=True)
    for part in _NEEDED:
        source = _REPOSITORY / part
        (shutil.copytree if source.is_dir() else shutil.copy)(source, checkout / part)
    copied = base / name / name
    shutil.copytree(campaign, copied)
    document = yaml.safe_load((copied / "campaign.yaml").read_text(encoding="utf-8"))
    (copied / "calibration").rename(copied / f"{name} p")
    (copied / "a.mp4").rename(copied / f"{name}.mp4")
    document["camera"]["calibration_images"] = f"{name} p/{Path(document['camera']['calibration_images']).name}"
    document["floor"]["image"] = f"{name} p/{Path(document['floor']['image']).name}"
    for key in document["floor"].keys() & {"more_images"}:
        document["floor"][key] = f"{name} p/{Path(document['floor'][key]).name}"
    document["runs"] = {run: {**document["runs"]["a"], "video": f"{name}.mp4"}}
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    (copied / "campaign.yaml").write_text(text, encoding="utf-8")
    return Workplace(base / name / "work", copied, checkout)


def _unverified(place: Workplace) -> str:
    folders = [path.parent for path in place.folder.glob("results/*/files.sha256")]
    if len(folders) != 1:
        return f"{len(folders)} folders of results instead of one"
    line = [sys.executable, "-m", "towval.cli", "verify", str(folders[0])]
    verified = subprocess.run(
        line, check=False, cwd=place.folder, env=place.variables(), capture_output=True, text=True
    )
    return "" if verified.returncode == 0 else f"does not verify\n{verified.stdout}{verified.stderr}"
