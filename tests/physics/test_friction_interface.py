"""A friction law from outside the package: one class, one line of registration, and all of the physics uses it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from quadrature import reference_wrench
from studies.paper.finite_volumes import mesh_pressure, meshed_patch
from towval.model import FrictionLaw, FrictionSpecification, TimedPath, check_friction_law
from towval.model.errors import InputError
from towval.physics.contact import pressure_plane
from towval.physics.dynamics import Outcome, feedback
from towval.physics.friction_laws import LAWS, Coulomb, FittedLaw, Makkar, fitted_law
from towval.physics.friction_table import coefficient_over_speed, friction_table, ratio_and_slope
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.wrench import friction_wrench, sliding_patch


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    """μ_k + (μ_s − μ_k) exp(−(v / v_s)²), regularised over v_s / 10."""

    name: ClassVar[str] = "stribeck"
    static: float
    kinetic: float
    stiction_velocity: float

    def coefficient(self, speed):
        x = np.asarray(speed) / self.stiction_velocity
        return (self.kinetic + (self.static - self.kinetic) * np.exp(-x * x)) * np.tanh(10 * x)

    def slope(self, speed):
        x = np.asarray(speed) / self.stiction_velocity
        peak, rise = (self.static - self.kinetic) * np.exp(-x * x), np.tanh(10 * x)
        return (-2 * x * peak * rise + (self.kinetic + peak) * 10 * (1 - rise * rise)) / self.stiction_velocity

    @property
    def speed_range(self):
        return 1e-5 * self.stiction_velocity, 7 * self.stiction_velocity

    @property
    def plateau(self):
        return self.kinetic


@pytest.fixture
def law(monkeypatch):
    monkeypatch.setattr(LAWS, "_values", dict(LAWS))
    LAWS.register("stribeck", lambda s: FittedLaw(Stribeck(s.static, s.kinetic, s.stiction_velocity), residual=0.0))
    return fitted_law(FrictionSpecification(0.42, 0.35, 0.004, 0.05, law="stribeck")).law


def test_specification_names_its_law(law):
    assert law == Stribeck(0.42, 0.35, 0.004)
    assert law.parameters == {"static": 0.42, "kinetic": 0.35, "stiction_velocity": 0.004}
    with pytest.raises(InputError, match="stribek"):
        fitted_law(FrictionSpecification(0.4, 0.35, 0.004, 0.05, law="stribek"))


@pytest.mark.parametrize("twist", [(0.01, 0.003, 0.02), (1e-4, -2e-4, 0.01), (0.0, 0.002, -0.3)])
def test_wrench_under_the_new_law_agrees_with_quadrature(law, square, twist):
    contact = pressure_plane(square, [(30.0, (0.03, 0.02))])
    wrench = friction_wrench(sliding_patch(contact, law), twist)
    assert wrench == pytest.approx(reference_wrench(contact, law, twist), abs=1e-9 * 30)


def test_plan_and_dynamics_under_the_new_law_agree_with_the_mesh(law, cube, lap):
    """The same law on the exact patch and on finite volumes of the footprint."""
    _, tether, hinge, start = lap
    mesh = meshed_patch(mesh_pressure(cube.patch, [(cube.mass * 9.81, (0.0, 0.0))], 0.02), law)
    times = np.linspace(0, 40.0, 201)
    path = TimedPath(hinge.time_s[:401], hinge.position[:401])
    plans = [quasistatic_plan(cube, friction, path, tether) for friction in (law, mesh)]
    assert not plans[0].findings
    assert plans[0].pose == pytest.approx(plans[1].pose, abs=1e-3)
    towed = [feedback(cube, friction, tether, hinge, start, times) for friction in (law, mesh)]
    assert towed[0].outcome == Outcome.CONVERGED
    assert towed[0].pose[:, :2] == pytest.approx(towed[1].pose[:, :2], abs=1e-3)
    coulomb = feedback(cube, Coulomb(0.35, 1e-3), tether, hinge, start, times)
    assert np.abs(coulomb.pose - towed[0].pose).max() > 1e-3


@pytest.mark.parametrize(
    "given", [Stribeck(0.42, 0.35, 0.004), Makkar(0.06, 400, 40, 0.35, 800, 0.2), Coulomb(0.35, 1e-3)]
)
def test_table_holds_the_law_and_its_slope(given):
    table = friction_table(given)
    for speed in np.geomspace(1e-8, 10, 400):
        ratio, slope = ratio_and_slope(table, speed, 1 / speed)
        assert ratio * speed == pytest.approx(float(given.coefficient(speed)), rel=1e-9)
        assert slope == pytest.approx(float(given.slope(speed)), rel=1e-6, abs=1e-8 / speed)


def test_a_speed_that_is_no_number_reads_nothing_beyond_the_table():
    """A state that has left the range of numbers: its bits would be read as the number of a part."""
    table = friction_table(Coulomb(0.35, 0.005))
    assert coefficient_over_speed(table, np.nan) == pytest.approx(0.35 / 0.005)
    assert ratio_and_slope(table, np.nan, np.nan) == pytest.approx((0.35 / 0.005,) * 2)


@pytest.mark.parametrize(
    ("unusable", "why"),
    [
        (lambda: Makkar(0.3, 40, 400, 0.1, 800, 0), "out of range"),  # falls below zero
        (lambda: Makkar(0, 0, 0, 0, 0, 0), "out of range"),  # no friction at all
        (lambda: Makkar(0.1, np.nan, 40, 0.35, 800, 0), "gamma2"),
        (lambda: check_friction_law(Stribeck(np.nan, 0.35, 0.004)), "out of range"),
        (lambda: check_friction_law(Stribeck(-1.0, 0.35, 0.004)), "out of range"),
        (lambda: check_friction_law(0.35), "not a friction law"),
    ],
)
def test_unusable_laws_are_input_errors(unusable, why):
    with pytest.raises(InputError, match=why):
        unusable()


class Narrow(Stribeck):
    """A law that has not reached its plateau where it says so."""

    @property
    def speed_range(self):
        return 1e-5 * self.stiction_velocity, 1.5 * self.stiction_velocity


class Kinked(Stribeck):
    """A law that rises along a straight line and then stays."""

    def coefficient(self, speed):
        return self.kinetic * np.minimum(1.0, np.asarray(speed) / self.stiction_velocity)

    def slope(self, speed):
        return np.where(np.asarray(speed) < self.stiction_velocity, self.kinetic / self.stiction_velocity, 0.0)


@pytest.mark.parametrize(("kind", "why"), [(Narrow, "speed_range"), (Kinked, "not smooth enough")])
def test_laws_that_a_table_cannot_hold_are_input_errors(kind, why):
    with pytest.raises(InputError, match=why):
        friction_table(kind(0.42, 0.35, 0.004))
