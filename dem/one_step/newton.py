r"""Proximal point with a semismooth Newton method inside: the polish that reaches 1e-10.

Outer step k: solve the problem of W̄ + αI and q̄ − α x_k, whose solution is x_{k+1}; a smaller α after success, a larger one after failure.
Inner: F = x − P_K(x − ŷ), y = (W̄ + αI) x + q̄ − α x_k. With J ∈ ∂P_K and Q = J(I + μ n tᵀ), t = y_T/‖y_T‖,

    [(I − J) + Q (W̄ + αI)] d = −F ,

steps 1, ½, ¼, 0.1 projected on K, accepted where ‖F‖ falls by a tenth. From a cold start, sweeps of the regularised problem follow each
step; near a solution they would leave it again.

Rockafellar (1976); Alart and Curnier (1991); Acary, Brémond and Huber (2018).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...cache import njit
from .blocks import Blocks
from .linear import BlockSystem
from .monitor import Monitor
from .sweeps import natural_map, product, project, sweep

__all__ = ["polish", "solve_proximal_newton"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]

_INNER = 25  # Newton steps per outer step


def solve_proximal_newton(blocks: Blocks, monitor: Monitor, *, limit: int = 1_000_000) -> None:
    """From 100 sweeps, with sweeps between the Newton steps."""
    x = monitor.best.copy()
    for _ in range(100):
        sweep(blocks.pointer, blocks.column, blocks.value, blocks.place, blocks.q, blocks.mu, x, False)
    monitor.sweeps += 100
    if not monitor(x):
        _solve(blocks, monitor, x, limit, alpha=1e-2, down=0.3, up=5.0, sweeps=3)


def polish(blocks: Blocks, monitor: Monitor, *, limit: int = 40, start: Array | None = None) -> None:
    """Without sweeps, from `start` (default: the best iterate), whose active set should be nearly right; `limit` counts factorisations."""
    _solve(blocks, monitor, monitor.best if start is None else start, limit, alpha=1e-5, down=0.5, up=2.5, sweeps=0)


def _solve(
    blocks: Blocks, monitor: Monitor, x: Array, limit: int, *, alpha: float, down: float, up: float, sweeps: int
) -> None:
    b, n = blocks, len(blocks.mu)
    system, unit = BlockSystem(blocks), np.ones(n)
    value, shifted = np.empty_like(b.value), np.empty_like(b.value)
    residual, y = np.empty((n, 3)), np.empty((n, 3))
    spent, failures = 0, 0
    x = x.copy()
    while spent < limit and failures < 12:
        shifted[:] = b.value
        shifted[b.place] += alpha * np.eye(3)
        q = b.q - alpha * x
        z, first, solved = x.copy(), np.inf, False
        for _ in range(_INNER):
            product(b.pointer, b.column, shifted, q, z, y)
            error = _newton_matrix(b.pointer, b.column, b.value, b.place, b.mu, z, y, alpha, value, residual)
            first = min(first, error) if first == np.inf else first
            if (error <= 1e-2 * first and error < first) or error == 0.0:
                solved = True
                break
            if spent >= limit or monitor.out_of_time:
                break
            try:
                system.factorise(value)
            except np.linalg.LinAlgError:
                break
            spent += 1
            monitor.factorisations += 1
            d = system.solve(residual)
            if not np.all(np.isfinite(d)):
                break
            for step in (1.0, 0.5, 0.25, 0.1):
                trial = z - step * d
                project(trial, b.mu)
                product(b.pointer, b.column, shifted, q, trial, y)
                if natural_map(trial, y, b.mu, unit, residual) <= 0.81 * error:
                    z = trial
                    break
            else:
                if sweeps == 0:
                    break
            for _ in range(sweeps):
                sweep(b.pointer, b.column, shifted, b.place, q, b.mu, z, False)
            monitor.sweeps += sweeps
        before = monitor.error
        if monitor(z):
            return
        if solved:
            alpha, failures, x = max(alpha * down, 1e-15), 0, z
        else:
            alpha, failures = min(alpha * up, 1e2), failures + 1
            if monitor.error < before:
                x = z


@njit
def _newton_matrix(
    pointer: Ints,
    column: Ints,
    value: Array,
    place: Ints,
    mu: Array,
    x: Array,
    y: Array,
    alpha: float,
    out: Array,
    residual: Array,
) -> float:
    """Fill the block values of (I − J) + Q(W̄ + αI) and F; returns ‖F‖²."""
    jac, q = np.empty((3, 3)), np.empty((3, 3))
    squared = 0.0
    for i in range(len(mu)):
        m = mu[i]
        slip = np.sqrt(y[i, 1] ** 2 + y[i, 2] ** 2)
        z0, z1, z2 = x[i, 0] - y[i, 0] - m * slip, x[i, 1] - y[i, 1], x[i, 2] - y[i, 2]
        t = np.sqrt(z1 * z1 + z2 * z2)
        jac[:] = 0.0
        if t <= m * z0:
            jac[0, 0] = jac[1, 1] = jac[2, 2] = 1.0
        elif m * t <= -z0:
            z0 = z1 = z2 = 0.0
        else:
            s1, s2 = z1 / t, z2 / t
            c = 1.0 / (1.0 + m * m)
            along = (z0 + m * t) * c
            jac[0, 0], jac[0, 1], jac[0, 2] = c, c * m * s1, c * m * s2
            for k in range(3):
                jac[1, k], jac[2, k] = m * s1 * jac[0, k], m * s2 * jac[0, k]
            turn = m * along / t
            jac[1, 1] += turn * (1.0 - s1 * s1)
            jac[1, 2] -= turn * s1 * s2
            jac[2, 1] -= turn * s1 * s2
            jac[2, 2] += turn * (1.0 - s2 * s2)
            z0, z1, z2 = along, m * along * s1, m * along * s2
        residual[i, 0], residual[i, 1], residual[i, 2] = x[i, 0] - z0, x[i, 1] - z1, x[i, 2] - z2
        squared += residual[i, 0] ** 2 + residual[i, 1] ** 2 + residual[i, 2] ** 2
        t1, t2 = (y[i, 1] / slip, y[i, 2] / slip) if slip > 0.0 else (0.0, 0.0)
        for a in range(3):
            q[a, 0] = jac[a, 0]
            q[a, 1] = jac[a, 1] + jac[a, 0] * m * t1
            q[a, 2] = jac[a, 2] + jac[a, 0] * m * t2
        for k in range(pointer[i], pointer[i + 1]):
            for a in range(3):
                for e in range(3):
                    out[k, a, e] = q[a, 0] * value[k, 0, e] + q[a, 1] * value[k, 1, e] + q[a, 2] * value[k, 2, e]
        for a in range(3):
            for e in range(3):
                out[place[i], a, e] += alpha * q[a, e] - jac[a, e]
            out[place[i], a, a] += 1.0
    return squared
