"""Normal loads of a block towed at height: MuJoCo's rigid body in three dimensions beside the package's pressure.

MuJoCo stands the block on the four corners of a box, or on four feet with four corners each. The package's tow in three
dimensions gets the tether's force, the heading and the twist that MuJoCo has at the moment, so the paths of both do not
enter, the loads do.

Slow tows only. MuJoCo's contact is a convex relaxation that lifts a sliding contact by up to μ v: at 5 mm/s and
an impedance of 0.5 in place of 0.9 the block glides; at 5 cm/s it hops, and its loads are no longer those of a tow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from studies.frame import Row
from towval.model import Array, Ground, Patch, Sliding, Tether, TimedPath, TowedObject
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import RefusedError
from towval.physics.friction_laws import Coulomb
from towval.physics.motion import TAUT
from towval.physics.spatial.pressure import BALANCED
from towval.physics.spatial.problem import tow_problem
from towval.physics.spatial.rates import accelerations
from towval.physics.spatial.soles import work_for
from towval.physics.splines import spline_through

if TYPE_CHECKING:
    import mujoco

MASS_KG, HALF_M, CENTRE_HEIGHT_M, FRICTION = 5.0, 0.2, 0.15, 0.35
FOOT_AT_M, FOOT_HALF_M, FOOT_HEIGHT_M = 0.16, 0.03, 0.02
SIGNS = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
"""Quadrants of corners and feet, in the order of the loads."""

REST_LENGTH_M, STIFFNESS, DAMPING = 0.6, 1000.0, 50.0
STEP_S = 1e-3
_IMPEDANCE = ".5 .5 .001"  # the default, .9 .95 .001, lets feet hop at 5 mm/s
_SETTLED = 0.4  # share of the tow that is not reported
_RISE_M_PER_S = 1e-7  # of the package's friction; the block slides at some mm/s
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(12)
_NODES = np.stack(np.meshgrid(_GAUSS, _GAUSS), axis=-1).reshape(-1, 2)
_WEIGHTS = np.outer(_GAUSS_WEIGHTS, _GAUSS_WEIGHTS).ravel()


@dataclass(frozen=True)
class TowAtHeight:
    """A block behind a tether whose hinge moves at constant velocity, for MuJoCo and for the planar pressure.

    ``feet`` instead of a flat sole; ``anchor_height``, ``hinge_height`` [m]; ``anchor_y`` [m] beside the middle of its
    front; ``direction`` [rad] and ``speed`` [m/s] of the hinge, which starts straight ahead; ``slope`` (2,) [1] of the
    floor; ``centre`` (2,) [m] of mass; ``duration`` [s].
    """

    feet: bool
    anchor_height: float
    hinge_height: float
    anchor_y: float = 0.0
    direction: float = 0.0
    speed: float = 0.005
    slope: tuple[float, float] = (0.0, 0.0)
    centre: tuple[float, float] = (0.0, 0.0)
    duration: float = 10.0

    @property
    def gravity(self) -> Array:
        """(3,) along the floor, and into it [m/s²]."""
        return GRAVITY_M_PER_S2 * np.array([*self.slope, 1.0]) / -np.sqrt(1 + np.dot(self.slope, self.slope))

    @property
    def patch(self) -> Patch:
        """The footprint: the block's base, or its feet."""
        if not self.feet:
            return Patch(HALF_M * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))
        foot = FOOT_HALF_M * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return Patch.of([FOOT_AT_M * quadrant + foot for quadrant in SIGNS])


@dataclass(frozen=True)
class EngineLoads:
    """What MuJoCo has at moments (n,) [s], in body axes.

    ``loads`` (n, 4) by quadrant [N]; ``moments`` (n, 2) of the loads, ``Σ N x`` and ``Σ N y`` about the middle [N m];
    ``tow`` (n, 3) force of the tether [N]; ``heading`` (n,) [rad]; ``twist`` (n, 3) of the centre of mass along the
    floor [m/s, m/s, rad/s].
    """

    loads: Array
    moments: Array
    tow: Array
    heading: Array
    twist: Array


def engine_loads(tow: TowAtHeight) -> EngineLoads:
    """Tow the block in MuJoCo, and report a hundred times after it has settled."""
    import mujoco  # noqa: PLC0415 — an extra: not everybody has it

    model = block_model(tow)
    data = mujoco.MjData(model)
    start = model.body("hinge").pos[:2].copy()
    along = tow.speed * np.array([np.cos(tow.direction), np.sin(tow.direction)])
    count = round(tow.duration / STEP_S)
    reported = set(np.linspace(_SETTLED * count, count - 1, 100).astype(int).tolist())
    rows = []
    for i in range(count):
        data.mocap_pos[0, :2] = start + along * (i * STEP_S)
        mujoco.mj_step(model, data)
        if i in reported:
            rows.append(np.concatenate(_state(model, data)))
    table = np.array(rows)
    return EngineLoads(table[:, :4], table[:, 4:6], table[:, 6:9], table[:, 9], table[:, 10:])


def _state(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array, Array, Array, Array]:
    """Loads, their moments, force of the tether, heading and twist, in body axes, of the step that was taken last."""
    import mujoco  # noqa: PLC0415 — an extra: not everybody has it

    block = model.body("block").id
    axes, middle = data.xmat[block].reshape(3, 3), data.xpos[block]
    loads, moments, force = np.zeros(4), np.zeros(2), np.zeros(6)
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, force)
        place = (axes.T @ (data.contact[k].pos - middle))[:2]
        loads[2 * int(place[0] > 0) + int(place[1] > 0)] += force[0]
        moments += force[0] * place
    span = data.site("hinge").xpos - data.site("anchor").xpos
    pull = max(0.0, STIFFNESS * (data.ten_length[0] - REST_LENGTH_M) + DAMPING * data.ten_velocity[0])
    heading = np.array([np.arctan2(axes[1, 0], axes[0, 0])])
    turning = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, block, turning, 1)
    omega, (vx, vy) = turning[2], turning[3:5]
    x, y, _ = model.body_ipos[block]
    twist = np.array([vx - omega * y, vy + omega * x, omega])
    return loads, moments, axes.T @ (pull * span / np.linalg.norm(span)), heading, twist


def block_model(tow: TowAtHeight) -> mujoco.MjModel:
    """Floor, block on its sole or feet, hinge as a mocap body, and the tether as a tendon that only pulls."""
    import mujoco  # noqa: PLC0415 — an extra: not everybody has it

    sole = f'<geom type="box" size="{HALF_M} {HALF_M} {CENTRE_HEIGHT_M}"/>'
    half = f"{FOOT_HALF_M} {FOOT_HALF_M} {FOOT_HEIGHT_M / 2}"
    below = FOOT_HEIGHT_M / 2 - CENTRE_HEIGHT_M
    feet = "".join(f'<geom type="box" size="{half}" pos="{x} {y} {below}"/>' for x, y in FOOT_AT_M * SIGNS)
    inertia = MASS_KG * (HALF_M**2 + CENTRE_HEIGHT_M**2) / 3
    gravity = " ".join(map(str, tow.gravity))
    hinge = f"{HALF_M + REST_LENGTH_M} {tow.anchor_y} {tow.hinge_height}"
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="{STEP_S}" gravity="{gravity}" cone="elliptic" impratio="10" integrator="implicitfast"/>
    <default><geom friction="{FRICTION} 0 0" mass="0" solimp="{_IMPEDANCE}"/></default>
    <worldbody>
      <geom type="plane" size="50 50 1"/>
      <body name="hinge" mocap="true" pos="{hinge}"><site name="hinge"/></body>
      <body name="block" pos="0 0 {CENTRE_HEIGHT_M}"><freejoint/>
        <inertial pos="{tow.centre[0]} {tow.centre[1]} 0" mass="{MASS_KG}"
          diaginertia="{inertia} {inertia} {MASS_KG * 2 * HALF_M**2 / 3}"/>{feet if tow.feet else sole}
        <site name="anchor" pos="{HALF_M} {tow.anchor_y} {tow.anchor_height - CENTRE_HEIGHT_M}"/></body>
    </worldbody>
    <tendon><spatial stiffness="{STIFFNESS}" damping="{DAMPING}" springlength="0 {REST_LENGTH_M}">
      <site site="hinge"/><site site="anchor"/></spatial></tendon>
    </mujoco>""")


def program_loads(tow: TowAtHeight, force: ArrayLike, heading: float, twist: ArrayLike) -> tuple[float, Array, Array]:
    """Normal force [N], its moments (2,) [N m] about the middle, loads (4,) [N] of feet, by the package.

    Parameters
    ----------
    tow : TowAtHeight
    force : array_like (3,)
        Of the tether, body axes [N].
    heading : float
        Of the block [rad], which turns the slope.
    twist : array_like (3,)
        Of the centre of mass, body axes [m/s, m/s, rad/s].

    Raises
    ------
    RefusedError
        No pressure balances the tow.
    """
    force, (vx, vy, omega) = np.asarray(force, dtype=np.float64), np.asarray(twist, dtype=np.float64)
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    centre, anchor = np.array(tow.centre), np.array([HALF_M, tow.anchor_y])
    # A tether that pulls with this very force: in its direction, and stretched by it.
    pull = float(np.linalg.norm(force))
    away = (REST_LENGTH_M + pull / STIFFNESS) * force / pull
    hinge = turn @ (anchor - centre + away[:2])
    towed = TowedObject(tow.patch, MASS_KG, centre, 1.0, anchor, tow.anchor_height, CENTRE_HEIGHT_M)
    problem = tow_problem(
        towed,
        Sliding(Coulomb(FRICTION, _RISE_M_PER_S)),
        Tether(REST_LENGTH_M, STIFFNESS),
        Ground(GRAVITY_M_PER_S2, np.array(tow.slope)),
        tow.anchor_height + float(away[2]),
        spline_through(TimedPath(np.array([0.0, 1.0]), np.array([hinge, hinge]))),
    )
    work = work_for(problem.soles, problem.regions)
    state = np.array([0.0, 0.0, heading, *(turn @ [vx, vy]), omega])
    if accelerations(problem, TAUT, 0.0, 0, state, work, np.empty(6)) != BALANCED:
        raise RefusedError("no pressure balances the tow", got=f"a pull of {pull:.2f} N")
    m, x = work.moments, work.pressure
    normal = float(m[:3] @ x)
    moments = np.array([m[[1, 3, 4]] @ x, m[[2, 4, 5]] @ x]) + normal * centre
    return normal, moments, _loads_of_feet(x, centre) if tow.feet else np.full(4, np.nan)


def _loads_of_feet(pressure: Array, centre: Array) -> Array:
    """Loads (4,) [N] of the feet under a plane of pressure about the centre of mass, by Gauss nodes over each."""
    nodes = FOOT_AT_M * SIGNS[:, None] + FOOT_HALF_M * _NODES - centre
    return np.asarray(np.maximum(0.0, pressure[0] + nodes @ pressure[1:]) @ (FOOT_HALF_M**2 * _WEIGHTS))


def load_row(tow: TowAtHeight) -> Row:
    """Differences of MuJoCo's loads from the package's, means over the tow, as parts of the normal force.

    Returns
    -------
    dict
        ``normal`` of the sum of the loads; ``centre`` of their moments over half the side; ``feet`` the largest of a
        foot, NaN without feet; ``self_stress`` the part of it that loads no resultant, + − − + over the feet;
        ``transfer``, for scale, the moments less those of the weight; ``scatter``, the standard deviation of MuJoCo's
        sum of the loads: where it is not small, the block hops.
    """
    seen = engine_loads(tow)
    at_rest = -MASS_KG * tow.gravity[2] * np.array(tow.centre)
    parts = []
    for loads, moments, force, heading, twist in zip(
        seen.loads, seen.moments, seen.tow, seen.heading, seen.twist, strict=True
    ):
        normal, balance, ours = program_loads(tow, force, float(heading), twist)
        differences = [loads.sum() - normal, *(moments - balance) / HALF_M, *(loads - ours)]
        parts.append(np.array([*differences, *(balance - at_rest) / HALF_M, loads.sum()]) / normal)
    mean, scatter = np.mean(parts, axis=0), np.std(parts, axis=0)
    feet = mean[3:7] if tow.feet else np.full(4, np.nan)
    return {
        "normal": float(abs(mean[0])),
        "centre": float(np.abs(mean[1:3]).max()),
        "feet": float(np.abs(feet).max()),
        "self_stress": float(abs(feet @ [1, -1, -1, 1]) / 4),
        "transfer": float(np.abs(mean[7:9]).max()),
        "scatter": float(scatter[9]),
    }


SIDEWAYS: dict[str, Any] = {"anchor_height": 0.12, "hinge_height": 0.3, "direction": 1.0, "duration": 40.0}
TOWS: dict[str, dict[str, Any]] = {
    "straight, level tether at 5 cm": {"anchor_height": 0.05, "hinge_height": 0.05},
    "straight, level tether at 25 cm": {"anchor_height": 0.25, "hinge_height": 0.25},
    "straight, inclined tether": {"anchor_height": 0.12, "hinge_height": 0.3},
    "inclined tether, slope 2 % and 1 %": {"anchor_height": 0.12, "hinge_height": 0.3, "slope": (0.02, 0.01)},
    "inclined tether, hinge moves sideways": SIDEWAYS,
    "the same, centre of mass and anchor off the middle": SIDEWAYS | {"centre": (0.03, 0.02), "anchor_y": 0.05},
    "near tipping: level tether at 40 cm": {"anchor_height": 0.4, "hinge_height": 0.4},
}
"""Tows by the name that tables show, and what each sets of :class:`TowAtHeight`."""


def compared_tows() -> Iterator[tuple[str, TowAtHeight]]:
    """All tows, on a flat sole and on feet."""
    for feet in (False, True):
        for name, keys in TOWS.items():
            yield f"{'feet' if feet else 'box'}: {name}", TowAtHeight(feet, **keys)
