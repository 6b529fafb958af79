"""Multipliers of linearised surfaces, a small complementarity problem solved exactly: 0 ≤ γ ⊥ S γ − f ≥ 0.

One surface may be soft (index 0): instead of f_0 ≤ 0 the overstress y = ⟨f_0⟩ obeys γ_0 = Σ c_i y^N_i. For an active set A of the others
γ_0 solves y + h Σ c_i y^N_i = f_eff, h and f_eff after elimination of A. In u = ln y this is ln(e^u + Σ e^{ln h c_i + N_i u}) = ln f_eff,
convex and increasing with slopes between 1 and N: Newton from the right converges monotonically, N up to 1000 in some ten steps.
"""

from __future__ import annotations

import math

from ..cache import njit
from .key import kernels_hash

__all__ = ["multipliers", "soft_root"]

_FOLDER = kernels_hash()


@njit(folder=_FOLDER)
def soft_root(effective, drop, out, first, result):
    """(γ, dy/dγ, y) of y + drop Σ c_i y^N_i = effective into `result`; powers as in `out[first:]`: number, ln c_i (4), N_i (4)."""
    result[0], result[1], result[2] = 0.0, math.inf, 0.0
    if not effective > 0.0:
        return
    count = int(out[first])
    goal = math.log(effective)
    u = goal
    if drop > 0.0:
        scale = math.log(drop)
        for i in range(count):
            u = min(u, (goal - scale - out[first + 1 + i]) / out[first + 5 + i])
        for _ in range(60):
            top = u
            for i in range(count):
                top = max(top, scale + out[first + 1 + i] + out[first + 5 + i] * u)
            total = math.exp(u - top)
            slope = total
            for i in range(count):
                part = math.exp(scale + out[first + 1 + i] + out[first + 5 + i] * u - top)
                total += part
                slope += out[first + 5 + i] * part
            change = (top + math.log(total) - goal) * total / slope
            u -= change
            if abs(change) <= 4e-16 * max(1.0, abs(u)):
                break
    y = math.exp(u)
    gamma, slope = 0.0, 0.0
    for i in range(count):
        part = math.exp(min(out[first + 1 + i] + out[first + 5 + i] * u, 700.0))
        gamma += part
        slope += out[first + 5 + i] * part
    if drop > 0.0 and y < 0.5 * effective:
        gamma = (effective - y) / drop
    result[0] = gamma
    result[1] = y / slope if slope > 0.0 else math.inf
    result[2] = y


@njit(folder=_FOLDER)
def _active(mask, S, f, m, soft, out, first, gamma, rest, places, L, u, v, result):
    """Multipliers of the active set `mask`; returns the largest violation in metric units, infinity for a dependent set."""
    count = 0
    for i in range(m):
        gamma[i], rest[i] = 0.0, 0.0
        if (mask >> i) & 1:
            places[count] = i
            count += 1
    for a in range(count):
        i = places[a]
        for b in range(a + 1):
            value = S[i, places[b]]
            for k in range(b):
                value -= L[a, k] * L[b, k]
            if a == b:
                if not value > 1e-13 * S[i, i]:
                    return math.inf
                L[a, a] = math.sqrt(value)
            else:
                L[a, b] = value / L[b, b]
        value, other = f[i], S[i, 0]
        for k in range(a):
            value -= L[a, k] * u[k]
            other -= L[a, k] * v[k]
        u[a], v[a] = value / L[a, a], other / L[a, a]
    if soft:
        effective, drop = f[0], S[0, 0]
        for a in range(count):
            effective -= v[a] * u[a]
            drop -= v[a] * v[a]
        soft_root(effective, drop if drop > 1e-15 * S[0, 0] else 0.0, out, first, result)
        gamma[0] = result[0]
        for a in range(count):
            u[a] -= v[a] * result[0]
    worst = 0.0
    for a in range(count - 1, -1, -1):
        value = u[a]
        for k in range(a + 1, count):
            value -= L[k, a] * u[k]
        u[a] = value / L[a, a]
        i = places[a]
        gamma[i] = u[a]
        worst = max(worst, -u[a] * math.sqrt(S[i, i]))
    for i in range(1 if soft else 0, m):
        if (mask >> i) & 1 == 0:
            value = f[i]
            for j in range(m):
                value -= S[i, j] * gamma[j]
            rest[i] = value
            if S[i, i] > 0.0:
                worst = max(worst, value / math.sqrt(S[i, i]))
    return worst


@njit(folder=_FOLDER)
def multipliers(start, S, f, m, soft, out, first, gamma, rest, places, L, u, v, result):
    """Active set (bits) and its multipliers `gamma`; −1 if there is none. Exchange from `start`, then all: the least violation wins."""
    scale = 0.0
    for i in range(m):
        if S[i, i] > 0.0:
            scale = max(scale, abs(f[i]) / math.sqrt(S[i, i]))
    tolerance = 4e-16 * scale
    mask, best, least = start, -1, math.inf
    total = 1 << m
    for turn in range(8 + total):
        if turn >= 8:
            mask = turn - 8
            if soft and mask & 1:
                continue
        worst = _active(mask, S, f, m, soft, out, first, gamma, rest, places, L, u, v, result)
        if worst < least:
            best, least = mask, worst
            if worst <= tolerance:
                return mask
        if turn < 8 and worst < math.inf:
            other = 0
            for i in range(1 if soft else 0, m):
                if ((mask >> i) & 1 and gamma[i] > 0.0) or (rest[i] > 0.0 and S[i, i] > 0.0):
                    other |= 1 << i
            mask = other
    if best >= 0:
        _active(best, S, f, m, soft, out, first, gamma, rest, places, L, u, v, result)
    return best
