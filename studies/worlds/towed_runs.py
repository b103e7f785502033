"""Synthetic runs with known ground truth for the tables of the verdict: drawn, moved and measured, but not rendered.

The object moves by friction summed over cells of its footprint and a Runge-Kutta rule of fixed step; it is measured by
projecting the corners of its top with a camera drawn from the calibration's covariance, and placing them with the
nominal one. Neither shares code with the simulation or with the sampling under test; campaign and truth share what a
campaign.yaml holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from studies.worlds.makkar import makkar_coefficients
from studies.worlds.measured import measured_track
from studies.worlds.scenes import ceiling, drive, two_bodies
from towval.model import (
    Array,
    Calibration,
    Camera,
    Floor,
    FrictionSpecification,
    Load,
    Patch,
    Tether,
    TowingScene,
    Track,
)
from towval.model.geometry import compose, rigid_fit, transform
from towval.model.inputs import deviations
from towval.optics.projection import project, to_plane

GRAVITY = 9.81
RATE_HZ = 25
STEP_S = 4e-4
CELLS = (18, 12)
"""A quarter of the step moves the paths by less than 0.001 mm, four times as many cells by 0.05 to 0.5 mm."""

PATH_M = 2.2
FRAME_STD = np.array([1e-4, 1e-4, 2e-4])
START_STD = np.array([4e-4, 4e-4, 6e-4])
PARAMETER_STD = np.array([0.4, 0.4, 0.3, 0.3, 4e-4, 4e-4, *np.zeros(6), *[2e-4] * 3, *[4e-4] * 3])
ROVER, TOWED = two_bodies()

DRAWN = ("friction", "body_mass", "load_mass", "load_at", "anchor", "hinge", "rest_length", "stiffness")
"""Uncertain inputs in which the ground truth departs from what is stated; the others are exact."""


@dataclass(frozen=True)
class Truth:
    """The ground truth: scene, factor on the friction law, shift of the centre of mass, and a stripe of the floor.

    ``stripe`` is (x, y, direction x, direction y, length [m], factor): floor of another friction from a point on.
    """

    scene: TowingScene
    friction_factor: float = 1.0
    centre_shift: tuple[float, float] = (0.0, 0.0)
    stripe: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class SyntheticRun:
    """A campaign's scene with its deviations, the ground truth drawn from them, and the rover's trajectory.

    ``gamma`` (6,) are the coefficients of Makkar's law for the scene's specification of friction.
    """

    scene: TowingScene
    gamma: Array
    deviations: dict[str, float]
    truth: Truth
    drive: Callable[[float], Array]
    start: Array
    time_s: Array


def synthetic_run(seed: int) -> SyntheticRun:
    """A random scene: masses, load, friction, tether, path and speed of the rover; and its ground truth."""
    rng = np.random.default_rng([seed, 1])
    kinetic = rng.uniform(0.25, 0.5)
    body_mass, load_mass = rng.uniform(3.0, 6.0), rng.uniform(0.5, 2.5)
    at = rng.uniform([-0.18, -0.11], [0.18, 0.11])
    # The pressure at the corner farthest from the load, as a share of the mean: a third is left for the planted fault.
    while 6 * np.sum(np.abs(at) / [0.5, 0.35]) * load_mass / (body_mass + load_mass) > 0.6:
        at *= 0.9
    scene = TowingScene(
        Patch(TOWED.top_corners_m),
        body_mass,
        Load(load_mass, at, np.array([0.1, 0.1, 0.0])),
        np.array([0.25, 0.0]),
        np.array([-0.42, 0.0]),
        Tether(rng.uniform(0.4, 0.8), float(np.exp(rng.uniform(np.log(400), np.log(3000))))),
        FrictionSpecification(kinetic * rng.uniform(1.0, 1.15), kinetic, 0.0052, 0.07),
    )
    known = {name: std for name, std in deviations(scene).items() if name in DRAWN}
    speed, turn = rng.uniform(0.2, 0.35), rng.uniform(-0.7, 0.7)
    path = drive((-0.4, rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)), speed, turn, rest_s=0.5)
    times = np.arange(round((0.5 + 0.5 + PATH_M / speed) * RATE_HZ)) / RATE_HZ
    hinge = transform(path(0.0), scene.hinge)
    heading, bearing = path(0.0)[2] + rng.uniform(-0.5, 0.5), path(0.0)[2] + rng.uniform(-0.4, 0.4)
    taut = scene.tether.rest_length - rng.uniform(0.01, 0.04)
    anchor = hinge - taut * np.array([np.cos(bearing), np.sin(bearing)])
    origin = anchor - (transform([0, 0, heading], scene.anchor))
    start = np.array([*origin, heading])
    gamma = makkar_coefficients(scene.friction)
    return SyntheticRun(scene, gamma, known, _drawn_truth(scene, known, rng), path, start, times)


def _drawn_truth(scene: TowingScene, std: dict[str, float], rng: np.random.Generator) -> Truth:
    def about(value: float, deviation: float) -> float:
        return value + deviation * float(rng.standard_normal())

    def point_about(value: Array, deviation: float) -> Array:
        return value + deviation * rng.standard_normal(value.shape)

    true = replace(
        scene,
        body_mass=about(scene.body_mass, std["body_mass"]),
        load=replace(
            scene.load, mass=about(scene.load.mass, std["load_mass"]), at=point_about(scene.load.at, std["load_at"])
        ),
        anchor=point_about(scene.anchor, std["anchor"]),
        hinge=point_about(scene.hinge, std["hinge"]),
        tether=Tether(
            about(scene.tether.rest_length, std["rest_length"]), about(scene.tether.stiffness, std["stiffness"])
        ),
    )
    return Truth(true, about(1.0, std["friction"] / scene.friction.kinetic))


def planted(run: SyntheticRun, right: Array, fault: str, seed: int) -> tuple[Truth, float]:
    """The ground truth with a fault in it, and where on the object's trajectory ``right`` (n, 3) the fault begins [m].

    "stripe": friction × 1.6 over 0.4 m of the floor; "centre of mass" 20 mm off; "tether" 10 % longer.
    """
    rng, truth = np.random.default_rng([seed, 2]), run.truth
    if fault == "tether":
        tether = truth.scene.tether
        longer = replace(truth.scene, tether=Tether(1.1 * tether.rest_length, tether.stiffness))
        return replace(truth, scene=longer), 0.0
    if fault == "centre of mass":
        angle = rng.uniform(0, 2 * np.pi)
        return replace(truth, centre_shift=(0.02 * np.cos(angle), 0.02 * np.sin(angle))), 0.0
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(right[:, :2], axis=0), axis=1))])
    begins = rng.uniform(0.25, 0.5) * length[-1]
    row = int(np.searchsorted(length, begins))
    ahead = np.subtract(right[min(row + 5, len(right) - 1), :2], right[row, :2])
    ahead /= np.linalg.norm(ahead)
    # The stripe begins where the foremost cell is when the origin is there: friction changes from then on.
    front = (transform(right[row], run.scene.patch.outline) @ ahead).max() - right[row, :2] @ ahead
    place = right[row, :2] + front * ahead
    return replace(truth, stripe=(*place, *ahead, 0.4, 1.6)), float(begins)


def true_motion(run: SyntheticRun, truth: Truth) -> Array:
    """Poses (n, 3) of the object at the run's times."""
    scene = truth.scene
    nx, ny = CELLS
    low, high = scene.patch.outline.min(axis=0), scene.patch.outline.max(axis=0)
    x, y = ((np.arange(n) + 0.5) / n * (b - a) + a for n, a, b in zip(CELLS, low, high, strict=True))
    cells = np.array([(a, b) for a in x for b in y])
    mass = scene.body_mass + scene.load.mass
    own_centre = scene.load.mass * scene.load.at / mass
    centre = own_centre + truth.centre_shift
    moments = np.array([[nx * ny, 0, 0], [0, (cells[:, 0] ** 2).sum(), 0], [0, 0, (cells[:, 1] ** 2).sum()]])
    plane = np.linalg.solve(moments, mass * GRAVITY * np.array([1, *centre]))
    force = plane[0] + cells @ plane[1:]
    if force.min() < 0:
        raise ValueError("the object would tip: the sum over cells holds pressed footprints only")
    inertia = scene.body_mass * (np.sum((high - low) ** 2) / 12 + own_centre @ own_centre)
    inertia += scene.load.mass * (np.sum(scene.load.size[:2] ** 2) / 12 + np.sum((scene.load.at - own_centre) ** 2))
    steps = round((run.time_s[-1] - run.time_s[0]) / STEP_S)
    halves = np.array([run.drive(t) for t in run.time_s[0] + np.arange(2 * steps + 1) * STEP_S / 2])
    gamma = run.gamma.copy()
    gamma[[0, 3, 5]] *= truth.friction_factor
    every = round(1 / (RATE_HZ * STEP_S))
    state = np.array([*transform(run.start, centre), run.start[2], 0.0, 0.0, 0.0])
    states = _integrated(
        state,
        transform(halves, scene.hinge),
        np.column_stack([cells - centre, force]),
        np.array([mass, inertia, *(scene.anchor - centre), scene.tether.rest_length, scene.tether.stiffness]),
        gamma,
        np.array(truth.stripe),
        STEP_S,
        every,
    )
    turned = np.column_stack([np.zeros((len(states), 2)), states[:, 2]])
    return np.column_stack([states[:, :2] + transform(turned, -centre), states[:, 2]])


@njit
def _rate(state, hinge, cells, body, gamma, stripe):
    mass, inertia, ax, ay, rest, stiffness = body
    c, s = np.cos(state[2]), np.sin(state[2])
    fx = fy = torque = 0.0
    for i in range(len(cells)):
        rx, ry = c * cells[i, 0] - s * cells[i, 1], s * cells[i, 0] + c * cells[i, 1]
        vx, vy = state[3] - state[5] * ry, state[4] + state[5] * rx
        v = np.hypot(vx, vy) + 1e-12
        mu = gamma[0] * (np.tanh(gamma[1] * v) - np.tanh(gamma[2] * v)) + gamma[3] * np.tanh(gamma[4] * v)
        into = (state[0] + rx - stripe[0]) * stripe[2] + (state[1] + ry - stripe[1]) * stripe[3]
        if 0 <= into < stripe[4]:
            mu *= stripe[5]
        drag = -mu * cells[i, 2] / v
        fx, fy, torque = fx + drag * vx, fy + drag * vy, torque + drag * (rx * vy - ry * vx)
    px, py = c * ax - s * ay, s * ax + c * ay
    dx, dy = hinge[0] - state[0] - px, hinge[1] - state[1] - py
    length = np.hypot(dx, dy)
    pull = max(0.0, stiffness * (length - rest)) / length
    fx, fy, torque = fx + pull * dx, fy + pull * dy, torque + pull * (px * dy - py * dx)
    return np.array([state[3], state[4], state[5], fx / mass, fy / mass, torque / inertia])


@njit
def _integrated(state, hinge, cells, body, gamma, stripe, h, every):
    steps = (len(hinge) - 1) // 2
    states = np.empty((steps // every + 1, 6))
    states[0] = state
    for k in range(steps):
        a = _rate(state, hinge[2 * k], cells, body, gamma, stripe)
        b = _rate(state + h / 2 * a, hinge[2 * k + 1], cells, body, gamma, stripe)
        c = _rate(state + h / 2 * b, hinge[2 * k + 1], cells, body, gamma, stripe)
        d = _rate(state + h * c, hinge[2 * k + 2], cells, body, gamma, stripe)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
        if (k + 1) % every == 0:
            states[(k + 1) // every] = state
    return states


def nominal_calibration(scale: float = 1.0) -> Calibration:
    """The camera as calibrated, with a covariance of the size of a good calibration's, or ``scale`` times as wide."""
    camera, floor = ceiling((960, 540), focal_px=780.0)
    return Calibration(camera, floor, np.diag((scale * PARAMETER_STD) ** 2), 0.05)


class TrueCamera:
    """A camera drawn from the calibration's covariance, and true heights; it measures poses as the pipeline would.

    Bodies are registered with ``scale`` times the usual deviation.
    """

    def __init__(self, calibration: Calibration, seed: int, scale: float = 1.0):
        self.rng = np.random.default_rng([seed, 3])
        self.nominal, self.start_std = calibration, scale * START_STD
        change = np.sqrt(np.diagonal(calibration.covariance)) * self.rng.standard_normal(18)
        camera, T = calibration.camera, np.array(calibration.floor.T_camera_floor)
        matrix = camera.matrix + np.array([[change[0], 0, change[2]], [0, change[1], change[3]], [0, 0, 0]])
        self.camera = Camera(camera.resolution_px, matrix, camera.distortion + change[4:12], "drawn")
        T[:3, :3] = Rotation.from_rotvec(Rotation.from_matrix(T[:3, :3]).as_rotvec() + change[12:15]).as_matrix()
        T[:3, 3] += change[15:]
        self.floor = Floor(T)
        self.errors = {body.name: self.rng.standard_normal(4) for body in (ROVER, TOWED)}

    def measured(self, body, time_s: Array, pose: Array) -> Track:
        """The track of a body whose true poses (n, 3) are given."""
        n, corners = len(pose), transform(pose[:, None, :], body.top_corners_m)
        error = self.errors[body.name]
        top = body.tracked_plane_height_m + body.height_std_m * error[3]
        points = np.concatenate([corners, np.full((*corners.shape[:2], 1), top)], axis=-1).reshape(-1, 3)
        pixels = project(self.camera, self.floor, points)
        seen = to_plane(self.nominal.camera, self.nominal.floor, pixels, body.tracked_plane_height_m)
        placed = np.array([rigid_fit(body.top_corners_m, s) for s in seen.reshape(n, -1, 2)])
        placed[:, 2] = np.unwrap(placed[:, 2])
        placed = compose(placed, self.start_std * error[:3])
        placed += FRAME_STD * self.rng.standard_normal(placed.shape)
        return measured_track(body.name, time_s, placed, FRAME_STD, self.start_std)
