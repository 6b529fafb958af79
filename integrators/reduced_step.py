"""The step of a law as a projection of a few numbers: trial values from strain and state, the projection by a method, then tensors again.

With B = Σ a_k A_k at frozen internal variables the trial numbers are z = (‖dev B‖, T, R), T_i = Σ b_ik tr A_k (kind 0), or the
principal values of B in descending order and R (kind 1). The method returns the increments e conjugate to z and P = ∂e/∂z^tr; then,
with n = dev B/‖dev B‖,

    kind 0   ΔX_k = a_k e_q n + Σ b_ik e_i I,    tangent c₀ 𝕀 + c₁ I⊗I + c₂ n⊗n + c₃ (n⊗I + I⊗n);
    kind 1   ΔX_k = a_k Σ e_i n_i⊗n_i,           tangent by P and (e_i − e_j)/(b_i − b_j), no eigenvector derivative.

Compiled once per machine: a law enters through numbers and the method through a pointer. Points are taken in blocks of `BLOCK`.

Plan: see `plan`. Coefficients: stiffness pair, stress at zero, pair ∂B/∂ε, B at zero; per tensor pair ∂B/∂X_k, moduli pair, a_k; per
trace ∂T/∂(tr ε), T at zero, and per tensor ∂T/∂(tr X_k), b_k; per scalar force R at zero and ∂R/∂s; then what method and strain
terms read.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..cache import njit
from .kernel_types import STEP_SIGNATURE, compiled
from .key import kernels_hash
from .plan import (
    FROZEN,
    KIND,
    METRIC,
    MOVING,
    NORM,
    PLACES,
    SCALAR_START,
    SCALARS,
    STRAIN,
    STRAIN_START,
    TENSORS,
    TRACE_START,
    TRACES,
    UNKNOWNS,
)
from .spectral import eigen, norm6
from .strain_terms import WORK

__all__ = ["BLOCK", "reduced_step"]

BLOCK = 64
_FOLDER = kernels_hash()
_ROOT = 1.4142135623730951


def reduced_step() -> Any:
    """The compiled step."""
    return compiled(_step, STEP_SIGNATURE)


@njit(folder=_FOLDER)
def _trial(e, x, c, plan, b, axes, trial):
    """Trial numbers of one point into `trial`; B in `b` (its deviator for kind 0), eigenvalues and vectors in `axes` (kind 1)."""
    tensors, scalars, traces = plan[TENSORS], plan[SCALARS], plan[TRACES]
    head = plan[UNKNOWNS] - plan[MOVING]
    trace = e[0] + e[1] + e[2]
    sphere = c[5] + c[4] * trace
    for i in range(6):
        b[i] = c[3] * e[i]
    for k in range(tensors):
        p, o = plan[PLACES + k], 6 + 5 * k
        for i in range(6):
            b[i] += c[o] * x[p + i]
        sphere += c[o + 1] * (x[p] + x[p + 1] + x[p + 2])
    if plan[KIND] == 0:
        if plan[NORM] > 0:
            # twice: what rounding of a large mean leaves is no part of a small deviator
            for _ in range(2):
                mean = (b[0] + b[1] + b[2]) / 3.0
                for i in range(3):
                    b[i] -= mean
            trial[0] = norm6(b)
        for i in range(traces):
            o = plan[TRACE_START] + (2 + 2 * tensors) * i
            value = c[o + 1] + c[o] * trace
            for k in range(tensors):
                p = plan[PLACES + k]
                value += c[o + 2 + 2 * k] * (x[p] + x[p + 1] + x[p + 2])
            trial[plan[NORM] + i] = value
    else:
        for i in range(3):
            b[i] += sphere
        eigen(b, axes)
        # descending order
        for turn in range(3):
            i = 1 if turn == 1 else 0
            j = i + 1
            if axes[i] < axes[j]:
                axes[i], axes[j] = axes[j], axes[i]
                for r in range(3):
                    o = 3 + 3 * r
                    axes[o + i], axes[o + j] = axes[o + j], axes[o + i]
        for i in range(3):
            trial[i] = axes[i]
    for j in range(plan[MOVING]):
        o = plan[SCALAR_START] + (1 + scalars) * j
        value = c[o]
        for i in range(scalars):
            value += c[o + 1 + i] * x[plan[PLACES + tensors + i]]
        trial[head + j] = value
        trial[plan[UNKNOWNS] + j] = x[plan[PLACES + tensors + scalars + j]]
    for j in range(plan[FROZEN]):
        trial[plan[UNKNOWNS] + plan[MOVING] + j] = x[plan[PLACES + tensors + scalars + plan[MOVING] + j]]


@njit(folder=_FOLDER)
def _isotropic(c0, c1, t):
    """t = c₀ 𝕀 + c₁ I⊗I."""
    for i in range(36):
        t[i] = 0.0
    for i in range(6):
        t[7 * i] = c0
    for i in range(3):
        for j in range(3):
            t[6 * i + j] += c1


@njit(folder=_FOLDER)
def _norm_tangent(c, plan, b, q, slip, found, t):
    """Tangent of kind 0."""
    n = plan[UNKNOWNS]
    pair, cross, sphere = 0.0, 0.0, 0.0
    first = 2 * n
    if plan[NORM] > 0:
        pair = found[first]
    for i in range(plan[TRACES]):
        g = c[plan[TRACE_START] + (2 + 2 * plan[TENSORS]) * i]
        row = first + n * (plan[NORM] + i)
        if plan[NORM] > 0:
            cross += g * found[row]
        for j in range(plan[TRACES]):
            sphere += g * found[row + plan[NORM] + j] * c[plan[TRACE_START] + (2 + 2 * plan[TENSORS]) * j]
    drop = c[3] * c[3] * slip
    _isotropic(c[0] - drop, c[1] + drop / 3.0 - sphere, t)
    if q > 0.0:
        c2 = (drop - c[3] * c[3] * pair) / q / q
        c3 = -c[3] * cross / q
        for i in range(6):
            left = c2 * b[i] + (c3 if i < 3 else 0.0)
            for j in range(6):
                t[6 * i + j] += left * b[j]
            for j in range(3):
                t[6 * i + j] += c3 * b[i]


@njit(folder=_FOLDER)
def _dyad(axes, l, m, d):
    """Unit Mandel vector of sym(n_l ⊗ n_m)."""
    x, y, z = axes[3 + l], axes[6 + l], axes[9 + l]
    p, q, r = axes[3 + m], axes[6 + m], axes[9 + m]
    first, half = (1.0, 0.5 * _ROOT) if l == m else (_ROOT, 1.0)
    d[0], d[1], d[2] = first * x * p, first * y * q, first * z * r
    d[3], d[4], d[5] = half * (y * r + z * q), half * (x * r + z * p), half * (x * q + y * p)


@njit(folder=_FOLDER)
def _principal_tangent(c, plan, axes, found, t, dyads):
    """Tangent of kind 1: C − G DF G, G = g₀ 𝕀 + g₁ I⊗I."""
    n = plan[UNKNOWNS]
    first = 2 * n
    g0, g1 = c[3], c[4]
    size = abs(axes[0]) + abs(axes[1]) + abs(axes[2])
    own = c[plan[METRIC]] - c[plan[METRIC] + 1]
    _isotropic(c[0], c[1], t)
    for k in range(3):
        _dyad(axes, k, k, dyads[k])
    for k in range(3):
        # row k of G P G in principal values
        r0, r1, r2 = 0.0, 0.0, 0.0
        for l in range(3):
            w = g1 + (g0 if l == k else 0.0)
            r0 += w * found[first + n * l]
            r1 += w * found[first + n * l + 1]
            r2 += w * found[first + n * l + 2]
        total = g1 * (r0 + r1 + r2)
        r0, r1, r2 = g0 * r0 + total, g0 * r1 + total, g0 * r2 + total
        for i in range(6):
            left = dyads[k, i]
            for j in range(6):
                t[6 * i + j] -= left * (r0 * dyads[0, j] + r1 * dyads[1, j] + r2 * dyads[2, j])
    for k in range(3):
        l, m = (k + 1) % 3, (k + 2) % 3
        gap = axes[l] - axes[m]
        if abs(gap) > 1e-9 * size:
            theta = (found[l] - found[m]) / gap
            # a projection turns no further than its trial: what rounding over a small gap makes beyond is cut off
            if own > 0.0:
                theta = min(max(theta, 0.0), 1.0 / own)
        else:
            theta = 0.5 * (found[first + n * l + l] + found[first + n * m + m]) - 0.5 * (
                found[first + n * l + m] + found[first + n * m + l]
            )
        theta *= g0 * g0
        if theta != 0.0:
            _dyad(axes, l, m, dyads[3])
            for i in range(6):
                left = theta * dyads[3, i]
                for j in range(6):
                    t[6 * i + j] -= left * dyads[3, j]


def _step(method, law, rest, eps, old, new, stress, tangent, want, dissipation, status, coefficients, plan):
    tensors, scalars, n, traces = plan[TENSORS], plan[SCALARS], plan[UNKNOWNS], plan[TRACES]
    count = min(eps.shape[0], BLOCK)
    last = tangent.shape[0] - 1
    step = 1 if coefficients.shape[0] > 1 else 0
    trial = np.zeros((count, n + plan[MOVING] + plan[FROZEN] + 1))
    found = np.zeros((count, 2 * n + n * n + 1))
    b, axes = np.zeros((count, 6)), np.zeros((count, 12))
    flow, dyads, work = np.zeros(6), np.zeros((4, 6)), np.zeros(WORK)
    head = n - plan[MOVING]
    for start in range(0, eps.shape[0], BLOCK):
        block = min(BLOCK, eps.shape[0] - start)
        for i in range(block):
            m = start + i
            _trial(eps[m], old[m], coefficients[step * m], plan, b[i], axes[i], trial[i])
        method(law, trial, coefficients, step * start, plan, found, status[start : start + block], block)
        for i in range(block):
            m = start + i
            c, e, f = coefficients[step * m], eps[m], found[i]
            x, y, s, t = old[m], new[m], stress[m], tangent[min(m, last)]
            trace = e[0] + e[1] + e[2]
            sphere = c[2] + c[1] * trace
            for j in range(6):
                s[j] = c[0] * e[j]
            slip, q = 0.0, 0.0
            lost = 0.0
            for j in range(n):
                lost += f[j] * f[n + j]
            dissipation[m] = lost
            if plan[KIND] == 0:
                if plan[NORM] > 0:
                    q = trial[i, 0]
                    # where the deviator is rounding of the strain, e_q/q is taken at its limit P_qq
                    size = 0.0
                    for j in range(6):
                        size = max(size, abs(e[j]))
                    slip = f[2 * n]
                    if q > 1e-13 * abs(c[3]) * size and abs(f[0]) < 1e280 * q:
                        slip = f[0] / q
                    if c[plan[METRIC]] > 0.0:
                        slip = min(max(slip, 0.0), 1.0 / c[plan[METRIC]])
                for j in range(6):
                    flow[j] = slip * b[i, j]
            else:
                for j in range(6):
                    flow[j] = 0.0
                for k in range(3):
                    _dyad(axes[i], k, k, dyads[3])
                    for j in range(6):
                        flow[j] += f[k] * dyads[3, j]
            for k in range(tensors):
                p, o = plan[PLACES + k], 6 + 5 * k
                ball = 0.0
                for j in range(traces):
                    ball += c[plan[TRACE_START] + (2 + 2 * tensors) * j + 3 + 2 * k] * f[plan[NORM] + j]
                for j in range(6):
                    y[p + j] = x[p + j] + (c[o + 4] * flow[j] + (ball if j < 3 else 0.0))
                    s[j] += c[o + 2] * y[p + j]
                sphere += c[o + 3] * (y[p] + y[p + 1] + y[p + 2])
            for j in range(scalars):
                p = plan[PLACES + tensors + j]
                y[p] = x[p]
            for j in range(plan[MOVING]):
                p = plan[PLACES + tensors + scalars + j]
                y[p] = x[p] + f[head + j]
            for j in range(3):
                s[j] += sphere
            if want:
                if plan[KIND] == 0:
                    _norm_tangent(c, plan, b[i], q, slip, f, t)
                else:
                    _principal_tangent(c, plan, axes[i], f, t, dyads)
            if plan[STRAIN] > 0:
                rest(e, s, work, c[plan[STRAIN_START] :], want, t)
            elif plan[STRAIN] < 0:
                for j in range(6):
                    s[j] = -s[j]
                if want:
                    for j in range(36):
                        t[j] = -t[j]
            if status[m] == 0 and not math.isfinite(s[0] + s[1] + s[2] + s[3] + s[4] + s[5] + lost):
                status[m] = 2
