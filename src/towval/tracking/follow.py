"""One body followed through a video: prediction, measurement, acceptance, and the record."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Finding, Track, TrackStatus
from towval.model.geometry import compose, transform, wrapped
from towval.tracking.echoes import Echoes
from towval.tracking.edges_alone import ByEdges, EdgesAlone
from towval.tracking.fields import Fields
from towval.tracking.finished_track import Followed
from towval.tracking.jumps import jump_findings
from towval.tracking.outline import OutlineFit, as_begun, judge_clicks, observe_outline, observe_size, pose_from_clicks
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import Measurement, Motion, Tracker, as_tracker, step_between
from towval.tracking.record import Record
from towval.tracking.relocalisation import Candidate, Lookalikes, Relocaliser
from towval.tracking.template import Luma
from towval.tracking.two_measurements import EdgeWatch
from towval.tracking.warped_top import WarpedTop

TrackerMaker = Callable[[PlanarTarget, Luma, Array], Tracker]


@dataclass(frozen=True)
class FollowConstants:
    """Tuned constants of following; lengths in pixels are measured on the planar target."""

    outline_every_s: float = 0.5  # [s] Between pictures whose edges are fitted, at first;
    outline_doubled_after: int = 12  # doubled after each dozen, so that a long video costs little more.
    most_acceleration: float = 5.0  # [m/s²] ASSUME: half of gravity, more than wheels or a tether give.
    surprise_px: float = 3.0  # [px] From the prediction, beyond what acceleration explains.
    search_every_s: float = 0.23  # [s] Between searches for a lost body: both ways of it within half a second.
    foreign: float = 3.0  # Times the usual misfit: probably something else.
    agree_px: float = 2.0  # [px] Within which a search confirms a doubtful pose.
    home: float = 0.5  # Of a body's reach from its place: nothing else can be so near.
    much_farther: float = 4.0  # Distance of a rival over that of the find for which the find counts.
    remembered_s: float = 3.0  # [s] How long the last place is of use for a body that may move unobserved.
    most_covered: float = 0.3  # Of a target over another body: bodies stand beside each other.


CONSTANTS = FollowConstants()

_NOWHERE, _UNKNOWN = np.full(3, np.nan), np.full((3, 3), np.nan)


class Follower:
    """Follows one body from clicks on its corners (n, 2) [px] in the first picture and keeps a record.

    ``make_tracker`` builds the tracker from target, picture and pose. A body that is not observed is predicted for
    ``coast_s`` [s] before it counts as lost.
    """

    def __init__(
        self,
        target: PlanarTarget,
        time_s: float,
        luma: Luma,
        clicks_px: Array,
        make_tracker: TrackerMaker,
        coast_s: float,
    ):
        self.target, self.coast_s = target, coast_s
        clicked, self.start_covariance, misfit_px = pose_from_clicks(target, clicks_px)
        self.pixel_m = target.metres_per_pixel(clicked)
        self.findings = judge_clicks(target.body, misfit_px, self.pixel_m)
        fit = observe_outline(luma, target, clicked)
        self.first_pose = clicked if fit is None else compose(clicked, fit.correction)
        self.outline_fits: list[OutlineFit] = []
        self.fitted_in: list[int] = []
        self.edge_watch, self.echoes = EdgeWatch(target), Echoes(target, luma, self.first_pose)
        self.fields, self.warp = Fields(target, self.echoes.template), WarpedTop(target, self.echoes.template)
        self.edges_alone = EdgesAlone(target, self.echoes.template)
        self.sizes: list[float] = []
        self.next_outline_s = self.next_search_s = self.confirmed_until_s = time_s
        self.outlines_fitted = self.mistakable = self.searches = 0
        self.tracker = as_tracker(make_tracker(target, luma, self.first_pose))
        self.relocaliser = Relocaliser(target, luma, self.first_pose)
        self.lookalikes = Lookalikes(target, luma, self.first_pose)
        self.looked: tuple[float, list[Candidate]] | None = None
        self.motion, self.texture_motion = Motion(time_s, self.first_pose), Motion(time_s, self.first_pose)
        self.record = Record()
        self.follow(time_s, luma)

    @property
    def place(self) -> Array | None:
        """Outline (n, 2) of the body on the floor in the last picture [m]; None where it was not observed."""
        tracked = self.record.last_status == TrackStatus.TRACKED
        return transform(self.motion.pose, self.target.body.top_corners_m) if tracked else None

    def follow(self, time_s: float, luma: Luma, others: Sequence["Follower"] = ()) -> None:
        """Take in the next picture: predict, measure, decide, record. ``others`` follow the other bodies."""
        coasting = time_s - self.motion.time_s <= self.coast_s
        # The picture after an observation is always predicted, however slow the video.
        after_observation = self.record.last_status == TrackStatus.TRACKED
        predicted = self.motion.predict(time_s) if coasting or after_observation else self.motion.pose
        accepted = self._accepted(time_s, luma, predicted, others)
        if accepted is not None:
            self._keep_observation(time_s, luma, accepted)
        elif coasting:
            self.record.keep(time_s, predicted, self._coasting_covariance(time_s), TrackStatus.COASTING, 0.0, np.nan)
        else:
            self.record.keep(time_s, _NOWHERE, _UNKNOWN, TrackStatus.LOST, 0.0, np.nan)

    def _accepted(
        self, time_s: float, luma: Luma, predicted: Array, others: Sequence["Follower"]
    ) -> Measurement | None:
        """The measurement that counts as an observation, None where the frame coasts or is lost.

        Every decision about a frame is made here: the tracker's own gates (None), the motion, relocalisation,
        lookalikes after a gap, and the places of other bodies.
        """
        measured = self.tracker.measure(luma, predicted, self.motion.velocity)
        measured = self._as_the_texture_went(time_s, luma, predicted, measured)
        may_stray_m = CONSTANTS.most_acceleration * (time_s - self.motion.time_s) ** 2
        if measured is None and may_stray_m < CONSTANTS.home * self.target.reach_m:
            measured = self._by_edges(luma, predicted)
        after_gap = self.record.last_status not in (None, TrackStatus.TRACKED)
        if measured is None or self._surprising(time_s, measured.pose):
            measured = self._search(time_s, luma, measured, others)
        elif after_gap and not self._unmistakable(time_s, luma, measured.pose, others):
            return None
        return None if measured is None or self._taken(measured.pose, others) else measured

    def _taken(self, pose: Array, others: Sequence["Follower"]) -> bool:
        """Whether another body stands at a pose: two cannot be in one place."""
        places = [other.place for other in others]
        return any(place is not None and self._over(pose, place) for place in places)

    def _over(self, pose: Array, outline: Array) -> bool:
        return self.target.covered_by(pose, outline) > CONSTANTS.most_covered

    def _as_the_texture_went(
        self, time_s: float, luma: Luma, predicted: Array, measured: Measurement | None
    ) -> Measurement | None:
        """A measurement, or, where none is or it looks foreign, a better one where the texture's own motion leads.

        Where the outline hops from one edge to another and back, the motion predicts as if the body had.
        """
        led = self.texture_motion.predict(time_s)
        if self.target.apart_m(led, predicted) < CONSTANTS.agree_px * self.pixel_m:
            return measured
        # Of a lost body nobody knows the motion.
        unsure = self.record.last_status != TrackStatus.LOST if measured is None else self._foreign(measured)
        if not unsure:
            return measured
        again = self.tracker.measure(luma, led, self.texture_motion.velocity)
        better = again is not None and (measured is None or again.residual < measured.residual)
        return again if better else measured

    def _foreign(self, measured: Measurement) -> bool:
        """Whether far more is left over than usual: probably something else."""
        return measured.residual > CONSTANTS.foreign * self.record.usual_misfit()

    def _surprising(self, time_s: float, pose: Array) -> bool:
        """Whether a pose is farther from where the motion leads than a body can have got.

        An outline that hops takes the motion along, and then the texture's own one leads to where the body is.
        """
        gap_s = time_s - self.motion.time_s
        led = (self.motion.predict(time_s), self.texture_motion.predict(time_s))
        return min(self.target.apart_m(place, pose) for place in led) > float(self._explained_m(gap_s))

    def _explained_m(self, gap_s: ArrayLike) -> Array:
        """How far acceleration and noise lead from where the motion would after gaps (...) [m]."""
        return np.asarray(CONSTANTS.surprise_px * self.pixel_m + CONSTANTS.most_acceleration * np.square(gap_s))

    def _search(
        self, time_s: float, luma: Luma, doubtful: Measurement | None, others: Sequence["Follower"] = ()
    ) -> Measurement | None:
        """Search the whole picture; a doubtful measurement is confirmed if the search leads to the same place.

        Where a shaken camera makes each picture surprising, one that confirms a measurement serves the next ones, too.
        """
        if doubtful is not None and time_s < self.confirmed_until_s and not self._foreign(doubtful):
            return doubtful
        first = self.record.last_status in (None, TrackStatus.TRACKED)
        if time_s < self.next_search_s and not first:
            return None
        self.next_search_s, self.searches = time_s + CONSTANTS.search_every_s, 0 if first else self.searches + 1
        for place in self._places(time_s, luma):
            found = self._found_at(luma, place)
            if found is None:
                continue
            apart_m = 0.0 if doubtful is None else self.target.apart_m(found.pose, doubtful.pose)
            if self._surprising(time_s, found.pose) and self._foreign(found):
                continue
            if apart_m <= CONSTANTS.agree_px * self.pixel_m and self._unmistakable(time_s, luma, found.pose, others):
                if doubtful is not None:
                    self.confirmed_until_s = self.next_search_s
                return found
        return None

    def _places(self, time_s: float, luma: Luma) -> Iterator[Array]:
        """Candidate poses: by features, for which part of the body suffices, then by its whole appearance.

        By appearance it is the best place and, of those as good, the one nearest to where the body was. A body that
        stays lost is searched for by one and the other in turn, which halves the cost.
        """
        if self.searches % 2 == 0:
            place = self.relocaliser.find(luma)
            if place is not None:
                yield place
        if self.searches == 0 or self.searches % 2 == 1:
            candidates = self._candidates(time_s, luma)
            for best in candidates[:1]:
                yield best.pose
                as_good = self.lookalikes.rivals(candidates, best.pose) or []
                yield from sorted(as_good, key=lambda pose: self._stray_m(time_s, pose))[:1]

    def _candidates(self, time_s: float, luma: Luma) -> list[Candidate]:
        """What looks like the body in a picture, sought once."""
        if self.looked is None or self.looked[0] != time_s:
            self.looked = time_s, self.lookalikes.candidates(luma)
        return self.looked[1]

    def _unmistakable(self, time_s: float, luma: Luma, pose: Array, others: Sequence["Follower"] = ()) -> bool:
        """Whether the picture at a pose looks like the body, and nothing else that looks alike could be it.

        A rival is ruled out where another body is known to stand, where the tracker does not find the body at full
        resolution, where it is farther than a body can have moved, or much farther than ``pose`` from the last or
        predicted place: with ``pose`` near that place, or the rival over ``pose``, which then is the body itself,
        turned. A body with a twin may be hidden while the twin is in view: it is accepted only near its place.
        """
        if self._turned_round(time_s, pose):
            self.mistakable += 1
            return False
        rivals = self.lookalikes.rivals(self._candidates(time_s, luma), pose)
        if rivals is None:
            return False
        rivals = [rival for rival in rivals if not self._taken(rival, others) and self._as_sharp(luma, rival)]
        stray, remembered = self._stray_m(time_s, pose), time_s - self.motion.time_s <= CONSTANTS.remembered_s
        at_home = remembered and stray <= CONSTANTS.home * self.target.reach_m
        nearest = min((self._stray_m(time_s, rival) for rival in rivals), default=np.inf)
        within_reach = [rival for rival in rivals if not self._surprising(time_s, rival)]
        alone = not within_reach if not self._surprising(time_s, pose) else not rivals
        outline = transform(pose, self.target.body.top_corners_m)
        turned = remembered and all(self._over(rival, outline) for rival in rivals)
        alone |= (at_home or turned) and nearest > CONSTANTS.much_farther * stray
        if alone and (at_home or not self._twin_at_large(others)):
            return True
        self.mistakable += 1
        return False

    def _turned_round(self, time_s: float, pose: Array) -> bool:
        """Whether a pose lies over the last one, but turned by more than a body turns while it is remembered.

        A pattern that looks the same both ways is found so where the body itself does not quite fit.
        """
        last = self.motion.pose
        if time_s - self.motion.time_s > CONSTANTS.remembered_s or abs(wrapped(pose[2] - last[2])) < np.pi / 2:
            return False
        return self._over(pose, transform(last, self.target.body.top_corners_m))

    def _twin_at_large(self, others: Sequence["Follower"]) -> bool:
        """Whether what looked like the body in the first picture may be anywhere: no tracked body stood there."""
        tracked = [transform(one.first_pose, one.target.body.top_corners_m) for one in others if one.place is not None]
        return any(not any(self._over(twin, place) for place in tracked) for twin in self.lookalikes.twins)

    def _as_sharp(self, luma: Luma, place: Array) -> bool:
        """Whether the tracker, too, finds the body at a place that looks like it coarsely."""
        found = self._found_at(luma, place)
        return found is not None and self.target.apart_m(found.pose, place) < self.target.reach_m / 2

    def _found_at(self, luma: Luma, place: Array) -> Measurement | None:
        """The body near a place to which a search leads, by its texture or by its edges alone."""
        return self.tracker.measure(luma, place) or self._by_edges(luma, place)

    def _by_edges(self, luma: Luma, place: Array) -> Measurement | None:
        return self.edges_alone.measure(luma, place, self.outline_fits, self.edge_watch.looks().size)

    def _stray_m(self, time_s: float, pose: Array) -> float:
        """Distance of a pose from the last observation or from the prediction, the smaller [m]."""
        return min(self.target.apart_m(known, pose) for known in (self.motion.pose, self.motion.predict(time_s)))

    def _keep_observation(self, time_s: float, luma: Luma, found: Measurement) -> None:
        if isinstance(found, ByEdges):
            pose = self.motion.observe(time_s, found.pose)
            self.texture_motion.observe(time_s, pose)
            self.edges_alone.keep(len(self.record), found)
        else:
            found, pose = self._by_texture(time_s, luma, found)
        self.record.keep(time_s, pose, found.covariance, TrackStatus.TRACKED, found.inlier_fraction, found.residual)

    def _by_texture(self, time_s: float, luma: Luma, found: Measurement) -> tuple[Measurement, Array]:
        """A measurement by the texture, measured again where the outline shows a better one, and its pose."""
        due, predicted = time_s >= self.next_outline_s, self.motion.predict(time_s)
        # What stays in the picture (a sensor's pattern) holds plain parts where they stood: the few edges look hidden.
        asked = due or self._foreign(found)
        found, fit, apart = self.edge_watch.look(len(self.record), time_s, luma, found, predicted, self.tracker, asked)
        found.learn()
        pose, place = found.pose, compose(found.pose, fit.correction) if fit is not None and apart else found.pose
        if time_s > self.motion.time_s:
            step = self.motion.velocity * (time_s - self.motion.time_s)
            if self.echoes.is_due(step):
                self.echoes.look(luma, pose, step)
                self.fields.look(luma, pose, step)
                self.warp.look(time_s, luma, pose)
            place = self.motion.observe(time_s, place)
            self.texture_motion.observe(time_s, pose)
            pose = np.array([*pose[:2], place[2] + step_between(place, pose)[2]])
        self.record.keep_points(found.points_m, found.weights)
        if due:
            if fit is not None:
                self.outline_fits.append(as_begun(luma, self.target, found.pose, fit, self.start_covariance))
                self.fitted_in.append(len(self.record))
            size = observe_size(luma, self.target, place)
            if size is not None:
                self.sizes.append(size)
            self.outlines_fitted += 1
            doublings = self.outlines_fitted // CONSTANTS.outline_doubled_after
            self.next_outline_s = time_s + CONSTANTS.outline_every_s * 2**doublings
        return found, pose

    def _coasting_covariance(self, time_s: float) -> Array:
        # ASSUME: while not observed the body may have stopped, or gone on twice as fast.
        gone = np.abs(self.motion.velocity) * (time_s - self.motion.time_s)
        path = float(np.hypot(gone[0], gone[1])) + self.pixel_m
        return np.diag(np.square([path, path, gone[2] + self.pixel_m / self.target.reach_m]))

    def followed(self) -> Followed:
        """What is known of the body after the last picture."""
        return Followed(
            target=self.target,
            pixel_m=self.pixel_m,
            first_pose=self.first_pose,
            start_covariance=self.start_covariance,
            record=self.record,
            edge_watch=self.edge_watch,
            edges_alone=self.edges_alone,
            fits=self.outline_fits,
            fitted_in=self.fitted_in,
            exposure_s=self.tracker.exposure_s,
            widest_blur_px=self.tracker.widest_blur_px,
            mistakable=self.mistakable,
            findings=self.findings,
        )

    def jumps(self, track: Track, taken: NDArray[np.bool_]) -> list[Finding]:
        """Findings about steps in the body's finished track between pictures (n,) that were ``taken``, not repeated."""
        seen = track.seen & taken
        observed = track.time_s[seen], track.pose[seen], track.covariance[seen]
        return jump_findings(self.target, *observed, self._explained_m)
