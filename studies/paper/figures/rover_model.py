"""Fig. 3: the rover's kinematics, where its instantaneous centre may be, and how a step is planned."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon

from studies.frame import Drawing
from studies.paper.figures.drawing import (
    CASE_COLOURS,
    OBJECT_PATH,
    REGION,
    REGION_EDGE,
    ROVER_PATH,
    SPECIFICATION,
    TETHER,
    arrow,
    bare_axes,
    draw_outline,
    draw_rover,
    draw_wheel,
    letter,
)
from studies.paper.scene import paper_scene
from studies.rover_geometry import centre_between, feasible_pieces, moved_by, twist_about
from towval.model import Array
from towval.model.geometry import transform
from towval.planning.feasible_region import feasible_piece, flanks, nearest_centre
from towval.planning.kinematics import Rover, steering_of_twist
from towval.report.style import PAGE_WIDTH_IN, figure_function

FACING_UP = np.array([0.0, 0.0, np.pi / 2])
"""The rover stands upright in the drawings, so that its flanks are left and right."""


@figure_function
def rover_figure(rover: Rover, outline: Array, anchor: Array, rest_length: float) -> Figure:
    """Fig. 3 in the paper's arrangement.

    Parameters
    ----------
    rover : Rover
        The rover.
    outline : ndarray (n, 2)
        Footprint of the towed object in its frame [m].
    anchor : ndarray (2,)
        Where the tether holds the object [m].
    rest_length : float
        Length of the tether [m].
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 5.2), layout="constrained")
    panels = figure.subplots(2, 2, width_ratios=[1.35, 1], height_ratios=[1, 1.15])
    _geometry(panels[0, 0], rover)
    _towing(panels[0, 1], rover, outline, anchor, rest_length)
    _step(panels[1, 0], rover)
    _cases(panels[1, 1], rover)
    return figure


def _draw_region(axes: Axes, rover: Rover, pose: Array, extent: float, *, flanks_only: bool = False) -> None:
    """The feasible region: the flanks in cyan, the pieces that the planner leaves out dotted."""
    for piece in feasible_pieces(rover, extent):
        flank = len(set(piece.sides)) == 1
        if flanks_only and not flank:
            continue
        style = {"facecolor": REGION if flank else "none", "edgecolor": REGION_EDGE, "zorder": 0, "linewidth": 0.5}
        style |= {} if flank else {"hatch": "......", "linewidth": 0.3}
        axes.add_patch(Polygon(transform(pose, piece.polygon(extent)), closed=True, **style))


def _label(axes: Axes, place: Array, text: str, shift: tuple[float, float] = (4, 4), **style: Any) -> None:
    backing = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
    axes.annotate(
        text,
        (place[0], place[1]),
        xytext=shift,
        textcoords="offset points",
        fontsize=8,
        bbox=backing,
        zorder=6,
        **style,
    )


def _dot(axes: Axes, place: Array, colour: str = "#222222", size: float = 3.0) -> None:
    axes.plot(*place, "o", color=colour, markersize=size, markeredgewidth=0, zorder=5)


def _geometry(axes: Axes, rover: Rover) -> None:
    """(a) Four wheels, the equivalent bicycle and their common centre."""
    bare_axes(axes)
    letter(axes, "a")
    reach = 2.1 * flanks(rover).tightest_radius
    _draw_region(axes, rover, FACING_UP, reach)
    centre = np.array([0.12, -1.45 * flanks(rover).tightest_radius])
    twist = twist_about(centre)
    draw_rover(axes, rover, FACING_UP, steering_of_twist(rover.wheel_positions, twist))
    on_floor = transform(FACING_UP, centre)
    for position in rover.wheel_positions:
        axes.plot(*np.transpose([transform(FACING_UP, position), on_floor]), color="#777777", lw=0.5, ls=(0, (4, 3)))
    for position, angle, name in zip(rover.axles, steering_of_twist(rover.axles, twist), "12", strict=True):
        draw_wheel(axes, rover.wheel_radius, position, angle, FACING_UP, facecolor="none", edgecolor="#c8322b", lw=0.9)
        axes.plot(*np.transpose([transform(FACING_UP, position), on_floor]), color="#c8322b", lw=0.7)
        above = (-44, 16) if name == "1" else (-44, -24)
        _label(axes, transform(FACING_UP, position), rf"$\lambda_{name},\alpha_{name},\beta_{name}$", above)
    _dot(axes, on_floor)
    _label(axes, on_floor, r"$\Omega_r$", (5, -3))
    for side in (-1, 1):
        _label(axes, np.array([side * 0.85 * reach, 0.0]), r"$S_{\Omega_r}$", (-6, -10))
    _frame(axes, FACING_UP, 0.42 * reach / 2.1)
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-0.5 * reach, 0.5 * reach)


def _frame(axes: Axes, pose: Array, size: float) -> None:
    """Axes i and j of the rover's frame."""
    for direction, name, shift in (
        ([size, 0.0], r"$\hat{\imath}_r$", (3, -2)),
        ([0.0, size], r"$\hat{\jmath}_r$", (-4, 4)),
    ):
        arrow(axes, pose[:2], transform(pose, np.array(direction)), "#111111")
        _label(axes, transform(pose, np.array(direction)), name, shift)


def _towing(axes: Axes, rover: Rover, outline: Array, anchor: Array, rest_length: float) -> None:
    """(b) Object, tether and rover with the paths of both, and the range of one wheel."""
    bare_axes(axes)
    letter(axes, "b")
    pose = np.array([0.0, 0.0, np.radians(62)])
    _draw_region(axes, rover, pose, 1.75 * flanks(rover).tightest_radius, flanks_only=True)
    twist = twist_about(np.array([0.0, -2.6 * flanks(rover).tightest_radius]))
    draw_rover(axes, rover, pose, steering_of_twist(rover.wheel_positions, twist))
    hinge = transform(pose, rover.hinge)
    direction = np.array([np.cos(pose[2] - 0.1), np.sin(pose[2] - 0.1)])
    knot = hinge - rest_length * direction
    body = np.array([0.0, 0.0, pose[2] + 0.25])
    body[:2] = knot - transform(body, anchor)
    draw_outline(axes, outline, body, facecolor="#efe6d8", edgecolor="#7a5c2e", linewidth=0.8)
    axes.plot(*np.transpose([knot, hinge]), color=TETHER, lw=1.1)
    for place, name, shift in ((hinge, r"$P_r$", (6, -5)), (knot, r"$Q_T$", (6, -4))):
        _dot(axes, place)
        _label(axes, place, name, shift)
    _path(axes, pose, twist, hinge, SPECIFICATION, r"$s_r(t)$", 0.75, (4, 0))
    _path(axes, np.array([*body[:2], pose[2] + 0.15]), twist, body[:2], OBJECT_PATH, r"$s_o(t)$", 0.3, (-28, 2))
    _steering_range(axes, rover, pose)
    axes.autoscale_view()


def _path(
    axes: Axes,
    pose: Array,
    twist: Array,
    start: Array,
    colour: str,
    name: str,
    ahead: float,
    shift: tuple[float, float],
) -> None:
    """A dashed path through a point carried by a body with a constant twist, up to a time ahead [s]."""
    times = np.linspace(-0.55, ahead, 40)
    poses = np.array([moved_by([*start, pose[2]], twist, t) for t in times])
    axes.plot(poses[:, 0], poses[:, 1], color=colour, lw=1.0, ls=(0, (5, 2)), zorder=1)
    arrow(axes, poses[-2, :2], poses[-1, :2], colour)
    _label(axes, poses[-1, :2], name, shift, color=colour)


def _steering_range(axes: Axes, rover: Rover, pose: Array) -> None:
    """The range of the front left wheel, as an arc with its limits."""
    place = transform(pose, rover.wheel_positions[0])
    least, greatest = np.degrees(rover.steering_ranges[0] + pose[2])
    radius = 2.6 * rover.wheel_radius
    axes.add_patch(
        Arc((place[0], place[1]), 2 * radius, 2 * radius, theta1=least, theta2=greatest, color="#333333", lw=0.7)
    )
    for limit in (least, greatest):
        end = place + radius * np.array([np.cos(np.radians(limit)), np.sin(np.radians(limit))])
        axes.plot(*np.transpose([place, end]), color="#333333", lw=0.5)
        offset = round(abs(limit - np.degrees(pose[2])), 1)
        sign = "−" if limit > np.degrees(pose[2]) else "+"
        _label(axes, end, f"{sign}{offset:g}°", (-26, 2) if sign == "−" else (6, 9))


def _step(axes: Axes, rover: Rover) -> None:
    """(c) The turn about Ω that brings the rover to the next point of its path with the planned heading."""
    bare_axes(axes)
    letter(axes, "c")
    start, end = np.array([0.0, 0.0, 0.25]), np.array([1.75, 1.15, 0.95])
    centre, turn = centre_between(start, end)
    for pose, shade in ((start, 1.0), (end, 0.45)):
        draw_rover(axes, rover, pose, np.zeros(4), alpha=shade)
    radius = np.linalg.norm(start[:2] - centre)
    angle = np.arctan2(*(start[:2] - centre)[::-1]) + np.linspace(0, turn, 60)
    axes.plot(*(centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)).T, color=ROVER_PATH, lw=1.3)
    share = np.linspace(-0.25, 1.3, 120)[:, None]
    nominal = start[:2] + share * (end - start)[:2] + 0.07 * np.sin(2 * np.pi * share) * np.array([-0.5, 0.85])
    axes.plot(*nominal.T, color=SPECIFICATION, lw=0.9, ls=(0, (5, 2)))
    _label(axes, nominal[-1], r"$s_r$", (4, 0), color=SPECIFICATION)
    for pose, name, shift in ((start, r"$P_0,\vartheta_0$", (16, -16)), (end, r"$P_1,\vartheta_1$", (20, -10))):
        _dot(axes, pose[:2])
        _label(axes, pose[:2], name, shift)
        arrow(axes, pose[:2], transform(pose, np.array([0.62, 0.0])), "#111111")
        axes.plot(*np.transpose([pose[:2], centre]), color="#777777", lw=0.5, ls=(0, (4, 3)))
    _dot(axes, centre)
    _label(axes, centre, r"$\Omega_r$", (5, 0))
    size = 0.9
    first = np.degrees(np.arctan2(*(start[:2] - centre)[::-1]))
    axes.add_patch(
        Arc((centre[0], centre[1]), size, size, theta1=first, theta2=first + np.degrees(turn), color="#333333", lw=0.7)
    )
    middle = np.radians(first) + turn / 2
    _label(axes, centre + 0.5 * size * np.array([np.cos(middle), np.sin(middle)]), r"$\varphi$", (-2, -10))
    axes.autoscale_view()


def _cases(axes: Axes, rover: Rover) -> None:
    """(d) Centres inside, close to and far from the feasible region, and the centres used instead."""
    bare_axes(axes)
    letter(axes, "d")
    region, radius = flanks(rover), flanks(rover).tightest_radius
    reach = 2.5 * radius
    polygon = feasible_piece(rover, (-1,) * 4).polygon(reach)
    axes.add_patch(Polygon(transform(FACING_UP, polygon), closed=True, facecolor=REGION, edgecolor=REGION_EDGE, lw=0.6))
    wanted = {
        "A": [-0.15 * radius, -1.6 * radius],
        "B": [0.75 * radius, -1.5 * radius],
        "C": [-1.2 * radius, -0.75 * radius],
    }
    for case, place in wanted.items():
        near = np.array(nearest_centre(region.normals[1], region.offsets[1], region.corners[1], *place)[:2])
        taken = region.tips[1] if case == "C" else near
        from_here, to_there = transform(FACING_UP, np.array(place)), transform(FACING_UP, taken)
        _dot(axes, from_here, CASE_COLOURS[case], 4.0)
        _label(
            axes, from_here, rf"$\Omega_r$, case {case}", (7, 3) if case == "B" else (6, -3), color=CASE_COLOURS[case]
        )
        if case != "A":
            arrow(axes, from_here, to_there, CASE_COLOURS[case], shrinkA=2)
            _dot(axes, to_there, CASE_COLOURS[case], 4.0)
            _label(axes, to_there, r"$\Omega_r^*$", (6, -8) if case == "B" else (-12, 6), color=CASE_COLOURS[case])
    draw_rover(axes, rover, FACING_UP, np.zeros(4))
    axes.set_xlim(-0.75 * radius, 2.55 * radius)
    axes.set_ylim(-1.55 * radius, 1.35 * radius)


def _figure_3(plan: Mapping[str, Any], _: Mapping[str, pd.DataFrame]) -> Figure:
    scene = paper_scene(plan)
    return rover_figure(scene.rover, scene.towed.patch.outline, scene.towed.anchor, scene.tether.rest_length)


FIGURE_3 = Drawing((), _figure_3)
