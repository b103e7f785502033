"""The towed cube in MuJoCo: another engine, with contact at points in place of a patch.

MuJoCo comes with the extra ``bench``; without it these points of the chart are left out, with the reason.
"""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np

from towval.types import Array, Path, Tether, TowedObject

LAYOUTS = {"box": 0, "4 × 4 spheres": 4, "8 × 8 spheres": 8}
"""Contacts: a box (four corners), or spheres in a grid, so many along a side."""

_THIN = 0.02  # m, half the height of the box
_RADIUS = 0.005  # m, of a sphere


def mujoco_is_there() -> bool:
    """Whether MuJoCo is installed."""
    return importlib.util.find_spec("mujoco") is not None


def mujoco_poses(
    towed: TowedObject,
    friction: float,
    tether: Tether,
    hinge: Path,
    start: Array,
    times: Array,
    step_s: float,
    layout: str,
) -> Array:
    """Poses (n, 3) of a square object's frame at times that are multiples of the step [m, m, rad].

    Parameters
    ----------
    towed : TowedObject
        Its outline must be an upright square about the origin, its centre of mass there, too.
    friction : float
        Coulomb's coefficient.
    tether, hinge, start, times
        As in :func:`towval.physics.dynamics.feedback`.
    step_s : float
        Time step [s].
    layout : str
        One of :data:`LAYOUTS`.
    """
    import mujoco  # noqa: PLC0415

    model = mujoco.MjModel.from_xml_string(_document(towed, friction, tether, start, step_s, layout))
    data: Any = mujoco.MjData(model)
    count = round((times[-1] - times[0]) / step_s)
    moments = times[0] + np.arange(count + 1) * step_s
    way = np.column_stack([np.interp(moments, hinge.time_s, hinge.position[:, k]) for k in (0, 1)])
    states, target = np.empty((count + 1, 4)), data.mocap_pos[0]
    for i in range(count + 1):
        target[:2] = way[i]
        states[i] = data.qpos[0], data.qpos[1], data.qpos[3], data.qpos[6]
        mujoco.mj_step(model, data)
    kept = states[np.round((times - times[0]) / step_s).astype(int)]
    heading = np.unwrap(2 * np.arctan2(kept[:, 3], kept[:, 2]))
    return np.column_stack([kept[:, :2], heading])


def _document(towed: TowedObject, friction: float, tether: Tether, start: Array, step_s: float, layout: str) -> str:
    half, along = float(towed.patch.outline[:, 0].max()), LAYOUTS[layout]
    if along:
        places = np.linspace(-half + _RADIUS, half - _RADIUS, along)
        contacts = "".join(
            f'<geom type="sphere" size="{_RADIUS}" pos="{x} {y} {_RADIUS - _THIN}" mass="0" friction="{friction} 0 0"/>'
            for x in places
            for y in places
        )
    else:
        contacts = f'<geom type="box" size="{half} {half} {_THIN}" mass="0" friction="{friction} 0 0"/>'
    # The anchor is at the height of the floor, as in the plane model, so that the tow does not tilt the cube.
    return f"""
    <mujoco><compiler angle="radian"/><option timestep="{step_s}" gravity="0 0 -9.81" cone="elliptic" impratio="10"/>
    <worldbody>
      <geom type="plane" size="5 5 1" friction="{friction} 0 0"/>
      <body name="hinge" mocap="true" pos="1 0 0"><site name="hinge"/></body>
      <body name="cube" pos="{start[0]} {start[1]} {_THIN}" euler="0 0 {start[2]}"><freejoint/>
        <inertial pos="0 0 {-_THIN}" mass="{towed.mass}" diaginertia="0.1 0.1 {towed.inertia}"/>{contacts}
        <site name="anchor" pos="{towed.anchor[0]} {towed.anchor[1]} {-_THIN}"/></body>
    </worldbody>
    <tendon><spatial stiffness="{tether.stiffness}" springlength="0 {tether.rest_length}">
      <site site="hinge"/><site site="anchor"/></spatial></tendon>
    </mujoco>"""
