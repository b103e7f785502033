"""A body whose texture does not hold its place, followed by the edges of its top."""

from types import SimpleNamespace

import numpy as np
import pytest
from painted import POSE, picture, target, texture

from towval.model import TrackStatus
from towval.model.geometry import compose
from towval.tracking import edges_alone
from towval.tracking.edges_alone import EdgesAlone
from towval.tracking.finished_track import finished
from towval.tracking.follow import Follower
from towval.tracking.outline import OutlineFit, observe_outline
from towval.tracking.pose import Measurement, Tracker, step_between
from towval.tracking.template import make_template

BOX = target()
PIXEL_M = BOX.metres_per_pixel(POSE)
GREY = texture(mean=170.0, contrast=8.0)
USUAL = OutlineFit(np.zeros(3), np.diag([0.1 * PIXEL_M, 0.1 * PIXEL_M, 1e-3]) ** 2)
SIZES = np.zeros((1, 2))


class Fading(Tracker):
    """Finds the texture where it is, or nothing where it has faded."""

    def __init__(self):
        self.at, self.faded = POSE, False

    def measure(self, luma, predicted, velocity=None):
        return None if self.faded else Measurement(self.at, np.diag([1e-4, 1e-4, 1e-4]) ** 2, residual=1.0)


def followed(rate, pictures=range(40, 80), step_m=1e-3, covered=None):
    """A box on its way whose texture has faded in some pictures: its track and how far it is off [px]."""
    tracker, luma = Fading(), picture(BOX, grey=GREY)
    follower = Follower(BOX, 0.0, luma, BOX.pixels(BOX.body.top_corners_m, POSE), lambda *_: tracker, 0.2)
    follower.relocaliser = SimpleNamespace(find=lambda _: None)
    follower.lookalikes = SimpleNamespace(candidates=lambda _: [], rivals=lambda *_: [], twins=[])
    true = [compose(POSE, np.array([step_m * i, 0, 1e-4 * i])) for i in range(100)]
    for i, pose in enumerate(true[1:], start=1):
        tracker.at, tracker.faded = pose, i in pictures
        follower.follow(i / rate, picture(BOX, pose, covered if i in pictures and covered else GREY))
    track = finished(follower.followed(), "scripted")
    return track, np.linalg.norm((track.pose - true)[:, :2], axis=1) / PIXEL_M


def test_a_body_whose_texture_fades_is_followed_by_its_edges_as_well_as_they_are_known():
    track, off_px = followed(25)
    assert track.seen.all()
    assert off_px.max() < 0.15
    off_m = off_px * PIXEL_M
    std_m = np.sqrt(np.trace(track.covariance[:, :2, :2], axis1=1, axis2=2))
    assert (off_m < 3 * std_m).all()
    assert std_m[40:80].max() < 0.3 * PIXEL_M
    texts = [found.text for found in track.findings if found.code == "edges_alone"]
    assert len(texts) == 1
    assert "40 of 100 pictures" in texts[0]


def test_what_covers_a_body_is_not_followed_by_its_edges():
    """A card of the body's size lies on it from some picture on, with edges in the same places."""
    track, _ = followed(25, covered=texture(seed=5, mean=170.0, contrast=8.0))
    assert not (track.status[40:80] == TrackStatus.TRACKED).any()
    assert not any(found.code == "edges_alone" for found in track.findings)


def test_edges_are_not_followed_where_a_body_may_be_far():
    """At two pictures a second another thing may stand where it is predicted."""
    track, _ = followed(2)
    assert not (track.status[40:80] == TrackStatus.TRACKED).any()


@pytest.fixture
def alone():
    return EdgesAlone(BOX, make_template(picture(BOX, grey=GREY), BOX, POSE))


@pytest.mark.parametrize("step_px", [(0, 0, 0), (4, -4, 0), (-3, 3, 0.02), (0, 5, -0.03)])
def test_a_body_beside_where_it_is_predicted_is_found(alone, step_px):
    step = np.array(step_px) * [PIXEL_M, PIXEL_M, 1.0]
    found = alone.measure(picture(BOX, grey=GREY), compose(POSE, step), [USUAL], SIZES)
    assert BOX.apart_m(found.pose, POSE) < 0.2 * PIXEL_M  # A corner, by its turn as well.


def test_a_body_beyond_reach_is_not_found_at_other_edges(alone):
    step = np.array([20 * PIXEL_M, 0, 0])
    assert alone.measure(picture(BOX, grey=GREY), compose(POSE, step), [USUAL], SIZES) is None


@pytest.mark.parametrize(("strip_px", "is_found"), [(0.0, True), (5.0, False)])
def test_where_one_end_fades_into_the_floor_the_top_itself_confirms_the_other(strip_px, is_found):
    """The side that is seen below that end has an edge as clear, and with no front edge all else fits with it."""
    faint, strip_m = texture(mean=170.0, contrast=3.0, finest_m=0.5), strip_px * PIXEL_M
    own = EdgesAlone(BOX, make_template(picture(BOX, grey=faint), BOX, POSE))
    middle = np.array([0.6 - strip_m / 2, 0.0])

    def grey(xy):
        return np.where(xy[:, 0] + middle[0] < -0.6, 140.0, faint(xy + middle))

    luma = picture(target(length=2.4 + strip_m), compose(POSE, np.array([*middle, 0.0])), grey)
    found = own.measure(luma, compose(POSE, np.array([-strip_m, 0.0, 0.0])), [USUAL], SIZES)
    assert (found is not None) == is_found
    assert not is_found or BOX.apart_m(found.pose, POSE) < 0.5 * PIXEL_M


def test_a_shadow_over_a_part_of_a_top_of_which_one_end_fades_into_the_floor_is_not_left_over():
    faint = texture(mean=170.0, contrast=3.0, finest_m=0.5)
    own = EdgesAlone(BOX, make_template(picture(BOX, grey=faint), BOX, POSE))
    middle = np.array([0.6, 0.0])

    def shaded(xy):
        at = xy + middle
        return np.where(at[:, 0] < -0.6, 140.0, faint(at)) - 15 / (1 + np.exp(-at[:, 1] / 0.1))

    luma = picture(target(length=2.4), compose(POSE, np.array([*middle, 0.0])), shaded)
    found = own.measure(luma, POSE, [USUAL], SIZES)
    assert found is not None
    assert BOX.apart_m(found.pose, POSE) < 0.5 * PIXEL_M


def test_edges_stand_where_the_texture_of_the_registered_pictures_says(alone):
    """Edges that lay beside the texture's place all along lie beside it still."""
    beside = OutlineFit(np.array([0.5 * PIXEL_M, 0, 0]), USUAL.covariance)
    found = alone.measure(picture(BOX, grey=GREY), POSE, [beside], SIZES)
    assert step_between(found.pose, POSE)[0] / PIXEL_M == pytest.approx(0.5, abs=0.1)


def test_edges_too_far_apart_are_as_uncertain_as_that(alone):
    luma = picture(BOX, grey=GREY)
    size = observe_outline(luma, BOX, POSE, wide=True).size
    sure = alone.measure(luma, POSE, [USUAL], size[None])
    unsure = alone.measure(luma, POSE, [USUAL], size[None] + PIXEL_M)
    assert unsure.covariance[0, 0] > sure.covariance[0, 0] + (0.2 * PIXEL_M) ** 2


@pytest.mark.parametrize(
    ("std_px", "usual_px", "is_found"), [(0.2, 0.2, True), (0.4, 0.2, False), (0.12, 0.05, True), (0.2, 0.05, False)]
)
def test_only_sure_edges_are_followed(alone, monkeypatch, std_px, usual_px, is_found):
    """As sure as a third of a pixel, and as three times what was usual."""
    known = np.diag([PIXEL_M, PIXEL_M, 1e-3]) ** 2
    fit = OutlineFit(np.zeros(3), std_px**2 * known)
    monkeypatch.setattr(edges_alone, "observe_outline", lambda *_, **__: fit)
    usual = OutlineFit(np.zeros(3), usual_px**2 * known)
    found = alone.measure(picture(BOX, grey=GREY), POSE, [usual], SIZES)
    assert (found is not None) == is_found


@pytest.mark.parametrize(("contrast", "is_found"), [(12.0, True), (20.0, False)])
def test_only_faint_texture_gives_way_to_edges(contrast, is_found):
    """Strong texture that is not found is hidden, and so may its edges be."""
    grey = texture(mean=170.0, contrast=contrast)
    own = EdgesAlone(BOX, make_template(picture(BOX, grey=grey), BOX, POSE))
    assert (own.measure(picture(BOX, grey=grey), POSE, [USUAL], SIZES) is not None) == is_found


@pytest.mark.parametrize(("brighter", "is_found"), [(30.0, True), (60.0, False)])
def test_a_glint_on_part_of_a_top_is_not_followed(alone, brighter, is_found):
    """Its border stands out more than the edges."""
    glint = picture(BOX, grey=lambda xy: GREY(xy) + brighter * (xy[:, 0] < -0.3))
    assert (alone.measure(glint, POSE, [USUAL], SIZES) is not None) == is_found


def test_a_body_without_texture_has_nothing_to_tell_it_by():
    assert EdgesAlone(BOX, None).measure(picture(BOX, grey=GREY), POSE, [USUAL], SIZES) is None


@pytest.mark.parametrize(
    "registration", [None, OutlineFit(np.array([PIXEL_M, -0.5 * PIXEL_M, 0.01]), USUAL.covariance)]
)
def test_poses_end_where_the_edges_are_whatever_the_registration_became(alone, registration):
    """What led from texture to edges when few outlines were known is not what all of them say in the end."""
    beside = OutlineFit(np.array([0.5 * PIXEL_M, 0, 0]), USUAL.covariance)
    alone.keep(7, alone.measure(picture(BOX, grey=GREY), POSE, [beside], SIZES))
    found = alone.measure(picture(BOX, grey=GREY), POSE, [beside], SIZES)
    pose = compose(found.pose, alone.steps(registration)[0])
    pose = pose if registration is None else compose(pose, registration.correction)
    assert BOX.apart_m(pose, POSE) < 0.1 * PIXEL_M
    assert alone.pictures == [7]


@pytest.mark.parametrize(("off_px", "is_found"), [(1.0, True), (3.0, False)])
def test_edges_farther_off_have_to_be_as_sure_from_where_they_are(alone, monkeypatch, off_px, is_found):
    """An outline that is sure from where the body is predicted, and not from where that leads."""
    luma, there = picture(BOX, grey=GREY), compose(POSE, np.array([off_px * PIXEL_M, 0, 0]))
    unsure = OutlineFit(np.zeros(3), np.diag([PIXEL_M, PIXEL_M, 1e-3]) ** 2)

    def observed(_luma, _target, pose, wide):
        at_the_end = BOX.apart_m(pose, POSE) < 0.01 * PIXEL_M
        return unsure if at_the_end else OutlineFit(step_between(pose, POSE), USUAL.covariance)

    monkeypatch.setattr(edges_alone, "observe_outline", observed)
    assert (alone.measure(luma, there, [USUAL], SIZES) is not None) == is_found
