"""The table of uncertain inputs: how each row acts on a scene, and that values at their stated place change nothing."""

from dataclasses import replace

import numpy as np
import pytest

from towval.model import FloorRegion, FrictionSpecification, Ground, Load, MassSpread, Patch, Tether, TowingScene
from towval.model.input_types import deviations
from towval.model.inputs import INPUTS, Realisation

SCENE = TowingScene(
    Patch([[-0.25, -0.175], [0.25, -0.175], [0.25, 0.175], [-0.25, 0.175]]),
    4.0,
    Load(1.5, (-0.15, 0.08), (0.1, 0.1, 0.0)),
    (0.25, 0.0),
    (-0.42, 0.0),
    Tether(0.6, 800.0, 12.0, 0.1, full_load=20.0),
    FrictionSpecification(0.4, 0.35, 0.002, 0.02, across_over_along=1.04, radius_over_planar=0.95),
    MassSpread((0.01, 0.0), 0.18),
    0.05,
    0.2,
    0.12,
    Ground(9.81, (0.001, -0.002), (FloorRegion([[0, 0], [1, 0], [1, 1]], 1.1),)),
)
OF_THE_CAMERA = "rover_height", "object_height", "readout"
ACTING = [name for name in INPUTS if INPUTS[name].stated and not INPUTS[name].within and name not in OF_THE_CAMERA]


def drawn(name, change):
    row = INPUTS[name]
    return row.acts(Realisation.nominal(SCENE), row.values(SCENE) + change).scene


def numbers(value):
    """All numbers of a scene, in one row."""
    if isinstance(value, str) or value is None:
        return []
    if hasattr(value, "__dataclass_fields__"):
        return [number for field in value.__dataclass_fields__ for number in numbers(getattr(value, field))]
    if isinstance(value, tuple):
        return [number for part in value for number in numbers(part)]
    return np.ravel(value).tolist()


def test_a_tether_whose_full_load_is_not_known_has_no_stiffening_to_be_unsure_of():
    linear = replace(SCENE, tether=replace(SCENE.tether, stiffening=0.0, full_load=0.0))
    assert deviations(linear)["stiffening"] == 0.0 < deviations(SCENE)["stiffening"]


@pytest.mark.parametrize("name", ACTING)
def test_a_row_acts_on_the_scene_and_not_at_its_stated_value(name):
    assert numbers(drawn(name, 0.0)) == pytest.approx(numbers(SCENE), rel=1e-15)
    changed = np.array(numbers(drawn(name, 1e-3 * max(1e-2, np.abs(INPUTS[name].values(SCENE)).max()))))
    assert (changed != np.array(numbers(SCENE))).any()


@pytest.mark.parametrize("name", ["hinge_height", "anchor_height", "centre_of_mass_height", "damping", "stiffening"])
def test_what_cannot_be_below_zero_scatters_to_one_side(name):
    row = INPUTS[name]
    below, above = (row.acts(Realisation.nominal(SCENE), np.array([sign * 0.03])).scene for sign in (-1, 1))
    assert numbers(below) == numbers(above)


@pytest.mark.parametrize(
    "name",
    [
        "across_over_along", "radius_over_planar", "regions", "inertia", "stiction_velocity",
        "friction", "body_mass", "rest_length", "stiffness",
    ],
)  # fmt: skip
def test_a_draw_far_out_leaves_a_scene_that_can_be_simulated(name):
    row = INPUTS[name]
    far = row.acts(Realisation.nominal(SCENE), row.values(SCENE) - 10.0 * max(1.0, row.values(SCENE)[0]))
    assert np.isfinite(numbers(far.checked().scene)).all()


def test_static_friction_is_drawn_by_itself_and_goes_along_where_kinetic_is_identified():
    assert drawn("friction", 0.035).friction.static == pytest.approx(0.44)
    assert drawn("static_friction", 0.02).friction.kinetic == 0.35
    assert drawn("static_friction", -0.2).friction.static == 0.35


def test_a_law_without_a_peak_keeps_none_at_any_kinetic_coefficient():
    """By a product and a quotient the static coefficient came out below the kinetic one in a quarter of the cases."""
    plain = replace(SCENE, friction=replace(SCENE.friction, static=SCENE.friction.kinetic))
    row = INPUTS["friction"]
    for value in np.random.default_rng(0).uniform(0.1, 0.9, 300):
        friction = row.acts(Realisation.nominal(plain), np.array([value])).scene.friction
        assert friction.static == friction.kinetic == value


def test_velocities_of_the_law_stay_apart():
    friction = drawn("stiction_velocity", 0.018).friction
    assert friction.friction_velocity >= 6 * friction.stiction_velocity * (1 - 1e-12)
    assert drawn("friction_velocity", -0.019).friction.friction_velocity == pytest.approx(0.012)
    close = replace(SCENE, friction=replace(SCENE.friction, friction_velocity=0.008))
    row = INPUTS["friction_velocity"]
    assert row.acts(Realisation.nominal(close), row.values(close)).scene.friction.friction_velocity == 0.008
