"""Turns one draw of the uncertain inputs into a tow to simulate and the motion that would be measured.

Camera, its readout, heights, registration in the first frame and tracking noise move the measured object *and* the
rover that drives the simulation; masses, tether and friction move the simulation alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Body, Calibration, DecimatedTrack, Finding, SimulatedMotion, TowingScene, Track
from towval.model.checks import within
from towval.model.errors import InputError, RefusedError, TowvalError
from towval.model.geometry import compose
from towval.model.inputs import INPUTS, Realisation
from towval.optics.moved_view import pose_sensitivity, readout_sensitivity
from towval.validation.consequences import WIDER, widened
from towval.validation.curve_noise import CurveNoise
from towval.validation.hinge_trajectory import nodes_between
from towval.validation.simulate_many import Batch, Drawn

_RATE_STEP_S = 1e-4


@dataclass(frozen=True)
class UncertaintySettings:
    """Keys of ``config["uncertainty"]``.

    ``samples``: number of draws, a power of two, or "auto": as many as the bounds of a run need, from 256 to 2048;
    ``seed`` of the scrambled Sobol sequence; ``tolerance_m`` of integration [m]; ``confidence`` of the limits that a
    right model keeps; ``processes``: number of simulation threads.
    """

    samples: int | Literal["auto"] = "auto"
    seed: int = 1
    tolerance_m: float = 3e-6
    confidence: float = 0.99
    processes: int = 1

    def __post_init__(self) -> None:
        number = isinstance(self.samples, int) and self.samples >= 64 and not self.samples & (self.samples - 1)
        if not number and self.samples != "auto":
            raise InputError(
                "uncertainty.samples is out of range", got=self.samples, allowed="auto, or a power of two from 64 on"
            )
        if not 0.5 <= self.confidence < 1:
            raise InputError("uncertainty.confidence is out of range", got=self.confidence, allowed="0.5 up to below 1")
        within(self, "uncertainty", processes=(1, 256))
        within(self, "uncertainty", "m", tolerance_m=(1e-12, 1e-3))


@dataclass(frozen=True)
class Case:
    """One run: what was stated and what was measured.

    ``deviations`` are those of :func:`towval.model.inputs.deviations`; inputs without one are exact, and those of the
    heights are in the bodies. ``run`` is its name: inputs that runs share have the same draws in all of them, the
    others do not. ``assumed`` are the inputs of which neither value nor deviation was stated.
    """

    scene: TowingScene
    deviations: Mapping[str, float]
    calibration: Calibration
    rover: Body
    towed: Body
    rover_track: Track
    rover_decimated: DecimatedTrack
    object_track: Track
    object_decimated: DecimatedTrack
    simulated: SimulatedMotion
    run: str = ""
    assumed: tuple[str, ...] = ()

    @property
    def upstream(self) -> tuple[Finding, ...]:
        """Findings of the earlier stages."""
        parts = (
            self.calibration, self.rover_track, self.object_track, self.rover_decimated, self.object_decimated,
            self.simulated,
        )  # fmt: skip
        return tuple(each for part in parts for each in part.findings)


@dataclass(frozen=True)
class _Motions:
    """Poses of a body along its track, and their derivatives.

    By the camera (n, 3, 18), the height of the target (n, 3) and the camera's readout (n, 3).
    """

    pose: Array
    by_camera: Array
    by_height: Array
    by_readout: Array

    def shifted(self, real: Realisation, body: str) -> Array:
        """Poses (n, 3) for changes of camera and readout, and of the height and the registration of the body."""
        moved = self.pose + self.by_camera @ real.camera + self.by_height * real.height[body]
        return compose(moved + self.by_readout * real.readout, real.registration[body])


class Sampler:
    """Turns standard normal numbers into a tow to simulate and a measured motion of the object."""

    def __init__(self, case: Case, settings: UncertaintySettings):
        self.case, self.settings = case, settings
        self.times = case.simulated.time_s
        begin, end = self.times[[0, -1]]
        self.nodes = nodes_between(case.rover_decimated, begin, end, parts=2)
        self.rover_moves = case.rover_decimated.poses_and_rates_at(self.nodes)
        # The effect of a camera change on the rover's rates is computed from poses shortly before and after each node.
        self.around = np.clip(self.nodes[:, None] + [0.0, -_RATE_STEP_S, _RATE_STEP_S], begin, end).T
        around = case.rover_decimated.poses_and_rates_at(self.around.ravel())
        self.rover = _motions(case.calibration, case.rover, around)
        self.noise_std = np.nan_to_num(case.object_track.std[case.object_track.rows_at(self.times)])
        moves = np.concatenate([case.simulated.pose, case.simulated.twist], axis=1)
        self.object = _motions(case.calibration, case.towed, moves)
        _check_seen(case, self.object)
        self.start = _motions(case.calibration, case.towed, case.object_decimated.poses_and_rates_at(self.times[:1]))
        self.nominal = Realisation.nominal(case.scene)
        self.batch = Batch(
            self.nodes, self.times, case.simulated.rung, case.simulated.sticking,
            settings.tolerance_m, settings.processes,
        )  # fmt: skip
        self.rover_noise, self.wider = CurveNoise.of(case.rover_track, case.rover_decimated, self.nodes), 1.0
        self.start_std = _start_std(case.object_track, case.object_decimated, begin)
        self.roots = _roots(case)
        if "tracking" in widened(case.upstream):
            self.noise_std, self.start_std, self.wider = WIDER * self.noise_std, WIDER * self.start_std, WIDER
        # Only what varies is drawn: each further column makes the shares of all less accurate.
        self.drawn = [name for name in INPUTS if self.roots[name].any()] or ["camera"]
        self.stated = {name: INPUTS[name].values(case.scene) for name in self.drawn}
        self.widths = {INPUTS[name].label: len(INPUTS[name].components) for name in self.drawn}
        self.names = dict(zip(self.drawn, self.widths.values(), strict=True))
        self.own = np.repeat([INPUTS[name].shared == "run" for name in self.drawn], list(self.widths.values()))

    @property
    def as_stated(self) -> Drawn:
        """The tow with all inputs as stated, from the measured place.

        Draws start there, too; a run's first pose may have been moved nearer, as its tether allows.
        """
        return Drawn(self.case.scene, self.rover_moves, self.start.pose[0])

    def generator(self, index: int, purpose: int) -> np.random.Generator:
        """One generator per draw, so that the result does not depend on how draws are shared among threads."""
        return np.random.default_rng([self.settings.seed, index, crc32(self.case.run.encode()), purpose])

    def lay_out(self, index: int, draw: Array) -> tuple[Drawn | None, Array]:
        """The tow to simulate of one draw, None where it cannot be simulated, and measured poses (n, 3)."""
        rng = self.generator(index, 0)
        noise = self.noise_std * rng.standard_normal(self.noise_std.shape)
        moves = self.wider * self.rover_noise.drawn(rng)
        start = self.start_std * self.generator(index, 2).standard_normal(3)
        drawn, measured = self.moved(draw)
        return drawn and drawn._replace(rover=drawn.rover + moves, start=drawn.start + start), measured + noise

    def moved(self, draw: Array) -> tuple[Drawn | None, Array]:
        """The same without noise, for inputs (d,) given as standard normal numbers."""
        towed, rover = self.case.towed.name, self.case.rover.name
        try:
            real = self._realisation(draw)
        except TowvalError:
            return None, np.full_like(self.noise_std, np.nan)
        poses, before, after = self.rover.shifted(real, rover).reshape(3, -1, 3)
        rates = (after - before) / (self.around[2] - self.around[1])[:, None]
        driven = np.concatenate([poses, rates], axis=1)
        return Drawn(real.scene, driven, self.start.shifted(real, towed)[0]), self.object.shifted(real, towed)

    def _realisation(self, draw: Array) -> Realisation:
        """All inputs at the values of a draw of standard normal numbers."""
        real = self.nominal
        parts = np.split(draw, np.cumsum(list(self.widths.values()))[:-1])
        for row, part in zip(map(INPUTS.__getitem__, self.drawn), parts, strict=True):
            real = row.acts(real, self.stated[row.name] + self.roots[row.name] @ part)
        return real.checked()


def _check_seen(case: Case, simulated: _Motions) -> None:
    """Refuse a simulated path (n, 3) that leaves what a camera can see: what a pose there depends on is not defined."""
    known = np.isfinite(simulated.by_camera).all() and np.isfinite(simulated.by_height).all()
    if not (known and np.isfinite(simulated.by_readout).all()):
        seen = case.object_track.rows_at(case.simulated.time_s)
        apart_m = np.linalg.norm(case.simulated.pose[:, :2] - case.object_track.pose[seen, :2], axis=1)
        raise RefusedError(
            "the simulated object leaves what the camera can see",
            got=f"{np.nanmax(apart_m):.3g} m from where the object was measured",
            allowed="a path below the camera",
            remedy="check object.tether_anchor_m, rover.tether_hinge_m and tether.rest_length_m, in metres",
        )


def _start_std(track: Track, decimated: DecimatedTrack, begin_s: float) -> Array:
    """Deviation (3,) [m, m, rad] of the pose from which the object starts: what its curve leaves of a frame's noise.

    The noise is that which the track states, as in all draws: of few frames a second the curve takes motion for noise.
    """
    kept = max(0, int(np.searchsorted(decimated.time_s, begin_s + 1e-9)) - 1)
    share = np.sqrt(np.diagonal(decimated.covariance[kept])) / decimated.noise
    return np.asarray(share * np.nanmedian(track.std, axis=0))


def _motions(calibration: Calibration, body: Body, moves: Array) -> _Motions:
    """Of a body with poses and rates (n, 6)."""
    pose, rate = np.split(moves, 2, axis=1)
    seen = calibration.camera, calibration.floor, body, pose
    return _Motions(pose, *pose_sensitivity(*seen), readout_sensitivity(*seen, rate))


def _roots(case: Case) -> dict[str, Array]:
    """Square roots (k, k) of the covariances of the inputs, by name."""
    stated = dict(case.deviations)
    of_video = case.rover_track.camera
    covariances = {"camera": case.calibration.covariance + (0.0 if of_video is None else of_video.added)}
    for body, track in ((case.rover, case.rover_track), (case.towed, case.object_track)):
        stated[f"{body.name}_height"] = body.height_std_m
        covariances[f"{body.name}_registration"] = track.start_covariance
    roots = {name: _root(covariance) for name, covariance in covariances.items()}
    drawn = {row.name: 0.0 if row.within else stated.get(row.name, 0.0) for row in INPUTS.values() if row.stated}
    roots = {name: std * np.eye(len(INPUTS[name].components)) for name, std in drawn.items()} | roots
    return roots | {name: WIDER * roots[name] for name in widened(case.upstream) if name in roots}


def _root(covariance: ArrayLike) -> Array:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
