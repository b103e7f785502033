"""What several of the paper's figures share: colours, panel letters, rovers, objects, plain maps."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from towval.model import Array
from towval.model.geometry import transform
from towval.planning.kinematics import Rover

OBJECT_PATH = "#000000"
ROVER_PATH = "#1f63b4"
SPECIFICATION = "#c8322b"
REGION = "#aee3ea"
REGION_EDGE = "#3a9fae"
BODY = "#d9d9d9"
TETHER = "#7a5c2e"

CASE_COLOURS = {"A": "#2b8a3e", "B": "#e08a00", "C": "#7b3fb5"}
"""Cases of the planner, Fig. 5."""

CENTRE_COLOURS = {"G1": "#1f63b4", "G2": "#d9480f", "G3": "#2b8a3e"}
"""Places of the centre of mass, Fig. 4."""

CURVE_TITLES = {"line": "line", "circle": "circle", "lemniscate": "lemniscate", "rounded_square": "rounded square"}

WHEEL_WIDTH = 0.45
"""Width of a drawn wheel in units of its diameter."""


def letter(axes: Axes, name: str, title: str = "") -> None:
    """Put a panel's letter, and maybe a title, above its upper left corner."""
    axes.set_title(f"({name})" + (f"  {title}" if title else ""), loc="left")


def map_axes(axes: Axes, *, labels: bool = True) -> None:
    """Equal scales in metres."""
    axes.set_aspect("equal", adjustable="datalim")
    if labels:
        axes.set_xlabel(r"$x$ [m]")
        axes.set_ylabel(r"$y$ [m]")


def bare_axes(axes: Axes) -> None:
    """Equal scales without a frame, for drawings."""
    axes.set_aspect("equal")
    axes.set_axis_off()


def draw_outline(axes: Axes, outline: Array, pose: Array, **style: object) -> None:
    """An outline (n, 2) of a body at a pose (3,)."""
    settings = {"facecolor": "none", "edgecolor": "#555555", "linewidth": 0.5} | style
    axes.add_patch(Polygon(transform(pose, outline), closed=True, **settings))


def draw_rover(axes: Axes, rover: Rover, pose: Array, steering: Array, **style: object) -> None:
    """A rover with its four steered wheels at a pose (3,), steering angles (4,) [rad]."""
    settings = {"facecolor": BODY, "edgecolor": "#444444", "linewidth": 0.6} | style
    draw_outline(axes, 0.82 * rover.wheel_positions, pose, **settings)
    for position, angle in zip(rover.wheel_positions, steering, strict=True):
        draw_wheel(axes, rover.wheel_radius, position, angle, pose)


def draw_wheel(axes: Axes, radius: float, position: Array, steering: float, pose: Array, **style: object) -> None:
    """A wheel from above, at a position (2,) of a body with a pose (3,)."""
    box = radius * np.array([[1, WHEEL_WIDTH], [-1, WHEEL_WIDTH], [-1, -WHEEL_WIDTH], [1, -WHEEL_WIDTH]])
    settings = {"facecolor": "#4d4d4d", "edgecolor": "#222222", "linewidth": 0.4, "zorder": 3} | style
    axes.add_patch(Polygon(transform(pose, transform([*position, steering], box)), closed=True, **settings))


def arrow(axes: Axes, start: Array, end: Array, colour: str, **style: object) -> None:
    """A thin arrow from a point to another."""
    settings = {"arrowstyle": "-|>", "color": colour, "lw": 0.8, "mutation_scale": 7, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=settings | style)


def limits_around(points: Array, margin: float = 0.06) -> tuple[tuple[float, float], tuple[float, float]]:
    """x and y limits around points (n, 2), widened by a share of the larger side."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    pad = margin * float((high - low).max())
    return (low[0] - pad, high[0] + pad), (low[1] - pad, high[1] + pad)
