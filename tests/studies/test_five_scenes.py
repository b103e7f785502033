"""The page of five scenes: what it says of the choices of a run, and that its scenes are what it says."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from studies.tables.five_scenes import FILMED, Scene, page
from towval.model import Choice

CHOICES = (
    Choice("lens model", "k1", "k1 k2", 0.0007, "RMS over the picture"),
    Choice("tracking", "plane, 1024 points", "plane, 4096 points", 0.00008, "RMS of the path"),
    Choice("model of the object", "dynamics", "quasi-static patch", 0.012, "at most"),
    Choice("draws", "256", "128", float("nan"), "of u_val"),
    Choice("effect: tow above the floor", "taken", "left out", 0.0142, "RMS over the path"),
    Choice("effect: slope of the floor", "left out", "one deviation of it", 0.0011, "RMS over the path"),
    Choice("effect: friction radius", "left out", "one deviation of it", 0.0002, "RMS over the path"),
)


def test_the_page_says_what_was_taken_and_what_the_largest_left_out_would_move():
    result = SimpleNamespace(
        measured={"object": SimpleNamespace(time_s=np.arange(90))},
        comparison=SimpleNamespace(u_measurement_m=0.001, verdict="agrees"),
        choices=CHOICES,
        kept=(14, 22),
    )
    text = page([Scene("bar", "a bar", result, "Its true path is known.")])
    assert re.search(r"Made on \d{4}-\d\d-\d\d at commit [0-9a-f–]+\+? by", text)
    assert "| bar | a bar | dynamics (12 mm) | k1 (0.7 mm) | plane, 1024 points (0.08 mm) | 14 and 22 of 90 |" in text
    assert "| – | 256 (not known) | tow above the floor |" in text
    assert "u_D is 1.00 mm; the verdict: agrees." in text
    assert "left out, the largest is slope of the floor: 1.1 mm, 1.1 u_D. Its true path is known." in text
    assert "| lens model | k1 | k1 k2 | 0.7 mm RMS over the picture |" in text


def test_a_scene_that_is_refused_says_why():
    text = page([Scene("bar", "a bar", "it cannot be sampled")])
    row, head = (next(line for line in text.splitlines() if line.startswith(start)) for start in ("| bar", "| scene"))
    assert row.count("|") == head.count("|")
    assert "Refused: it cannot be sampled." in text


@pytest.mark.parametrize("name", FILMED)
def test_a_filmed_object_follows_the_rover_on_its_tether(name):
    tow = FILMED[name]
    short = type(tow)(**{**vars(tow), "seconds": min(tow.seconds, 3.0)})
    towed = short.towed(0.6)
    assert len(towed) == round(25 * short.seconds)
    assert np.isfinite(towed).all()
    moved = np.linalg.norm(towed[-1, :2] - towed[0, :2])
    rover = np.linalg.norm(tow.rover(short.seconds)[:2] - tow.rover(0.0)[:2])
    assert 0.3 * rover < moved < 1.1 * rover
