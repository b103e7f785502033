"""Feedforward from rest and from matched speed, and creep at rest: properties of the equations, solved accurately."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from studies.frame import Maps, Part, Row, Settings, Study, judged
from studies.maps.integrators import CUBE, FRICTION
from towval.model import Array, FrictionLaw, SimulatedMotion, Tether, TimedPath
from towval.physics.contact import resting_pressure
from towval.physics.creep import creep_length
from towval.physics.dynamics import Outcome, feedback, feedforward
from towval.physics.friction_laws import Coulomb, fit_makkar
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.wrench import sliding_patch
from towval.planning.paths import lemniscate, timed

STARTS = {"rest": 0.0, "matched": 1.0}
"""Share of the nominal velocity at the start."""

FOLLOWED_M, CREPT_M = 0.01, 1e-3
PULL = 0.5
"""Pull on the resting object, as a share of the limit of friction."""

_STEPS = 4000


def laws() -> dict[str, FrictionLaw]:
    """Friction that rises to a plateau, and friction with a peak at rest."""
    return {"flat law": Coulomb(FRICTION, 1e-3), "peaked law": fit_makkar(0.36, 0.35, 1e-3, 1e-2).law}


def feedforward_rows(law: str, speeds: list[float]) -> list[Row]:
    """Cells of the map over speed and start: distance from the nominal path under the nominal force alone."""
    patch, rows = sliding_patch(resting_pressure(CUBE), laws()[law]), []
    curve, tether = lemniscate(2.0), Tether(0.6, 1e5)
    for speed in speeds:
        specification = timed(curve, curve.length / speed / _STEPS, mean_speed=speed)
        nominal = quasistatic_plan(CUBE, patch, specification, tether)
        shown = np.arange(0, len(nominal.time_s), 4)
        for start, share in STARTS.items():
            motion = feedforward(
                CUBE,
                patch,
                TimedPath(nominal.time_s, nominal.tether_force),
                nominal.pose[0],
                nominal.time_s[shown],
                start_twist=share * nominal.twist[0],
            )
            rows.append({"map": f"feedforward, {law}", "x": speed, "y": start} | _drifted(motion, nominal.pose[shown]))
    return rows


def _drifted(motion: SimulatedMotion, nominal: Array) -> Row:
    if motion.outcome != Outcome.CONVERGED:
        return judged(np.nan, FOLLOWED_M, [str(motion.outcome)])
    flags = [finding.code for finding in motion.findings]
    gap = np.linalg.norm(motion.pose[:, :2] - nominal[:, :2], axis=1)
    return judged(float(np.sqrt(np.mean(gap**2))), FOLLOWED_M, flags)


def creep_rows(stictions: list[float], durations_s: list[float]) -> list[Row]:
    """Cells of the map over v_s and duration: how far an object creeps under half of the limit of friction."""
    rows = []
    tether = Tether(0.6, 1000.0)
    for stiction in stictions:
        law = Coulomb(FRICTION, stiction)
        reach = float(CUBE.anchor[0]) + tether.rest_length + PULL * FRICTION * CUBE.mass * 9.81 / tether.stiffness
        for duration in durations_s:
            # The hinge backs off with the creep that the law predicts, so that the pull stays.
            creep = stiction * np.arctanh(PULL)
            hinge = TimedPath(np.array([0.0, duration]), np.array([[reach, 0.0], [reach + creep * duration, 0.0]]))
            centred = replace(CUBE, centre_of_mass=np.zeros(2))
            motion = feedback(centred, law, tether, hinge, (0, 0, 0), np.linspace(0, duration, 51))
            crept = creep_length(motion, centred, stiction)
            flags = [] if motion.outcome == Outcome.CONVERGED else [str(motion.outcome)]
            flags += ["creep"] if crept > CREPT_M else []
            error = float(np.linalg.norm(motion.pose[-1, :2]))
            rows.append({"map": "creep at rest", "x": stiction, "y": duration} | judged(error, CREPT_M, flags))
    return rows


def open_loop_rows(what: str, **keys: Any) -> list[Row]:
    """Cells of one part: "feedforward" or "creep"."""
    return feedforward_rows(**keys) if what == "feedforward" else creep_rows(**keys)


def _parts(settings: Settings) -> dict[str, Part]:
    speeds = [0.01, 0.1] if settings.quick else [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2]
    parts: dict[str, Part] = {
        name.replace(" ", "_"): {"what": "feedforward", "law": name, "speeds": speeds} for name in laws()
    }
    stictions = [1e-4, 1e-2] if settings.quick else [1e-6, 1e-5, 1e-4, 1e-3, 1e-2]
    durations = [1.0, 100.0] if settings.quick else [1.0, 10.0, 100.0, 1000.0]
    return parts | {"creep": {"what": "creep", "stictions": stictions, "durations_s": durations}}


STUDY = Study(
    parts=_parts,
    rows=open_loop_rows,
    chart=Maps(
        title="Open loops: feedforward, and creep at rest",
        axes={
            "feedforward, flat law": ("mean speed [m/s]", "start"),
            "feedforward, peaked law": ("mean speed [m/s]", "start"),
            "creep at rest": ("stiction velocity v_s [m/s]", "duration [s]"),
        },
        note="Right: feedforward within 10 mm RMS of the nominal path; creep below 1 mm under half of the limit of "
        "friction. Flagged: a named outcome; 0.1 % more force that moves the object by over 10 mm; the check for "
        "creep. Nothing here has a default.",
        take="Do not feed forward: a tow in an open loop stays near the wanted path by chance alone, and is flagged "
        "everywhere. A regularised law creeps at rest by about half of v_s times the duration.",
    ),
)
