"""Rows that were taken at another time than those beside them: interlaced video, and what is none."""

import re

import numpy as np
import pytest
from driven import MOTION, PICTURES, STEP_S, filmed, tracked
from painted import POSE
from painted import picture as painted_picture
from painted import target as painted_target

from towval.model.geometry import compose
from towval.tracking.echoes import Echoes
from towval.tracking.fields import Fields, _apart, field_findings, field_lateness


def woven(even, odd):
    """A picture of the even rows of one and the odd rows of another."""
    both = even.copy()
    both[1::2] = odd[1::2]
    return both


def apart(later, heading=0.7, pictures=10, **painted):
    """What fields show in pictures of a painted body whose odd rows are later by a share of a picture's time."""
    own = painted_target()
    step = 2.0 * own.metres_per_pixel(POSE) * np.array([np.cos(heading), np.sin(heading), 0.0])
    fields = Fields(own, Echoes(own, painted_picture(own, **painted), POSE).template)
    for i in range(pictures):
        at = (compose(POSE, when * step) for when in (i, i + later))
        seen = (painted_picture(own, pose, seed=2 * i + k, **painted) for k, pose in enumerate(at))
        fields.look(woven(*seen), compose(POSE, (i + later / 2) * step), step)
    return fields.apart()


@pytest.mark.parametrize("later", [0.5, -0.5, 1.0])
@pytest.mark.parametrize("heading", [0.0, -0.9, -1.87])  # 1.87 and 0.3 of the pose: along the columns of the picture
def test_the_time_between_the_fields_is_found(later, heading):
    assert apart(later, heading, noise=2.0) == pytest.approx(abs(later), rel=0.25)


@pytest.mark.parametrize(("later", "named"), [(0.0, False), (0.07, False), (0.16, True)])
def test_fields_are_named_from_a_tenth_of_a_picture_on(later, named):
    assert (apart(later, noise=1.0) > 0) == named


def test_few_pictures_tell_nothing():
    assert apart(0.5, pictures=7) == 0.0
    assert apart(0.5, pictures=8) == pytest.approx(0.5, rel=0.25)


@pytest.mark.parametrize(("scatter", "named"), [(0.09, True), (0.15, False)])
def test_what_scatters_from_picture_to_picture_is_not_named(scatter, named):
    share = 0.3 + scatter * np.tile([1.0, -1.0], 4)
    assert (_apart(np.column_stack([np.ones(8), share])) > 0) == named


def test_fields_swapped_in_mid_run_are_found_in_its_parts():
    own = painted_target()
    fields = Fields(own, None)
    rows = np.column_stack([np.full(32, 100.0), 100.0 * np.repeat([0.5, -0.5], 16)])
    fields.rows.extend(rows.ravel())
    assert fields.apart() == pytest.approx(0.5)


def test_interlaced_video_is_named_and_its_poses_may_be_those_of_either_field():
    _, pictures = filmed()
    found = tracked([woven(pictures[i], pictures[i + 2]) for i in range(0, len(pictures), 5)])
    (named,) = [each for each in found["rover"].findings if each.code == "fields_apart"]
    # The object rests: it is the rover that shows what the camera does.
    assert named in found["object"].findings
    assert float(re.search(r"taken (\d+) ms", named.text)[1]) == pytest.approx(400 * STEP_S, rel=0.3)
    middle = [MOTION((i + 0.2) * STEP_S)[:2] for i in range(5, PICTURES)]
    error = np.linalg.norm(found["rover"].pose[5:, :2] - middle, axis=1)
    std = np.sqrt(np.linalg.eigvalsh(found["rover"].covariance[5:, :2, :2])[:, -1])
    assert np.all(error < 2 * std)
    way = np.linalg.norm(np.diff(middle, axis=0)[-5:], axis=1)
    assert std[-5:] == pytest.approx(0.2 * way, rel=0.3)


def test_progressive_video_is_not():
    _, pictures = filmed()
    assert "fields_apart" not in {each.code for each in tracked(pictures[::5])["rover"].findings}


def test_lateness_is_half_of_the_time_between_the_fields():
    time_s = np.arange(10) * STEP_S
    pose = np.column_stack([0.3 * time_s, np.zeros(10), np.zeros(10)])
    assert np.sqrt(field_lateness(time_s, pose, 0.5)[[0, 5], 0, 0]) == pytest.approx(0.3 * STEP_S / 4)
    assert not field_lateness(time_s, pose, 0.0).any()
    (found,) = field_findings(time_s, 0.5)
    assert "taken 20 ms before or after" in found.text
    assert field_findings(time_s, 0.0) == ()
