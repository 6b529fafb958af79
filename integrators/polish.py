"""Polish an approximate solution of a conic program: proximal augmented Lagrangian with semismooth Newton, dense.

    min ½ xᵀPx + qᵀx   subject to   b − A x ∈ K,   K = {0} × orthant × second-order × semidefinite cones,

with multipliers z ∈ K*. At fixed z the inner problem, strongly convex by a proximal term, has the Newton matrix P + τ AᵀVA + ρ 𝕀,
V an element of the generalised Jacobian of the projection on K*: positive definite at vertices and on redundant constraints alike. No
active set is guessed. An interior point stops at about the square root of its gap from a degenerate optimum; this stops at rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["ConeSizes", "Program", "natural_map", "polish"]

Array = NDArray[np.float64]
ROOT = np.sqrt(2.0)
PROXIMAL = 1e-6


@dataclass(frozen=True)
class ConeSizes:
    """Rows of A by cone, in this order: equalities, inequalities, second-order cones, orders of semidefinite cones."""

    zero: int
    nonneg: int
    second_order: Sequence[int] = ()
    semidefinite: Sequence[int] = ()


@dataclass(frozen=True)
class Program:
    """Data of the program, dense; semidefinite rows hold the upper triangle by columns, off-diagonal entries times √2."""

    P: Array
    q: Array
    A: Array
    b: Array
    cones: ConeSizes

    def gradient(self, x: Array, z: Array) -> Array:
        """Px + q + Aᵀz."""
        return self.P @ x + self.q + self.A.T @ z


def _second_order(w: Array) -> tuple[Array, Array]:
    t, v = w[0], w[1:]
    size = float(np.linalg.norm(v))
    n = w.size
    if size <= t:
        return w, np.eye(n)
    if size <= -t:
        return np.zeros(n), np.zeros((n, n))
    u = v / size
    half = 0.5 * (t + size)
    jacobian = np.empty((n, n))
    jacobian[0, 0] = 0.5
    jacobian[0, 1:] = jacobian[1:, 0] = 0.5 * u
    jacobian[1:, 1:] = (half / size) * np.eye(n - 1) + (0.5 - half / size) * np.outer(u, u)
    return np.concatenate([[half], half * u]), jacobian


def _semidefinite(w: Array, order: int) -> tuple[Array, Array]:
    columns, rows = np.tril_indices(order)  # the upper triangle by columns
    scale = np.where(rows == columns, 1.0, ROOT)
    matrix = np.zeros((order, order))
    matrix[rows, columns] = matrix[columns, rows] = w / scale
    values, vectors = np.linalg.eigh(matrix)
    positive = np.maximum(values, 0.0)
    projected = ((vectors * positive) @ vectors.T)[rows, columns] * scale
    jacobian = np.zeros((w.size, w.size))
    for i in range(order):
        for j in range(i + 1):
            gap = values[i] - values[j]
            theta = (positive[i] - positive[j]) / gap if gap > 1e-14 * abs(values).max() else float(values[i] > 0)
            dyad = np.outer(vectors[:, i], vectors[:, j])
            dyad = (dyad + dyad.T) * (0.5 if i == j else 1 / ROOT)
            entries = dyad[rows, columns] * scale
            jacobian += theta * np.outer(entries, entries)
    return projected, jacobian


def _project(w: Array, cones: ConeSizes) -> tuple[Array, Array]:
    """Projection on the dual cone, and an element of its Jacobian."""
    out, jacobian = w.copy(), np.zeros((w.size, w.size))
    start = cones.zero
    jacobian[:start, :start] = np.eye(start)
    stop = start + cones.nonneg
    out[start:stop] = np.maximum(w[start:stop], 0.0)
    jacobian[range(start, stop), range(start, stop)] = w[start:stop] > 0
    blocks: list[tuple[int, Any]] = [(n, _second_order) for n in cones.second_order]
    blocks += [(n * (n + 1) // 2, lambda part, n=n: _semidefinite(part, n)) for n in cones.semidefinite]
    for length, project in blocks:
        place = slice(stop, stop + length)
        out[place], jacobian[place, place] = project(w[place])
        stop += length
    return out, jacobian


def natural_map(program: Program, x: Array, z: Array) -> float:
    """Largest entry of (Px + q + Aᵀz, z − Π(z + Ax − b)): zero at a solution and nowhere else."""
    feasible = z - _project(z + program.A @ x - program.b, program.cones)[0]
    return max(float(np.abs(program.gradient(x, z)).max(initial=0.0)), float(np.abs(feasible).max(initial=0.0)))


def polish(program: Program, x: Array, z: Array, *, goal: float = 1e-13, turns: int = 20) -> tuple[Array, Array, float]:
    """Better (x, z) and its natural map; never a worse one. `x` and `z` are any start, best an interior point's answer.

    `goal` is relative to the largest entry of x, z and the data, where that exceeds 1.
    """
    best = (x, _project(z, program.cones)[0], np.inf)
    best = (x, best[1], natural_map(program, *best[:2]))
    tau, stalled = 1e3, 0
    for _ in range(turns):
        scale = max(1.0, *(float(np.abs(v).max(initial=0.0)) for v in (best[0], best[1], program.q, program.b)))
        if best[2] <= goal * scale or stalled > 4:
            break
        x = _inner(program, best[0], best[1], tau, max(1e-15 * scale, 1e-3 * best[2]))
        z = _project(best[1] + tau * (program.A @ x - program.b), program.cones)[0]
        residual = natural_map(program, x, z)
        stalled = stalled + 1 if not residual < 0.5 * best[2] else 0
        if residual < best[2]:
            # slow and still falling: a stiffer penalty; its rounding, if too stiff, shows as a growing residual below
            tau = min(10 * tau, 1e6) if residual > 0.1 * best[2] else tau
            best = (x, z, residual)
        else:
            tau *= 0.1
    return best


def _inner(program: Program, x0: Array, z: Array, tau: float, tolerance: float) -> Array:
    """Minimise the augmented Lagrangian at multipliers z, with the proximal term about x0, by Newton with backtracking."""

    def level(x: Array) -> tuple[float, Array, Array]:
        w, jacobian = _project(z + tau * (program.A @ x - program.b), program.cones)
        step = x - x0
        value = 0.5 * x @ program.P @ x + program.q @ x + 0.5 * (w @ w) / tau + 0.5 * PROXIMAL * step @ step
        return float(value), program.gradient(x, w) + PROXIMAL * step, jacobian

    x = x0
    value, slope, jacobian = level(x)
    for _ in range(30):
        size = float(np.abs(slope).max(initial=0.0))
        if size <= tolerance:
            break
        matrix = program.P + tau * program.A.T @ (jacobian @ program.A) + PROXIMAL * np.eye(x.size)
        direction = -np.linalg.solve(matrix, slope)
        factor = 1.0
        while factor > 1e-3:
            new = level(x + factor * direction)
            # near the minimum the value is flat to rounding; there the slope decides
            if new[0] < value + 1e-4 * factor * (slope @ direction) or float(np.abs(new[1]).max()) < 0.9 * size:
                break
            factor *= 0.5
        else:
            break
        x = x + factor * direction
        value, slope, jacobian = new
    return x
