"""The reduced step with one surface, or one function of power terms, in a diagonal metric: safeguarded Newton, exact at the apex.

    min_z ½ ‖z − z^tr‖²_{W⁻¹} + Φ(z) + soft powers of f   subject to   f(z) ≤ 0,  q ≥ 0,        z = z^tr − W e.

The same iteration as `reduced_projection` with nothing to choose: M = 𝕀 + L W, one multiplier from the linearised surface (by
`soft_root` for power terms), steps accepted on the exact penalty function. The first turn takes the curvature γ ∂²f at the multiplier
of the linearised surface. q ≥ 0 is left out first; if the answer has q < 0, the minimiser has q = 0, by convexity, and the rest is
solved again with q pinned (its modulus taken as zero).

Sizes and flags of the plan are constants of the code, one compiled version per combination.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from ..cache import njit
from .kernel_types import METHOD_SIGNATURE, compiled
from .key import kernels_hash
from .plan import CURVED, FIRST_SCALAR, FROZEN, METRIC, MOVING, NONLINEAR, NORM, SOFT, UNKNOWNS, VISCOUS
from .reduced_faces import soft_root

__all__ = ["single_method"]

_FOLDER = kernels_hash()
TURNS, CUTS = 80, 40
PATIENCE = 12  # turns after which steps of some rounding units are taken for rounding
FAR = 4.0  # multiples of the size of f at zero force from which the start is drawn in
NEAR = 0.1  # of it, to where


def single_method(plan: Any) -> Any:
    """The compiled method for laws with these sizes and flags."""
    places = (UNKNOWNS, MOVING, FROZEN, FIRST_SCALAR, NORM, SOFT, VISCOUS, NONLINEAR, CURVED)
    return _compiled(*(int(plan[i]) for i in places))


@functools.cache
def _compiled(*sizes: int) -> Any:
    return compiled(_method(*sizes), METHOD_SIGNATURE)


@njit(folder=_FOLDER)
def _powers(f, out, powers):
    """Σ c_i ⟨f⟩^(N_i + 1)/(N_i + 1)."""
    total = 0.0
    u = math.log(f)
    for j in range(int(out[powers])):
        exponent = out[powers + 5 + j] + 1.0
        total += math.exp(min(out[powers + 1 + j] + exponent * u, 709.0)) / exponent
    return total


# at module level: numba finds a function in its index again only if what it calls is the same object in every process
@njit(folder=_FOLDER)
def _drawn_in(law, trial, w, s, gamma, c, z, out, size):
    """Factor on the trial: along the ray to zero force, which is admissible, until |f| is small beside its terms there.

    By convexity f(λ z) ≤ λ f(z), so that the first factor is on one side of small; else to twice what is inside. `size`: where the size of
    f at zero force stands.
    """
    floor = NEAR * out[size]
    low, high, inside, outside = 0.0, 1.0, -floor, out[0]
    length = floor / outside
    for _ in range(60):
        if not length > 0.0:
            length = 0.5 * high
        for k in range(z.shape[0]):
            z[k] = length * trial[k] if w[k] > 0.0 else trial[k]
        law(z, s, gamma, c, 0, out)
        if abs(out[0]) <= floor:
            return length
        if out[0] <= 0.0:
            low, inside = length, out[0]
        else:
            high, outside = length, out[0]
        if high <= 2.0 * low:
            break
        length = low + (high - low) * inside / (inside - outside)
        if not length > 2.0 * low:
            length = math.sqrt(low * high)
    return high


@njit(folder=_FOLDER)
def _halved(law, trial, w, s, gamma, c, z, out):
    """Factor on the trial by halving, at most twice what is inside."""
    length = 1.0
    for _ in range(60):
        length *= 0.5
        for k in range(z.shape[0]):
            z[k] = length * trial[k] if w[k] > 0.0 else trial[k]
        law(z, s, gamma, c, 0, out)
        if out[0] <= 0.0:
            return 2.0 * length
    return length


def _method(
    n: int, moving: int, frozen: int, r0: int, norm: int, soft: int, phi: int, nonlinear: int, curved: int
) -> Any:
    nr = moving if nonlinear else 0
    bent = bool(curved or phi or nr)
    top = r0 if nr else n
    il = 1 + 2 * n
    value = il + n * n
    forces = value + 2
    block = forces + moving
    powers = block + moving * moving
    data = moving + frozen

    def project(law, trial, coefficients, first, plan, found, status, count):
        step = 1 if coefficients.shape[0] > 1 else 0
        out, w, iw, z, e, e_old, de = (
            np.zeros(powers + 10),
            np.zeros(n),
            np.zeros(n),
            np.zeros(n),
            np.zeros(n),
            np.zeros(n),
            np.zeros(n),
        )
        s, s_old, gamma, result = np.zeros(data + 1), np.zeros(data + 1), np.ones(1), np.zeros(3)
        M, v, g, column = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
        metric = plan[METRIC]
        for point in range(count):
            c, zt, answer = coefficients[first + step * point], trial[point], found[point]
            if step == 1 or point == 0:
                for k in range(n):
                    w[k] = c[metric + (n + 1) * k]
                    iw[k] = 1.0 / math.sqrt(w[k]) if w[k] > 0.0 else 0.0
            for k in range(n):
                z[k], e[k] = zt[k], 0.0
            for k in range(data):
                s[k] = s_old[k] = zt[n + k]
            weight = 0.0
            gamma[0] = 0.0 if phi else 1.0
            law(z, s, gamma, c, 2, out)
            for k in range(nr):
                z[r0 + k] = out[forces + k]
            if out[0] <= 0.0 and not phi:
                status[point] = 0
                for k in range(n):
                    answer[k] = 0.0
                    answer[n + k] = z[k]
                for k in range(n * n):
                    answer[2 * n + k] = 0.0
                continue
            flag, pinned, weight_q = 1, False, w[0]
            gram, rate = 0.0, 0.0
            drawable = bool(curved) and not (soft or phi or nr)
            for attempt in range(2):
                if attempt == 1:
                    # once more from where the halved trial is admissible, or from zero force
                    if flag == 0 or not drawable:
                        break
                    flag, pinned, weight = 1, False, 0.0
                    w[0], iw[0] = weight_q, 1.0 / math.sqrt(weight_q) if weight_q > 0.0 else 0.0
                if drawable and (attempt == 1 or out[0] > FAR * out[powers + 9]):
                    length = (
                        _drawn_in(law, zt, w, s, gamma, c, z, out, powers + 9)
                        if attempt == 0
                        else _halved(law, zt, w, s, gamma, c, z, out)
                    )
                    for k in range(n):
                        z[k], e[k] = zt[k], 0.0
                        if w[k] > 0.0:
                            z[k] = length * zt[k]
                            e[k] = (zt[k] - z[k]) / w[k]
                    law(z, s, gamma, c, 2, out)
                before, penalty, turn, gram, rate = math.inf, 0.0, 0, 0.0, math.inf
                overstress = 0.0
                while turn < TURNS:
                    turn += 1
                    if not math.isfinite(out[0]):
                        flag = 2
                        break
                    for k in range(nr):
                        w[r0 + k] = out[block + (nr + 1) * k]
                        iw[r0 + k] = 1.0 / math.sqrt(w[r0 + k]) if w[r0 + k] > 0.0 else 0.0
                    drift, size, far, across, base = 0.0, 0.0, 0.0, 0.0, out[0]
                    for k in range(n):
                        slope = out[1 + k]
                        p = out[1 + n + k] - e[k] if phi else -e[k]
                        v[k], g[k] = p, slope
                        across += slope * w[k] * slope
                        base -= slope * w[k] * p
                        p += weight * slope
                        drift += w[k] * p * p
                        size = max(size, abs(z[k]) * iw[k])
                        far = max(far, abs(zt[k]) * iw[k])
                    gram = across
                    if bent:
                        bend = 1.0
                        if not phi:
                            bend = weight
                            if turn == 1 and attempt == 0 and not soft and across > 0.0:
                                bend = max(base, 0.0) / across
                        # elimination without pivoting: the leading minors of 𝕀 + L W are at least one; the factors stay in M
                        for k in range(n):
                            for l in range(n):
                                M[k, l] = bend * out[il + n * k + l] * w[l]
                            M[k, k] += 1.0
                        for a in range(n):
                            inverse = 1.0 / M[a, a]
                            M[a, a] = inverse
                            for i in range(a + 1, n):
                                ratio = M[i, a] * inverse
                                M[i, a] = ratio
                                for j in range(a + 1, n):
                                    M[i, j] -= ratio * M[a, j]
                                v[i] -= ratio * v[a]
                                g[i] -= ratio * g[a]
                        for b in range(n):
                            a = n - 1 - b
                            left, right = v[a], g[a]
                            for i in range(a + 1, n):
                                left -= M[a, i] * v[i]
                                right -= M[a, i] * g[i]
                            v[a], g[a] = left * M[a, a], right * M[a, a]
                        base, gram = out[0], 0.0
                        for k in range(n):
                            slope = out[1 + k] * w[k]
                            base -= slope * v[k]
                            gram += slope * g[k]
                    if not gram > 0.0 and not soft:
                        flag = 3 if out[0] > 0.0 else 1
                        if flag == 3:
                            break
                    inverse = 1.0 / gram if gram > 0.0 else 1.0
                    root = math.sqrt(inverse)
                    if soft:
                        # a multiplier belongs to its overstress also where a step has gone past it, to f ≤ 0
                        excess = out[0] if weight > 0.0 else max(out[0], 0.0)
                        missed = abs(excess - overstress) * root if turn > 1 else math.inf
                        soft_root(base, gram if gram > 1e-15 * across else 0.0, out, powers, result)
                        multiplier, rate, overstress = result[0], result[1], result[2]
                    else:
                        missed = abs(min(-out[0], weight * gram)) * root
                        multiplier = max(base, 0.0) * inverse if gram > 0.0 else 0.0
                    far += out[powers + 9] * root
                    near, close = 2e-14 * size + 4e-16 * far, 1e-12 * size + 1e-14 * far
                    residual = max(math.sqrt(drift), missed)
                    change = 0.0
                    for k in range(n):
                        de[k] = v[k] + multiplier * g[k]
                        change += w[k] * de[k] * de[k]
                    late = turn >= PATIENCE
                    done = turn > 1 and (
                        residual <= near
                        or (residual >= 0.5 * before and residual <= close)
                        or (
                            missed <= (8.0 if late else 1.0) * close
                            and math.sqrt(change) <= (30.0 if late else 1.0) * near
                        )
                    )
                    if done or not bent:
                        if not done:
                            weight = multiplier
                            for k in range(n):
                                e[k] += de[k]
                                z[k] = zt[k] - w[k] * e[k] if w[k] > 0.0 else z[k]
                        if norm and not pinned and z[0] * iw[0] < -near:
                            pinned, before, turn = True, math.inf, 0
                            w[0], iw[0], z[0], e[0] = 0.0, 0.0, 0.0, 0.0
                            gamma[0] = weight if phi else 1.0
                            law(z, s, gamma, c, 2, out)
                            continue
                        flag = 0
                        break
                    penalty = max(penalty, 1.1 * multiplier)
                    old = out[value]
                    for k in range(top):
                        old += 0.5 * w[k] * e[k] * e[k]
                    if out[0] > 0.0:
                        old += _powers(out[0], out, powers) if soft else penalty * out[0]
                    if nr:
                        old -= out[value + 1]
                        for k in range(nr):
                            old -= z[r0 + k] * (s[k] - s_old[k])
                    slack = 1e-13 * (change + abs(old)) + 1e-15 * penalty * far / root
                    for k in range(n):
                        e_old[k] = e[k]
                    length = 1.0
                    gamma[0] = multiplier if phi else 1.0
                    for _ in range(CUTS):
                        for k in range(n):
                            e[k] = e_old[k] + length * de[k]
                            if w[k] > 0.0:
                                z[k] = zt[k] - w[k] * e[k]
                        for k in range(nr):
                            s[k] = s_old[k] + e[r0 + k]
                        law(z, s, gamma, c, 2, out)
                        if math.isfinite(out[0]):
                            now = out[value]
                            for k in range(top):
                                now += 0.5 * w[k] * e[k] * e[k]
                            if out[0] > 0.0:
                                now += _powers(out[0], out, powers) if soft else penalty * out[0]
                            if nr:
                                now -= out[value + 1]
                                for k in range(nr):
                                    z[r0 + k] = out[forces + k]
                                    now -= z[r0 + k] * (s[k] - s_old[k])
                            if now <= old - 1e-4 * length * change + slack:
                                break
                        length *= 0.5
                        gamma[0] = weight + length * (multiplier - weight) if phi else 1.0
                    weight += length * (multiplier - weight)
                    before = residual
            status[point] = flag
            if flag == 0:
                inverse = 0.0
                if weight > 0.0:
                    inverse = 1.0 / (gram + rate) if soft else 1.0 / gram
                for k in range(n):
                    answer[k], answer[n + k] = e[k], z[k]
                    for l in range(n):
                        answer[2 * n + n * k + l] = g[k] * inverse * g[l]
                if bent:
                    # P += M⁻¹ L, column by column
                    bend = 1.0 if phi else weight
                    for l in range(n):
                        for k in range(n):
                            column[k] = bend * out[il + n * k + l]
                        for a in range(n):
                            for i in range(a + 1, n):
                                column[i] -= M[i, a] * column[a]
                        for b in range(n):
                            a = n - 1 - b
                            left = column[a]
                            for i in range(a + 1, n):
                                left -= M[a, i] * column[i]
                            column[a] = left * M[a, a]
                            answer[2 * n + n * a + l] += column[a]
                if pinned:
                    answer[0], answer[n] = zt[0] / weight_q, 0.0
                    for l in range(n):
                        answer[2 * n + l] = answer[2 * n + n * l] = 0.0
                    answer[2 * n] = 1.0 / weight_q
            if pinned:
                w[0] = weight_q
                iw[0] = 1.0 / math.sqrt(weight_q) if weight_q > 0.0 else 0.0

    return project
