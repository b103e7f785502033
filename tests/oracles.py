"""Numbers and closed forms that were found outside this project, for tests to compare with."""

import numpy as np
from scipy.special import ellipe, ellipk

# Pressure: a square of 0.4 m under N = 49.05 N.
SQUARE_SIDE_M, SQUARE_LOAD_N = 0.4, 49.05
PRESSURE_MAX_PA = {0.05: 536.484375, 0.1: 817.5, 0.15: 1635.0}
"""Largest pressure [Pa] by eccentricity [m] along one side."""
TWO_AXES_PRESSURE_MAX_PA, TWO_AXES_CONTACT_M2 = 782.0412205574, 0.1491052590
"""Load at (0.05, 0.05) m."""

# Friction wrench under a constant coefficient and uniform pressure.
DISK_WRENCH = {
    0.25: (0.24803130976099, 0.63578612360834),
    0.5: (0.48384375563013, 0.5477483547722),
    2.0: (0.96768751126025, 0.12780919828415),
}
"""Force / (μ N) and moment / (μ N R) of a disk by the distance of the centre of rotation over R."""
SQUARE_SPIN_M, RECTANGLE_SPIN_M, SQUARE_CORNER_SPIN_M = 0.15303914329284, 0.19362122002674, 0.30607828658569
"""Moment / (μ N) of 0.4 × 0.4 and 0.6 × 0.4 m turning about the centroid, and of the square about a corner."""
FOUR_CORNERS_OVER_PATCH = 1.848

# Motion.
COAST = {"mu": 0.35, "v0": 0.1, "v_s": 0.01, "t": 0.02}
COAST_SPEED, COAST_DISTANCE, COAST_REST_DISTANCE = 0.031348944194, 0.001313327626, 0.001480194175
DISK_STOP_RATIO = 0.6530017892
"""v / (R ω) with which a uniform sliding and spinning Coulomb disk comes to rest."""
TRACTRIX = {"length": 0.6, "s": 1.0, "theta": 0.373353004869, "object_m": (0.441334234799, -0.218843694889)}
LAP_FINAL_POSE = (0.24350136, -0.30703927, 0.32105829)
"""Centre of the cube [m, m, rad] after a lap of 400 s, to 1e-7."""


def rectangle_pressure(width: float, depth: float, load: float, eccentricity: float) -> float:
    """Largest pressure under a rectangle ``width`` × ``depth``, load off centre along ``depth``, unilateral."""
    if eccentricity <= depth / 6:
        return load / (width * depth) * (1 + 6 * eccentricity / depth)
    return 2 * load / (3 * width * (depth / 2 - eccentricity))


def disk_wrench(ratio: float) -> tuple[float, float]:
    """Force / (μ N) and moment / (μ N R) of a uniform disk whose centre of rotation lies at ``ratio`` R."""
    m = ratio**2 if ratio <= 1 else ratio**-2
    e, k = ellipe(m), ellipk(m)
    if ratio <= 1:
        force = 4 / (3 * np.pi * ratio) * ((1 + m) * e - (1 - m) * k)
        about_centre = 4 / (9 * np.pi) * ((7 + m) * e - 4 * (1 - m) * k)
    else:
        square = ratio**2
        force = 4 / (3 * np.pi) * ((1 + square) * e - (square - 1) * k)
        about_centre = 4 / (9 * np.pi) * ((7 + square) * ratio * e - (square - 1) * (square + 3) * k / ratio)
    return force, about_centre - ratio * force


def rectangle_spin(a: float, b: float) -> float:
    """Mean distance from the centre of a rectangle [m]: moment / (μ N) of its rotation."""
    d = np.hypot(a, b)
    return (d + a**2 / (2 * b) * np.log((b + d) / a) + b**2 / (2 * a) * np.log((a + d) / b)) / 6


def coast_speed(mu: float, v0: float, v_s: float, t: float, gravity: float = 9.81) -> float:
    """Speed of a body sliding freely under μ tanh(v / v_s)."""
    return v_s * np.arcsinh(np.sinh(v0 / v_s) * np.exp(-mu * gravity * t / v_s))
