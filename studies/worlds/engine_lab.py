"""A laboratory that MuJoCo renders: box-shaped bodies, shadows and perspective, under a ceiling camera.

No code that draws or projects is shared with the package: the picture is MuJoCo's, the lens the division model
(Fitzgibbon 2001), which is none of OpenCV's. MuJoCo comes with the extra ``bench``; it needs EGL to draw off screen.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studies.worlds.engine_textures import FLOORS, TOPS, Picture, board_texture, floor_texture, top_texture
from towval.model import Array

RESOLUTION_PX = (1280, 720)
ROVER_SIZE_M, OBJECT_SIZE_M = (0.75, 0.5, 0.40), (0.5, 0.35, 0.25)
"""Length, width and height of the tops."""

INNER_CORNERS, SQUARE_M, THICKNESS_M = (9, 6), 0.04, 0.003
_FINER = 1.3  # Rendered pixels a pixel of the camera.
_WIDER = 0.86  # Of the focal length, so that the lens finds all of its picture.
_NEAR_M = 0.05
_AWAY_M = 60.0


@dataclass(frozen=True)
class Look:
    """How a laboratory looks, drawn by :meth:`of`: kinds of floor and tops, ``noise`` [grey levels], focal length [px],
    the lens' ``division`` coefficient, ``lights``, the camera's ``height`` [m], its ``tilt`` and where to [rad], and
    the mean ``brightness`` [grey levels]."""

    floor: str
    tops: tuple[str, str]
    noise: float
    focal_px: float
    division: float
    lights: int
    height: float
    tilt: float
    towards: float
    brightness: float = 105.0

    @staticmethod
    def of(rng: np.random.Generator) -> Look:
        """A look at random."""
        return Look(
            str(rng.choice(list(FLOORS))), (str(rng.choice(list(TOPS))), str(rng.choice(list(TOPS)))),
            rng.uniform(1, 3.5), rng.uniform(0.62, 0.75) * RESOLUTION_PX[0], rng.uniform(-0.12, 0.02),
            int(rng.integers(1, 4)), rng.uniform(2.9, 3.5), np.radians(rng.uniform(0, 22)), rng.uniform(0, 2 * np.pi),
        )  # fmt: skip


def rendering_engine() -> Any:
    """MuJoCo, which draws off screen where this is what imports it first."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco  # noqa: PLC0415 — an extra: not everybody has it

    return mujoco


def can_render() -> bool:
    """Whether MuJoCo is there and draws off screen."""
    try:
        mujoco = rendering_engine()
        mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()
    except (ImportError, AttributeError, RuntimeError):
        return False
    return True


class EngineLab:
    """A laboratory of a ``look`` whose camera looks at ``middle`` (2,) [m], its rows ``along`` [rad]."""

    def __init__(self, rng: np.random.Generator, look: Look, middle: Array, along: float):
        self._engine = mujoco = rendering_engine()
        self.rng, self.look = rng, look
        width, height = (round(side * _FINER) // 2 * 2 for side in RESOLUTION_PX)
        self._set_camera(middle, along, (width, height))
        with tempfile.TemporaryDirectory() as folder:
            self.model = mujoco.MjModel.from_xml_string(self._described(Path(folder), (width, height)))
        self.data = mujoco.MjData(self.model)
        self.renderer = mujoco.Renderer(self.model, height, width)
        self.hide("rover", "object", "board", "tether")
        self.gain = look.brightness / float(self._rendered().mean())

    def _set_camera(self, middle: Array, along: float, rendered_px: tuple[int, int]) -> None:
        look = self.look
        ahead = np.array([np.cos(look.towards), np.sin(look.towards), 0]) * np.sin(look.tilt)
        ahead[2] = -np.cos(look.tilt)
        self.place = np.array([*middle, 0.0]) - ahead * look.height / np.cos(look.tilt)
        up = np.cross(-ahead, [np.cos(along), np.sin(along), 0])
        up /= np.linalg.norm(up)
        self.axes = np.column_stack([np.cross(up, -ahead), up, -ahead])
        """Right, up and backwards (3, 3): the engine's camera looks along its negative z."""
        self.rendered_focal_px = look.focal_px * _FINER * _WIDER
        self.centre_px = (np.array(RESOLUTION_PX) - 1) / 2 + self.rng.normal(0, 6, 2)
        pixels = np.stack(np.meshgrid(*map(np.arange, RESOLUTION_PX)), axis=-1)
        seen = (pixels - self.centre_px) / look.focal_px
        straight = seen / (1 + look.division * np.sum(seen**2, axis=-1, keepdims=True))
        source_px = straight * self.rendered_focal_px + (np.array(rendered_px) - 1) / 2
        self.source_px = np.moveaxis(source_px.astype(np.float32), -1, 0).copy()

    def project(self, places: Array) -> Array:
        """Pixels (n, 2) of places (n, 3) [m] of the world."""
        x, y, z = ((np.atleast_2d(places) - self.place) @ self.axes).T
        straight = np.column_stack([x / -z, y / z])
        seen = straight.copy()
        for _ in range(60):
            seen = straight * (1 + self.look.division * np.sum(seen**2, axis=1, keepdims=True))
        return np.asarray(seen * self.look.focal_px + self.centre_px)

    def ray(self, pixel: Array) -> Array:
        """A place (3,) [m] one metre before the camera, about at a pixel (2,)."""
        x, y = (pixel - self.centre_px) / self.look.focal_px
        return np.asarray(self.axes @ [x, -y, -1.0])

    def put(self, name: str, place: Array, turned: Rotation) -> None:
        """Place a body: ``rover``, ``object``, ``board`` or ``tether``."""
        at = self.model.body(name).mocapid[0]
        self.data.mocap_pos[at], self.data.mocap_quat[at] = place, np.roll(turned.as_quat(), 1)

    def hide(self, *names: str) -> None:
        """Take bodies out of the picture."""
        for name in names:
            self.put(name, np.array([_AWAY_M, _AWAY_M, 0.0]), Rotation.identity())

    def stretch_tether(self, hinge: Array, anchor: Array) -> None:
        """Draw the tether between two places (3,) [m]."""
        span = anchor - hinge
        length = float(np.linalg.norm(span))
        self.put("tether", (hinge + anchor) / 2, Rotation.align_vectors([span / length], [[0, 0, 1]])[0])
        self.model.geom("tether").size[1] = length / 2

    def picture(self) -> Picture:
        """What the camera takes (height, width, 3): noise of light and of colour, eight bits."""
        seen = self._rendered() * self.gain
        noise = self.look.noise * np.sqrt(0.4 + 0.6 * np.clip(seen, 0, 255) / 128)
        seen = seen + noise * self.rng.standard_normal((*seen.shape[:2], 1))
        seen = seen + 0.5 * noise * self.rng.standard_normal(seen.shape)
        return np.clip(np.rint(seen), 0, 255).astype(np.uint8)

    def _rendered(self) -> NDArray[np.float32]:
        self._engine.mj_forward(self.model, self.data)
        self.renderer.update_scene(self.data)
        half = _NEAR_M * self.renderer.height / 2 / self.rendered_focal_px
        for camera in self.renderer.scene.camera:
            camera.pos[:], camera.forward[:], camera.up[:] = self.place, -self.axes[:, 2], self.axes[:, 1]
            camera.frustum_near, camera.frustum_bottom, camera.frustum_top = _NEAR_M, -half, half
        smooth = cv2.GaussianBlur(self.renderer.render().astype(np.float32), (0, 0), 0.55 * _FINER)
        u, v = self.source_px
        return np.asarray(cv2.remap(smooth, u, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), dtype=np.float32)

    def _described(self, folder: Path, rendered_px: tuple[int, int]) -> str:
        """The scene in MuJoCo's language; its textures are written into ``folder``."""
        rng, look = self.rng, self.look
        cv2.imwrite(str(folder / "floor.png"), floor_texture(rng, look.floor)[..., ::-1])
        board, sheet = board_texture(INNER_CORNERS, SQUARE_M)
        tops = {"rover": top_texture(rng, look.tops[0]), "object": top_texture(rng, look.tops[1]), "board": board}
        materials = "".join(_covered(folder, name, top, rng) for name, top in tops.items())
        light = rng.uniform(0.25, 0.5) / np.sqrt(look.lights)
        lamps = "".join(
            f'<light pos="{x} {y} {z}" dir="{-x / 2} {-y / 2} {-z}" cutoff="80" exponent="1" castshadow="true" '
            f'diffuse="{light} {light} {light}" specular="{light} {light} {light}"/>'
            for x, y, z in rng.uniform([-2, -2, 2.8], [2, 2, 3.6], (look.lights, 3))
        )
        boxes = "".join(
            f'<body name="{name}" mocap="true"><geom type="box" material="{name}" size="{_half(size)}" '
            f'pos="0 0 {z}"/></body>'
            for name, size, z in (
                ("rover", (*ROVER_SIZE_M[:2], ROVER_SIZE_M[2] - 0.06), ROVER_SIZE_M[2] / 2 + 0.03),
                ("object", (*OBJECT_SIZE_M[:2], OBJECT_SIZE_M[2] - 0.01), OBJECT_SIZE_M[2] / 2 + 0.005),
                ("board", (*sheet, THICKNESS_M), -THICKNESS_M / 2),
            )
        )
        return f"""<mujoco><compiler texturedir="{folder}"/>
        <visual><global offwidth="{rendered_px[0]}" offheight="{rendered_px[1]}"/><map znear="0.05" zfar="20"/>
        <quality offsamples="8" shadowsize="2048"/><headlight ambient=".3 .3 .3" diffuse=".1 .1 .1"/></visual>
        <asset><texture name="floor" type="2d" file="floor.png"/><material name="floor" texture="floor" specular="0"/>
        {materials}</asset>
        <worldbody>{lamps}<geom type="plane" size="3.2 3.2 1" material="floor"/>{boxes}
        <body name="tether" mocap="true"><geom name="tether" type="capsule" size=".004 .1" rgba=".8 .75 .6 1"/></body>
        </worldbody></mujoco>"""


def _half(size: tuple[Any, ...]) -> str:
    return " ".join(str(side / 2) for side in size)


def _covered(folder: Path, name: str, top: Picture, rng: np.random.Generator) -> str:
    """A material with a picture on its upper side and one colour on the others."""
    side = 2048 if top.shape[0] != top.shape[1] else len(top)
    square = cv2.resize(top, (side, side), interpolation=cv2.INTER_LINEAR)
    cv2.imwrite(str(folder / f"{name}_top.png"), square[..., ::-1])
    plain = np.empty((side, side, 3), np.uint8)
    plain[:] = rng.integers(20, 200, 3)
    cv2.imwrite(str(folder / f"{name}_side.png"), plain)
    faces = " ".join(f'file{face}="{name}_side.png"' for face in ("right", "left", "up", "down", "back"))
    return (
        f'<texture name="{name}" type="cube" {faces} filefront="{name}_top.png"/>'
        f'<material name="{name}" texture="{name}" specular="{rng.uniform(0, 0.3)}" shininess="0.3"/>'
    )
