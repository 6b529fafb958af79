r"""Non-linear Gauss–Seidel on the Delassus form, with the exact local solve: the compiled sweeps and the residual of the scaled problem.

Jean (1999), CMAME 177, 235–257.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...cache import njit
from .local import solve_contact

__all__ = ["natural_map", "product", "project", "sweep"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


@njit
def sweep(
    pointer: Ints, column: Ints, value: Array, place: Ints, q: Array, mu: Array, x: Array, backward: bool
) -> float:
    """One sweep over all contacts, `x` (n, 3) in place; returns the squared change."""
    change = 0.0
    n = len(mu)
    new = np.empty(3)
    for at in range(n):
        i = n - 1 - at if backward else at
        g0, g1, g2 = q[i, 0], q[i, 1], q[i, 2]
        for k in range(pointer[i], pointer[i + 1]):
            j = column[k]
            if j != i:
                x0, x1, x2 = x[j, 0], x[j, 1], x[j, 2]
                g0 += value[k, 0, 0] * x0 + value[k, 0, 1] * x1 + value[k, 0, 2] * x2
                g1 += value[k, 1, 0] * x0 + value[k, 1, 1] * x1 + value[k, 1, 2] * x2
                g2 += value[k, 2, 0] * x0 + value[k, 2, 1] * x1 + value[k, 2, 2] * x2
        solve_contact(value[place[i]], g0, g1, g2, mu[i], new)
        for s in range(3):
            change += (new[s] - x[i, s]) ** 2
            x[i, s] = new[s]
    return change


@njit
def product(pointer: Ints, column: Ints, value: Array, q: Array, x: Array, out: Array) -> None:
    """out = W̄ x + q̄, shape (n, 3)."""
    for i in range(q.shape[0]):
        g0, g1, g2 = q[i, 0], q[i, 1], q[i, 2]
        for k in range(pointer[i], pointer[i + 1]):
            j = column[k]
            x0, x1, x2 = x[j, 0], x[j, 1], x[j, 2]
            g0 += value[k, 0, 0] * x0 + value[k, 0, 1] * x1 + value[k, 0, 2] * x2
            g1 += value[k, 1, 0] * x0 + value[k, 1, 1] * x1 + value[k, 1, 2] * x2
            g2 += value[k, 2, 0] * x0 + value[k, 2, 1] * x1 + value[k, 2, 2] * x2
        out[i, 0], out[i, 1], out[i, 2] = g0, g1, g2


@njit
def project(x: Array, mu: Array) -> None:
    """Project x (n, 3) on K in place."""
    for i in range(x.shape[0]):
        t = np.sqrt(x[i, 1] ** 2 + x[i, 2] ** 2)
        if t > mu[i] * x[i, 0]:
            along = (x[i, 0] + mu[i] * t) / (1.0 + mu[i] * mu[i])
            if along <= 0.0:
                x[i, 0] = x[i, 1] = x[i, 2] = 0.0
            else:
                x[i, 0] = along
                x[i, 1] *= mu[i] * along / t
                x[i, 2] *= mu[i] * along / t


@njit
def natural_map(x: Array, y: Array, mu: Array, rho: Array, out: Array) -> float:
    """out = x − P_K(x − ρ (y + μ‖y_T‖ n)) for y = W̄ x + q̄; returns the squared norm."""
    squared = 0.0
    for i in range(x.shape[0]):
        slip = np.sqrt(y[i, 1] ** 2 + y[i, 2] ** 2)
        z0 = x[i, 0] - rho[i] * (y[i, 0] + mu[i] * slip)
        z1 = x[i, 1] - rho[i] * y[i, 1]
        z2 = x[i, 2] - rho[i] * y[i, 2]
        t = np.sqrt(z1 * z1 + z2 * z2)
        if t > mu[i] * z0:
            along = (z0 + mu[i] * t) / (1.0 + mu[i] * mu[i])
            if along <= 0.0:
                z0 = z1 = z2 = 0.0
            else:
                z0 = along
                z1 *= mu[i] * along / t
                z2 *= mu[i] * along / t
        out[i, 0], out[i, 1], out[i, 2] = x[i, 0] - z0, x[i, 1] - z1, x[i, 2] - z2
        squared += out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2
    return squared
