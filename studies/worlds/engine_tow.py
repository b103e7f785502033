"""A towed box by MuJoCo: a truth whose program is not ours. Level floor, tow in its plane, Coulomb's law at points.

MuJoCo comes with the extra ``bench``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from studies.worlds.towed_runs import TOWED
from towval.model import Array
from towval.model.geometry import transform

STEP_S = 5e-4
_POINTS = (8, 6)
_SPHERE_M, _THIN_M = 0.005, 0.02
_IMPEDANCE = ".95 .99 .0005"


def engine_tow(numbers: Mapping[str, Array], drive: Callable[[float], Array], start: Array, time_s: Array) -> Array:
    """Poses (n, 3) [m, m, rad] of the object at times (n,) [s], from rest at ``start`` (3,).

    ``numbers`` by the names of :data:`studies.worlds.verdict_worlds.STD`; ``drive`` is the rover's pose at a time.
    """
    import mujoco  # noqa: PLC0415 — an extra: not everybody has it

    n = {name: float(value) for name, value in numbers.items() if value.ndim == 0}
    mass = n["mass"] + n["load"]
    centre = (n["mass"] * numbers["body_centre"] + n["load"] * numbers["load_at"]) / mass
    size = np.ptp(TOWED.top_corners_m, axis=0)
    spread = n["mass"] * ((size @ size) / 12 * n["inertia"] + np.sum((numbers["body_centre"] - centre) ** 2))
    inertia = spread + n["load"] * (0.02 / 12 + np.sum((numbers["load_at"] - centre) ** 2))
    x, y = (side / count * (np.arange(count) - (count - 1) / 2) for side, count in zip(size, _POINTS, strict=True))
    points = "".join(
        f'<geom type="sphere" size="{_SPHERE_M}" pos="{px} {py} {_SPHERE_M - _THIN_M}" mass="0"/>'
        for px in x
        for py in y
    )
    hinge = transform(drive(time_s[0]), numbers["hinge"])
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="{STEP_S}" gravity="0 0 -9.81" cone="elliptic" impratio="20"/>
    <default><geom solimp="{_IMPEDANCE}" friction="{n["kinetic"]} 0 0"/></default>
    <worldbody><geom type="plane" size="9 9 1"/>
      <body name="hinge" mocap="true" pos="{hinge[0]} {hinge[1]} 0"><site name="hinge"/></body>
      <body name="object" pos="{start[0]} {start[1]} {_THIN_M}" euler="0 0 {np.degrees(start[2])}"><freejoint/>
        <inertial pos="{centre[0]} {centre[1]} {-_THIN_M}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
        {points}
        <site name="anchor" pos="{numbers["anchor"][0]} {numbers["anchor"][1]} {-_THIN_M}"/></body></worldbody>
    <tendon><spatial stiffness="{n["stiffness"]}" damping="{n["damping"]}" springlength="0 {n["rest"]}">
      <site site="hinge"/><site site="anchor"/></spatial></tendon></mujoco>""")
    data = mujoco.MjData(model)
    poses, row = np.empty((len(time_s), 3)), 0
    for i in range(round((time_s[-1] - time_s[0]) / STEP_S) + 1):
        data.mocap_pos[0, :2] = transform(drive(time_s[0] + i * STEP_S), numbers["hinge"])
        if i * STEP_S >= time_s[row] - time_s[0] - 1e-9:
            w, _, _, z = data.qpos[3:7]
            poses[row] = *data.qpos[:2], 2 * np.arctan2(z, w)
            row += 1
        mujoco.mj_step(model, data)
    poses[:, 2] = np.unwrap(poses[:, 2])
    return poses
