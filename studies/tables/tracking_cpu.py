"""CPU time of the whole tracking pass over pure decoding of the same video, 1080p.

    python -m studies.tables.tracking_cpu [--frames 300] [--rounds 3] [--campaign path/to/campaign]

A synthetic scene is written as H.264, or the videos of a campaign are read; decoding and tracking alternate, so that a
busy machine slows both, and the median ratio counts. Compiling is done before. The start (outlines, templates) costs as
much as some thirty frames: in short videos it shows. A film of fewer bits is decoded faster, and the ratio is larger.
"""

from __future__ import annotations

import argparse
import itertools
import resource
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from studies.costs import cpu_seconds
from studies.worlds.film import write_video
from studies.worlds.scenes import CeilingCamera, standard_scene
from towval.commands import calibrate
from towval.commands.console import errors_reported
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration
from towval.io.video import Luma, Video
from towval.model import Array, Body, Calibration
from towval.tracking.track import track


@dataclass(frozen=True)
class Film:
    """A video and what tracking it takes: clicks (n, 2) [px] by the name of a body."""

    path: Path
    calibration: Calibration
    bodies: Sequence[Body]
    clicks_px: Mapping[str, Array]

    def measured(self, rounds: int) -> list[tuple[float, float]]:
        """CPU seconds of decoding and of the pass, alternating."""

        def decode() -> None:
            for _ in Video(self.path):
                pass

        def follow(frames: Iterable[tuple[float, Luma]]) -> None:
            track(frames, self.calibration, self.bodies, self.clicks_px)

        follow(itertools.islice(Video(self.path), 30))
        return [(cpu_seconds(decode), cpu_seconds(lambda: follow(Video(self.path)))) for _ in range(rounds)]


@contextmanager
def synthetic(frames: int) -> Iterator[list[Film]]:
    """A film of a synthetic scene, one in a list."""
    scene = standard_scene(77)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.mp4"
        write_video(path, CeilingCamera(scene).frames(np.arange(frames) / 25), crf="20", preset="veryfast")
        yield [Film(path, scene.calibration, scene.bodies, scene.clicks(np.random.default_rng(0)))]


def of_campaign(folder: Path) -> list[Film]:
    """The films of a campaign, calibrated by its pictures."""
    campaign = load_campaign(folder)
    with TemporaryDirectory() as results:
        calibrate.run(folder, Path(results) / "camera.mcap")
        calibration = read_calibration(Path(results) / "camera.mcap")
    return [Film(run.video, calibration, campaign.bodies, run.clicks_px) for run in campaign.runs.values()]


def ratio(measured: Iterable[tuple[float, float]]) -> float:
    """Median of the pass over decoding."""
    return float(np.median([whole / decoding for decoding, whole in measured]))


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--campaign", type=Path, help="its videos in place of a synthetic one")
    arguments = parser.parse_args()
    print("film       frames   MB  decoding    pass  ratio   (CPU ms a frame; at most 1.25, goal 1.1)")
    with nullcontext(of_campaign(arguments.campaign)) if arguments.campaign else synthetic(arguments.frames) as films:
        for film in films:
            results, frames = film.measured(arguments.rounds), sum(1 for _ in Video(film.path))
            decoding, whole = 1e3 * np.median(results, axis=0) / frames
            megabytes = film.path.stat().st_size / 1e6
            print(f"{film.path.name:10}{frames:7}{megabytes:5.1f}{decoding:10.2f}{whole:8.2f}{ratio(results):7.2f}")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB, with what filmed the scene")


if __name__ == "__main__":
    main()
