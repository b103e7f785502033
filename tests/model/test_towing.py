"""Checks of the towed object's types: what each refuses, and that every effect is off where nothing is given."""

import numpy as np
import pytest

from towval.model import FloorRegion, Ground, Patch, Sliding, Tether, TowedObject
from towval.model.errors import InputError
from towval.physics.friction_laws import Coulomb

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def test_patch_of_several_outlines_keeps_them_all():
    second = np.array(SQUARE) + np.array([3.0, 0.0])
    patch = Patch.of([SQUARE, second])
    assert [len(ring) for ring in patch.outlines] == [4, 4]
    assert np.ptp(patch.corners, axis=0) == pytest.approx([4.0, 1.0])
    assert Patch(SQUARE).outlines[0] == pytest.approx(np.array(SQUARE))


@pytest.mark.parametrize(
    "build",
    [
        lambda: Patch.of([]),
        lambda: Patch.of([SQUARE, SQUARE[:2]]),
        lambda: Patch(SQUARE, further=(((0.0, 0.0), (1.0, np.nan), (1.0, 1.0)),)),
        lambda: Tether(0.6, 900.0, stiffening=0.3),
        lambda: Tether(0.6, 900.0, stiffening=1.0, full_load=20.0),
        lambda: Tether(0.6, 900.0, mass_per_length=-0.1),
        lambda: FloorRegion(SQUARE, 0.0),
        lambda: FloorRegion(SQUARE[:2], 1.1),
        lambda: Ground(gravity=0.0),
        lambda: Ground(slope=(0.8, 0.8)),
        lambda: Ground(slope=(0.1,)),
        lambda: Ground(regions=("wet",)),
        lambda: Sliding("coulomb"),
        lambda: Sliding(Coulomb(0.35, 1e-3), across_over_along=0.0),
        lambda: Sliding(Coulomb(0.35, 1e-3), radius_over_planar=-1.0),
        lambda: TowedObject(Patch(SQUARE), 1.0, (0.5, 0.5), 0.1, (1.0, 0.5), anchor_height=-0.01),
        lambda: TowedObject(Patch(SQUARE), 1.0, (0.5, 0.5), 0.1, (1.0, 0.5), centre_of_mass_height=np.nan),
    ],
)
def test_what_no_lab_has_is_refused(build):
    with pytest.raises(InputError):
        build()


def test_without_more_keys_every_effect_is_off():
    ground, sliding, tether = Ground(), Sliding(Coulomb(0.35, 1e-3)), Tether(0.6, 900.0)
    assert (ground.gravity, ground.slope.tolist(), ground.regions) == (9.81, [0.0, 0.0], ())
    assert (sliding.across_over_along, sliding.radius_over_planar) == (1.0, 1.0)
    assert (tether.damping, tether.stiffening, tether.mass_per_length) == (0.0, 0.0, 0.0)
