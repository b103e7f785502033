"""The stage ``calibrate``: pictures of a board, held up and lying on the floor, to a camera over a floor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.errors import InputError, RefusedError
from towval.types import Board, Calibration, Camera, Finding, Floor, FloorReference, Severity, View
from towval.vision.bundle import Estimate, adjust, marginal_covariance, residuals
from towval.vision.corners import Sighting, sight_chessboard
from towval.vision.floor import in_floor_axes
from towval.vision.lens import LENS_MODELS, LensTrial, active_parameters, choose_lens, try_lenses
from towval.vision.scene import Scene, first_guess, unflipped

NamedImage = tuple[str, NDArray[np.uint8]]

_FIRST_MODELS = ("none", "k1", "k1 k2")
"""Lens models fitted in turn before any view is judged: from rough to good enough to tell a bad view."""


@dataclass(frozen=True)
class CalibrateSettings:
    """What the stage can be told; the keys of ``config["calibrate"]``.

    ``lens_models`` to choose from, names of :data:`towval.vision.lens.LENS_MODELS`, smallest first; ``folds`` the
    views are divided into to be held out; ``misfit_ratio`` beyond which times the corner noise a view is dropped;
    ``threads`` that look for boards.
    """

    lens_models: tuple[str, ...] = tuple(LENS_MODELS)
    folds: int = 6
    misfit_ratio: float = 4.0
    threads: int = 2

    def __post_init__(self) -> None:
        unknown = [name for name in self.lens_models if name not in LENS_MODELS]
        if unknown or not self.lens_models:
            raise InputError("calibrate.lens_models", got=list(self.lens_models), allowed=", ".join(LENS_MODELS))


def calibrate(
    images: Iterable[NamedImage],
    floor_images: Sequence[NamedImage],
    board: Board,
    floor: FloorReference,
    settings: CalibrateSettings,
    *,
    heights_m: Sequence[float] = (),
) -> Calibration:
    """Calibrate a camera and the floor under it.

    Parameters
    ----------
    images : iterable of (str, ndarray of uint8)
        Name and grey picture of the board held in many poses.
    floor_images : sequence of (str, ndarray of uint8)
        The board lying on the floor; the first of them fixes the floor frame unless ``floor`` has marks.
    board : Board
        The board.
    floor : FloorReference
        What fixes the floor frame.
    settings : CalibrateSettings
        How to go about it.
    heights_m : sequence of float, optional
        Heights of the bodies' tops, on which the quality is given [m].

    Returns
    -------
    Calibration
        Camera, floor, covariance, every view with its residuals or the reason why it was dropped, and findings.

    Raises
    ------
    InputError
        When no picture shows the board, the floor board is missing or its corners are not where the floor says.
    RefusedError
        When too few views are left to calibrate from.
    """
    named = [*images]
    sightings, unseen = look_for_boards([*named, *floor_images], board, settings.threads)
    floor_names = {name for name, _ in floor_images}
    resolution = _common_resolution([*named, *floor_images])
    flat = [s for s in sightings if s.name in floor_names]
    flat = _with_origin(flat, floor_images, floor)
    scene = Scene(resolution, tuple(s for s in sightings if s.name not in floor_names), tuple(flat), floor)
    return calibrate_scene(scene, settings, unseen, heights_m)


def _common_resolution(images: Sequence[NamedImage]) -> tuple[int, int]:
    sizes = {image.shape for _, image in images}
    if len(sizes) != 1:
        raise InputError("the calibration images differ in size", got=sorted(sizes), allowed="one size for all")
    height, width = sizes.pop()
    return width, height


def _with_origin(flat: list[Sighting], images: Sequence[NamedImage], floor: FloorReference) -> list[Sighting]:
    if len(floor.marks_px):
        return flat
    if not images or not flat or flat[0].name != images[0][0]:
        raise InputError(
            "the board is not seen in the first floor image",
            got=images[0][0] if images else "no floor image",
            allowed="the whole board, flat on the floor",
            remedy="check floor.image, or give surveyed marks on the floor instead",
        )
    return [in_floor_axes(flat[0], floor), *flat[1:]]


def look_for_boards(
    images: Sequence[NamedImage], board: Board, threads: int = 2
) -> tuple[list[Sighting], dict[str, str]]:
    """Look for the board in every picture: quickly first, thoroughly where that finds nothing.

    Returns
    -------
    sightings : list of Sighting
        The boards found, in the order of the pictures.
    unseen : dict
        Name of each other picture and the reason.
    """

    def look(image: NamedImage) -> Sighting | None:
        quick = sight_chessboard(*image, board, thorough=False)
        return quick or sight_chessboard(*image, board, thorough=True)

    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(look, images))
    if not any(found):
        columns, rows = board.inner_corners
        raise InputError(
            f"no picture shows a board of {columns} × {rows} inner corners",
            got=f"{len(images)} pictures",
            remedy="count the corners where four squares meet, not the squares, along both sides of the board",
        )
    unseen = {name: "no whole board found" for (name, _), s in zip(images, found, strict=True) if s is None}
    return [s for s in found if s is not None], unseen


def calibrate_scene(
    scene: Scene, settings: CalibrateSettings, unseen: dict[str, str], heights_m: Sequence[float] = ()
) -> Calibration:
    """Calibrate from corners that are already found; see :func:`calibrate`."""
    everything = scene
    scene, start, dropped = _without_misfits(scene, settings)
    trials = try_lenses(scene.blocks, start, settings.lens_models, settings.folds)
    chosen = choose_lens(trials)
    active = active_parameters(chosen.model, with_floor=scene.reference is not None)
    covariance, condition = marginal_covariance(scene.blocks, chosen.estimate, active)
    estimate = chosen.estimate
    return Calibration(
        camera=Camera(scene.resolution_px, estimate.matrix, estimate.distortion, chosen.model),
        floor=Floor(estimate.T_camera_floor),
        covariance=covariance,
        corner_noise_px=estimate.noise_px,
        views=_views(everything, scene, estimate, dropped, unseen),
        findings=_dropped_findings(dropped),
        quality=_quality(scene, trials, chosen, condition),
    )


def _without_misfits(scene: Scene, settings: CalibrateSettings) -> tuple[Scene, Estimate, dict[str, str]]:
    """Drop the views that do not fit a first calibration, worst first, until all others do."""
    dropped: dict[str, str] = {}
    while True:
        if len(scene.sightings) < 3:
            raise RefusedError(
                "too few views of the board",
                got=f"{len(scene.sightings)} usable",
                allowed="three at the very least, twelve to do well",
                remedy="film the board tilted by 20° to 40° to all sides, all over the picture",
            )
        estimate = first_guess(scene)
        for model in _FIRST_MODELS:
            active = active_parameters(model, with_floor=scene.reference is not None)
            estimate = unflipped(scene, adjust(scene.blocks, estimate, active))
        worst, rms = max(_view_rms(scene, estimate).items(), key=lambda item: item[1])
        if rms <= settings.misfit_ratio * estimate.noise_px or len(scene.sightings) == 3:
            return scene, estimate, dropped
        dropped[worst] = f"does not fit: {rms:.2f} px RMS where the corner noise is {estimate.noise_px:.2f} px"
        scene = scene.without({worst})


def _view_rms(scene: Scene, estimate: Estimate) -> dict[str, float]:
    found = residuals(scene.blocks, estimate)[: len(scene.sightings)]
    return {s.name: float(np.sqrt(np.mean(r**2))) for s, r in zip(scene.sightings, found, strict=True)}


def _views(
    everything: Scene, scene: Scene, estimate: Estimate, dropped: dict[str, str], unseen: dict[str, str]
) -> tuple[View, ...]:
    fitted = dict(zip((s.name for s in scene.sightings), residuals(scene.blocks, estimate), strict=False))
    tilts = dict(zip((s.name for s in scene.sightings), tilts_deg(scene, estimate), strict=True))
    on_floor = {s.name for s in everything.floor_boards}
    seen = [
        View(
            name=s.name,
            corners_px=s.corners_px,
            board_m=s.board_m,
            residuals_px=fitted.get(s.name, np.full_like(s.corners_px, np.nan)),
            tilt_deg=tilts.get(s.name, np.nan),
            on_floor=s.name in on_floor,
            dropped=dropped.get(s.name, ""),
        )
        for s in everything.sightings
    ]
    empty = np.zeros((0, 2))
    return (*seen, *(View(name, empty, empty, empty, np.nan, dropped=reason) for name, reason in unseen.items()))


def tilts_deg(scene: Scene, estimate: Estimate) -> list[float]:
    """Angle between each board and the image plane [°]."""
    floor_normal = estimate.T_camera_floor[:3, 2]
    normals = [cv2.Rodrigues(place[:3])[0][:, 2] for place in estimate.places[: len(scene.boards)]]
    normals += [floor_normal] * len(scene.floor_boards)
    return [float(np.degrees(np.arccos(min(1.0, abs(normal[2]))))) for normal in normals]


def _dropped_findings(dropped: dict[str, str]) -> tuple[Finding, ...]:
    return tuple(
        Finding(Severity.WARNING, "view-dropped", f"{name} was dropped: {reason}.") for name, reason in dropped.items()
    )


def _quality(scene: Scene, trials: Sequence[LensTrial], chosen: LensTrial, condition: float) -> dict[str, float]:
    quality = {"views_used": float(len(scene.sightings)), "condition_number": condition}
    for trial in trials:
        quality[f"held_out_rms_px {trial.model}"] = float(np.sqrt(trial.score_px2))
    return quality
