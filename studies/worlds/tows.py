"""Towed objects at random places and headings, filmed as they start: what a search without clicks is put to."""

from __future__ import annotations

from typing import Any

import numpy as np

from studies.worlds.scenes import CeilingCamera, FilmedScene, drive, small_camera, standard_scene
from towval.model import Array
from towval.model.geometry import transform
from towval.tracking.start import Tow
from towval.tracking.template import Luma

MARGIN_PX = 5.0


def towed(seed: int, **changes: Any) -> tuple[FilmedScene, Tow]:
    """A scene whose object stands behind the rover, joined to it by a tether, both at random headings; and the tow."""
    rng = np.random.default_rng([seed, 4])
    tow = Tow(np.array([-0.42, 0.0]), np.array([0.25, 0.0]), 0.65)
    ahead, bearing = rng.uniform(-np.pi, np.pi), rng.uniform(-0.4, 0.4)
    rover = np.array([*rng.uniform([-0.3, -0.2], [0.3, 0.2]), ahead])
    anchor = transform(rover, tow.hinge) - 0.6 * np.array([np.cos(ahead + bearing), np.sin(ahead + bearing)])
    heading = ahead + rng.uniform(-0.5, 0.5)
    origin = anchor - transform([0.0, 0.0, heading], tow.anchor)
    motions = (drive((rover[0], rover[1], rover[2]), 0.3), drive((origin[0], origin[1], heading), 0.3))
    scene = standard_scene(seed, **(small_camera() | {"motions": motions} | changes))
    for i, body in enumerate(scene.bodies):
        pixels = scene.target(i).pixels(body.top_corners_m, motions[i](0.0))
        if ((pixels < MARGIN_PX) | (pixels > np.array(scene.camera.resolution_px) - MARGIN_PX)).any():
            return towed(1000 + seed, **changes)
    return scene, tow


def spread(scene: FilmedScene, times: Array) -> list[Luma]:
    """Pictures of a scene at some times [s]."""
    film = CeilingCamera(scene)
    return [film.picture(float(t)) for t in times]


def off_px(scene: FilmedScene, index: int, pose: Array) -> float:
    """How far the farthest corner of a body may be from where it is in the first picture [px]."""
    target = scene.target(index)
    true = scene.motions[index](0.0)
    return target.apart_m(true, pose) / target.metres_per_pixel(true)
