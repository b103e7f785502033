import numpy as np
import pytest

from footprints import random_star, rectangle
from oracles import SQUARE_LOAD_N, rectangle_pressure
from studies.paper.finite_volumes import mesh_pressure, meshed_patch, triangulate
from towval.model import Patch
from towval.model.errors import InputError, RefusedError
from towval.physics.contact import pressure_plane
from towval.physics.friction_laws import Coulomb, Makkar
from towval.physics.wrench import friction_wrench, sliding_patch, wrench_and_slopes, wrench_at_origin

TWISTS = [(0.05, 0.01, 0.2), (0.1, 0.0, 0.05), (0.0, 0.0, 0.3)]


@pytest.fixture(scope="module")
def square():
    return rectangle(0.4, 0.4)


@pytest.fixture(scope="module")
def makkar():
    return Makkar(0.06, 400, 40, 0.35, 800, 0)


def test_mesh_fills_any_footprint_with_small_enough_cells():
    rng = np.random.default_rng(1)
    for _ in range(12):
        patch = Patch(random_star(rng))
        size = np.linalg.norm(np.ptp(patch.outline, axis=0))
        mesh = triangulate(patch, 0.05 * size)
        x, y = patch.outline.T
        area = 0.5 * abs(x @ np.roll(y, -1) - np.roll(x, -1) @ y)
        assert mesh.areas.min() > 0
        assert mesh.areas.sum() == pytest.approx(area, rel=1e-9)
        assert mesh.longest_edge <= 0.05 * size


def test_mesh_leaves_holes_open():
    hole = rectangle(0.2, 0.1).outline
    mesh = triangulate(Patch(rectangle(0.4, 0.4).outline, (hole,)), 0.03)
    assert mesh.areas.sum() == pytest.approx(0.16 - 0.02)


@pytest.mark.parametrize("eccentricity", [0.03, 0.1, 0.15])
def test_mesh_pressure_goes_to_the_closed_form(square, eccentricity):
    largest = rectangle_pressure(0.4, 0.4, SQUARE_LOAD_N, eccentricity)
    a, _, c = mesh_pressure(square, [(SQUARE_LOAD_N, (eccentricity, 0))], 0.02).history[-1].coefficients
    assert 0.2 * a + c == pytest.approx(largest, rel=5e-3)


def test_dropping_whole_cells_gets_worse_towards_the_edge(square):
    """Numbers from elsewhere: with 1,352 cells the pressure at the edge is 6.6e-4, 2.8e-3 and 10 % off."""
    errors = []
    for eccentricity in (0.1, 0.15, 0.19):
        pressure = mesh_pressure(square, [(SQUARE_LOAD_N, (eccentricity, 0))], 0.028)
        assert len(pressure.force) == pytest.approx(1352, rel=0.1)
        a, _, c = pressure.history[-1].coefficients
        errors.append(abs((0.2 * a + c) / rectangle_pressure(0.4, 0.4, SQUARE_LOAD_N, eccentricity) - 1))
    assert errors == sorted(errors)
    assert errors[0] < 3e-3
    assert 0.01 < errors[2] < 0.3


def test_history_starts_with_the_whole_patch_and_its_residual_falls(square):
    history = mesh_pressure(square, [(SQUARE_LOAD_N, (0.1, 0.06))], 0.02).history
    assert history[0].in_contact.all()
    residuals = [iteration.residual for iteration in history]
    assert residuals == sorted(residuals, reverse=True)
    assert residuals[-1] < 1e-9 < residuals[0]


@pytest.mark.parametrize("twist", TWISTS)
def test_mesh_and_boundary_converge_to_each_other(square, makkar, twist):
    loads = [(SQUARE_LOAD_N, (0.1, 0.03))]
    exact = friction_wrench(sliding_patch(pressure_plane(square, loads), makkar), twist)
    sizes = (0.06, 0.03, 0.015)
    patches = [meshed_patch(mesh_pressure(square, loads, size), makkar) for size in sizes]
    errors = [np.abs(friction_wrench(patch, twist) - exact).max() for patch in patches]
    assert errors[2] < 2e-4 * 0.35 * SQUARE_LOAD_N
    # Cells on the neutral line keep the order a little below the two of the centroid rule.
    assert np.log(errors[0] / errors[2]) / np.log(sizes[0] / sizes[2]) > 1.4


def test_friction_factor_of_one_half_on_one_side_halves_that_sides_share(square):
    pressure = mesh_pressure(square, [(10.0, (0, 0))], 0.02)
    law = Coulomb(0.4, 1e-6)
    patch = meshed_patch(pressure, law, factor=lambda place: np.where(place[:, 0] > 0, 0.5, 1.0))
    force_x, force_y, moment = friction_wrench(patch, (0.0, 0.1, 0.0))
    assert (force_x, force_y) == pytest.approx((0, -0.4 * 10 * 0.75), rel=1e-2, abs=1e-9)
    assert moment == pytest.approx(0.4 * 0.1 * (5 - 2.5), rel=2e-2)  # ±0.1 m are the halves' centres


def test_anisotropic_friction_is_that_of_the_direction_of_sliding(square):
    pressure, law = mesh_pressure(square, [(10.0, (0, 0))], 0.04), Coulomb(0.4, 1e-6)
    patch = meshed_patch(pressure, law, anisotropy=((4.0, 0.0), (0.0, 1.0)))
    assert friction_wrench(patch, (0.1, 0, 0))[:2] == pytest.approx((-8.0, 0.0), abs=1e-9)
    assert friction_wrench(patch, (0, 0.1, 0))[:2] == pytest.approx((0.0, -4.0), abs=1e-9)
    oblique = friction_wrench(patch, (0.1, 0.1, 0))
    assert oblique[0] / oblique[1] == pytest.approx(4.0)


@pytest.mark.parametrize("twist", TWISTS)
def test_slopes_of_an_anisotropic_mesh_are_the_derivatives(square, makkar, twist):
    pressure = mesh_pressure(square, [(49.05, (0.03, 0))], 0.05)
    patch = meshed_patch(pressure, makkar, anisotropy=((1.5, 0.2), (0.2, 0.8)))
    *_, xx, xy, yy, xw, yw, ww = wrench_and_slopes(patch, *twist)
    step = 1e-6 * np.eye(3)
    numeric = np.column_stack(
        [np.subtract(wrench_at_origin(patch, *(twist + e)), wrench_at_origin(patch, *(twist - e))) / 2e-6 for e in step]
    )
    slopes = np.array([[xx, xy, xw], [xy, yy, yw], [xw, yw, ww]])
    assert np.abs(slopes - numeric).max() < 1e-5 * np.abs(slopes).max()


def test_wrong_sizes_and_tensors_are_input_errors(square, makkar):
    with pytest.raises(InputError, match="element size"):
        triangulate(square, 0.0)
    pressure = mesh_pressure(square, [(10.0, (0, 0))], 0.1)
    with pytest.raises(InputError, match="anisotropy"):
        meshed_patch(pressure, makkar, anisotropy=((1.0, 0.5), (0.2, 1.0)))
    with pytest.raises(InputError, match="factor"):
        meshed_patch(pressure, makkar, factor=lambda place: np.full(len(place), -1.0))


def test_load_that_leaves_no_cells_is_refused(square):
    with pytest.raises(RefusedError, match="did not settle"):
        mesh_pressure(square, [(10.0, (0.1999, 0.1999))], 0.1)
