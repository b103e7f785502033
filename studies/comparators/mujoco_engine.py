"""MuJoCo on the same scenes: what it gives for the same cube, tether and path of the hinge, and what it costs.

MuJoCo has Coulomb friction at points: the four corners of a box, or a grid of small spheres. A patch is neither, so the
difference to the continuous patch does not vanish with the time step.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from studies.comparators.tow_scenes import TowScene
from studies.comparators.work_precision import REFERENCE_TOLERANCE_M, reference_places
from studies.costs import take_turns
from studies.frame import Row
from towval.model import Array
from towval.physics.friction_table import PLATEAU

if TYPE_CHECKING:
    import mujoco

_THIN = 0.02  # half the height of the body [m]; its anchor is on the floor, so that the tow does not tilt it
_SPHERE_M = 0.005
USUAL_IMPEDANCE = ".9 .95 .001"
"""MuJoCo's own default of ``solimp``."""

ROUNDS = 3
"""How often a simulation is timed; the least counts."""

LAYOUTS = {"box": 0, "4 × 4 spheres": 4}
"""Contacts of the object by name: how many spheres along a side, none for the corners of a box."""


def is_installed() -> bool:
    """Whether MuJoCo, which comes with the extra ``bench``, is installed."""
    return importlib.util.find_spec("mujoco") is not None


def mujoco_rows(scene: TowScene, steps: Iterable[float] = (0.002, 0.01)) -> list[Row]:
    """CPU time and error of MuJoCo on a scene whose object is a square about its centre of mass.

    Parameters
    ----------
    scene : TowScene
        Its law counts by the friction at high speed alone.
    steps : iterable of float, optional
        Time steps [s].

    Returns
    -------
    list of dict
        ``contact`` "box" or "4 × 4 spheres", ``step_s``, ``cpu_s``, ``error_m`` and ``rms_m`` of the centre over the
        scene's times, against our integrator at 1e-12 m; ``outcome`` "computed", or why it was skipped.
    """
    if not is_installed():
        nothing = dict.fromkeys(("step_s", "cpu_s", "error_m", "rms_m"), np.nan)
        return [{"contact": "box"} | nothing | {"outcome": "skipped: mujoco is not installed"}]
    exact = reference_places(scene, REFERENCE_TOLERANCE_M)
    settings = [(contact, step) for contact in LAYOUTS for step in steps]
    calls = {
        f"{contact}, {step:g} s": partial(mujoco_places, scene, step, LAYOUTS[contact]) for contact, step in settings
    }
    rows: list[Row] = []
    for (contact, step), timed in zip(settings, take_turns(calls, ROUNDS).values(), strict=True):
        error = np.linalg.norm(timed.result - exact, axis=1)
        rows.append(
            {
                "contact": contact,
                "step_s": step,
                "cpu_s": timed.cpu_s,
                "error_m": float(error.max()),
                "rms_m": float(np.sqrt(np.mean(error**2))),
                "outcome": "computed",
            }
        )
    return rows


def mujoco_places(scene: TowScene, step: float, spheres: int, impedance: str = USUAL_IMPEDANCE) -> Array:
    """The object's centre (n, 2) [m] at the scene's times, rounded to the nearest time step [s].

    ``impedance`` is MuJoCo's ``solimp`` of the contacts.
    """
    import mujoco  # noqa: PLC0415 — an extra: not everybody has it

    model = mujoco_model(scene, step, spheres, impedance)
    data = mujoco.MjData(model)
    begin, end = scene.times[0], scene.times[-1]
    count = round((end - begin) / step)
    moments = begin + np.arange(count) * step
    path = np.column_stack([np.interp(moments, scene.hinge.time_s, scene.hinge.position[:, k]) for k in (0, 1)])
    places = np.empty((count + 1, 2))
    target = data.mocap_pos[0]
    for i in range(count):
        target[:2] = path[i]
        places[i] = data.qpos[:2]
        mujoco.mj_step(model, data)
    places[count] = data.qpos[:2]
    return places[np.round((scene.times - begin) / step).astype(int)]


def mujoco_model(scene: TowScene, step: float, spheres: int, impedance: str = USUAL_IMPEDANCE) -> mujoco.MjModel:
    """Floor, object on its contacts, hinge as a mocap body, and the tether as a tendon that only pulls."""
    import mujoco  # noqa: PLC0415

    towed, friction = scene.towed, float(scene.patch.table[PLATEAU])
    half = float(towed.patch.outline.max())
    x, y, heading = scene.start_pose
    hinge_x, hinge_y = scene.hinge.position[0]
    if spheres:
        places = np.linspace(-half + _SPHERE_M, half - _SPHERE_M, spheres)
        contacts = "".join(
            f'<geom type="sphere" size="{_SPHERE_M}" pos="{px} {py} {_SPHERE_M - _THIN}" mass="0" '
            f'friction="{friction} 0 0"/>'
            for px in places
            for py in places
        )
    else:
        contacts = f'<geom type="box" size="{half} {half} {_THIN}" mass="0" friction="{friction} 0 0"/>'
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="{step}" gravity="0 0 -9.81" cone="elliptic" impratio="10"/>
    <default><geom solimp="{impedance}"/></default>
    <worldbody>
      <geom type="plane" size="5 5 1" friction="{friction} 0 0"/>
      <body name="hinge" mocap="true" pos="{hinge_x} {hinge_y} 0"><site name="hinge"/></body>
      <body name="object" pos="{x} {y} {_THIN}" euler="0 0 {np.degrees(heading)}"><freejoint/>
        <inertial pos="0 0 {-_THIN}" mass="{towed.mass}" diaginertia="0.1 0.1 {towed.inertia}"/>{contacts}
        <site name="anchor" pos="{towed.anchor[0]} {towed.anchor[1]} {-_THIN}"/></body>
    </worldbody>
    <tendon><spatial stiffness="{scene.tether.stiffness}" springlength="0 {scene.tether.rest_length}">
      <site site="hinge"/><site site="anchor"/></spatial></tendon>
    </mujoco>""")
