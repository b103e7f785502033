import numpy as np
from numba import njit

from towval.physics.lanes import lanes, load_lanes, multiply, multiply_add, unpacked


@njit
def products(array, a, b):
    first, second = load_lanes(array, np.uint64(1)), lanes(a, b, a, b)
    return unpacked(multiply(first, second)), unpacked(multiply_add(first, second, first))


def test_lanes_are_four_floats_each_by_itself():
    array = np.array([9.0, 1.0, 2.0, 3.0, 4.0, 9.0])
    product, sum_ = products(array, 10.0, -1.0)
    assert product == (10.0, -2.0, 30.0, -4.0)
    assert sum_ == (11.0, 0.0, 33.0, 0.0)
