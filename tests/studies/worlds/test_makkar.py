import numpy as np
import pytest

from studies.worlds.makkar import makkar_coefficients
from studies.worlds.towed_runs import synthetic_run
from towval.physics.friction_laws.makkar import fit_specification


@pytest.mark.parametrize("seed", range(0, 60, 5))
def test_the_program_fits_the_law_that_its_definition_gives(seed):
    specification = synthetic_run(seed).scene.friction
    assert fit_specification(specification).law.gamma == pytest.approx(makkar_coefficients(specification), rel=1e-9)


def test_the_law_meets_what_is_stated():
    specification = synthetic_run(3).scene.friction
    g1, g2, g3, g4, g5, _ = makkar_coefficients(specification)
    v = np.linspace(0, 1, 200_001)
    mu = g1 * (np.tanh(g2 * v) - np.tanh(g3 * v)) + g4 * np.tanh(g5 * v)
    assert mu.max() == pytest.approx(specification.static)
    assert v[mu.argmax()] == pytest.approx(specification.stiction_velocity, abs=1e-5)
    assert mu[-1] == pytest.approx(specification.kinetic)
