"""One step of the stiff integrator for ``q̈ = a(t, q, q̇)`` with three coordinates.

SOURCE: G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia
Differential Equations package", BIT Numerical Mathematics 63 (2023) 27: order 5, error estimate of order 4, eight
stages, stiffly accurate and L-stable, dense output of order 4. Why this method, by measurement: docs/physics.md.

With ``y = (q, q̇)`` the stage equations ``(I/(hγ) − J) k = r`` halve: for J = [[0, I], [K, D]] they are
``(I/(hγ) − D − hγ K) k_v = r_v + hγ K r_q`` and ``k_q = hγ (r_q + k_v)``.
"""

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled

ORDER = 5
STAGES = 8
GAMMA = 0.21193756319429014
NODES = np.array([0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0])
TIME_WEIGHTS = np.array(
    [0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0, 0, 0]
)


def _lower(rows: list[list[float]]) -> Array:
    matrix = np.zeros((STAGES, STAGES))
    for i, row in enumerate(rows):
        matrix[i, : len(row)] = row
    return matrix


_LAST = [-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946]
A = _lower(
    [
        [],
        [3.0],
        [2.849394379747939, 0.45842242204463923],
        [-6.954028509809101, 2.489845061869568, -10.358996098473584],
        [2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641],
        _LAST,
        [*_LAST, 1.0],
        [*_LAST, 1.0, 1.0],
    ]
)
C = _lower([
    [],
    [-14.155112264123755],
    [-17.97296035885952, -2.859693295451294],
    [147.12150275711716, -1.41221402718213, 71.68940251302358],
    [165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306],
    [24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471],
    [30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
     -28.087943162872662],
    [37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
     -54.66780262877968, -9.48861652309627],
])  # fmt: skip
DENSE = np.array([
    [25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
     1.1241088310450404, 0.4272876194431874, -0.17202221070155493],
    [-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
     15.98066361424651, -6.789040303419874, -6.710236069923372],
    [11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
     -59.78993625266729, -0.15582684282751913, 4.883087185713722],
])  # fmt: skip


@compiled(allocates=False, forceinline=True)
def inverse_3(m: Array, out: Array) -> bool:
    """Inverse of a 3 × 3 matrix into ``out``; False where it is singular or not finite."""
    a, b, c, d, e, f, g, h, i = m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2]
    A, B, C_ = e * i - f * h, f * g - d * i, d * h - e * g
    determinant = a * A + b * B + c * C_
    if determinant == 0 or not np.isfinite(determinant):
        return False
    r = 1 / determinant
    out[0, 0], out[0, 1], out[0, 2] = A * r, (c * h - b * i) * r, (b * f - c * e) * r
    out[1, 0], out[1, 1], out[1, 2] = B * r, (a * i - c * g) * r, (c * d - a * f) * r
    out[2, 0], out[2, 1], out[2, 2] = C_ * r, (b * g - a * h) * r, (a * e - b * d) * r
    return True


@compiled(allocates=False, inline="always")
def product_3(m: Array, x: Array | tuple[float, float, float]) -> tuple[float, float, float]:
    """Product of a 3 × 3 matrix with three numbers."""
    return (
        m[0, 0] * x[0] + m[0, 1] * x[1] + m[0, 2] * x[2],
        m[1, 0] * x[0] + m[1, 1] * x[1] + m[1, 2] * x[2],
        m[2, 0] * x[0] + m[2, 1] * x[1] + m[2, 2] * x[2],
    )


@compiled(allocates=False, forceinline=True)
def stage_matrix(h: float, jacobian: Array, inverse: Array, scratch: Array) -> bool:
    """Invert ``I/(hγ) − D − hγ K`` into ``inverse``; ``jacobian`` (3, 6) is [K D]. False where that fails."""
    hg = h * GAMMA
    for i in range(3):
        for j in range(3):
            scratch[i, j] = (1 / hg if i == j else 0.0) - jacobian[i, 3 + j] - hg * jacobian[i, j]
    return inverse_3(scratch, inverse)


@compiled(allocates=False, forceinline=True)
def stage_state(stage: int, y: Array, k: Array, out: Array) -> None:
    """State (6,) of a stage after the first into ``out``, which holds that of the stage before."""
    for i in range(6):
        if stage < 6:
            total = y[i]
            for j in range(stage):
                total += A[stage, j] * k[j, i]
            out[i] = total
        else:
            out[i] += k[stage - 1, i]


@compiled(allocates=False, forceinline=True)
def end_of_step(stage_y: Array, k: Array, weights: Array, out: Array) -> float:
    """State (6,) after a step into ``out``; returns the step's error over the weights (root mean square)."""
    error = 0.0
    for i in range(6):
        out[i] = stage_y[i] + k[STAGES - 1, i]
        ratio = k[STAGES - 1, i] / weights[i]
        error += ratio * ratio
    return math.sqrt(error / 6)


@compiled(allocates=False, forceinline=True)
def solve_stage(
    stage: int, h: float, jacobian: Array, inverse: Array, time_slope: Array, rates: Array, k: Array
) -> None:
    """Turn the rates (6,) of a stage into its increment ``k[stage]``, given those before; ``rates`` is used up."""
    hg = h * GAMMA
    for j in range(stage):
        weight = C[stage, j] / h
        for i in range(6):
            rates[i] += weight * k[j, i]
    weight = h * TIME_WEIGHTS[stage]
    for i in range(3):
        pushed = jacobian[i, 0] * rates[0] + jacobian[i, 1] * rates[1] + jacobian[i, 2] * rates[2]
        rates[3 + i] += weight * time_slope[i] + hg * pushed
    for i in range(3):
        solved = inverse[i, 0] * rates[3] + inverse[i, 1] * rates[4] + inverse[i, 2] * rates[5]
        k[stage, 3 + i] = solved
        k[stage, i] = hg * (rates[i] + solved)


@compiled(allocates=False, forceinline=True)
def dense_output(theta: float, y0: Array, y1: Array, k: Array, out: Array) -> None:
    """State at the fraction ``theta`` of a step, to order 4, into ``out`` (6,)."""
    for i in range(6):
        r0 = r1 = r2 = 0.0
        for j in range(STAGES):
            r0 += DENSE[0, j] * k[j, i]
            r1 += DENSE[1, j] * k[j, i]
            r2 += DENSE[2, j] * k[j, i]
        out[i] = (1 - theta) * y0[i] + theta * (y1[i] + (1 - theta) * (r0 + theta * (r1 + theta * r2)))
