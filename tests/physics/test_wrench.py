from dataclasses import replace

import numpy as np
import pytest
import shapely

from footprints import random_star, rectangle
from oracles import (
    DISK_WRENCH,
    FOUR_CORNERS_OVER_PATCH,
    RECTANGLE_SPIN_M,
    SQUARE_CORNER_SPIN_M,
    SQUARE_SPIN_M,
    disk_wrench,
    rectangle_spin,
)
from quadrature import reference_wrench
from towval.model import Patch
from towval.physics.contact import pressure_plane
from towval.physics.friction_laws import Coulomb, Makkar
from towval.physics.wrench import friction_wrench, sliding_patch, wrench_and_slopes, wrench_at_origin

COULOMB = Coulomb(1.0, 1e-12)


def regular_polygon(n, radius=1.0):
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    return Patch(radius * np.column_stack([np.cos(angle), np.sin(angle)]))


@pytest.mark.parametrize(("ratio", "digits"), DISK_WRENCH.items())
def test_disk_has_the_closed_forms_wrench(ratio, digits):
    assert disk_wrench(ratio) == pytest.approx(digits, rel=1e-12)
    # The wrench of inscribed regular polygons goes to the disk's as n⁻²: Richardson takes the rest away.
    wrenches = []
    for n in (240, 480):
        patch = sliding_patch(pressure_plane(regular_polygon(n), [(1.0, (0, 0))]), COULOMB)
        wrenches.append(friction_wrench(patch, (ratio, 0.0, 1.0)))
    force_x, force_y, moment = (4 * wrenches[1] - wrenches[0]) / 3
    assert (-force_x, -moment) == pytest.approx(disk_wrench(ratio), abs=2e-8)
    assert force_y == pytest.approx(0, abs=1e-12)


def test_disk_turning_about_its_centre():
    wrenches = []
    for n in (240, 480):
        patch = sliding_patch(pressure_plane(regular_polygon(n), [(1.0, (0, 0))]), COULOMB)
        wrenches.append(friction_wrench(patch, (0.0, 0.0, 1.0)))
    assert ((4 * wrenches[1] - wrenches[0]) / 3) == pytest.approx([0, 0, -2 / 3], abs=1e-9)


@pytest.mark.parametrize(("sides", "digits"), [((0.4, 0.4), SQUARE_SPIN_M), ((0.6, 0.4), RECTANGLE_SPIN_M)])
def test_rectangle_turning_about_its_centre(sides, digits):
    patch = sliding_patch(pressure_plane(rectangle(*sides), [(7.0, (0, 0))]), COULOMB)
    assert rectangle_spin(*sides) == pytest.approx(digits, rel=1e-12)
    assert friction_wrench(patch, (0, 0, -2.0)) == pytest.approx([0, 0, 7 * digits], rel=1e-10, abs=1e-10)


def test_square_turning_about_a_corner(square):
    patch = sliding_patch(pressure_plane(square, [(1.0, (0, 0))]), COULOMB)
    force_x, force_y, moment = friction_wrench(patch, (0.2, -0.2, 1.0))
    about_corner = moment - (0.2 * force_y - 0.2 * force_x)
    assert about_corner == pytest.approx(-SQUARE_CORNER_SPIN_M, rel=1e-10)


def test_four_points_are_not_a_patch():
    assert np.hypot(0.2, 0.2) / SQUARE_SPIN_M == pytest.approx(FOUR_CORNERS_OVER_PATCH, abs=5e-4)


def random_scene(rng):
    outline = random_star(rng, corners=(3, 8))
    polygon = shapely.Polygon(outline)
    size = np.linalg.norm(np.ptp(outline, axis=0))
    inside = shapely.get_coordinates(polygon.representative_point())[0]
    middle = shapely.get_coordinates(polygon.convex_hull.centroid)[0]
    place = middle + rng.uniform(0, 0.8) * (inside - middle)
    contact = pressure_plane(Patch(outline), [(10.0, place)])
    law = Makkar(*(rng.uniform(0, 0.2, 1)), 400, 40, 0.35, 10 ** rng.uniform(1.5, 3.5), rng.choice([0.0, 0.3]))
    return contact, law, size


def centre_of_rotation(rng, contact, size, kind):
    edge = contact.edges[rng.integers(len(contact.edges))]
    start, end = edge[:2], edge[2:]
    if kind == "vertex":
        return start
    if kind == "edge":
        return start + rng.uniform() * (end - start)
    if kind == "close to an edge":
        normal = np.array([-(end - start)[1], (end - start)[0]]) / np.hypot(*(end - start))
        return start + rng.uniform() * (end - start) + 10 ** rng.uniform(-9, -1) * size * normal
    if kind == "inside":
        return contact.centre + 0.3 * size * rng.uniform(-1, 1, 2)
    return contact.centre + 10 ** rng.uniform(0, 1.5) * size * rng.normal(size=2)


@pytest.mark.parametrize("kind", ["vertex", "edge", "close to an edge", "inside", "outside"])
def test_boundary_integral_agrees_with_high_order_quadrature(kind):
    rng = np.random.default_rng(11)
    for _ in range(6):
        contact, law, size = random_scene(rng)
        omega = rng.choice([-1, 1]) * 10 ** rng.uniform(-4, 0.5) / size
        cx, cy = centre_of_rotation(rng, contact, size, kind)
        twist = np.array([cy * omega, -cx * omega, omega])
        wrench = friction_wrench(sliding_patch(contact, law), twist)
        reference = reference_wrench(contact, law, twist)
        reach = np.hypot(*contact.centre) + size
        scale = contact.normal_force * 0.35 * np.array([1, 1, reach])
        assert np.abs((wrench - reference) / scale).max() < 1e-8


@pytest.mark.parametrize("twist", [(0.02, 0.01, 0.1), (0.1, 0.0, 0.5), (0.1, 0.02, 0.01), (0.0, 0.0, 1.0)])
def test_hole_is_the_footprint_less_what_is_cut_out(makkar, twist):
    """The same pressure plane over the outline, over the cut-out and over what is left of the outline."""
    hole = np.array([[-0.1, -0.05], [0.12, -0.08], [0.1, 0.1], [-0.05, 0.12]])
    left = pressure_plane(
        Patch([[-0.3, -0.2], [0.3, -0.2], [0.25, 0.2], [-0.3, 0.25]], (hole,)), [(30.0, (0.02, 0.01))]
    )
    outer, inner = left.rings
    parts = [replace(left, rings=(ring,)) for ring in (outer, inner[::-1])]
    whole, cut_out = (friction_wrench(sliding_patch(part, makkar), twist) for part in parts)
    assert friction_wrench(sliding_patch(left, makkar), twist) == pytest.approx(whole - cut_out, abs=1e-9)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.215, 0.14), (0.2, 0.13), (0.4, 0.1), (-3.0, 5.0)])
def test_four_feet_agree_with_high_order_quadrature(makkar, centre):
    foot = 0.02 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    feet = Patch.of([foot + np.array([0.215 * x, 0.14 * y]) for x, y in ([-1, -1], [1, -1], [1, 1], [-1, 1])])
    contact = pressure_plane(feet, [(60.0, (0.02, -0.03))])
    twist = np.array([0.3 * centre[1], -0.3 * centre[0], 0.3])
    wrench = friction_wrench(sliding_patch(contact, makkar), twist)
    scale = 60.0 * 0.35 * np.array([1, 1, 0.26])
    assert np.abs((wrench - reference_wrench(contact, makkar, twist)) / scale).max() < 1e-8


def test_wrench_is_continuous_as_turning_vanishes(square, makkar):
    patch = sliding_patch(pressure_plane(square, [(49.05, (0.05, 0.03))]), makkar)
    straight = friction_wrench(patch, (0.05, 0.02, 0.0))
    for omega in 10.0 ** -np.arange(3, 16):
        turning = friction_wrench(patch, (0.05, 0.02, omega))
        # First order in ω with a slope of the size of the wrench over the speed.
        assert np.abs(turning - straight).max() < 100 * omega + 1e-9


def test_boundary_and_area_rule_agree_where_they_meet(square, makkar):
    patch = sliding_patch(pressure_plane(square, [(49.05, (0.1, 0.06))]), makkar)
    ((x, _, radius),) = patch.circles
    speed, omega = 0.1, 0.1 / (4 * radius)  # of the middle of the patch, so that C is four radii away
    below = np.array(wrench_and_slopes(patch, 0.0, speed * (1 - 1e-12) - omega * x, omega))
    above = np.array(wrench_and_slopes(patch, 0.0, speed * (1 + 1e-12) - omega * x, omega))
    # 1e-10 of μ N and μ N times the size, as both promise; not the same numbers, as they are computed differently.
    assert (above != below).any()
    assert above[:3] == pytest.approx(below[:3], rel=1e-10, abs=0.35 * 49.05 * 1e-10)
    assert above[3:] == pytest.approx(below[3:], rel=1e-6, abs=1e-6)


def wrench_over_triangles(contact, law, twist, order=24):
    """Gauss nodes over triangles, exact where the centre of rotation is some sizes of a triangle away."""
    x, w = np.polynomial.legendre.leggauss(order)
    u, v = ((grid.ravel() + 1) / 2 for grid in np.meshgrid(x, x, indexing="ij"))
    weight = np.outer(w, w).ravel() / 4 * u
    total = np.zeros(3)
    for triangle in shapely.constrained_delaunay_triangles(
        shapely.MultiPolygon([shapely.Polygon(ring) for ring in contact.rings])
    ).geoms:
        a, b, c = shapely.get_coordinates(triangle)[:3]
        px, py = a[:, None] + np.outer(b - a, u) + np.outer(c - b, u * v)
        ux, uy = twist[0] - twist[2] * py, twist[1] + twist[2] * px
        speed, area = np.hypot(ux, uy), abs((b - a)[0] * (c - b)[1] - (b - a)[1] * (c - b)[0])
        force = area * weight * contact.pressure(np.column_stack([px, py])) * law.coefficient(speed) / speed
        total -= [(force * ux).sum(), (force * uy).sum(), (force * (px * uy - py * ux)).sum()]
    return total


@pytest.mark.parametrize("reach", [4.0, 7.0, 20.0])
def test_rules_over_the_area_suffice_where_they_begin_to_serve(reach):
    """Just beyond the distance of C at which a rule takes over, in radii of the part and then of the whole patch."""
    rng = np.random.default_rng(17)
    tried = 0
    while tried < 20:
        contact, law, _ = random_scene(rng)
        patch = sliding_patch(contact, law)
        if len(patch.circles) > 1:
            continue
        tried += 1
        middle, radius = (patch.circles[0, :2], patch.circles[0, 2]) if reach == 4.0 else (0.0, patch.radius)
        scale = contact.normal_force * 0.35 * np.array([1, 1, np.hypot(*contact.centre) + radius])
        for angle in rng.uniform(0, 2 * np.pi, 10):
            cx, cy = patch.origin + middle + 1.0001 * reach * radius * np.array([np.cos(angle), np.sin(angle)])
            omega = 10 ** rng.uniform(-4, 0.5) / (reach * radius)
            twist = np.array([cy * omega, -cx * omega, omega])
            error = friction_wrench(patch, twist) - wrench_over_triangles(contact, law, twist)
            assert np.abs(error / scale).max() < 2e-10


@pytest.mark.parametrize("kind", ["near one tip", "between the tips", "beyond"])
def test_small_tips_far_apart_keep_their_digits(makkar, kind):
    """The footprint stands on two tips; the triangles that C spans with their edges are 1e8 times the wrench."""
    outline = [[0.0, 0.0], [0.4, 0.3], [1.0, 0.0], [0.9, 0.6], [0.1, 0.6]]
    contact = pressure_plane(Patch(outline), [(10.0, (0.55, 0.001))])
    assert len(contact.rings) == 2
    assert contact.contact_area < 1e-4
    rng = np.random.default_rng(4)
    for _ in range(30):
        angle = rng.uniform(0, 2 * np.pi)
        reach = {"near one tip": 0.06, "between the tips": rng.uniform(0.1, 0.4), "beyond": rng.uniform(0.7, 2.0)}[kind]
        cx, cy = (0.0 if kind == "near one tip" else 0.5) + reach * np.cos(angle), reach * np.sin(angle)
        omega = rng.choice([-1, 1]) * 10 ** rng.uniform(-3, 0.5)
        twist = np.array([cy * omega, -cx * omega, omega])
        error = friction_wrench(sliding_patch(contact, makkar), twist) - wrench_over_triangles(contact, makkar, twist)
        assert np.abs(error).max() < 1e-9 * 10.0 * 0.35


@pytest.mark.parametrize("twist", [(0.02, 0.01, 0.1), (0.1, 0, 0.01), (1e-4, 2e-4, 1e-3), (0, 0, 0.2), (1e-9, 0, 1e-8)])
def test_slopes_are_the_derivatives(square, makkar, twist):
    patch = sliding_patch(pressure_plane(square, [(49.05, (0.07, 0.03))]), makkar)
    *_, xx, xy, yy, xw, yw, ww = wrench_and_slopes(patch, *twist)
    step = 1e-5 * np.linalg.norm(twist)
    numeric = np.column_stack(
        [
            np.subtract(wrench_at_origin(patch, *(twist + e)), wrench_at_origin(patch, *(twist - e))) / (2 * step)
            for e in step * np.eye(3)
        ]
    )
    slopes = np.array([[xx, xy, xw], [xy, yy, yw], [xw, yw, ww]])
    assert np.abs(slopes - numeric).max() < 1e-6 * np.abs(slopes).max()


def test_friction_takes_power_and_reverses_with_the_twist(square, makkar):
    patch = sliding_patch(pressure_plane(square, [(49.05, (0.07, 0.03))]), makkar)
    rng = np.random.default_rng(3)
    for twist in rng.normal(size=(50, 3)) * 10 ** rng.uniform(-6, 0, (50, 1)):
        wrench = friction_wrench(patch, twist)
        assert wrench @ twist < 0
        assert friction_wrench(patch, -twist) == pytest.approx(-wrench, rel=1e-9, abs=1e-9)


def test_object_at_rest_feels_nothing(square, makkar):
    patch = sliding_patch(pressure_plane(square, [(49.05, (0, 0))]), makkar)
    assert (friction_wrench(patch, (0, 0, 0)) == 0).all()
