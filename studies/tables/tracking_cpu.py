"""CPU time of the whole tracking pass over pure decoding of the same video, 1080p.

    python -m studies.tables.tracking_cpu [--frames 300] [--rounds 3]

A synthetic scene is written as H.264; decoding and tracking alternate, so that a busy machine slows both, and the
median ratio counts. Compiling is done before. The start (outlines, templates) costs as much as some thirty frames: in
short videos it shows.
"""

from __future__ import annotations

import argparse
import itertools
import resource
import tempfile
from pathlib import Path

import numpy as np

from studies.costs import cpu_seconds
from studies.worlds.film import write_video
from studies.worlds.scenes import CeilingCamera, FilmedScene, standard_scene
from towval.commands.console import errors_reported
from towval.io.video import Video
from towval.tracking.track import track


def measure(path: Path, scene: FilmedScene, rounds: int) -> list[tuple[float, float]]:
    """CPU seconds of decoding and of the pass, alternating."""
    clicks = scene.clicks(np.random.default_rng(0))

    def decode() -> None:
        for _ in Video(path):
            pass

    def follow() -> None:
        track(Video(path), scene.calibration, scene.bodies, clicks)

    track(itertools.islice(Video(path), 30), scene.calibration, scene.bodies, clicks)
    return [(cpu_seconds(decode), cpu_seconds(follow)) for _ in range(rounds)]


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    scene = standard_scene(77)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.mp4"
        write_video(path, CeilingCamera(scene).frames(np.arange(arguments.frames) / 25), crf="20", preset="veryfast")
        results = measure(path, scene, arguments.rounds)
        rate = path.stat().st_size * 8 / (arguments.frames / 25) / 1e6
    decoding, whole = np.median(results, axis=0) / arguments.frames * 1e3
    print(f"{arguments.frames} frames at {rate:.1f} Mbit/s, CPU ms a frame: decoding {decoding:.2f}, pass {whole:.2f}")
    print(f"ratio {np.median([b / a for a, b in results]):.3f} (must be at most 1.25, goal 1.1)")
    print(
        f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB, the synthetic camera included"
    )


if __name__ == "__main__":
    main()
