"""A synthetic ceiling camera: it films two textured bodies with known motion, lens and noise.

Every pixel of a body's top is the top's texture at the exact intersection of the pixel's ray with the plane of the
top; the outline is soft over one pixel, as an area sensor sees it. Sides, shadow, an arm, a change of light, motion
blur and noise can be added. Truth and measurement share the camera model only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from towval.model import Body, Calibration, Camera, Floor
from towval.model.geometry import inverse_transform, transform
from towval.optics.projection import project, to_plane
from towval.tracking.planar_target import PlanarTarget

Motion = Callable[[float], np.ndarray]
"""Pose (3,) of a body [m, m, rad] at a time [s]."""


def smooth_noise(rng: np.random.Generator, shape: tuple[int, int], grain: float) -> np.ndarray:
    """Noise of unit deviation whose features are about ``grain`` cells wide."""
    white = rng.standard_normal(shape).astype(np.float32)
    noise = cv2.GaussianBlur(white, (0, 0), grain, borderType=cv2.BORDER_REFLECT)
    return noise / noise.std()


@dataclass(frozen=True)
class FilmedScene:
    """What is filmed, and how.

    ``contrast`` deviation of the tops' grey values; ``noise`` of the sensor [grey levels]; ``exposure_s`` how long the
    shutter is open; ``light(t)`` a factor on everything; ``shade(t, xy)`` a factor (n,) at floor points (n, 2);
    ``cover(t)`` polygons [floor m] at ``cover_height_m`` that hide what is below, in grey 60; ``hidden`` names of
    bodies that are not drawn at a time.
    """

    camera: Camera
    floor: Floor
    bodies: tuple[Body, ...]
    motions: tuple[Motion, ...]
    seed: int = 0
    contrast: float = 35.0
    brightness: tuple[float, float] = (110.0, 190.0)
    grain_m: float = 0.012
    noise: float = 3.0
    psf_px: float = 0.6
    exposure_s: float = 0.0
    light: Callable[[float], float] = field(default=lambda _: 1.0)
    shade: Callable[[float, np.ndarray], np.ndarray] | None = None
    cover: Callable[[float], list[np.ndarray]] = field(default=lambda _: [])
    cover_height_m: float = 0.6
    hidden: Callable[[float], tuple[str, ...]] = field(default=lambda _: ())
    texture_of: tuple[int, ...] = (0, 1)

    @property
    def calibration(self) -> Calibration:
        """The true camera as a calibration without error."""
        return Calibration(self.camera, self.floor, np.zeros((18, 18)), 0.0)

    def target(self, index: int) -> PlanarTarget:
        """The top of a body under the camera."""
        return PlanarTarget(self.bodies[index], self.camera, self.floor)

    def truth(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Poses (n, 3) of each body at ``times`` (n,)."""
        return {
            body.name: np.array([motion(t) for t in times])
            for body, motion in zip(self.bodies, self.motions, strict=True)
        }

    def clicks(self, rng: np.random.Generator, noise_px: float = 0.7, time_s: float = 0.0) -> dict[str, np.ndarray]:
        """Clicks on the corners of the tops in the first picture."""
        clicks = {}
        for body, motion in zip(self.bodies, self.motions, strict=True):
            corners = transform(motion(time_s), body.top_corners_m)
            pixels = project(
                self.camera, self.floor, np.column_stack([corners, np.full(len(corners), body.tracked_plane_height_m)])
            )
            clicks[body.name] = pixels + noise_px * rng.standard_normal(pixels.shape)
        return clicks


class CeilingCamera:
    """Films a scene: :meth:`frames` yields ``(time_s, luma)``; ``ground`` is the floor alone (height, width)."""

    def __init__(self, scene: FilmedScene):
        self.scene = scene
        width, height = scene.camera.resolution_px
        rng = self._rng = np.random.default_rng(scene.seed)
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)
        self._ground_xy = to_plane(scene.camera, scene.floor, grid, 0.0).astype(np.float32)
        self._targets = [
            to_plane(scene.camera, scene.floor, grid, b.tracked_plane_height_m).astype(np.float32) for b in scene.bodies
        ]
        floor_texture = 130 + 14 * smooth_noise(rng, (1024, 1024), 2.0) + 8 * smooth_noise(rng, (1024, 1024), 12.0)
        self.ground = _look_up(floor_texture, self._ground_xy, 0.008)
        self._blurred_ground = cv2.GaussianBlur(self.ground, (0, 0), scene.psf_px)
        self._textures = [self._texture(rng, body) for body in scene.bodies]
        # Noise is cut from one larger field at a random place: as good as new, and cheap.
        self._noise = scene.noise * rng.standard_normal((height + 509, width + 509), dtype=np.float32)

    def _texture(self, rng: np.random.Generator, body: Body) -> np.ndarray:
        """Grey values of a top on a grid of 1 mm, its centre at the origin."""
        size = int(np.abs(body.top_corners_m).max() * 2000) + 40
        grain = self.scene.grain_m * 1000
        noise = smooth_noise(rng, (size, size), grain / 2.5) + 0.7 * smooth_noise(rng, (size, size), grain * 2)
        return rng.uniform(*self.scene.brightness) + self.scene.contrast * np.clip(noise / np.hypot(1, 0.7), -2.2, 2.2)

    def render(self, time_s: float) -> np.ndarray:
        """The picture without noise (height, width) float32, light and shade included."""
        scene = self.scene
        image: np.ndarray = self._blurred_ground.copy()
        for i, (body, motion) in enumerate(zip(scene.bodies, scene.motions, strict=True)):
            if body.name not in scene.hidden(time_s):
                self._draw_body(image, i, motion(time_s))
        image *= scene.light(time_s)
        if scene.shade is not None:
            image *= scene.shade(time_s, self._ground_xy.reshape(-1, 2)).reshape(image.shape)
        for polygon in scene.cover(time_s):
            points = np.column_stack([polygon, np.full(len(polygon), scene.cover_height_m)])
            _fill(image, project(scene.camera, scene.floor, points), 60.0)
        return image

    def picture(self, time_s: float) -> np.ndarray:
        """What the sensor gives (height, width) uint8."""
        exposure = self.scene.exposure_s
        steps = 1 if exposure == 0 else 9
        moments = time_s + exposure * ((np.arange(steps) + 0.5) / steps - 0.5)
        image = self.render(moments[0])
        for moment in moments[1:]:
            image += self.render(moment)
        v, u = self._rng.integers(0, 509, 2)
        image = image / steps + self._noise[v : v + image.shape[0], u : u + image.shape[1]]
        return np.clip(np.round(image), 0, 255).astype(np.uint8)

    def frames(self, times: np.ndarray) -> Iterator[tuple[float, np.ndarray]]:
        """Times and pictures."""
        for time_s in times:
            yield float(time_s), self.picture(float(time_s))

    def _draw_body(self, image: np.ndarray, index: int, pose: np.ndarray) -> None:
        scene, body = self.scene, self.scene.bodies[index]
        corners = transform(pose, body.top_corners_m)
        solid = np.concatenate(
            [np.column_stack([corners, np.full(len(corners), z)]) for z in (0, body.tracked_plane_height_m)]
        )
        pixels = project(scene.camera, scene.floor, solid)
        size = np.array(scene.camera.resolution_px)
        low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 6, 0, size)
        high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 7, 0, size)
        if (high - low < 3).any():
            return
        box = slice(low[1], high[1]), slice(low[0], high[0])
        part = self.ground[box].copy()
        self._draw_sides(part, body, pose, low)
        own = inverse_transform(pose, self._targets[index][box])
        (by_row_x, by_column_x), (by_row_y, by_column_y) = np.gradient(own[..., 0]), np.gradient(own[..., 1])
        pixel = np.sqrt(np.abs(by_row_x * by_column_y - by_column_x * by_row_y))
        share = np.clip(0.5 - _signed_distance(body.top_corners_m, own) / pixel, 0, 1)
        part += share * (_look_up(self._textures[scene.texture_of[index]], own, 0.001) - part)
        image[box] = cv2.GaussianBlur(part, (0, 0), scene.psf_px)

    def _draw_sides(self, image: np.ndarray, body: Body, pose: np.ndarray, corner_px: np.ndarray) -> None:
        """The walls that face the camera, carried a little under the top so that no seam shows."""
        target = body.tracked_plane_height_m
        corners, inner = transform(pose, body.top_corners_m), transform(pose, 0.96 * body.top_corners_m)
        camera = self.scene.floor.camera_position_m[:2]
        for i in range(len(corners)):
            j = (i + 1) % len(corners)
            edge = corners[j] - corners[i]
            if np.array([edge[1], -edge[0]]) @ (camera - corners[i]) > 0:
                wall = [
                    [*corners[i], 0],
                    [*corners[j], 0],
                    [*corners[j], target],
                    [*inner[j], target],
                    [*inner[i], target],
                    [*corners[i], target],
                ]
                _fill(image, project(self.scene.camera, self.scene.floor, np.array(wall)) - corner_px, 75.0)


def _fill(image: np.ndarray, pixels: np.ndarray, grey: float) -> None:
    mask = np.zeros(image.shape, np.uint8)
    cv2.fillPoly(mask, [np.round(pixels * 16).astype(np.int32)], 255, cv2.LINE_AA, 4)
    v, u = np.nonzero(mask)
    image[v, u] += mask[v, u] / np.float32(255) * (grey - image[v, u])


def _look_up(texture: np.ndarray, xy: np.ndarray, cell_m: float) -> np.ndarray:
    """Texture centred at the origin, read at points (..., 2) [m]."""
    place = (xy / cell_m + (np.array(texture.shape[::-1]) - 1) / 2).astype(np.float32)
    return cv2.remap(
        texture.astype(np.float32), place[..., 0], place[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
    ).astype(np.float64)


def _signed_distance(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of points (..., 2) from a polygon's outline [m], negative inside."""
    x, y = points[..., 0], points[..., 1]
    nearest2 = np.full(x.shape, np.inf, dtype=x.dtype)
    inside = np.zeros(x.shape, dtype=bool)
    for (ax, ay), (bx, by) in zip(polygon.tolist(), np.roll(polygon, -1, axis=0).tolist(), strict=True):
        ex, ey, from_x, from_y = bx - ax, by - ay, x - ax, y - ay
        along = np.clip((from_x * ex + from_y * ey) / (ex * ex + ey * ey), 0, 1)
        np.minimum(nearest2, (from_x - along * ex) ** 2 + (from_y - along * ey) ** 2, out=nearest2)
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + ex * from_y / ey)
    distance = np.sqrt(nearest2)
    return np.where(inside, -distance, distance)


def rectangle(length: float, width: float) -> np.ndarray:
    """Corners of a rectangle about the origin, counter-clockwise [m]."""
    return np.array([[-length, -width], [length, -width], [length, width], [-length, width]]) / 2


def ceiling(
    resolution_px: tuple[int, int] = (1920, 1080),
    focal_px: float = 1560.0,
    height_m: float = 4.0,
    tilt_rad: float = 0.06,
    distortion: tuple[float, ...] = (-0.06, 0.01),
) -> tuple[Camera, Floor]:
    """A camera at the ceiling that looks down, tilted a little, x of the floor to the right of the picture."""
    width, height = resolution_px
    matrix = np.array([[focal_px, 0, width / 2 + 3.3], [0, focal_px * 1.001, height / 2 - 4.7], [0, 0, 1]])
    camera = Camera(resolution_px, matrix, np.pad(distortion, (0, 8 - len(distortion))), "test")
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    down = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
    rotation = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ down
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, -rotation @ np.array([0.05, -0.03, height_m])
    return camera, Floor(T)


def small_camera() -> dict[str, Any]:
    """Changes to a scene that film it with a quarter of the pixels: four times as fast, pixels of 4.7 mm."""
    camera, floor = ceiling((960, 540), 780.0)
    return {"camera": camera, "floor": floor, "grain_m": 0.024}


def two_bodies() -> tuple[Body, Body]:
    """A rover and a box of the usual sizes."""
    return Body("rover", 0.42, rectangle(0.75, 0.5)), Body("object", 0.25, rectangle(0.5, 0.35))


def drive(start: tuple[float, float, float], speed: float, turn: float = 0.0, rest_s: float = 0.0) -> Motion:
    """A motion along an arc after a rest, with a smooth start."""

    def pose(time_s: float) -> np.ndarray:
        t = max(0.0, time_s - rest_s)
        path = speed * (t - 0.5 * (1 - np.exp(-2 * t)))
        heading = start[2] + turn * path
        chord = path * np.sinc(turn * path / 2 / np.pi)
        middle = start[2] + turn * path / 2
        return np.array([start[0] + chord * np.cos(middle), start[1] + chord * np.sin(middle), heading])

    return pose


def standard_scene(seed: int = 0, **changes: Any) -> FilmedScene:
    """Rover and object at 1080p from 4 m, each going about a metre in eight seconds."""
    rng = np.random.default_rng(1000 + seed)
    camera, floor = ceiling()
    speed = 0.13
    motions = (
        drive((rng.uniform(-0.5, 0.0), rng.uniform(0.2, 0.5), rng.uniform(-0.3, 0.3)), speed, rng.uniform(-0.6, 0.6)),
        drive(
            (rng.uniform(-1.0, -0.7), rng.uniform(-0.6, -0.3), rng.uniform(-0.3, 0.3)), speed, rng.uniform(-0.8, 0.8)
        ),
    )
    return replace(FilmedScene(camera, floor, two_bodies(), motions, seed=seed), **changes)
