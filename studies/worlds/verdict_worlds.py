"""Runs whose truth is not the model of the verdict: other laws, three dimensions, deviations that are stated wrong.

The truth moves on elasto-plastic or LuGre bristles (:mod:`studies.worlds.bristles`): a rigid body under a tether at
height, on a slope, anisotropic, over a stripe of the floor, on a sole or four feet, with a tether that stiffens and
damps; or by MuJoCo (:mod:`studies.worlds.engine_tow`). What a lab would state of it is the truth plus draws of its
deviations. The list of what is drawn here is written apart from the table of uncertain inputs; what a truth does not
have (friction radius, stiction velocity, spread of the mass) is uncertain there all the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from studies.worlds.bristles import BristledObject, TetherAtHeight, bristle_tow, cells_of
from studies.worlds.engine_tow import engine_tow
from studies.worlds.lab_tows import rectangle
from studies.worlds.scenes import drive
from studies.worlds.towed_runs import TOWED
from towval.model import Array, FloorRegion, FrictionSpecification, Ground, Load, MassSpread, Patch, Tether, TowingScene
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.geometry import transform
from towval.model.inputs import deviations

RATE_HZ = 25
STRIPE_M = 0.3
NO_STRIPE = (0.0, 0.0, 1.0, 0.0, 0.0)
PATH_M = 1.4
REST_S = 0.4
LENGTH, WIDTH = 0.5, 0.35
FULL_LOAD_N = 40.0


@dataclass(frozen=True)
class World:
    """What a truth has: ``heights`` of tow and mass, a ``floor`` that slopes and is anisotropic, ``feet``, ``tether``
    that stiffens and damps, ``region`` of other friction, LuGre's law of friction; ``engine``: it is MuJoCo's, on
    points with Coulomb's law; ``rope``: stiff, and about as long as the tow at its start; ``stated`` is what a lab
    states of a deviation over what it is."""

    heights: bool = False
    floor: bool = False
    feet: bool = False
    tether: bool = False
    region: bool = False
    lugre: bool = False
    engine: bool = False
    rope: bool = False
    stated: float = 1.0


WORLDS = {
    "level": World(),
    "heights": World(heights=True),
    "floor": World(floor=True),
    "tether": World(tether=True),
    "lab": World(heights=True, floor=True, feet=True, tether=True),
    "region": World(tether=True, region=True),
    "other law": World(tether=True, lugre=True),
    "engine": World(tether=True, engine=True),
    "level, deviations 2 × too small": World(stated=0.5),
    "lab, deviations 2 × too small": World(heights=True, floor=True, feet=True, tether=True, stated=0.5),
    "level, deviations 2 × too large": World(stated=2.0),
    "rope": World(tether=True, rope=True),
    "lab, rope": World(heights=True, floor=True, feet=True, tether=True, rope=True),
}
_FIRST = 11  # worlds that were there first, whose runs keep their numbers

STD = {
    "kinetic": 0.005, "static": 0.01, "friction_velocity": 0.3, "mass": 0.01, "load": 0.01, "load_at": 0.001,
    "anchor": 0.001, "hinge": 0.001, "rest": 0.001, "stiffness": 0.02, "damping": 0.2, "hinge_height": 0.002,
    "anchor_height": 0.002, "centre_height": 0.01, "slope": 0.0003, "across": 0.02, "stiffening": 0.05,
    "body_centre": 0.002, "inertia": 0.05, "region": 0.02,
}  # fmt: skip
"""True deviations: what a careful lab reaches; shares of the value for :data:`RELATIVE`."""

RELATIVE = ("friction_velocity", "mass", "load", "stiffness", "damping", "inertia")

STATED = {
    "friction": "kinetic", "static_friction": "static", "friction_velocity": "friction_velocity", "body_mass": "mass",
    "load_mass": "load", "load_at": "load_at", "anchor": "anchor", "hinge": "hinge", "rest_length": "rest",
    "stiffness": "stiffness", "damping": "damping", "hinge_height": "hinge_height", "anchor_height": "anchor_height",
    "centre_of_mass_height": "centre_height", "slope": "slope", "across_over_along": "across",
    "stiffening": "stiffening", "body_centre": "body_centre", "inertia": "inertia", "regions": "region",
}  # fmt: skip
"""Which of them an input of the table is."""

Numbers = dict[str, Array]


@dataclass(frozen=True)
class WorldRun:
    """A run: true and stated ``numbers`` by the names of :data:`STD`, times (n,) [s], start pose (3,) and path; where a
    ``stripe`` of the floor is, if any."""

    world: World
    true: Numbers
    stated: Numbers
    drive: Callable[[float], Array]
    start: Array
    time_s: Array
    stripe: tuple[float, ...] = ()

    @property
    def scene(self) -> TowingScene:
        """The scene as a lab states it."""
        return scene_of(self.stated, self)

    @property
    def deviations(self) -> dict[str, float]:
        """As stated, by the names of the table of inputs."""
        known = deviations(self.scene)
        for name, own in STATED.items():
            if name in known:
                known[name] *= self.world.stated * _is_there(own, self.world)
        # A whole sole is plane here, and known to be.
        known["radius_over_planar"] *= self.world.feet
        return known

    def off(self) -> dict[str, list[float]]:
        """By how many stated deviations the components of each input of the table are off."""
        known, found = self.deviations, {}
        for name, own in STATED.items():
            difference = np.atleast_1d(self.true[own] - self.stated[own])
            # A moment of inertia is stated as such, and a share of it here.
            std = STD[own] * self.world.stated * float(self.stated[own]) if own == "inertia" else known.get(name, 0.0)
            found[name] = [float(value) / std if std > 0 else 0.0 for value in difference]
        return found

    def truth(self, changes: Numbers | None = None) -> Array:
        """True poses (n, 3); ``changes`` are added to the true numbers."""
        true = {name: value + (changes or {}).get(name, 0.0) for name, value in self.true.items()}
        return engine_tow(true, self.drive, self.start, self.time_s) if self.world.engine else _moved(true, self)


def _is_there(own: str, world: World) -> bool:
    """Whether a world has what a number is of; what it does not have is stated as nought, exactly."""
    if own in ("hinge_height", "anchor_height", "centre_height"):
        return world.heights
    if own in ("slope", "across"):
        return world.floor
    if own in ("damping", "stiffening"):
        return world.tether and not (own == "stiffening" and world.engine)
    if own == "region":
        return world.region
    return True


def number_of(name: str, seed: int) -> int:
    """The seed of a world's run that no other world has."""
    later, index = divmod(list(WORLDS).index(name), _FIRST)
    return _FIRST * seed + index + 10**6 * later


def world_run(world: World, seed: int) -> WorldRun:
    """A random run of a world."""
    rng = np.random.default_rng([seed, 11])
    kinetic = rng.uniform(0.25, 0.45)
    true: Numbers = {
        "kinetic": np.array(kinetic),
        "static": np.array(kinetic * rng.uniform(1.02, 1.15)),
        "friction_velocity": np.array(rng.uniform(0.01, 0.05)),
        "mass": np.array(rng.uniform(3.5, 6.0)),
        "load": np.array(rng.uniform(0.5, 2.0)),
        "load_at": rng.uniform([-0.12, -0.08], [0.12, 0.08]),
        "anchor": np.array([0.25, 0.0]),
        "hinge": np.array([-0.42, 0.0]),
        "rest": np.array(rng.uniform(0.45, 0.8)),
        "stiffness": np.array(float(np.exp(rng.uniform(*np.log((1e4, 1e5) if world.rope else (500, 3000)))))),
        "damping": np.array(rng.uniform(5, 20) if world.tether else 0.0),
        "hinge_height": np.array(rng.uniform(0.1, 0.25) if world.heights else 0.0),
        "anchor_height": np.array(rng.uniform(0.03, 0.1) if world.heights else 0.0),
        "centre_height": np.array(rng.uniform(0.1, 0.18) if world.heights else 0.0),
        "slope": rng.normal(size=2) * 0.002 if world.floor else np.zeros(2),
        "across": np.array(rng.uniform(0.92, 1.08) if world.floor else 1.0),
        "stiffening": np.array(rng.uniform(0.1, 0.4) if world.tether else 0.0),
        "body_centre": np.zeros(2),
        "inertia": np.array(1.0),
        "region": np.array(rng.choice([0.75, 1.3]) if world.region else 1.0),
    }
    if world.engine:
        true |= {"static": true["kinetic"], "stiffening": np.array(0.0)}
    stated = {}
    for name, value in true.items():
        std = STD[name] * (value if name in RELATIVE else 1.0) * _is_there(name, world)
        stated[name] = value + std * rng.standard_normal(value.shape)
    stated["static"] = np.maximum(stated["static"], stated["kinetic"])
    stated["stiffening"] = np.abs(stated["stiffening"])
    speed, turn = rng.uniform(0.15, 0.3), rng.uniform(-0.7, 0.7)
    path = drive((-0.4, rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)), speed, turn, rest_s=REST_S)
    times = np.arange(round((REST_S + 0.5 + PATH_M / speed) * RATE_HZ)) / RATE_HZ
    heading, bearing = path(0.0)[2] + rng.uniform(-0.4, 0.4), path(0.0)[2] + rng.uniform(-0.3, 0.3)
    rise = float(true["hinge_height"] - true["anchor_height"])
    # A rope may be taut at the start, with half of what friction holds.
    held = 0.5 * float(true["static"] * (true["mass"] + true["load"])) * GRAVITY_M_PER_S2 / float(true["stiffness"])
    slack = rng.uniform(-held, 0.003) if world.rope else rng.uniform(0.01, 0.03)
    taut = np.sqrt(float(true["rest"]) ** 2 - rise**2) - slack
    anchor = transform(path(0.0), true["hinge"]) - taut * np.array([np.cos(bearing), np.sin(bearing)])
    start = np.array([*(anchor - transform([0, 0, heading], true["anchor"])), heading])
    run = WorldRun(world, true, stated, path, start, times)
    return replace(run, stripe=half_way(run)) if world.region else run


def half_way(run: WorldRun) -> tuple[float, ...]:
    """(x, y, direction x, direction y, length [m]) of a stripe that the object reaches half-way, on an even floor."""
    poses = replace(run, stripe=()).truth()
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1))])
    row, after = np.searchsorted(length, [length[-1] / 2, length[-1] / 2 + 0.02])
    middle, ahead = poses[row], poses[after, :2] - poses[row, :2]
    ahead /= np.linalg.norm(ahead)
    front = float((transform(middle, TOWED.top_corners_m) @ ahead).max())
    return (*(middle[:2] + (front - middle[:2] @ ahead) * ahead), *ahead, STRIPE_M)


def _ring(stripe: tuple[float, ...]) -> Array:
    """Corners (4, 2) of a stripe [m]."""
    place, ahead, length = np.array(stripe[:2]), np.array(stripe[2:4]), stripe[4]
    aside = 2.0 * np.array([-ahead[1], ahead[0]])
    return np.array([place - aside, place + length * ahead - aside, place + length * ahead + aside, place + aside])


def feet() -> list[Array]:
    """Outlines (4, 2) of the four feet [m]."""
    return [rectangle(0.05, 0.05, x, y) for x in (-0.2, 0.2) for y in (-0.13, 0.13)]


def scene_of(numbers: Numbers, run: WorldRun) -> TowingScene:
    """The scene of a run with these numbers."""
    world = run.world
    regions = (FloorRegion(_ring(run.stripe), float(numbers["region"])),) if run.stripe else ()
    n = {name: float(value) for name, value in numbers.items() if value.ndim == 0}
    gyration = float(np.sqrt((LENGTH**2 + WIDTH**2) / 12 * n["inertia"]))
    return TowingScene(
        Patch.of(feet()) if world.feet else Patch(TOWED.top_corners_m),
        n["mass"],
        Load(n["load"], numbers["load_at"], np.array([0.1, 0.1, 0.08])),
        numbers["anchor"],
        numbers["hinge"],
        Tether(n["rest"], n["stiffness"], n["damping"], n["stiffening"], 0.0, FULL_LOAD_N),
        FrictionSpecification(
            n["static"], n["kinetic"], 0.1 * n["friction_velocity"], n["friction_velocity"],
            across_over_along=n["across"],
        ),
        MassSpread(numbers["body_centre"], gyration),
        n["anchor_height"],
        n["hinge_height"],
        n["centre_height"],
        Ground(slope=numbers["slope"], regions=regions),
    )  # fmt: skip


def _moved(n: Numbers, run: WorldRun) -> Array:
    """Poses (n, 3) of the true object at the run's times."""
    rings = feet() if run.world.feet else [rectangle(LENGTH, WIDTH)]
    places, areas = cells_of(rings, 4 if run.world.feet else 12)
    body, load = float(n["mass"]), float(n["load"])
    mass = body + load
    centre = (body * n["body_centre"] + load * n["load_at"]) / mass
    inertia = body * ((LENGTH**2 + WIDTH**2) / 12 * float(n["inertia"]) + np.sum((n["body_centre"] - centre) ** 2))
    inertia += load * (0.02 / 12 + np.sum((n["load_at"] - centre) ** 2))
    towed = BristledObject(
        places, areas, mass, (float(centre[0]), float(centre[1])), float(n["centre_height"]), float(inertia),
        (float(n["anchor"][0]), float(n["anchor"][1])), float(n["static"]), float(n["kinetic"]),
        float(n["friction_velocity"]), float(n["across"]), lugre=run.world.lugre,
        stripe=(*(run.stripe or NO_STRIPE), float(n["region"])),
    )  # fmt: skip
    tether = TetherAtHeight(
        float(n["rest"]), float(n["stiffness"]), float(n["damping"]), float(n["stiffening"]), FULL_LOAD_N,
        float(n["hinge_height"]), float(n["anchor_height"]),
    )  # fmt: skip

    def hinge(times: Array) -> tuple[Array, Array]:
        coarse = np.arange(0, times[-1] + 0.02, 0.004)
        points = np.array([transform(run.drive(t), n["hinge"]) for t in coarse])
        places = np.column_stack([np.interp(times, coarse, points[:, i]) for i in range(2)])
        rates = np.gradient(points, coarse, axis=0)
        return places, np.column_stack([np.interp(times, coarse, rates[:, i]) for i in range(2)])

    slope = (float(n["slope"][0]), float(n["slope"][1]))
    _, poses, _ = bristle_tow(towed, tether, hinge, run.start, float(run.time_s[-1]), slope=slope, report_s=1 / RATE_HZ)
    return poses


def with_stated(run: WorldRun, **numbers: Array) -> WorldRun:
    """The run with some numbers stated otherwise."""
    return replace(run, stated={**run.stated, **numbers})
