"""What fits no ROS message, as plain JSON values and back: the attachment ``details.json`` of a file."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from towval.io import ros
from towval.io.mcap_file import McapContent
from towval.model import Array, Bounds, Camera, Choice, Comparison, Explanation, Finding, Floor, Severity, VisibleFault
from towval.model.errors import InputError

Reader = TypeVar("Reader", bound=Callable[..., Any])


def result_reader(read: Reader) -> Reader:
    """Decorator of a reader of a file: content that is whole but not what its kind of file holds is an `InputError`."""

    @functools.wraps(read)
    def reading(path: Path, *args: Any, **options: Any) -> Any:
        try:
            return read(path, *args, **options)
        except (ArithmeticError, AttributeError, LookupError, StopIteration, TypeError, ValueError) as error:
            raise InputError(
                f"{path} contradicts itself",
                got=f"{type(error).__name__}: {error}"[:300],
                allowed="a file that this version of towval made",
                remedy="run the stage that makes it again",
            ) from None

    return cast(Reader, reading)


def arrays(row: dict[str, Any]) -> dict[str, Any]:
    """Undo :func:`row_of` for arrays (n, 2): lists become arrays and null becomes NaN."""
    return {
        key: np.array(item, dtype=np.float64).reshape(len(item), 2)
        if isinstance(item, list)
        else np.nan
        if item is None
        else item
        for key, item in row.items()
    }


def view_out(camera: Camera, floor: Floor) -> dict[str, Any]:
    """A camera over a floor as plain values."""
    return {
        "camera": {
            "resolution_px": list(camera.resolution_px),
            "matrix": camera.matrix.tolist(),
            "distortion": camera.distortion.tolist(),
            "lens_model": camera.lens_model,
        },
        "T_camera_floor": floor.T_camera_floor.tolist(),
    }


def view_in(details: dict[str, Any]) -> tuple[Camera, Floor]:
    """Camera and floor of plain values."""
    camera = details["camera"]
    return Camera(**camera | {"resolution_px": tuple(camera["resolution_px"])}), Floor(details["T_camera_floor"])


def row_of(value: Any) -> dict[str, Any] | None:
    """A dataclass by the names of its fields; None for None."""
    return None if value is None else dataclasses.asdict(value)


def rows_of(values: Sequence[Any]) -> list[dict[str, Any]]:
    """Findings, choices, visible faults or views as rows."""
    return list(map(dataclasses.asdict, values))


def findings_in(found: list[dict[str, str]]) -> tuple[Finding, ...]:
    """Findings of rows."""
    return tuple(Finding(Severity(each["severity"]), each["code"], each["text"]) for each in found)


def faults_in(found: list[dict[str, Any]]) -> tuple[VisibleFault, ...]:
    """Visible faults of rows."""
    return tuple(VisibleFault(**with_nan(each)) for each in found)


def statement_out(comparison: Comparison) -> dict[str, Any]:
    """Bounds, visible faults and explanation of a comparison."""
    return {
        "drawn_tests": comparison.drawn_tests.tolist(),
        "bounds": dataclasses.asdict(comparison.bounds),
        "faults": rows_of(comparison.faults),
        "explanation": row_of(comparison.explanation),
    }


def statement_in(details: dict[str, Any]) -> dict[str, Any]:
    """The same from a file's details, as arguments of a comparison."""
    sizes = {part: {n: (v[0], v[1]) for n, v in of.items()} for part, of in details["bounds"].items()}
    return {
        "drawn_tests": np.reshape(details["drawn_tests"], (-1, 2)),
        "bounds": Bounds(**sizes),
        "faults": faults_in(details["faults"]),
        "explanation": explanation_in(details["explanation"]),
    }


def explanation_in(found: dict[str, Any] | None) -> Explanation | None:
    """An explanation of its row."""
    return None if found is None else Explanation(**with_nan(found) | {"assumed": tuple(found["assumed"])})


def with_nan(found: dict[str, Any]) -> dict[str, Any]:
    """Values by name, NaN where a file holds null."""
    return {name: np.nan if value is None else value for name, value in found.items()}


def choices_in(details: dict[str, Any]) -> tuple[Choice, ...]:
    """Choices of a file's details."""
    return tuple(Choice(**with_nan(each)) for each in details["choices"])


def details_with(content: McapContent, path: Path, *names: str) -> dict[str, Any]:
    """Details of a file that must hold some names.

    Raises `InputError` when one is missing: the file is of another stage.
    """
    missing = [name for name in names if name not in content.details]
    if missing:
        raise InputError(
            f"{path} was made by another stage, or by another version of towval",
            got=f"no {', '.join(missing)} in its details",
            remedy="make it again, or give the file that the documentation of this stage names",
        )
    return content.details


def planar_poses(values: list[Any]) -> Array:
    """Poses (n, 3) [m, m, rad] of ROS poses, headings unwrapped."""
    pose = np.array([[v.position.x, v.position.y, ros.heading_of(v.orientation)] for v in values]).reshape(-1, 3)
    pose[:, 2] = np.unwrap(pose[:, 2])
    return pose


def planar_twists(values: list[Any]) -> Array:
    """Rates (n, 3) [m/s, m/s, rad/s] of ROS twists."""
    rows = [[v.twist.linear.x, v.twist.linear.y, v.twist.angular.z] for v in values]
    return np.array(rows).reshape(-1, 3)
