"""Cost and error of a friction wrench: boundary integral, nodes over the area, meshes, cheaper models.

The reference is a sum over Gauss nodes on rectangles that shrink towards the centre of rotation, in NumPy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from studies.comparators.limit_surface import surface_wrench_at_centre
from studies.comparators.tabulated_wrench import read_wrench, wrench_table
from studies.costs import take_turns
from studies.frame import Part, Row, Scatter, Settings, Study, default_point, point
from studies.paper.finite_volumes import mesh_pressure, meshed_patch
from studies.worlds.reference import Box
from towval.model import Array, Patch, TowedObject
from towval.model.compiling import compiled
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import Coulomb
from towval.physics.limit_surface import limit_surface
from towval.physics.wrench import SlidingPatch, sliding_patch, wrench_at_origin

SIDE, MASS, CENTRE, FRICTION, STICTION = 0.4, 5.0, (0.03, 0.02), 0.35, 1e-3
TWISTS = 24
_CALLS = 4000
_SMALLEST = 1e-7


@dataclass(frozen=True)
class _Method:
    series: str
    setting: str
    wrench: Callable[[float, float, float], tuple[float, float, float]]
    repeated: Callable[[Array, int], float]
    calls: int = _CALLS
    default: bool = False


def friction_rows(element_sizes_m: list[float], parts: list[int], rounds: int) -> list[Row]:
    """A row a method: seconds a wrench, and the RMS error over random twists relative to μ N and μ N r."""
    half = SIDE / 2
    outline = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    towed = TowedObject(Patch(outline), MASS, np.array(CENTRE), MASS * SIDE**2 / 6, np.array([half, 0.0]))
    twists = _twists()
    truth = np.array([true_wrench(*twist) for twist in twists])
    unit = FRICTION * MASS * GRAVITY_M_PER_S2 * np.array([1, 1, half])
    methods = [*_boundary(towed), *_area(towed), *_meshes(towed, element_sizes_m), *_cheap(towed, parts)]
    calls = {f"{k}": lambda m=method: m.repeated(twists, m.calls) for k, method in enumerate(methods)}
    rows = []
    for method, timed in zip(methods, take_turns(calls, rounds).values(), strict=True):
        error = (np.array([method.wrench(*twist) for twist in twists]) - truth) / unit
        evaluations = method.calls * len(twists)
        rows.append(
            {
                "panel": "",
                "series": method.series,
                "setting": method.setting,
                "cost": timed.cpu_s / evaluations,
                "cost_most": timed.cpu_most_s / evaluations,
                "error": float(np.sqrt(np.mean(error**2))),
                "error_most": float(np.abs(error).max()),
                "default": method.default,
            }
        )
    return rows


def _twists() -> Array:
    """Twists (n, 3) about the centre of pressure, with centres of rotation inside, near and far from the patch."""
    rng = np.random.default_rng(6)
    distance = np.tile([0.3, 0.8, 2.0, 20.0], TWISTS // 4) * SIDE / 2 * rng.uniform(0.7, 1.3, TWISTS)
    about, rate = rng.uniform(0, 2 * np.pi, TWISTS), rng.choice([-1, 1], TWISTS) * rng.uniform(0.02, 0.5, TWISTS)
    rate /= np.maximum(1, distance / SIDE)
    return np.column_stack([rate * distance * np.sin(about), -rate * distance * np.cos(about), rate])


def true_wrench(vx: float, vy: float, omega: float) -> Array:
    """Force and moment (3,) about the centre of pressure [N, N, N m], for the velocity there."""
    box = Box((SIDE, SIDE), MASS, CENTRE, 1.0, (0.0, 0.0), FRICTION, STICTION)
    pressure = MASS * GRAVITY_M_PER_S2 / SIDE**2 * np.array([1, *(12 * np.array(box.centre) / SIDE**2)])
    x, wx = _graded(box.centre[0] - vy / omega)
    y, wy = _graded(box.centre[1] + vx / omega)
    x, y = np.meshgrid(x, y)
    force = np.outer(wy, wx) * (pressure[0] + pressure[1] * x + pressure[2] * y)
    x, y = x - box.centre[0], y - box.centre[1]
    ux, uy = vx - omega * y, vy + omega * x
    speed = np.hypot(ux, uy) + 1e-300
    drag = -FRICTION * force * np.tanh(speed / STICTION) / speed
    return np.array([(drag * ux).sum(), (drag * uy).sum(), (drag * (x * uy - y * ux)).sum()])


def _graded(pole: float) -> tuple[Array, Array]:
    """Gauss nodes and weights on a side, in panels that halve towards a place where the integrand bends."""
    pole, half = np.clip(pole, -SIDE / 2, SIDE / 2), SIDE / 2
    shrink = 0.5 ** np.arange(int(np.log2(SIDE / _SMALLEST)))
    cuts = np.unique(
        np.concatenate([[-half, pole, half], pole + (half - pole) * shrink, pole - (half + pole) * shrink])
    )
    nodes, weights = np.polynomial.legendre.leggauss(10)
    width = np.diff(cuts)
    return ((cuts[:-1] + width / 2)[:, None] + width[:, None] / 2 * nodes).ravel(), np.outer(width / 2, weights).ravel()


def _on_patch(series: str, setting: str, patch: SlidingPatch, *, calls: int = _CALLS, default: bool = False) -> _Method:
    """A method by nodes or boundary; its own origin is shifted to the centre of pressure, where twists are stated."""
    sx, sy = patch.origin - np.array(CENTRE)

    def wrench(vx: float, vy: float, omega: float) -> tuple[float, float, float]:
        fx, fy, moment = wrench_at_origin(patch, vx - omega * sy, vy + omega * sx, omega)
        return fx, fy, moment + sx * fy - sy * fx

    return _Method(series, setting, wrench, lambda twists, n: _repeat_patch(patch, twists, n), calls, default)


def _boundary(towed: TowedObject) -> list[_Method]:
    exact = sliding_patch(resting_pressure(towed), Coulomb(FRICTION, STICTION))
    methods = [_on_patch("boundary integral", "edges whole", exact, default=True)]
    for pieces in (2, 4):
        start, tangent = exact.edges[:, :2], exact.edges[:, 2:4]
        length = exact.edges[:, 4:] / pieces
        cut = [np.column_stack([start + k * length * tangent, tangent, length]) for k in range(pieces)]
        patch = exact._replace(edges=np.ascontiguousarray(np.concatenate(cut)))
        methods.append(_on_patch("boundary integral", f"edges in {pieces}", patch))
    return methods


def _area(towed: TowedObject) -> list[_Method]:
    box = Box((SIDE, SIDE), MASS, CENTRE, 1.0, (0.0, 0.0), FRICTION, STICTION)
    law, loads = Coulomb(FRICTION, STICTION), [(MASS * GRAVITY_M_PER_S2, CENTRE)]
    coarse = mesh_pressure(towed.patch, loads, SIDE / 4)
    methods = []
    for panels, order in ((1, 4), (1, 8), (2, 8), (4, 8), (8, 8)):
        places, force = box.nodes((panels, panels), order)
        # A meshed patch is its places and forces: another origin and other nodes make it a rule of Gauss.
        origin = force @ places / force.sum()
        nodes = np.ascontiguousarray(np.column_stack([places - origin, force]))
        patch = meshed_patch(coarse, law)
        rules = np.array([[0.0, len(nodes), 0.0]])
        patch = patch._replace(origin=origin, area_nodes=nodes, area_rules=rules)
        methods.append(_on_patch("Gauss nodes over the area", f"{len(nodes)} nodes", patch, calls=_CALLS // 4))
    return methods


def _meshes(towed: TowedObject, element_sizes_m: list[float]) -> list[_Method]:
    law, loads = Coulomb(FRICTION, STICTION), [(MASS * GRAVITY_M_PER_S2, CENTRE)]
    methods = []
    for size in element_sizes_m:
        # ASSUME: as in studies.paper.meshes, the paper's element size is 1/2.8 of the longest side of a cell.
        patch = meshed_patch(mesh_pressure(towed.patch, loads, 2.8 * size), law)
        calls = max(2, int(_CALLS * 30 / len(patch.area_nodes)))
        methods.append(_on_patch("mesh (Table 1)", f"{1e3 * size:g} mm", patch, calls=calls))
    return methods


def _cheap(towed: TowedObject, parts: list[int]) -> list[_Method]:
    contact, law = resting_pressure(towed), Coulomb(FRICTION, STICTION)
    exact = sliding_patch(contact, law)
    surface = limit_surface(exact)
    numbers, friction = np.array([surface.normal_force, surface.radius**2]), exact.table
    methods = [
        _Method(
            "limit surface",
            "ellipsoid",
            lambda vx, vy, omega: surface_wrench_at_centre(friction, numbers, vx, vy, omega),
            lambda twists, n: _repeat_surface(friction, numbers, twists, n),
        )
    ]
    for count in parts:
        table = wrench_table(exact, count)
        methods.append(
            _Method(
                "table of wrenches",
                f"{2 * count} × {count}",
                partial(read_wrench, table, exact.radius),
                partial(_repeat_table, table, exact.radius),
            )
        )
    return methods


@compiled()
def _repeat_patch(patch: SlidingPatch, twists: Array, count: int) -> float:
    total = 0.0
    for k in range(count):
        for i in range(len(twists)):
            total += wrench_at_origin(patch, twists[i, 0] + 1e-12 * k, twists[i, 1], twists[i, 2])[2]
    return total


@compiled()
def _repeat_surface(table: Array, numbers: Array, twists: Array, count: int) -> float:
    total = 0.0
    for k in range(count):
        for i in range(len(twists)):
            total += surface_wrench_at_centre(table, numbers, twists[i, 0] + 1e-12 * k, twists[i, 1], twists[i, 2])[2]
    return total


@compiled()
def _repeat_table(table: Array, radius: float, twists: Array, count: int) -> float:
    total = 0.0
    for k in range(count):
        for i in range(len(twists)):
            total += read_wrench(table, radius, twists[i, 0] + 1e-12 * k, twists[i, 1], twists[i, 2])[2]
    return total


def _parts(settings: Settings) -> dict[str, Part]:
    # SOURCE: Table 1's element sizes [m].
    sizes = [0.0100, 0.0075, 0.0050] if settings.quick else [0.0100, 0.0075, 0.0050, 0.0025, 0.0010]
    return {"all": {"element_sizes_m": sizes, "parts": [16, 64], "rounds": 2 if settings.quick else 5}}


def _why(rows: pd.DataFrame) -> str:
    default = default_point(rows)
    sampled = rows[rows["series"].isin(["Gauss nodes over the area", "mesh (Table 1)"])]
    nearest = sampled.loc[sampled["error"].idxmin()]
    cut = rows[(rows["series"] == default.series) & (rows["setting"] != default.setting)]["cost"] / default.cost
    surface = point(rows, "limit surface", "ellipsoid")
    tables = rows[rows["series"] == "table of wrenches"]
    table = tables.loc[tables["error"].idxmin()]
    return (
        f"It is right to {default.error:.0e}; the nearest of nodes and meshes ({nearest.setting}) to "
        f"{nearest.error:.0e}, in {nearest.cost / default.cost:.0f} times its time. With edges cut in pieces it takes "
        f"{cut.min():.1f} to {cut.max():.1f} times as long. Where that is enough, a table is right to "
        f"{table.error:.0e} in {table.cost / default.cost:.0%} of the time, an ellipsoid to {surface.error:.0e} in "
        f"{surface.cost / default.cost:.1%}."
    )


STUDY = Study(
    parts=_parts,
    rows=friction_rows,
    chart=Scatter(
        title="Friction wrench of a pressed square",
        cost="CPU time per wrench [s]",
        error=r"RMS error of force / $\mu N$ and moment / $\mu N a/2$",
        note="RMS over 24 twists with centres of rotation inside, near and far from the patch of side a, pressed by N.",
        take="Take the boundary integral with whole edges, the default.",
        why=_why,
        truth="Truth: graded Gauss quadrature in NumPy, without code of the package.",
    ),
)
