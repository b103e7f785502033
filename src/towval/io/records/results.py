"""``simulate.mcap``, ``uncertainty.mcap`` and ``compare.mcap`` and back."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from towval.io import ros
from towval.io.mcap_file import McapContent, Message, read_mcap, write_mcap
from towval.io.records.details import (
    choices_in,
    details_with,
    explanation_in,
    faults_in,
    findings_in,
    planar_poses,
    planar_twists,
    result_reader,
    row_of,
    rows_of,
    statement_in,
    statement_out,
    with_nan,
)
from towval.io.records.tracks import track_messages
from towval.model import Array, Comparison, Draws, RunUncertainty, SimulatedMotion, Track, Verdict
from towval.model.conventions import FLOOR_FRAME


def write_simulated(path: Path, simulated: SimulatedMotion, provenance: dict[str, str]) -> None:
    """Write ``simulate.mcap``: simulated poses and twists, tether force, tether length and tension."""
    messages = []
    for i, t in enumerate(simulated.time_s):
        ns, pose, force = ros.nanoseconds(t), simulated.pose[i], simulated.tether_force[i]
        state = ros.joint_state(t, ["tether"], [simulated.tether_length[i]], [], [np.hypot(*force)])
        messages += [
            Message("/object/pose_simulated", ns, ros.stamped_pose(t, pose)),
            Message("/object/twist_simulated", ns, ros.stamped_twist(t, simulated.twist[i])),
            Message("/tether/wrench", ns, ros.wrench(t, force)),
            Message("/tether/state", ns, state),
            Message("/tf", ns, ros.transforms(t, {"object_simulated": pose})),
        ]
    details = {
        "outcome": str(simulated.outcome),
        "advice": simulated.advice,
        "rung": str(simulated.rung),
        "findings": rows_of(simulated.findings),
        "statistics": dict(simulated.statistics),
        "choices": rows_of(simulated.choices),
    }
    write_mcap(path, messages, details, provenance)


@result_reader
def read_simulated(path: Path) -> SimulatedMotion:
    """Read ``simulate.mcap``.

    Raises `InputError` when the file is missing, damaged or no simulation.
    """
    content = read_mcap(path)
    details = details_with(content, path, "outcome", "rung")
    return SimulatedMotion(
        time_s=content.times_s("/object/pose_simulated"),
        pose=planar_poses([value.pose for value in content.values("/object/pose_simulated")]),
        twist=planar_twists(content.values("/object/twist_simulated")),
        tether_force=np.array([[v.wrench.force.x, v.wrench.force.y] for v in content.values("/tether/wrench")]),
        tether_length=np.array([value.position[0] for value in content.values("/tether/state")]),
        outcome=details["outcome"],
        advice=details["advice"],
        rung=details["rung"],
        findings=findings_in(details["findings"]),
        statistics=with_nan(details["statistics"]),
        choices=choices_in(details),
    )


_UNCERTAINTY_ARRAYS = ("measurement", "simulation", "validation")
_DRAWN = {"error": "/object/error_draw", "measurement": "/object/measurement_draw", "inputs": "/inputs/draw"}
"""Topics of what each draw led to, a message a draw."""

_KEPT_BITS = np.uint32(0xFFFFF000)
"""Of a draw's numbers: three to four digits, which halves what a file takes."""


def write_uncertainty(
    path: Path, uncertainty: RunUncertainty, simulated: SimulatedMotion, provenance: dict[str, str]
) -> None:
    """Write ``uncertainty.mcap``: the simulated pose with its covariances, and the draws."""
    messages = list(_draw_messages(uncertainty.draws, uncertainty.time_s[0]))
    for i, t in enumerate(uncertainty.time_s):
        for name in _UNCERTAINTY_ARRAYS:
            covariance = getattr(uncertainty, name)[i]
            value = ros.pose_with_covariance(t, simulated.pose[i], covariance)
            messages.append(Message(f"/object/{name}_uncertainty", ros.nanoseconds(t), value))
    skipped = ("time_s", "findings", "upstream", "draws", "faults", "explanation", *_UNCERTAINTY_ARRAYS)
    names = [field.name for field in dataclasses.fields(uncertainty) if field.name not in skipped]
    details = {name: getattr(uncertainty, name) for name in names}
    details["findings"], details["upstream"] = rows_of(uncertainty.findings), rows_of(uncertainty.upstream)
    details["faults"] = rows_of(uncertainty.faults)
    details["explanation"] = row_of(uncertainty.explanation)
    if uncertainty.draws is not None:
        details["draws"] = {"rows": uncertainty.draws.rows.tolist(), "names": dict(uncertainty.draws.names)}
    details["choices"] = rows_of(uncertainty.choices)
    write_mcap(path, messages, details, provenance)


def _draw_messages(draws: Draws | None, start_s: float) -> Iterator[Message]:
    if draws is None:
        return
    for name, topic in _DRAWN.items():
        values: Array = getattr(draws, name)
        for i, value in enumerate(values.reshape(len(values), -1, 3) if name != "inputs" else values[:, :, None]):
            cut = (value.astype(np.float32).view(np.uint32) & _KEPT_BITS).view(np.float32)
            yield Message(topic, ros.nanoseconds(start_s) + i, ros.number_array(cut))


def _draws(content: McapContent, details: dict[str, Any]) -> Draws | None:
    kept = details.pop("draws", None)
    if kept is None or not content.values(_DRAWN["error"]):
        return None
    arrays = {name: np.array([ros.numbers_of(v) for v in content.values(topic)]) for name, topic in _DRAWN.items()}
    return Draws(
        np.array(kept["rows"]), arrays["error"], arrays["measurement"], arrays["inputs"][..., 0], kept["names"]
    )


@result_reader
def read_uncertainty(path: Path, *, draws: bool = True) -> RunUncertainty:
    """Read ``uncertainty.mcap``, with its draws or without.

    Raises `InputError` when the file is missing, damaged or of another stage.
    """
    content = read_mcap(path, without=() if draws else tuple(_DRAWN.values()))
    details = dict(details_with(content, path, "upstream", "shares", "explanation"))
    details["findings"], details["choices"] = findings_in(details["findings"]), choices_in(details)
    details["upstream"], details["faults"] = findings_in(details["upstream"]), faults_in(details["faults"])
    details["draws"] = _draws(content, details)
    details["explanation"] = explanation_in(details["explanation"])
    topics = {name: f"/object/{name}_uncertainty" for name in _UNCERTAINTY_ARRAYS}
    arrays: dict[str, Any] = {
        name: np.array([ros.planar_covariance(value) for value in content.values(topic)])
        for name, topic in topics.items()
    }
    return RunUncertainty(time_s=content.times_s(topics["validation"]), **arrays, **details)


_COMPARISON_ARRAYS = ("time_s", "error", "along_across", "ratio")

_COMPARISON_SCALARS = tuple(
    f.name
    for f in dataclasses.fields(Comparison)
    if f.name not in (*_COMPARISON_ARRAYS, "findings", "drawn_tests", "bounds", "faults", "explanation")
)


def write_comparison(
    path: Path, comparison: Comparison, measured: Track, simulated: SimulatedMotion, provenance: dict[str, str]
) -> None:
    """Write ``compare.mcap``: ``/object/error``, and both paths again, so that one file serves other tools."""
    messages = error_messages(comparison)
    messages += track_messages("object", dataclasses.replace(measured, features=None))
    for t, pose in zip(simulated.time_s, simulated.pose, strict=True):
        value = ros.stamped_pose(t, pose)
        messages.append(Message("/object/pose_simulated", ros.nanoseconds(t), value))
    details = {name: getattr(comparison, name) for name in _COMPARISON_SCALARS}
    details |= statement_out(comparison)
    details["time_ns"] = [ros.nanoseconds(t) for t in comparison.time_s]
    details["findings"] = rows_of(comparison.findings)
    write_mcap(path, messages, details, provenance)


def error_messages(comparison: Comparison) -> list[Message]:
    """The errors of a run on ``/object/error``, ``/object/error_along_across`` and ``/object/error_ratio``."""
    messages = []
    rows = zip(*(getattr(comparison, name) for name in _COMPARISON_ARRAYS), strict=True)
    for t, error, shift, ratio in rows:
        ns = ros.nanoseconds(t)
        if np.isfinite(ratio):
            messages.append(Message("/object/error_ratio", ns, ros.number(ratio)))
        if np.isfinite(error).all():
            messages.append(Message("/object/error", ns, ros.stamped_vector(t, FLOOR_FRAME, error)))
            value = ros.stamped_vector(t, "object_path", np.append(shift, error[2]))
            messages.append(Message("/object/error_along_across", ns, value))
    return messages


@result_reader
def read_comparison(path: Path) -> Comparison:
    """Read ``compare.mcap``.

    Raises `InputError` when the file is missing, damaged or no comparison.
    """
    content = read_mcap(path)
    details = details_with(content, path, *_COMPARISON_SCALARS, "bounds", "explanation")
    time_ns = np.array(details["time_ns"], dtype=np.int64)
    index = {int(t): i for i, t in enumerate(time_ns)}
    error, shift = np.full((len(time_ns), 3), np.nan), np.full((len(time_ns), 2), np.nan)
    ratio = np.full(len(time_ns), np.nan)
    for message in content.topics.get("/object/error_ratio", []):
        ratio[index[message.time_ns]] = message.value.data
    for message in content.topics.get("/object/error", []):
        vector = message.value.vector
        error[index[message.time_ns]] = vector.x, vector.y, vector.z
    for message in content.topics.get("/object/error_along_across", []):
        shift[index[message.time_ns]] = message.value.vector.x, message.value.vector.y
    scalars: dict[str, Any] = {name: np.nan if details[name] is None else details[name] for name in _COMPARISON_SCALARS}
    scalars["verdict"] = Verdict(scalars["verdict"])
    findings = findings_in(details["findings"])
    arrays: dict[str, Any] = {"time_s": time_ns / 1e9, "error": error, "along_across": shift, "ratio": ratio}
    return Comparison(**arrays, findings=findings, **statement_in(details), **scalars)
