import numpy as np
import pytest

from towval.model.errors import InputError, RefusedError
from towval.physics.friction_law import coulomb_law, fit_makkar, friction_coefficient

SPECIFICATIONS = [
    (0.396, 0.35, 0.0052, 0.07),
    (0.4, 0.3, 1e-3, 0.05),
    (0.8, 0.2, 0.01, 0.1),
    (0.35001, 0.35, 1e-3, 0.01),
]


@pytest.mark.parametrize("specification", SPECIFICATIONS)
def test_fit_peaks_and_settles_where_asked(specification):
    static, kinetic, stiction, friction = specification
    fit = fit_makkar(*specification)
    speed = np.linspace(0, 5 * friction, 200_001)
    mu = friction_coefficient(fit.law, speed)
    assert fit.residual < 1e-12
    assert mu.max() == pytest.approx(static, rel=1e-8)
    assert speed[mu.argmax()] == pytest.approx(stiction, abs=2 * speed[1])
    settled = friction_coefficient(fit.law, friction)
    assert settled - kinetic == pytest.approx(0.01 * (static - kinetic), rel=1e-6)
    assert (np.diff(mu[mu.argmax() :]) <= 1e-15).all()
    assert mu[-1] == pytest.approx(kinetic, abs=1e-4 * (static - kinetic))


def test_law_with_the_peak_of_the_sample_campaign_is_close_to_the_truth(makkar):
    """The four numbers rounded as a lab would give them: above v_s the curve is known to 0.3 % of μ."""
    fit = fit_makkar(*SPECIFICATIONS[0])
    speed = np.linspace(0.0052, 0.3, 10_001)
    assert np.abs(friction_coefficient(fit.law, speed) - friction_coefficient(makkar, speed)).max() < 1e-3


def test_same_wish_same_law():
    fit_makkar.__globals__["_fit"].cache_clear()
    first = fit_makkar(*SPECIFICATIONS[0]).law.gamma
    fit_makkar.__globals__["_fit"].cache_clear()
    assert (fit_makkar(*SPECIFICATIONS[0]).law.gamma == first).all()


def test_static_equal_to_kinetic_gives_no_peak():
    fit = fit_makkar(0.35, 0.35, 1e-3, 1e-2)
    assert friction_coefficient(fit.law, np.linspace(0, 1, 1001)).max() <= 0.35
    assert friction_coefficient(fit.law, 1e-3) == pytest.approx(0.35, rel=2e-3)


def test_viscous_friction_is_part_of_the_kinetic_value():
    fit = fit_makkar(0.4, 0.35, 0.005, 0.07, viscous=0.5)
    assert friction_coefficient(fit.law, 0.07) == pytest.approx(0.35 + 0.01 * 0.05, rel=1e-9)
    assert fit.law.gamma[5] == 0.5


@pytest.mark.parametrize(
    "specification",
    [
        (0.3, 0.35, 0.005, 0.07),
        (0.4, 0.35, 0.07, 0.07),
        (0.4, 0.35, 0.08, 0.07),
        (-1, 0.3, 0.1, 0.2),
        (0.4, 0.3, np.nan, 1),
    ],
)
def test_contradicting_numbers_are_input_errors(specification):
    with pytest.raises(InputError):
        fit_makkar(*specification)


def test_speeds_too_close_together_are_refused():
    with pytest.raises(RefusedError, match="Makkar"):
        fit_makkar(0.4, 0.3, 0.01, 0.02)


def test_coulomb_law_is_a_tanh():
    speed = np.array([0.0, 1e-3, 0.5])
    assert friction_coefficient(coulomb_law(0.35, 1e-3), speed) == pytest.approx(0.35 * np.tanh(speed / 1e-3))
    with pytest.raises(InputError):
        coulomb_law(0.35, 0.0)
