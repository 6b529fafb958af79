"""The reduced step with curved, several or viscous surfaces and any hardening: sequential quadratic programming, exact at corners.

    min_z ½ ‖z − z^tr‖²_{W⁻¹} + Φ(z) + Σ soft powers   subject to   f_i(z) ≤ 0,  O z ≤ 0,       z = z^tr − W e,

with W(s) = ∂²ψ_s where ψ_s is not quadratic. Each turn linearises the surfaces and solves for the multipliers exactly
(`reduced_faces`), with the Hessian of the Lagrangian in M = 𝕀 + L W: no division by a modulus, so that a zero one is no special case, and
q ≥ 0 is one more surface, which makes the apex exact by convexity. Steps are accepted on the exact penalty function of the convex
program; far outside, the start is drawn along the ray to zero force, which is admissible. P = ∂e/∂z^tr comes from the last linear
system (Robinson 1974; Bertsekas 1982).

It stops at 2e-14 of the answer or at the rounding of the trial, in the metric.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from ..cache import njit
from .kernel_types import METHOD_SIGNATURE, compiled
from .key import kernels_hash
from .plan import (
    CURVED,
    FIRST_SCALAR,
    FROZEN,
    KIND,
    METRIC,
    MOVING,
    NONLINEAR,
    ORDERS,
    SOFT,
    SURFACES,
    UNKNOWNS,
    VISCOUS,
)
from .reduced_faces import multipliers

__all__ = ["projection_method"]

_FOLDER = kernels_hash()
TURNS, CUTS = 80, 40
PATIENCE = 12  # turns after which steps of some rounding units are taken for rounding


def projection_method(plan: Any) -> Any:
    """The compiled method for laws with these sizes and flags, which are constants of the code."""
    places = (UNKNOWNS, SURFACES, ORDERS, MOVING, FROZEN, FIRST_SCALAR, KIND, SOFT, VISCOUS, CURVED, NONLINEAR)
    return _compiled(*(int(plan[i]) for i in places))


@functools.cache
def _compiled(*sizes: int) -> Any:
    return compiled(_method(*sizes), METHOD_SIGNATURE)


@njit(folder=_FOLDER)
def _solve(M, n, B, k):
    """B (n, k) becomes M⁻¹ B, by elimination with partial pivoting; M is lost."""
    for c in range(n):
        best = c
        for i in range(c + 1, n):
            if abs(M[i, c]) > abs(M[best, c]):
                best = i
        if best != c:
            for j in range(n):
                M[c, j], M[best, j] = M[best, j], M[c, j]
            for j in range(k):
                B[c, j], B[best, j] = B[best, j], B[c, j]
        inverse = 1.0 / M[c, c]
        for i in range(c + 1, n):
            ratio = M[i, c] * inverse
            if ratio != 0.0:
                for j in range(c + 1, n):
                    M[i, j] -= ratio * M[c, j]
                for j in range(k):
                    B[i, j] -= ratio * B[c, j]
    for c in range(n - 1, -1, -1):
        inverse = 1.0 / M[c, c]
        for j in range(k):
            value = B[c, j]
            for i in range(c + 1, n):
                value -= M[c, i] * B[i, j]
            B[c, j] = value * inverse


@njit(folder=_FOLDER)
def _merit(n, m, mt, soft, r0, nr, f, out, values, powers, e, W, z, s, s_old, penalty):
    """Value of the program, violations weighed by `penalty`."""
    total = out[values]
    top = r0 if nr > 0 else n
    for k in range(top):
        for l in range(top):
            total += 0.5 * e[k] * W[k, l] * e[l]
    if nr > 0:
        total -= out[values + 1]
        for k in range(nr):
            total -= z[r0 + k] * (s[k] - s_old[k])
    for i in range(mt):
        if i == 0 and soft:
            if f[0] > 0.0:
                u = math.log(f[0])
                for j in range(int(out[powers])):
                    exponent = out[powers + 5 + j] + 1.0
                    total += math.exp(min(out[powers + 1 + j] + exponent * u, 709.0)) / exponent
        elif f[i] > 0.0:
            total += penalty[i] * f[i]
    return total


@njit(folder=_FOLDER)
def _surfaces(law, level, n, m, mo, kind, r0, nr, forces, c, z, s, gamma, out, f):
    """Functions at (z, s); the orders behind the surfaces. False if one is not finite."""
    law(z, s, gamma, c, level, out)
    finite = True
    for k in range(nr):
        z[r0 + k] = out[forces + k]
    for i in range(m):
        f[i] = out[i]
        if not math.isfinite(f[i]):
            finite = False
    for i in range(mo):
        f[m + i] = z[i + 1] - z[i] if kind == 1 else -z[i]
    return finite


def _method(
    n: int,
    m: int,
    mo: int,
    moving: int,
    frozen: int,
    r0: int,
    kind: int,
    soft: int,
    phi: int,
    curved: int,
    nonlinear: int,
) -> Any:
    mt = m + mo
    bent = bool(curved or phi or nonlinear)
    nr = moving if nonlinear else 0
    ig, ip = m, m + m * n
    il = ip + n
    values = il + n * n
    forces = values + 2
    block = forces + moving
    powers = block + moving * moving

    def project(law, trial, coefficients, first, plan, found, status, count):
        step = 1 if coefficients.shape[0] > 1 else 0
        out = np.zeros(powers + 9 + m)
        z, e, e_old, p, de, F = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
        s, s_old = np.zeros(moving + frozen + 1), np.zeros(moving + frozen + 1)
        f, trial_gamma, base, gamma = np.zeros(mt + 1), np.zeros(mt + 1), np.zeros(mt + 1), np.zeros(mt + 1)
        new, rest, penalty, u, v = (
            np.zeros(mt + 1),
            np.zeros(mt + 1),
            np.zeros(mt + 1),
            np.zeros(mt + 1),
            np.zeros(mt + 1),
        )
        places = np.zeros(mt + 1, dtype=np.int64)
        result = np.zeros(3)
        g, S, L, T = (
            np.zeros((mt, n)),
            np.zeros((mt + 1, mt + 1)),
            np.zeros((mt + 1, mt + 1)),
            np.zeros((mt + 1, mt + 1)),
        )
        W, M, V, B = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, 1 + max(mt, n))), np.zeros((mt + 1, n))
        for i in range(mo):
            if kind == 1:
                g[m + i, i], g[m + i, i + 1] = -1.0, 1.0
            else:
                g[m + i, i] = -1.0
        for point in range(count):
            c = coefficients[first + step * point]
            zt = trial[point]
            answer = found[point]
            for k in range(2 * n + n * n):
                answer[k] = 0.0
            for k in range(n):
                z[k], e[k] = zt[k], 0.0
                for l in range(n):
                    W[k, l] = c[plan[METRIC] + n * k + l]
            for k in range(moving + frozen):
                s[k] = s_old[k] = zt[n + k]
            for i in range(mt):
                gamma[i], penalty[i] = 0.0, 0.0
            result[2] = 0.0
            flag = 1
            finite = _surfaces(law, 2, n, m, mo, kind, r0, nr, forces, c, z, s, gamma, out, f)
            if not phi:
                plastic = not finite
                for i in range(m):
                    if not f[i] <= 0.0:
                        plastic = True
                if not plastic:
                    status[point] = 0
                    for k in range(n):
                        answer[n + k] = z[k]
                    continue
            if curved and not soft and not phi and nr == 0 and kind == 0:
                # along the ray to zero force, which is admissible, to at most twice what is: f may grow fast farther out
                length = 1.0
                for _ in range(60):
                    length *= 0.5
                    for k in range(n):
                        z[k] = length * zt[k] if W[k, k] > 0.0 else zt[k]
                    finite = _surfaces(law, 0, n, m, mo, kind, r0, nr, forces, c, z, s, gamma, out, f)
                    inside = finite
                    for i in range(m):
                        if not f[i] <= 0.0:
                            inside = False
                    if inside:
                        length *= 2.0
                        break
                for k in range(n):
                    if W[k, k] > 0.0:
                        z[k] = length * zt[k]
                        e[k] = (zt[k] - z[k]) / W[k, k]
                finite = _surfaces(law, 2, n, m, mo, kind, r0, nr, forces, c, z, s, gamma, out, f)
            mask = 0
            before = math.inf
            for turn in range(TURNS):
                if not finite:
                    flag = 2
                    break
                for k in range(nr):
                    for l in range(nr):
                        W[r0 + k, r0 + l] = out[block + k * nr + l]
                residual = 0.0
                for k in range(n):
                    value = e[k] - out[ip + k]
                    p[k] = -value
                    for i in range(m):
                        g[i, k] = out[ig + i * n + k]
                    for i in range(mt):
                        value -= gamma[i] * g[i, k]
                    F[k] = value
                for k in range(n):
                    for l in range(n):
                        residual += F[k] * W[k, l] * F[l]
                residual = math.sqrt(max(residual, 0.0))
                for k in range(n):
                    V[k, 0] = p[k]
                    for i in range(mt):
                        V[k, 1 + i] = g[i, k]
                if bent:
                    for k in range(n):
                        for l in range(n):
                            value = 1.0 if k == l else 0.0
                            for j in range(n):
                                value += out[il + k * n + j] * W[j, l]
                            M[k, l] = value
                    _solve(M, n, V, 1 + mt)
                answer_size, trial_size, floor, missed = 0.0, 0.0, 0.0, 0.0
                for k in range(n):
                    if W[k, k] > 0.0:
                        root = math.sqrt(W[k, k])
                        answer_size = max(answer_size, abs(z[k]) / root)
                        trial_size = max(trial_size, abs(zt[k]) / root)
                for i in range(mt):
                    value = f[i]
                    for k in range(n):
                        part = 0.0
                        for l in range(n):
                            part += g[i, l] * W[l, k]
                        F[k] = part
                        value -= part * V[k, 0]
                    base[i] = value
                    for j in range(mt):
                        value = 0.0
                        for k in range(n):
                            value += F[k] * V[k, 1 + j]
                        S[i, j] = value
                    if S[i, i] > 0.0:
                        if i == 0 and soft:
                            # a multiplier belongs to its overstress also where a step has gone past it, to f ≤ 0
                            miss = 0.0
                            if f[0] > 0.0 or gamma[0] > 0.0:
                                miss = f[0] - result[2] if turn > 0 else math.inf
                        else:
                            miss = min(-f[i], gamma[i] * S[i, i])
                        missed = max(missed, abs(miss) / math.sqrt(S[i, i]))
                        if i < m:
                            floor = max(floor, out[powers + 9 + i] / math.sqrt(S[i, i]))
                residual = max(residual, missed)
                near = 2e-14 * answer_size + 4e-16 * (trial_size + floor)
                close = 1e-12 * answer_size + 1e-14 * (trial_size + floor)
                if turn > 0 and (residual <= near or (residual >= 0.5 * before and residual <= close)):
                    flag = 0
                    break
                mask = multipliers(mask, S, base, mt, soft, out, powers, new, rest, places, L, u, v, result)
                if mask < 0:
                    flag = 3
                    break
                bend = 0.0
                for k in range(n):
                    value = V[k, 0]
                    for i in range(mt):
                        value += new[i] * V[k, 1 + i]
                    de[k] = value
                for k in range(n):
                    for l in range(n):
                        bend += de[k] * W[k, l] * de[l]
                late = turn >= PATIENCE
                if (
                    turn > 0
                    and missed <= (8.0 if late else 1.0) * close
                    and math.sqrt(bend) <= (30.0 if late else 1.0) * near
                ):
                    # the next step is below rounding, whatever the curvature makes of rounding in the residual
                    flag = 0
                    break
                slack = 1e-13 * bend
                for i in range(mt):
                    penalty[i] = max(penalty[i], 1.1 * new[i])
                    slack += 1e-15 * penalty[i] * math.sqrt(max(S[i, i], 0.0)) * (trial_size + floor)
                level = 0.0
                if bent:
                    level = _merit(n, m, mt, soft, r0, nr, f, out, values, powers, e, W, z, s, s_old, penalty)
                for k in range(n):
                    e_old[k] = e[k]
                length = 1.0
                for _ in range(CUTS):
                    for k in range(n):
                        e[k] = e_old[k] + length * de[k]
                    for k in range(nr):
                        s[k] = s_old[k] + e[r0 + k]
                    for k in range(n):
                        value = zt[k]
                        for l in range(n):
                            value -= W[k, l] * e[l]
                        z[k] = value
                    if not bent:
                        break
                    for i in range(mt):
                        trial_gamma[i] = gamma[i] + length * (new[i] - gamma[i])
                    finite = _surfaces(law, 2, n, m, mo, kind, r0, nr, forces, c, z, s, trial_gamma, out, f)
                    if finite:
                        now = _merit(n, m, mt, soft, r0, nr, f, out, values, powers, e, W, z, s, s_old, penalty)
                        if now <= level - 1e-4 * length * bend + 1e-13 * abs(level) + slack:
                            break
                    length *= 0.5
                for i in range(mt):
                    gamma[i] += length * (new[i] - gamma[i])
                before = residual
                if not bent:
                    flag = 0
                    break
            status[point] = flag
            if flag != 0:
                continue
            if mo > 0 and kind == 0 and (mask >> m) & 1:
                push = out[ip]
                for i in range(m):
                    push += gamma[i] * g[i, 0]
                if push * W[0, 0] <= zt[0]:
                    # q < 0 was rounding: with a smooth tip (slope zero at q = 0) the minimiser is a small q > 0, not an apex
                    mask -= 1 << m
                    z[0] = (zt[0] - W[0, 0] * push) / (1.0 + W[0, 0] * out[il])
                    e[0] = (zt[0] - z[0]) / W[0, 0]
            active = 0
            for i in range(mt):
                if (mask >> i) & 1 or (i == 0 and soft and gamma[0] > 0.0):
                    places[active] = i
                    active += 1
            for a in range(active):
                for b in range(active):
                    T[a, b] = S[places[a], places[b]]
                if soft and places[a] == 0:
                    T[a, a] += result[1]
                for l in range(n):
                    B[a, l] = V[l, 1 + places[a]]
            _solve(T, active, B, n)
            for k in range(n):
                answer[k], answer[n + k] = e[k], z[k]
                for l in range(n):
                    value = 0.0
                    for a in range(active):
                        value += V[k, 1 + places[a]] * B[a, l]
                    answer[2 * n + n * k + l] = value
            if bent:
                for k in range(n):
                    for l in range(n):
                        value = 1.0 if k == l else 0.0
                        for j in range(n):
                            value += out[il + k * n + j] * W[j, l]
                        M[k, l] = value
                        V[k, l] = out[il + k * n + l]
                _solve(M, n, V, n)
                for k in range(n):
                    for l in range(n):
                        answer[2 * n + n * k + l] += V[k, l]

    return project
