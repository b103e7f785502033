import numpy as np
import pytest

from studies.comparators.mujoco_loads import (
    CENTRE_HEIGHT_M,
    FOOT_AT_M,
    FOOT_HALF_M,
    FRICTION,
    HALF_M,
    MASS_KG,
    TOWS,
    TowAtHeight,
    load_row,
    program_loads,
)

AHEAD = (0.005, 0.0, 0.0)


def test_loads_of_a_tow_by_hand():
    """Level tether at height h: the centre moves by h T / N, and feet share it by their second moments."""
    height, normal = 0.1, MASS_KG * 9.81
    pull = FRICTION * normal
    found, moments, loads = program_loads(TowAtHeight(True, height, height), [pull, 0.0, 0.0], 0.0, AHEAD)
    assert found == pytest.approx(normal, rel=1e-12)
    np.testing.assert_allclose(moments, [height * pull, 0.0], atol=1e-9)
    second = FOOT_AT_M**2 + FOOT_HALF_M**2 / 3
    expected = normal / 4 + np.array([-1, -1, 1, 1]) * height * pull * FOOT_AT_M / (4 * second)
    np.testing.assert_allclose(loads, expected, rtol=1e-9)


def test_an_inclined_tether_lifts_and_a_slope_shifts_by_hand():
    normal = MASS_KG * 9.81 - 4.0
    found, moments, _ = program_loads(TowAtHeight(False, 0.0, 0.3), [FRICTION * normal, 0.0, 4.0], 0.0, AHEAD)
    assert found == pytest.approx(normal, rel=1e-12)
    assert moments[0] == pytest.approx(-4.0 * HALF_M, rel=1e-9)
    # The floor rises along x; a block that heads along y and is drawn there has downhill on its left.
    normal = MASS_KG * 9.81 / np.hypot(1, 0.05)
    tow = TowAtHeight(False, 0.0, 0.0, slope=(0.05, 0.0))
    found, moments, _ = program_loads(tow, [FRICTION * normal, -0.05 * normal, 0.0], np.pi / 2, AHEAD)
    assert found == pytest.approx(normal, rel=1e-12)
    np.testing.assert_allclose(moments, [0.0, CENTRE_HEIGHT_M * 0.05 * normal], atol=1e-9)


@pytest.mark.parametrize("feet", [False, True])
@pytest.mark.parametrize("name", ["straight, inclined tether", "straight, level tether at 25 cm"])
def test_loads_agree_with_an_engine_in_three_dimensions(feet, name):
    """1 % of the normal force, where leaving out the heights would miss the centre by 10 to 44 %."""
    pytest.importorskip("mujoco", reason="an optional peer to compare with: pip install 'towval[bench]'")
    row = load_row(TowAtHeight(feet, **TOWS[name]))
    assert row["transfer"] > 0.08
    assert row["normal"] < 0.01
    assert row["centre"] < 0.01
    if feet:
        assert row["feet"] < 0.01
