"""The paper's method: finite volumes on a triangle mesh of the footprint.

SOURCE: sections 2.1 and 2.2. It is the other side of the chart of speed against accuracy, and the way where
friction varies over the patch or with the direction of sliding, for which the boundary integral has no closed
radial part.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import Delaunay

from towval.model import Array, FrictionLaw, Patch, locked
from towval.model.errors import InputError, RefusedError
from towval.physics.contact import resultant
from towval.physics.footprint import footprint_polygon
from towval.physics.friction_table import friction_table
from towval.physics.wrench import SlidingPatch

_SPACING = 0.85  # of the element size, first try; less where a side came out longer
_TRIES = 12
_ITERATION_LIMIT = 100
_RESIDUAL_LIMIT = 1e-9


@dataclass(frozen=True)
class Mesh:
    """A conforming triangulation: ``vertices`` (n, 2) [m], ``triangles`` (m, 3) indices, counter-clockwise."""

    vertices: Array
    triangles: NDArray[np.int64]

    @property
    def centroids(self) -> Array:
        """Centres of the cells (m, 2) [m]."""
        return self.vertices[self.triangles].mean(axis=1)

    @property
    def areas(self) -> Array:
        """Areas of the cells (m,) [m²]."""
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])

    @property
    def longest_edge(self) -> float:
        """Longest side of all cells [m]."""
        corners = self.vertices[self.triangles]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


@dataclass(frozen=True)
class MeshIteration:
    """One solution for a part taken to be in contact, as in Fig. 2(c).

    ``in_contact`` (m,) the cells it was solved on; ``coefficients`` (3,) of the pressure plane [Pa/m, Pa/m, Pa];
    ``residual`` of equilibrium once the cells in traction carry nothing, the largest of force / N and moments /
    (N size).
    """

    in_contact: NDArray[np.bool_]
    coefficients: Array
    residual: float


@dataclass(frozen=True)
class MeshPressure:
    """Pressure by finite volumes: ``mesh``, ``history`` of the iterations, ``force`` p dS of each cell (m,) [N]."""

    mesh: Mesh
    history: tuple[MeshIteration, ...]
    force: Array


def triangulate(patch: Patch, element_size: float) -> Mesh:
    """Conforming Delaunay mesh of a footprint.

    Corners, edges cut evenly and a lattice of equilateral triangles inside are triangulated; edges that a triangle
    crosses are cut again, and the lattice is tightened until no side is longer than asked.

    Parameters
    ----------
    patch : Patch
    element_size : float
        Longest side allowed [m].

    Raises
    ------
    InputError
        When the footprint is no simple polygon, or the size is not above zero or gives more than five million cells.

    Examples
    --------
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> mesh = triangulate(square, 0.05)
    >>> round(mesh.areas.sum(), 6), bool(mesh.longest_edge <= 0.05)
    (np.float64(0.16), True)
    """
    polygon = footprint_polygon(patch)
    if not (element_size > 0 and polygon.area / element_size**2 < 2e6):
        raise InputError(
            "the element size cannot be used", got=f"{element_size} m", allowed="above zero, not absurdly fine"
        )
    spacing = _SPACING * element_size
    for _ in range(_TRIES):
        mesh = _conforming(polygon, spacing)
        if mesh is not None and mesh.longest_edge <= element_size:
            return mesh
        spacing *= 0.93
    raise RefusedError(
        "the footprint could not be meshed",
        got=f"element size {element_size} m",
        remedy="remove slivers from the outline, or choose a smaller element size",
    )


def _conforming(polygon: shapely.Polygon | shapely.MultiPolygon, spacing: float) -> Mesh | None:
    """A mesh whose triangles fill the polygon exactly, or None where they cross its boundary."""
    rings = [ring for part in shapely.get_parts(polygon) for ring in (part.exterior, *part.interiors)]
    boundary = np.concatenate([_cut_evenly(shapely.get_coordinates(ring), spacing) for ring in rings])
    inner = _lattice(polygon, spacing)
    vertices = np.concatenate([boundary, inner])
    triangles = Delaunay(vertices).simplices
    kept = shapely.contains_xy(polygon, *vertices[triangles].mean(axis=1).T)
    mesh = Mesh(vertices, triangles[kept].astype(np.int64))
    flipped = mesh.areas < 0
    mesh.triangles[flipped] = mesh.triangles[flipped][:, ::-1]
    mesh = Mesh(vertices, mesh.triangles[mesh.areas > 1e-9 * spacing**2])
    return mesh if abs(mesh.areas.sum() - polygon.area) < 1e-9 * polygon.area else None


def _cut_evenly(ring: Array, spacing: float) -> Array:
    pieces = []
    for start, end in itertools.pairwise(ring):
        n = max(1, int(np.ceil(np.linalg.norm(end - start) / spacing)))
        pieces.append(start + np.arange(n)[:, None] / n * (end - start))
    return np.concatenate(pieces)


def _lattice(polygon: shapely.Polygon | shapely.MultiPolygon, spacing: float) -> Array:
    """Points of a lattice of equilateral triangles inside, at least half a side from the boundary."""
    x0, y0, x1, y1 = polygon.bounds
    rows = np.arange(y0, y1, spacing * np.sqrt(3) / 2)
    columns = np.arange(x0, x1 + spacing, spacing)
    x, y = np.meshgrid(columns, rows)
    x[1::2] -= spacing / 2
    points = np.column_stack([x.ravel(), y.ravel()])
    inside = shapely.contains_xy(polygon.buffer(-spacing / 2), *points.T)
    return points[inside]


def mesh_pressure(patch: Patch, loads: Sequence[tuple[float, ArrayLike]], element_size: float) -> MeshPressure:
    """Unilateral pressure by finite volumes: solve, drop cells in traction, solve again.

    SOURCE: eqs. (1), (2), (6) to (8), the paper's iteration with its history. Cells are in contact wholly or not at
    all, so the result differs from :func:`towval.physics.contact.pressure_plane` to first order in the element size.

    Raises
    ------
    InputError, RefusedError
        As :func:`triangulate`; also when fewer than three cells are left or the iteration does not settle, as with
        loads close to the edge of the footprint: take a smaller element size or the exact method.

    Examples
    --------
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> round(mesh_pressure(square, [(50.0, (0.0, 0.0))], 0.05).force.sum(), 6)
    np.float64(50.0)
    """
    mesh = triangulate(patch, element_size)
    normal_force, centre = resultant(loads)
    size = float(np.linalg.norm(np.ptp(patch.corners, axis=0)))
    basis = np.column_stack([(mesh.centroids - centre) / size, np.ones(len(mesh.triangles))])
    areas = mesh.areas / size**2
    in_contact, history = np.ones(len(areas), dtype=bool), []
    for _ in range(_ITERATION_LIMIT):
        if in_contact.sum() < 3:
            break
        weighted = basis[in_contact] * areas[in_contact, None]
        plane = np.asarray(np.linalg.solve(basis[in_contact].T @ weighted, [0.0, 0.0, 1.0]), dtype=np.float64)
        pressure = np.where(in_contact, basis @ plane, 0.0)
        pushing = basis @ plane > 0
        left = (basis[pushing] * areas[pushing, None]).T @ (basis @ plane)[pushing] - (0, 0, 1)
        history.append(_iteration(in_contact, plane, centre, size, normal_force, np.abs(left).max()))
        if history[-1].residual < _RESIDUAL_LIMIT:
            return MeshPressure(mesh, tuple(history), pressure * areas * normal_force)
        in_contact = pushing
    raise RefusedError(
        "the pressure on the mesh did not settle",
        got=f"{int(in_contact.sum())} of {len(areas)} cells in contact after {len(history)} iterations",
        allowed="loads well inside the footprint",
        remedy="choose a smaller element size, or the exact method",
    )


def _iteration(
    in_contact: NDArray[np.bool_], plane: Array, centre: Array, size: float, normal_force: float, residual: float
) -> MeshIteration:
    slopes = plane[:2] * normal_force / size**3
    constant = plane[2] * normal_force / size**2 - slopes @ centre
    return MeshIteration(in_contact, np.array([*slopes, constant]), float(residual))


def meshed_patch(
    pressure: MeshPressure,
    law: FrictionLaw,
    *,
    factor: Callable[[Array], ArrayLike] | None = None,
    anisotropy: ArrayLike = ((1.0, 0.0), (0.0, 1.0)),
) -> SlidingPatch:
    """A pressed mesh as a sliding patch, with friction that may vary over it and with direction.

    Parameters
    ----------
    pressure : MeshPressure
    law : FrictionLaw
    factor : callable, optional
        Gives for places (m, 2) [m] in the body frame what μ is to be multiplied with there (m,) [1].
    anisotropy : array_like (2, 2), optional
        Symmetric positive definite A in body axes: the force on a cell is ``−p dS μ(w) A v / w`` with
        ``w = √(vᵀ A v)``. For A = diag(a², b²) sliding along x meets a μ(a v), along y b μ(b v). ASSUME: this form, the
        gradient of a dissipation potential, so that friction takes power in every motion.

    Returns
    -------
    SlidingPatch
        To be used wherever one made by :func:`towval.physics.wrench.sliding_patch` is.

    Examples
    --------
    >>> from towval.physics import Coulomb, Patch, friction_wrench
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> pressure = mesh_pressure(square, [(50.0, (0.0, 0.0))], 0.05)
    >>> patch = meshed_patch(pressure, Coulomb(0.35, 1e-3), anisotropy=[[1.0, 0.0], [0.0, 1.21]])
    >>> friction_wrench(patch, [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])[:, :2].round(2) + 0.0
    array([[-17.5 ,   0.  ],
           [  0.  , -19.25]])
    """
    matrix = locked(anisotropy, "anisotropy", (2, 2))
    if matrix[0, 1] != matrix[1, 0] or matrix[0, 0] <= 0 or np.linalg.det(matrix) <= 0:
        raise InputError("the anisotropy is out of range", got=matrix.tolist(), allowed="symmetric, positive definite")
    cells = pressure.force > 0
    places, force = pressure.mesh.centroids[cells], pressure.force[cells]
    origin = force @ places / force.sum()
    factors = np.ones(len(force)) if factor is None else locked(factor(places), "factor of friction", (len(force),))
    if (factors < 0).any():
        raise InputError("a factor of friction is out of range", got=factors.min(), allowed="zero or more")
    nodes = np.ascontiguousarray(np.column_stack([places - origin, force * factors]))
    entries = np.array([matrix[0, 0], matrix[0, 1], matrix[1, 1]])
    return SlidingPatch(
        origin=origin,
        edges=np.empty((0, 5)),
        pressure=np.zeros(3),
        area_nodes=nodes,
        area_rules=np.array([[0.0, len(nodes), 0.0]]),
        circles=np.empty((0, 3)),
        radius=float(np.linalg.norm(nodes[:, :2], axis=1).max()),
        per_force=1 / nodes[:, 2].sum(),
        table=friction_table(law),
        anisotropy=entries,
    )
