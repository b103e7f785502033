"""Scenes that are hard for a tracker, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from studies.worlds.scenes import FilmedScene, drive, standard_scene
from towval.model.geometry import transform

RATE_HZ = 25.0


@dataclass(frozen=True)
class Challenge:
    """A scene and the times [s] at which it is filmed."""

    scene: FilmedScene
    times: np.ndarray


def _times(seconds: float, rate: float = RATE_HZ) -> np.ndarray:
    return np.arange(round(seconds * rate)) / rate


def metre(seed: int, seconds: float = 3.0) -> Challenge:
    """Both bodies go about a metre."""
    return Challenge(_faster(standard_scene(seed), seconds), _times(seconds))


def _faster(scene: FilmedScene, seconds: float) -> FilmedScene:
    """The same scene with both motions stretched so that they cover a metre in ``seconds``."""
    pace = 1.0 / (0.13 * (seconds - 0.5))
    return replace(scene, motions=tuple(_paced(motion, pace) for motion in scene.motions))


def _paced(motion: Callable[[float], np.ndarray], pace: float) -> Callable[[float], np.ndarray]:
    return lambda t: motion(t * pace)


def _delayed(motion: Callable[[float], np.ndarray], delay_s: float) -> Callable[[float], np.ndarray]:
    return lambda t: motion(max(0.0, t - delay_s))


def arm_and_tether(seed: int) -> Challenge:
    """An arm 0.12 m wide sweeps over both bodies, and a dark tether lies across them."""
    base = metre(seed)

    def cover(t: float) -> list[np.ndarray]:
        at = -1.6 + 1.2 * t
        arm = np.array([[at, -1.5], [at + 0.12, -1.5], [at + 0.5, 1.5], [at + 0.38, 1.5]])
        rover, thing = base.scene.motions[0](t)[:2], base.scene.motions[1](t)[:2]
        across = 0.006 * np.array([-(rover - thing)[1], (rover - thing)[0]]) / np.linalg.norm(rover - thing)
        return [arm, np.array([rover - across, rover + across, thing + across, thing - across])]

    return replace(base, scene=replace(base.scene, cover=cover))


def light_step(seed: int) -> Challenge:
    """The light falls to 0.65 in one step."""
    base = metre(seed)
    return replace(base, scene=replace(base.scene, light=lambda t: 1.0 if t < 1.2 else 0.65))


def shadow_edge(seed: int) -> Challenge:
    """The edge of a shadow of half the light moves over both bodies."""
    base = metre(seed)

    def shade(t: float, xy: np.ndarray) -> np.ndarray:
        across = xy[:, 0] + 0.4 * xy[:, 1] - (-1.6 + 1.1 * t)
        return (0.75 + 0.25 * np.tanh(across / 0.01)).astype(np.float32)

    return replace(base, scene=replace(base.scene, shade=shade))


def every_tenth(seed: int) -> Challenge:
    """Only every tenth picture of a slower run."""
    scene = standard_scene(seed)
    return Challenge(scene, np.arange(21) * 10 / RATE_HZ)


def motion_blur(seed: int) -> Challenge:
    """The shutter is open for ten pixels of motion."""
    base = metre(seed)
    blur_m = 10 / 1560 * 3.7
    # A rest first: a picture blurred by a body that just starts has no one pose to compare with.
    motions = tuple(_delayed(motion, 0.2) for motion in base.scene.motions)
    return replace(base, scene=replace(base.scene, exposure_s=blur_m / 0.4, motions=motions))


def low_texture(seed: int) -> Challenge:
    """Tops almost plain."""
    base = metre(seed)
    return replace(base, scene=replace(base.scene, contrast=1.0))


def occlusion(seed: int) -> Challenge:
    """Something hides the object wholly for a second; the rover stays in view."""
    base = metre(seed)
    motion = base.scene.motions[1]

    def cover(t: float) -> list[np.ndarray]:
        if not 1.0 < t < 2.0:
            return []
        return [transform(motion(t), 0.6 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))]

    return replace(base, scene=replace(base.scene, cover=cover, cover_height_m=0.3))


def leaving(seed: int) -> Challenge:
    """The rover drives out of the picture."""
    base = metre(seed)
    motions = (drive((1.0, 0.3, 0.1), 0.8), base.scene.motions[1])
    return replace(base, scene=replace(base.scene, motions=motions))


def swapped(seed: int) -> Challenge:
    """While the object is hidden, a body of the same size and another texture takes its place."""
    base = occlusion(seed)
    scene = base.scene
    other = replace(scene.bodies[1], name="stranger")

    def hidden(t: float) -> tuple[str, ...]:
        return ("stranger",) if t < 1.5 else ("object",)

    scene = replace(
        scene,
        bodies=(*scene.bodies, other),
        motions=(*scene.motions, scene.motions[1]),
        texture_of=(0, 1, 2),
        hidden=hidden,
    )
    return replace(base, scene=scene)


def twin_in_view(seed: int) -> Challenge:
    """The object is carried off under a cover while another body that looks just like it stands in full view."""
    base = occlusion(seed)
    scene = base.scene
    before, beside = scene.motions[1], drive((0.3, -0.9, 0.3), 0.0)

    def motion(t: float) -> np.ndarray:
        # While it is hidden something pushes it 0.4 m aside.
        return before(t) + 0.4 * np.clip(t - 1.2, 0.0, 0.6) / 0.6 * np.array([0.0, 1.0, 0.0])

    def cover(t: float) -> list[np.ndarray]:
        if not 1.0 < t < 2.0:
            return []
        return [transform(motion(t), 0.6 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))]

    scene = replace(
        scene,
        bodies=(*scene.bodies, replace(scene.bodies[1], name="twin")),
        motions=(scene.motions[0], motion, beside),
        texture_of=(0, 1, 1),
        cover=cover,
    )
    return replace(base, scene=scene)


ACCURATE = {"1 m of path": metre}
HARD = {
    "arm and tether": arm_and_tether,
    "light x 0.65": light_step,
    "shadow edge": shadow_edge,
    "every 10th frame": every_tenth,
    "motion blur 10 px": motion_blur,
}
FLAGGED = {
    "low texture": low_texture,
    "full occlusion": occlusion,
    "leaving the image": leaving,
    "swapped": swapped,
    "twin in view": twin_in_view,
}
