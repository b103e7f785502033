"""Friction wrenches by brute-force quadrature, for the tests of the boundary integral."""

import itertools

import numpy as np


def reference_wrench(contact, law, twist, order=40, levels=12):
    """High-order quadrature that shares nothing with the module: polar panels about the centre of rotation.

    Each triangle of a triangulation is cut into the signed triangles that C spans with its sides; on those the radius
    is integrated from C by Gauss panels graded towards C, the side by Gauss panels graded towards the foot of C.
    """
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    grade = np.concatenate([[0.0], 4.0 ** np.arange(-levels, 1)])
    radial = np.concatenate([a + (b - a) * x for a, b in itertools.pairwise(grade)])
    radial_weight = np.concatenate([(b - a) * w for a, b in itertools.pairwise(grade)])
    vx, vy, omega = twist
    centre = np.array([-vy, vx]) / omega
    total = np.zeros(3)
    for x0, y0, x1, y1 in contact.edges:
        a, b = np.array([x0, y0]) - centre, np.array([x1, y1]) - centre
        side, length = b - a, np.hypot(*(b - a))
        foot = np.clip(-(a @ side) / length**2, 0, 1)
        cuts = [0.0, 1.0, foot]
        for g in grade[1:]:
            cuts += [foot - g * foot, foot + g * (1 - foot)]
        cuts = np.unique(cuts)
        for u0, u1 in itertools.pairwise(cuts):
            u, wu = u0 + (u1 - u0) * x, (u1 - u0) * w
            rays = a + u[:, None] * side
            s = rays[:, None, :] * radial[None, :, None]
            jacobian = (rays[:, 0] * side[1] - rays[:, 1] * side[0])[:, None] * radial[None, :]
            weight = wu[:, None] * radial_weight[None, :] * jacobian
            rho = np.hypot(s[..., 0], s[..., 1])
            place = s + centre
            pressure = place @ contact.coefficients[:2] + contact.coefficients[2]
            force = -np.sign(omega) * weight * pressure * law.coefficient(abs(omega) * rho)
            with np.errstate(invalid="ignore", divide="ignore"):
                direction = np.where(rho[..., None] > 0, np.stack([-s[..., 1], s[..., 0]], -1) / rho[..., None], 0.0)
            fx, fy = force * direction[..., 0], force * direction[..., 1]
            total += [fx.sum(), fy.sum(), (place[..., 0] * fy - place[..., 1] * fx).sum()]
    return total
