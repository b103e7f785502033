"""Films of the studies."""

import itertools
from pathlib import Path

import numpy as np

from studies.worlds.film import write_video
from towval.io.video import Video


def test_the_same_pictures_give_the_same_bytes(tmp_path: Path, lab_small: Path) -> None:
    rng = np.random.default_rng(5)
    pictures = [
        (time_s, np.clip(luma + rng.normal(0, 20, luma.shape), 0, 255).astype(np.uint8))
        for time_s, luma in itertools.islice(Video(lab_small / "b.mp4"), 12)
    ]
    written, held = set(), []
    for i in range(12):
        write_video(tmp_path / "a.mp4", pictures, crf="18", preset="veryfast")
        written.add((tmp_path / "a.mp4").read_bytes())
        # What an encoder takes from memory that it never wrote is another each time.
        held.append([np.full(int(rng.integers(10, 300_000)), i + rng.normal()) for _ in range(100)][::2])
    assert len(written) == 1
