"""Faults of what a lab hands in beside the video: pictures of the board, what is stated of it, clicks."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from towval.model import Array

Rng = np.random.Generator
Document = dict[str, Any]


def _repictured(
    folder: Path, pattern: str, change: Callable[[Array], Array], quality: int = 95, every: int = 1
) -> None:
    """Every so many of the pictures of a pattern changed; they are copies of the campaign's."""
    for path in sorted((folder / "calibration").glob(pattern))[::every]:
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if picture is not None:
            coded = cv2.imencode(".jpg", change(np.asarray(picture)), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
            if path.suffix == ".jpg":
                path.write_bytes(coded.tobytes())
            else:
                cv2.imwrite(str(path), np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)))


def _zoomed(percent: float) -> Callable[[Array], Array]:
    def zoom(picture: Array) -> Array:
        height, width = picture.shape
        M = cv2.getRotationMatrix2D((0.51 * width, 0.48 * height), 0, 1 + percent / 100)
        return np.asarray(cv2.warpAffine(picture, M, (width, height), flags=cv2.INTER_LANCZOS4, borderMode=4))

    return zoom


def board_size(_folder: Path, document: Document, percent: float, _rng: Rng) -> None:
    """The board was printed smaller than it is stated to be."""
    document["camera"]["board"]["square_m"] /= 1 - percent / 100


def board_thickness(_folder: Path, document: Document, millimetres: float, _rng: Rng) -> None:
    """The board is thinner than stated."""
    document["floor"]["board_thickness_m"] += millimetres / 1e3


def stretched_print(folder: Path, document: Document, percent: float, _rng: Rng) -> None:
    """A printer's feed drew the board longer: in each picture it is stretched about its middle, where it lies."""
    columns, rows = (int(n) for n in document["camera"]["board"]["inner_corners"])
    squares = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
    middle = squares.mean(axis=0)
    longer = np.diag([1 + percent / 100, 1.0, 1.0])
    longer[0, 2] = -percent / 100 * middle[0]
    paper = np.array([[-2, -2], [columns + 1, -2], [columns + 1, rows + 1], [-2, rows + 1]], dtype=np.float64)

    def stretch(picture: Array) -> Array:
        found, corners = cv2.findChessboardCornersSB(picture, (columns, rows))
        if not found:
            return picture
        H = cv2.findHomography(squares, corners.reshape(-1, 2))[0]
        moved = cv2.warpPerspective(
            picture, H @ longer @ np.linalg.inv(H), picture.shape[::-1], flags=cv2.INTER_LANCZOS4
        )
        edge = cv2.perspectiveTransform((paper @ longer[:2, :2].T + longer[:2, 2])[None], H)
        on_paper = cv2.fillConvexPoly(np.zeros_like(picture), np.round(edge).astype(np.int32), 255) > 0
        return np.where(on_paper, moved, picture)

    _repictured(folder, "*", stretch)


def bumped_after_first(folder: Path, document: Document, px: float, rng: Rng) -> None:
    """The camera was bumped after the first picture of the floor, and looked elsewhere from then on."""
    heading = rng.uniform(0, 2 * np.pi)
    by = px * _scale(document) * np.array([np.cos(heading), np.sin(heading)])
    M = np.array([[1.0, 0.0, by[0]], [0.0, 1.0, by[1]]])
    _repictured(
        folder,
        Path(document["floor"]["image"]).name,
        lambda picture: np.asarray(
            cv2.warpAffine(picture, M, picture.shape[::-1], flags=cv2.INTER_LANCZOS4, borderMode=4)
        ),
    )
    for key in ("origin_corner_px", "x_axis_end_corner_px"):
        document["floor"][key] = (np.array(document["floor"][key]) + by).tolist()


def held_zoom(folder: Path, _document: Document, percent: float, _rng: Rng) -> None:
    """The held pictures were taken with another zoom."""
    _repictured(folder, "board_*", _zoomed(percent))


def some_held_zoom(folder: Path, _document: Document, percent: float, _rng: Rng) -> None:
    """Every second of the held pictures was taken with another zoom."""
    _repictured(folder, "board_*", _zoomed(percent), every=2)


def held_crop(folder: Path, _document: Document, percent: float, _rng: Rng) -> None:
    """The held pictures are another part of the sensor, cut off on two sides and enlarged to the same size."""

    def cropped(picture: Array) -> Array:
        height, width = picture.shape
        kept = picture[round(height * percent / 100) :, : round(width * (1 - percent / 100))]
        return np.asarray(cv2.resize(kept, (width, height), interpolation=cv2.INTER_CUBIC))

    _repictured(folder, "board_*", cropped)


def held_skew(folder: Path, _document: Document, px: float, rng: Rng) -> None:
    """The board moved while a rolling shutter read it: over the picture's height it went so far to one side."""

    def skewed(picture: Array) -> Array:
        height, width = picture.shape
        by = rng.choice([-1, 1]) * px * width / 1920 / height
        M = np.array([[1.0, by, -by * height / 2], [0.0, 1.0, 0.0]])
        return np.asarray(cv2.warpAffine(picture, M, (width, height), flags=cv2.INTER_LANCZOS4, borderMode=4))

    _repictured(folder, "board_*", skewed)


def set_zoom(folder: Path, document: Document, percent: float, _rng: Rng) -> None:
    """All pictures of the board were taken with another zoom than the video."""
    _repictured(folder, "*", _zoomed(percent))
    width, height = document["camera"]["resolution_px"]
    centre = np.array([0.51 * width, 0.48 * height])
    for key in ("origin_corner_px", "x_axis_end_corner_px"):
        at = centre + (1 + percent / 100) * (np.array(document["floor"][key]) - centre)
        document["floor"][key] = at.tolist()


def some_held_flipped(folder: Path, _document: Document, kind: float, _rng: Rng) -> None:
    """Every second of the held pictures was saved sideways mirrored (1), upside down mirrored (2), or turned (3)."""
    flip = {1: 1, 2: 0, 3: -1}[int(kind)]
    _repictured(folder, "board_*", lambda picture: np.asarray(cv2.flip(picture, flip)), every=2)


def held_mirrored(folder: Path, _document: Document, kind: float, _rng: Rng) -> None:
    """The held pictures were saved sideways mirrored (1), upside down mirrored (2), or turned (3)."""
    flip = {1: 1, 2: 0, 3: -1}[int(kind)]
    _repictured(folder, "board_*", lambda picture: np.asarray(cv2.flip(picture, flip)))


def blurred_boards(folder: Path, _document: Document, px: float, rng: Rng) -> None:
    """The board moved while it was photographed, each time in another direction."""

    def smear(picture: Array) -> Array:
        length = max(2, round(px * picture.shape[1] / 1920))
        kernel = np.zeros((2 * length + 1,) * 2, dtype=np.float32)
        way = rng.uniform(0, np.pi)
        for s in np.linspace(-length / 2, length / 2, 20 * length):
            kernel[round(length + s * np.sin(way)), round(length + s * np.cos(way))] += 1
        return np.asarray(cv2.filter2D(picture, -1, kernel / kernel.sum()))

    _repictured(folder, "board_*", smear)


def compressed_boards(folder: Path, _document: Document, quality: float, _rng: Rng) -> None:
    """The pictures of the board were compressed again."""
    _repictured(folder, "*", lambda picture: picture, int(quality))


def fewer_boards(folder: Path, _document: Document, left: float, _rng: Rng) -> None:
    """Only some of the held pictures were handed in."""
    for path in sorted((folder / "calibration").glob("board_*"))[int(left) :]:
        path.unlink()


def corner_count(_folder: Path, document: Document, kind: float, _rng: Rng) -> None:
    """The board's corners were miscounted: a column too few (1), a row too few (2), squares for corners (3)."""
    columns, rows = document["camera"]["board"]["inner_corners"]
    miscounted = {1: [columns - 1, rows], 2: [columns, rows - 1], 3: [columns + 1, rows + 1]}
    document["camera"]["board"]["inner_corners"] = miscounted[int(kind)]


def top_size(_folder: Path, document: Document, percent: float, _rng: Rng) -> None:
    """Both tops are smaller than stated."""
    for body in ("rover", "object"):
        corners = np.array(document[body]["top_corners_m"]) / (1 - percent / 100)
        document[body]["top_corners_m"] = corners.tolist()


def _clicks(document: Document) -> dict[str, list[list[float]]]:
    clicks: dict[str, list[list[float]]] = next(iter(document["runs"].values()))["first_frame_clicks_px"]
    return clicks


def _scale(document: Document) -> float:
    return float(document["camera"]["resolution_px"][0] / 1920)


def shifted_clicks(_folder: Path, document: Document, px: float, rng: Rng) -> None:
    """All corners of both bodies were clicked off by the same way."""
    clicks, heading = _clicks(document), rng.uniform(0, 2 * np.pi)
    by = px * _scale(document) * np.array([np.cos(heading), np.sin(heading)])
    for body, corners in clicks.items():
        clicks[body] = (np.array(corners) + by).tolist()


def corner_clicked_wrong(_folder: Path, document: Document, px: float, rng: Rng) -> None:
    """One corner of the object was clicked off."""
    corners, heading = _clicks(document)["object"], rng.uniform(0, 2 * np.pi)
    by = px * _scale(document) * np.array([np.cos(heading), np.sin(heading)])
    wrong = int(rng.integers(4))
    corners[wrong] = (np.array(corners[wrong]) + by).tolist()


def turned_clicks(_folder: Path, document: Document, kind: float, _rng: Rng) -> None:
    """Corners were clicked half a turn round: of the rover (1), of the object (2), of both (3)."""
    clicks = _clicks(document)
    for body, own in (("rover", 1), ("object", 2)):
        if int(kind) in (own, 3):
            clicks[body] = [*clicks[body][2:], *clicks[body][:2]]


def rate_not_stated(_folder: Path, document: Document, _strength: float, _rng: Rng) -> None:
    """Nobody says how many pictures a second the camera takes."""
    del document["camera"]["fps"]
