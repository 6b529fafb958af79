"""The general engine: a small cone program at every point, compiled once per machine; sizes and cones are run-time data.

    min ½ yᵀ diag(p) y + qᵀy + Σ g(s)   over   s = h − G y ∈ K,    0 ≤ p ≤ 1,    q = q₀ + q₁ d,   h = h₀ + h₁ d,

with scalar convex terms g (see `scalar_terms`) of single entries of s,

d the data of the point (strain, old state, …). Proximal augmented Lagrangian: at multipliers λ ∈ K* the inner problem

    min_y ½ yᵀ diag(p) y + qᵀy + (1/2τ) ‖Π_{K*}(λ + τ(Gy − h))‖² + ½ ρ ‖y − y₀‖²

is strongly convex and C^{1,1}; its Newton matrix diag(p + ρ) + τ GᵀVG, V an element of the generalised Jacobian of the projection, is
positive definite at apex, corner and on redundant constraints alike. The program is positively homogeneous of degree one in (q, h), so
each point is brought to unit size first. The tangent differentiates the optimality system with the same V, iterated with the same
matrix, so that stress and tangent never disagree about the region (Rockafellar 1976; Sun & Sun 2002 for semismoothness).
"""

from __future__ import annotations

import math

import numpy as np

from ..cache import njit
from .cone_projection import ORTHANT, SECOND_ORDER, SEMIDEFINITE, project
from .key import files_hash
from .scalar_terms import POWER_TERM, proximal_step, scaled_term

__all__ = ["CONVERGED", "ITERATION_LIMIT", "NOT_FINITE", "ROUNDING", "solve_points"]

CONVERGED, ROUNDING, ITERATION_LIMIT, NOT_FINITE = range(4)

_FOLDER = files_hash("cone_projection.py", "general.py", "scalar_terms.py", "spectral.py")
_EPS = 2.220446049250313e-16


@njit(folder=_FOLDER)
def _factor(matrix, n):
    """Cholesky factor in the lower triangle, in place; a pivot lost to rounding is replaced by a large one (its unknown stays)."""
    for j in range(n):
        value = matrix[j, j]
        diagonal = value
        for k in range(j):
            value -= matrix[j, k] * matrix[j, k]
        if not value > 1e-15 * diagonal:
            value = 1e15 * max(diagonal, 1e-300)
        root = math.sqrt(value)
        matrix[j, j] = root
        for i in range(j + 1, n):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / root


@njit(folder=_FOLDER)
def _substitute(matrix, right, n):
    """Solve with the factor, in place."""
    for i in range(n):
        value = right[i]
        for k in range(i):
            value -= matrix[i, k] * right[k]
        right[i] = value / matrix[i, i]
    for i in range(n - 1, -1, -1):
        value = right[i]
        for k in range(i + 1, n):
            value -= matrix[k, i] * right[k]
        right[i] = value / matrix[i, i]


@njit(folder=_FOLDER)
def _project_all(kinds, starts, sizes, alphas, betas, tau, v, out, jacobians, marks, work):
    """Π_{K*}(v) cone by cone, the proximal step for scalar terms; Jacobians are marked 0, 1 or mixed (2, then in jacobians[b]).

    Returns the sum of the scalar terms.
    """
    total = 0.0
    for b in range(kinds.size):
        if kinds[b] >= POWER_TERM:
            out[starts[b]], jacobians[b, 0, 0], value = proximal_step(kinds[b], alphas[b], betas[b], v[starts[b]], tau)
            marks[b] = 2
            total += value
        elif kinds[b] == ORTHANT:
            for i in range(starts[b], starts[b] + sizes[b]):
                out[i] = v[i] if v[i] > 0.0 else 0.0
            marks[b] = 2
        else:
            marks[b] = project(kinds[b], alphas[b], v, starts[b], sizes[b], out, jacobians[b], work)
    return total


@njit(folder=_FOLDER)
def _apply_jacobian(kinds, starts, sizes, v, jacobians, marks, given, out):
    """out = V given."""
    for b in range(kinds.size):
        s, length = starts[b], sizes[b]
        if kinds[b] == ORTHANT:
            for i in range(s, s + length):
                out[i] = given[i] if v[i] > 0.0 else 0.0
        elif marks[b] == 0:
            for i in range(s, s + length):
                out[i] = 0.0
        elif marks[b] == 1:
            for i in range(s, s + length):
                out[i] = given[i]
        else:
            for i in range(length):
                value = 0.0
                for j in range(length):
                    value += jacobians[b, i, j] * given[s + j]
                out[s + i] = value


@njit(folder=_FOLDER)
def _newton_matrix(p, rho, tau, G, kinds, starts, sizes, v, jacobians, marks, matrix, product):
    """diag(p + ρ) + τ GᵀVG, lower triangle."""
    n = p.size
    for i in range(n):
        for j in range(i):
            matrix[i, j] = 0.0
        matrix[i, i] = p[i] + (rho if p[i] < 0.5 else 0.0)
    for b in range(kinds.size):
        s, length = starts[b], sizes[b]
        if kinds[b] == ORTHANT:
            for r in range(s, s + length):
                if v[r] > 0.0:
                    for i in range(n):
                        factor = tau * G[r, i]
                        if factor != 0.0:
                            for j in range(i + 1):
                                matrix[i, j] += factor * G[r, j]
        elif marks[b] == 1:
            for r in range(s, s + length):
                for i in range(n):
                    factor = tau * G[r, i]
                    if factor != 0.0:
                        for j in range(i + 1):
                            matrix[i, j] += factor * G[r, j]
        elif marks[b] == 2:
            for r in range(length):
                for j in range(n):
                    value = 0.0
                    for k in range(length):
                        value += jacobians[b, r, k] * G[s + k, j]
                    product[j] = tau * value
                for i in range(n):
                    factor = G[s + r, i]
                    if factor != 0.0:
                        for j in range(i + 1):
                            matrix[i, j] += factor * product[j]


@njit(folder=_FOLDER)
def _level(p, q, G, h, y, y0, lam, rho, tau, kinds, starts, sizes, alphas, betas, v, w, jacobians, marks, slope, work):
    """Value and slope of the inner problem at y; w = Π_{K*}(λ + τ(Gy − h)). Returns (value, largest entry of the slope)."""
    n, m = p.size, h.size
    for r in range(m):
        value = -h[r]
        for j in range(n):
            value += G[r, j] * y[j]
        v[r] = lam[r] + tau * value
    terms = _project_all(kinds, starts, sizes, alphas, betas, tau, v, w, jacobians, marks, work)
    total = 0.0
    for r in range(m):
        total += w[r] * w[r]
    total = 0.5 * total / tau + terms
    for i in range(n):
        step = y[i] - y0[i] if p[i] < 0.5 else 0.0
        total += y[i] * (0.5 * p[i] * y[i] + q[i]) + 0.5 * rho * step * step
        slope[i] = p[i] * y[i] + q[i] + rho * step
    for r in range(m):
        if w[r] != 0.0:
            for i in range(n):
                slope[i] += G[r, i] * w[r]
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(slope[i]))
        if slope[i] != slope[i]:
            return math.inf, math.inf
    return total, largest


@njit(folder=_FOLDER)
def _solve_point(
    p, G, q, h, kinds, starts, sizes, alphas, betas, y, lam, tolerance, tau, limit,
    y0, trial, v, w, slope, direction, jacobians, marks, matrix, product, work,
):  # fmt: skip
    """Solve one program of unit size from (y, λ), in place. Returns (status, residual, Newton steps, τ, ρ of the last matrix)."""
    n, m = p.size, h.size
    steps, stalled = 0, 0
    best = math.inf
    # λ must lie in K*; multipliers of scalar terms may have any value
    for r in range(m):
        v[r] = lam[r]
    _project_all(kinds, starts, sizes, alphas, betas, tau, v, w, jacobians, marks, work)
    for b in range(kinds.size):
        if kinds[b] < POWER_TERM:
            for r in range(starts[b], starts[b] + sizes[b]):
                lam[r] = w[r]
    inner = 1e-2
    status, residual = ITERATION_LIMIT, math.inf
    rho = 1e-3
    # powers and exponentials are flat where they do not act: only a stiff penalty sees them
    highest = 1e5
    for b in range(kinds.size):
        if kinds[b] > SEMIDEFINITE:
            highest = 1e11
    for _turn in range(60):
        for i in range(n):
            y0[i] = y[i]
        value, size = _level(
            p, q, G, h, y, y0, lam, rho, tau, kinds, starts, sizes, alphas, betas, v, w, jacobians, marks, slope, work
        )
        for _ in range(limit):
            if size <= inner:
                break
            _newton_matrix(p, rho, tau, G, kinds, starts, sizes, v, jacobians, marks, matrix, product)
            _factor(matrix, n)
            along = 0.0
            for i in range(n):
                direction[i] = -slope[i]
            _substitute(matrix, direction, n)
            for i in range(n):
                along += slope[i] * direction[i]
            steps += 1
            factor, taken = 1.0, False
            before, size_before = value, size
            while factor > 1e-9:
                for i in range(n):
                    trial[i] = y[i] + factor * direction[i]
                value, size = _level(
                    p,
                    q,
                    G,
                    h,
                    trial,
                    y0,
                    lam,
                    rho,
                    tau,
                    kinds,
                    starts,
                    sizes,
                    alphas,
                    betas,
                    v,
                    w,
                    jacobians,
                    marks,
                    slope,
                    work,
                )
                # near the minimum the value is flat to rounding; there the slope decides
                if value <= before + 1e-4 * factor * along or size <= 0.9 * size_before:
                    taken = True
                    break
                factor *= 0.5
            if not taken:
                value, size = _level(
                    p,
                    q,
                    G,
                    h,
                    y,
                    y0,
                    lam,
                    rho,
                    tau,
                    kinds,
                    starts,
                    sizes,
                    alphas,
                    betas,
                    v,
                    w,
                    jacobians,
                    marks,
                    slope,
                    work,
                )
                break
            for i in range(n):
                y[i] = trial[i]
        # residuals at (y, w): stationarity without the proximal term, and feasibility with complementarity |w − λ|/τ
        stationary, feasible, scale, reach = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            step = rho * (y[i] - y0[i]) if p[i] < 0.5 else 0.0
            stationary = max(stationary, abs(slope[i] - step))
            reach = max(reach, abs(y[i]))
        for r in range(m):
            feasible = max(feasible, abs(w[r] - lam[r]) / tau)
            scale = max(scale, abs(w[r]))
            lam[r] = w[r]
        scale = max(scale, reach)
        residual = max(stationary, feasible)
        if not residual < math.inf:
            return NOT_FINITE, residual, steps, tau, rho
        if residual <= tolerance * min(scale, 1.0):
            status = CONVERGED
            break
        if residual <= 8.0 * _EPS * (1.0 + scale) or (stalled >= 3 and best <= 64.0 * _EPS * (1.0 + scale)):
            status = ROUNDING
            break
        stalled = stalled + 1 if residual > 0.5 * best else 0
        if stalled > 8:
            break
        # rounding of Gy − h reaches the multipliers τ times enlarged: no residual below it can be asked of this penalty
        noise = 4.0 * _EPS * (1.0 + scale + tau * reach)
        if residual <= 8.0 * noise and tau > 1.0:
            tau = max(0.01 * tau, 1.0)
        elif residual > 0.05 * best or residual > 1e-3:
            tau = min(10.0 * tau, highest)
            rho = max(0.1 * rho, 1e-7)
        best = min(best, residual)
        inner = max(min(0.1 * residual, 1e-2), 4.0 * _EPS * (1.0 + scale + tau * reach))
    return status, residual, steps, tau, rho


@njit(folder=_FOLDER)
def _tangent(
    p, G, q1, h1, C, kinds, starts, sizes, tau, rho, lam, v, jacobians, marks, matrix, product, right, dy, dy0, dl, a, b, out,
):  # fmt: skip
    """∂²W/∂ε² = C + q₁ᵀ dy/dε − h₁ᵀ dλ/dε; (dy, dλ) solve the linearised program by the same proximal iteration."""
    n, m = p.size, lam.size
    for c in range(6):
        for i in range(n):
            dy[i] = 0.0
        for r in range(m):
            dl[r] = 0.0
        goal = 1e-300
        for i in range(n):
            goal = max(goal, abs(q1[i, c]))
        for r in range(m):
            goal = max(goal, abs(h1[r, c]))
        for _ in range(40):
            # M dy = −q₁ + ρ dy₀ − GᵀV(dλ − τ h₁)
            for r in range(m):
                a[r] = dl[r] - tau * h1[r, c]
            _apply_jacobian(kinds, starts, sizes, v, jacobians, marks, a, b)
            for i in range(n):
                dy0[i] = dy[i]
                right[i] = -q1[i, c] + (rho * dy[i] if p[i] < 0.5 else 0.0)
            for r in range(m):
                if b[r] != 0.0:
                    for i in range(n):
                        right[i] -= G[r, i] * b[r]
            _substitute(matrix, right, n)
            change = 0.0
            for i in range(n):
                dy[i] = right[i]
                if p[i] < 0.5:
                    change = max(change, rho * abs(dy[i] - dy0[i]))
            for r in range(m):
                value = -h1[r, c]
                for j in range(n):
                    value += G[r, j] * dy[j]
                a[r] = dl[r] + tau * value
            _apply_jacobian(kinds, starts, sizes, v, jacobians, marks, a, b)
            for r in range(m):
                change = max(change, abs(b[r] - dl[r]) / tau)
                dl[r] = b[r]
            if change <= 1e-13 * goal:
                break
        for i in range(6):
            value = C[i, c]
            for k in range(n):
                value += q1[k, i] * dy[k]
            for r in range(m):
                value -= h1[r, i] * dl[r]
            out[i, c] = value


@njit(folder=_FOLDER)
def solve_points(
    p, G, q0, q1, h0, h1, C, c1, kinds, starts, sizes, alphas, betas, data, warm, y_all, l_all,
    slopes, tangents, want_tangent, residuals, statuses, counts, tolerance, tau_start, limit,
):  # fmt: skip
    """The program at every row d of `data` (N, D).

    `y_all` (N, n), `l_all` (N, m) take the solutions and hold the start where `warm`; `slopes` (N, D) takes ∂W/∂d = C d + c₁ + q₁ᵀy − h₁ᵀλ,
    `tangents` (N, 6, 6) its derivative by the first six data. `residuals` are relative to the size of (q, h).
    """
    n, m, width = p.size, h0.size, data.shape[1]
    largest = 6
    for b in range(kinds.size):
        largest = max(largest, sizes[b] if kinds[b] == SECOND_ORDER else 6)
    jacobians = np.zeros((kinds.size, largest, largest))
    marks = np.zeros(kinds.size, dtype=np.int64)
    shapes, scales = np.zeros((2, kinds.size))
    y, y0, trial, slope, direction, product, dy, dy0 = np.zeros((8, n))
    lam, v, w, h, dl, a, b_ = np.zeros((7, m))
    q, right = np.zeros((2, n))
    matrix, work = np.zeros((n, n)), np.zeros(24)
    for point in range(data.shape[0]):
        scale = 0.0
        for i in range(n):
            value = q0[i]
            for k in range(width):
                value += q1[i, k] * data[point, k]
            q[i] = value
            scale = max(scale, abs(value))
        for r in range(m):
            value = h0[r]
            for k in range(width):
                value += h1[r, k] * data[point, k]
            h[r] = value
            scale = max(scale, abs(value))
        if not scale < math.inf:
            statuses[point] = NOT_FINITE
            continue
        if scale == 0.0:
            scale = 1.0
        for b in range(kinds.size):
            shapes[b], scales[b] = alphas[b], betas[b]
            if kinds[b] >= POWER_TERM:
                shapes[b], scales[b] = scaled_term(kinds[b], alphas[b], betas[b], scale)
        for i in range(n):
            q[i] /= scale
            y[i] = y_all[point, i] / scale if warm else 0.0
        for r in range(m):
            h[r] /= scale
            lam[r] = l_all[point, r] / scale if warm else 0.0
        status, residual, steps, tau, rho = _solve_point(
            p, G, q, h, kinds, starts, sizes, shapes, scales, y, lam, tolerance, tau_start, limit,
            y0, trial, v, w, slope, direction, jacobians, marks, matrix, product, work,
        )  # fmt: skip
        statuses[point], residuals[point], counts[point] = status, residual, steps
        for i in range(n):
            y_all[point, i] = y[i] * scale
        for r in range(m):
            l_all[point, r] = lam[r] * scale
        for k in range(width):
            value = c1[k]
            for j in range(width):
                value += C[k, j] * data[point, j]
            for i in range(n):
                value += q1[i, k] * y_all[point, i]
            for r in range(m):
                value -= h1[r, k] * l_all[point, r]
            slopes[point, k] = value
        if want_tangent:
            # a stiff penalty lets the iteration of the tangent converge in a few turns
            tau, rho = 1e4, 1e-6
            for r in range(m):
                value = -h[r]
                for j in range(n):
                    value += G[r, j] * y[j]
                v[r] = lam[r] + tau * value
            _project_all(kinds, starts, sizes, shapes, scales, tau, v, w, jacobians, marks, work)
            _newton_matrix(p, rho, tau, G, kinds, starts, sizes, v, jacobians, marks, matrix, product)
            _factor(matrix, n)
            _tangent(
                p, G, q1, h1, C, kinds, starts, sizes, tau, rho, lam, v, jacobians, marks, matrix, product, right,
                dy, dy0, dl, a, b_, tangents[point],
            )  # fmt: skip
