"""The tows of ``studies.worlds.lab_tows`` in the models of the package, each effect taken or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from studies.worlds.lab_tows import LabTow
from towval.model import Array, FrictionLaw, Ground, Patch, SimulatedMotion, Sliding, Tether, TimedPath, TowedObject
from towval.physics.dynamics import STANDARD, Accuracy, feedback
from towval.physics.friction_laws import Coulomb, fit_makkar, risen_law
from towval.physics.spatial.tow import Sticking

EFFECTS = ("heights", "slope", "anisotropy", "stiffening", "sticking")
RISE_M_PER_S = 1e-6
"""Speed over which friction rises to its static value where an object sticks: a ten-thousandth of v_k and less."""

STICTION_M_PER_S = 1e-3
"""v_s of the regularised law, where sticking is left out: what docs/physics.md uses for it."""

_HINGE_STEP_S = 0.02


def present_effects(tow: LabTow) -> tuple[str, ...]:
    """Effects that a tow has, by the names of :data:`EFFECTS`."""
    has = {
        "heights": max(tow.tether.hinge_height, tow.tether.anchor_height, tow.towed.centre_height) > 0,
        "slope": tow.slope != (0.0, 0.0),
        "anisotropy": tow.towed.across_over_along != 1.0,
        "stiffening": tow.tether.stiffening > 0,
        "sticking": True,
    }
    return tuple(name for name in EFFECTS if has[name])


def modelled(
    tow: LabTow, effects: tuple[str, ...], times: Array, accuracy: Accuracy = STANDARD, rise: float = RISE_M_PER_S
) -> SimulatedMotion:
    """Motion by ``towval.physics.dynamics.feedback`` with these effects alone, reported at times (n,) [s]."""
    towed, tether = tow.towed, tow.tether
    high = "heights" in effects
    rope = Tether(tether.rest_length, tether.stiffness, tether.damping)
    if "stiffening" in effects:
        rope = replace(rope, stiffening=tether.stiffening, full_load=tether.full_load)
    body = TowedObject(
        Patch.of(tow.rings),
        towed.mass,
        np.array(towed.centre),
        towed.inertia,
        np.array(towed.anchor),
        anchor_height=tether.anchor_height if high else 0.0,
        centre_of_mass_height=towed.centre_height if high else 0.0,
    )
    sticks = "sticking" in effects
    law = risen_law(towed.static, towed.kinetic, rise, towed.friction_velocity) if sticks else _regularised(tow)
    moments = np.linspace(times[0], times[-1], round((times[-1] - times[0]) / _HINGE_STEP_S) + 1)
    return feedback(
        body,
        Sliding(law, towed.across_over_along if "anisotropy" in effects else 1.0),
        rope,
        TimedPath(moments, tow.hinge(moments)[0]),
        tow.start_pose,
        times,
        accuracy=accuracy,
        ground=Ground(slope=np.array(tow.slope if "slope" in effects else (0.0, 0.0))),
        hinge_height=tether.hinge_height if high else 0.0,
        sticking=Sticking(towed.static, 2 * rise) if sticks else None,
    )


def _regularised(tow: LabTow) -> FrictionLaw:
    towed = tow.towed
    if towed.static == towed.kinetic:
        return Coulomb(towed.kinetic, STICTION_M_PER_S)
    return fit_makkar(towed.static, towed.kinetic, STICTION_M_PER_S, towed.friction_velocity).law


def distances_m(motion: SimulatedMotion, truth: Array) -> Array:
    """Distances (k,) [m] of a motion's places from the truth (n, 3), as far as the motion got."""
    reached = len(motion.pose)
    apart: Array = np.linalg.norm(motion.pose[:, :2] - truth[:reached, :2], axis=1)
    return apart
