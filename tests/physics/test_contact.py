import numpy as np
import pytest
import shapely

from footprints import random_star, rectangle
from oracles import PRESSURE_MAX_PA, SQUARE_LOAD_N, TWO_AXES_CONTACT_M2, TWO_AXES_PRESSURE_MAX_PA, rectangle_pressure
from towval.model import Patch
from towval.model.errors import InputError, RefusedError
from towval.physics.contact import pressure_plane


@pytest.mark.parametrize("eccentricity", [0.0, 0.02, 0.05, 0.4 / 6, 0.1, 0.15, 0.19, 0.1995])
def test_rectangle_has_the_closed_forms_pressure(square, eccentricity):
    contact = pressure_plane(square, [(SQUARE_LOAD_N, (eccentricity, 0.0))])
    largest = rectangle_pressure(0.4, 0.4, SQUARE_LOAD_N, eccentricity)
    assert contact.pressure((0.2, 0.1)) == pytest.approx(largest, rel=1e-11)
    assert largest == pytest.approx(PRESSURE_MAX_PA.get(eccentricity, largest), rel=1e-15)
    assert contact.contact_area == pytest.approx(0.4 * min(0.4, 3 * (0.2 - eccentricity)), rel=1e-11)


def test_load_near_a_corner_leaves_a_triangle(square):
    dx, dy = 0.05, 0.04
    contact = pressure_plane(square, [(SQUARE_LOAD_N, (0.2 - dx, 0.2 - dy))])
    assert contact.pressure((0.2, 0.2)) == pytest.approx(3 * SQUARE_LOAD_N / (8 * dx * dy), rel=1e-11)
    assert contact.contact_area == pytest.approx(8 * dx * dy, rel=1e-11)


def test_load_off_both_axes(square):
    contact = pressure_plane(square, [(SQUARE_LOAD_N, (0.05, 0.05))])
    assert contact.pressure((0.2, 0.2)) == pytest.approx(TWO_AXES_PRESSURE_MAX_PA, rel=1e-12)
    assert contact.contact_area == pytest.approx(TWO_AXES_CONTACT_M2, rel=1e-9)


def test_kern_is_where_the_whole_footprint_carries():
    """All of a rectangle b × h is pressed while |e_x|/b + |e_y|/h is at most a sixth."""
    patch = rectangle(0.6, 0.4)
    for share in np.linspace(0, 1, 7):
        corner = np.array([share * 0.6, (1 - share) * 0.4]) / 6
        assert pressure_plane(patch, [(10.0, 0.999 * corner)]).contact_area == pytest.approx(0.24, rel=1e-12)
        assert pressure_plane(patch, [(10.0, 1.02 * corner)]).contact_area < 0.24 * (1 - 1e-6)


def test_loads_add_up(square):
    parts = [(40.0, (0.01, -0.02)), (10.0, (-0.1, 0.1)), (-5.0, (0.05, 0.0))]
    together = pressure_plane(square, parts)
    centre = sum(f * np.array(place) for f, place in parts) / 45.0
    assert together.normal_force == pytest.approx(45.0)
    assert together.centre == pytest.approx(centre)
    assert together.coefficients == pytest.approx(pressure_plane(square, [(45.0, centre)]).coefficients, rel=1e-12)


def test_hole_carries_nothing():
    hole = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    contact = pressure_plane(Patch(rectangle(0.4, 0.4).outline, (hole,)), [(12.0, (0.0, 0.0))])
    assert contact.contact_area == pytest.approx(0.12)
    assert contact.pressure((0.15, 0.15)) == pytest.approx(100.0)


def four_feet(side=0.04, reach=(0.215, 0.14)):
    """Square feet about the corners of a rectangle; three carry less the further the load is from them."""
    square = side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return Patch.of([square + np.array(reach) * corner for corner in ([-1, -1], [1, -1], [1, 1], [-1, 1])])


def test_four_feet_carry_their_shares():
    """Loads on feet at (±a, ±b) under a plane: N/4 (1 ± x a/i_x² ± y b/i_y²), i² = a² + side²/12."""
    side, (a, b), (x, y) = 0.04, (0.215, 0.14), (0.03, -0.02)
    contact = pressure_plane(four_feet(side, (a, b)), [(60.0, (x, y))])
    assert len(contact.rings) == 4
    shares = {tuple(np.sign(r.mean(axis=0))): side**2 * contact.pressure(r.mean(axis=0)) for r in contact.rings}
    for (sx, sy), load in shares.items():
        assert load == pytest.approx(
            15.0 * (1 + sx * x * a / (a**2 + side**2 / 12) + sy * y * b / (b**2 + side**2 / 12)), rel=1e-11
        )


def test_foot_that_lifts_carries_nothing():
    """With the load close to the line between two feet the plane tips about it: the far foot is in the air."""
    contact = pressure_plane(four_feet(), [(60.0, (0.1, 0.08))])
    assert contact.pressure((-0.235, -0.16)) == 0
    assert contact.contact_area < 4 * 0.04**2 * (1 - 1e-3)
    assert contact.residual < 1e-12


@pytest.mark.parametrize("shift", [0.02, 0.04])
def test_parts_that_overlap_or_share_an_edge_are_refused(shift):
    square = 0.02 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    with pytest.raises(InputError, match="no simple polygon"):
        pressure_plane(Patch.of([square, square + np.array([shift, 0.0])]), [(10.0, (0.0, 0.0))])


def test_hole_belongs_to_the_part_around_it():
    outer = 0.1 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    aside = np.array([0.3, 0.0])
    contact = pressure_plane(Patch.of([outer - aside, outer + aside], [0.5 * outer + aside]), [(1.0, (0, 0))])
    assert contact.contact_area == pytest.approx(0.04 + 0.03, rel=1e-12)
    with pytest.raises(InputError):
        pressure_plane(Patch.of([outer - aside, outer + aside], [0.5 * outer]), [(1.0, (0, 0))])


def test_moved_and_turned_footprint_has_the_moved_and_turned_plane(square):
    angle, shift = 0.7, np.array([3.0, -2.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    here = pressure_plane(square, [(30.0, (0.11, 0.07))])
    there = pressure_plane(Patch(square.outline @ turn.T + shift), [(30.0, turn @ (0.11, 0.07) + shift)])
    points = np.array([[0.1, 0.1], [0.2, -0.1], [-0.05, 0.2]])
    assert there.pressure(points @ turn.T + shift) == pytest.approx(here.pressure(points), rel=1e-10)


def test_any_polygon_with_a_load_near_the_edge_of_its_hull_is_in_equilibrium():
    rng = np.random.default_rng(5)
    solved = 0
    while solved < 1500:
        outline = random_star(rng)
        hull = shapely.Polygon(outline).convex_hull
        size = np.linalg.norm(np.ptp(outline, axis=0))
        along = rng.uniform(0, hull.exterior.length)
        edge_point = shapely.get_coordinates(hull.exterior.interpolate(along))[0]
        middle = shapely.get_coordinates(hull.centroid)[0]
        place = edge_point + 10 ** rng.uniform(-3, 0) * (middle - edge_point)
        if hull.exterior.distance(shapely.Point(place)) < 1e-3 * size:
            continue
        contact = pressure_plane(Patch(outline), [(10.0, place)])
        assert contact.residual < 1e-10
        assert (contact.pressure(np.concatenate(contact.rings)) > -1e-9).all()
        solved += 1


@pytest.mark.parametrize("place", [(0.25, 0.0), (0.2, 0.0), (0.3, 0.3)])
def test_load_outside_the_footprint_is_refused(square, place):
    with pytest.raises(RefusedError, match="tips over"):
        pressure_plane(square, [(10.0, place)])


def test_lifting_load_is_refused(square):
    with pytest.raises(RefusedError, match="do not press"):
        pressure_plane(square, [(10.0, (0, 0)), (-11.0, (0, 0))])


def test_load_that_is_no_number_is_an_input_error(square):
    with pytest.raises(InputError, match="load is no array of numbers"):
        pressure_plane(square, [("a", (0.0, 0.0))])


def test_crossing_outline_is_an_input_error():
    with pytest.raises(InputError, match="no simple polygon"):
        pressure_plane(Patch([[0, 0], [1, 1], [1, 0], [0, 1]]), [(1.0, (0.5, 0.5))])
