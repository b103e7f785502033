"""Alignment against the noise bound, on picture pairs of known displacement that nobody here made."""

import pytest

from studies.real.displaced_windows import RIGID, rigid_errors, star_errors

pytestmark = pytest.mark.shared


@pytest.fixture
def pairs(shared_dir):
    folder = shared_dir / "real" / "dic"
    if not folder.is_dir():
        pytest.skip(f"no picture pairs at {folder}")
    return folder


def test_windows_of_noisy_speckle_are_at_the_bound(pairs):
    found, bound = star_errors(pairs, 31)
    assert len(found.errors) == found.windows
    assert found.scatter <= 1.2 * bound
    assert found.bias <= 0.002
    assert found.scatter / 1.3 <= found.stated_std <= 1.3 * found.scatter


@pytest.mark.parametrize("name", RIGID)
def test_rigid_shifts_are_not_biased(pairs, name):
    found = rigid_errors(pairs, name)
    assert len(found.errors) == found.windows
    assert found.bias <= 0.002
    assert found.scatter <= 0.001
