"""Peak memory of the tracking pass: 4K at 120 pictures a second, 1080p, and videos of growing length.

    python -m studies.tables.tracking_memory

Each case runs in a process of its own, whose largest resident set counts, libraries included. The long videos are one
short file played again and again with times that go on, the bodies at rest: what grows with the length is the record.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studies.worlds.film import write_video
from studies.worlds.scenes import CeilingCamera, FilmedScene, ceiling, drive, small_camera, standard_scene
from towval.commands.console import errors_reported
from towval.io.video import Video
from towval.tracking.track import track

LIMIT_MB = {"4k": 500, "1080p": 400, "small": 400}
LENGTHS = (("4k", 36), ("1080p", 500), ("small", 500), ("small", 10_000))


def scene_of(kind: str) -> FilmedScene:
    """The scene of a case: bodies that drive under a 4K camera, or stand under one of 1080p or a small one."""
    if kind == "4k":
        camera, floor = ceiling((3840, 2160), 3120.0)
        return standard_scene(5, camera=camera, floor=floor)
    size = small_camera() if kind == "small" else {}
    return standard_scene(5, **size, motions=(drive((-0.3, 0.4, 0.1), 0.0), drive((-0.9, -0.5, 0.2), 0.0)))


def again_and_again(path: Path, frames: int) -> Iterator[tuple[float, np.ndarray]]:
    """The pictures of a short video, played until there are ``frames`` of them, 25 a second.

    They are decoded once: a decoder that is opened hundreds of times grows by itself.
    """
    pictures = [luma.copy() for _, luma in Video(path)]
    for i in range(frames):
        yield i / 25, pictures[i % len(pictures)]


def peak_memory_mb() -> float:
    """Largest resident set of this program [MB of 10⁶ bytes].

    ``ru_maxrss`` would hold that of the program that started it, too.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return float(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) * 1024 / 1e6


def measure(kind: str, path: Path, frames: int) -> None:
    """Track a video and print the frames, the share tracked and the peak memory [MB]."""
    scene = scene_of(kind)
    clicks = scene.clicks(np.random.default_rng(0))
    pictures = Video(path) if kind == "4k" else again_and_again(path, frames)
    tracks = track(pictures, scene.calibration, scene.bodies, clicks)
    seen = np.mean([found.seen.mean() for found in tracks.values()])
    peak = peak_memory_mb()
    print(len(tracks["rover"].time_s), f"{seen:.3f}", f"{peak:.0f}")


@dataclass(frozen=True)
class Peak:
    """Of a case: its kind, frames, share tracked, and peak memory [MB]."""

    kind: str
    frames: int
    tracked: float
    peak_mb: float


def command(kind: str, path: Path, frames: int) -> list[str]:
    """What measures a case in a process of its own."""
    return [sys.executable, __file__, "--case", kind, str(path), str(frames)]


def peaks(lengths: Iterable[tuple[str, int]]) -> Iterator[Peak]:
    """The peak memory of videos of a kind and a number of frames; of "4k" there are always 36."""
    with tempfile.TemporaryDirectory() as folder:
        paths = {kind: Path(folder) / f"{kind}.mp4" for kind in LIMIT_MB}
        film = CeilingCamera(scene_of("4k")).frames(np.arange(36) / 120)
        write_video(paths["4k"], film, rate=120, crf="20", preset="ultrafast")
        for kind in ("1080p", "small"):
            still = replace(scene_of(kind), noise=3.0)
            write_video(paths[kind], CeilingCamera(still).frames(np.arange(30) / 25), crf="20", preset="ultrafast")
        subprocess.run(command("4k", paths["4k"], 36), capture_output=True, check=True)  # Compiling takes memory, too.
        for kind, frames in lengths:
            call = command(kind, paths[kind], frames)
            seen, tracked, peak = subprocess.run(call, capture_output=True, text=True, check=True).stdout.split()
            yield Peak(kind, int(seen), float(tracked), float(peak))


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        kind, path, frames = arguments.case
        measure(kind, Path(path), int(frames))
        return
    for each in peaks(LENGTHS):
        limit = LIMIT_MB[each.kind]
        verdict = "below" if each.peak_mb < limit else "ABOVE"
        print(
            f"{each.kind:6s}{each.frames:>7d} frames, tracked {each.tracked:.3f}, peak {each.peak_mb:.0f} MB "
            f"({verdict} {limit} MB)",
            flush=True,
        )


if __name__ == "__main__":
    main()
