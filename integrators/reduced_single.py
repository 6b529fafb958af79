"""The reduced step with one surface, or one function of power terms, in a diagonal metric: safeguarded Newton, exact at the apex.

    min_z ½ ‖z − z^tr‖²_{W⁻¹} + Φ(z) + soft powers of f   subject to   f(z) ≤ 0,  q ≥ 0,        z = z^tr − W e.

The same iteration as `reduced_projection` with nothing to choose: M = 𝕀 + L W, one multiplier from the linearised surface (by
`soft_root` for power terms), steps accepted on the exact penalty function. q ≥ 0 is left out first; if the answer has q < 0, the
minimiser has q = 0, by convexity, and the rest is solved again with q pinned (its modulus taken as zero).
"""

from __future__ import annotations

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


def single_method() -> Any:
    """The compiled method."""
    return compiled(_project, METHOD_SIGNATURE)


@njit(folder=_FOLDER)
def _eliminate(M, n, B, k):
    """B (n, k) becomes M⁻¹ B without pivoting: the leading minors of 𝕀 + L W, W diagonal, are at least one."""
    for c in range(n):
        inverse = 1.0 / M[c, c]
        for i in range(c + 1, n):
            ratio = M[i, c] * inverse
            for j in range(c + 1, n):
                M[i, j] -= ratio * M[c, j]
            for j in range(k):
                B[i, j] -= ratio * B[c, j]
    for c in range(n - 1, -1, -1):
        for j in range(k):
            value = B[c, j]
            for i in range(c + 1, n):
                value -= M[c, i] * B[i, j]
            B[c, j] = value / M[c, c]


@njit(folder=_FOLDER)
def _level(n, top, soft, out, value, powers, e, w, penalty, work):
    """Value of the program at f = out[0]; `work` is the part of the hardening energy."""
    total = out[value] + work
    for k in range(top):
        total += 0.5 * w[k] * e[k] * e[k]
    if out[0] > 0.0:
        if soft:
            u = math.log(out[0])
            for j in range(int(out[powers])):
                exponent = out[powers + 5 + j] + 1.0
                total += math.exp(min(out[powers + 1 + j] + exponent * u, 709.0)) / exponent
        else:
            total += penalty * out[0]
    return total


def _project(law, trial, coefficients, first, plan, found, status, count):
    n = plan[UNKNOWNS]
    soft, phi, norm = plan[SOFT] > 0, plan[VISCOUS] > 0, plan[NORM] > 0
    nr = plan[MOVING] if plan[NONLINEAR] > 0 else 0
    bent = plan[CURVED] > 0 or phi or nr > 0
    r0 = plan[FIRST_SCALAR]
    top = r0 if nr > 0 else n
    step = 1 if coefficients.shape[0] > 1 else 0
    ip = 1 + n
    il = ip + n
    value = il + n * n
    forces = value + 2
    block = forces + plan[MOVING]
    powers = block + plan[MOVING] * plan[MOVING]
    data = plan[MOVING] + plan[FROZEN]
    out, w, z, e, e_old, de = np.zeros(powers + 10), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    s, s_old, gamma, result = np.zeros(data + 1), np.zeros(data + 1), np.zeros(1), np.zeros(3)
    M, V = np.zeros((n, n)), np.zeros((n, max(n, 2)))
    for point in range(count):
        c, zt, answer = coefficients[first + step * point], trial[point], found[point]
        for k in range(n):
            z[k], e[k], w[k] = zt[k], 0.0, c[plan[METRIC] + (n + 1) * k]
        for k in range(data):
            s[k] = s_old[k] = zt[n + k]
        gamma[0], result[1], result[2] = 0.0, math.inf, 0.0
        law(z, s, gamma, c, 0, out)
        for k in range(nr):
            z[r0 + k] = out[forces + k]
        if out[0] <= 0.0 and not phi:
            status[point] = 0
            for k in range(2 * n + n * n):
                answer[k] = 0.0
            for k in range(n):
                answer[n + k] = z[k]
            continue
        flag, pinned, weight_q = 1, False, w[0]
        if plan[CURVED] > 0 and not (soft or phi or nr > 0 or out[0] <= 4.0 * out[powers + 9]):
            # along the ray to zero force, which is admissible, to at most twice what is: f may grow fast farther out
            length = 1.0
            for _ in range(60):
                length *= 0.5
                for k in range(n):
                    z[k] = length * zt[k] if w[k] > 0.0 else zt[k]
                law(z, s, gamma, c, 0, out)
                if out[0] <= 0.0:
                    length *= 2.0
                    break
            for k in range(n):
                if w[k] > 0.0:
                    z[k] = length * zt[k]
                    e[k] = (zt[k] - z[k]) / w[k]
        before, penalty, turn = math.inf, 0.0, 0
        gram = 0.0
        while turn < TURNS:
            turn += 1
            law(z, s, gamma, c, 2, out)
            if not math.isfinite(out[0]):
                flag = 2
                break
            for k in range(nr):
                w[r0 + k] = out[block + (nr + 1) * k]
            drift, size, far, across = 0.0, 0.0, 0.0, 0.0
            for k in range(n):
                p = out[ip + k] - e[k]
                V[k, 0], V[k, 1] = p, out[1 + k]
                p += gamma[0] * out[1 + k]
                drift += w[k] * p * p
                if w[k] > 0.0:
                    size = max(size, z[k] * z[k] / w[k])
                    far = max(far, zt[k] * zt[k] / w[k])
            if bent:
                for k in range(n):
                    for l in range(n):
                        M[k, l] = out[il + n * k + l] * w[l]
                    M[k, k] += 1.0
                _eliminate(M, n, V, 2)
            base, gram = out[0], 0.0
            for k in range(n):
                base -= out[1 + k] * w[k] * V[k, 0]
                gram += out[1 + k] * w[k] * V[k, 1]
                across += out[1 + k] * w[k] * out[1 + k]
            if not gram > 0.0 and not soft:
                flag = 3 if out[0] > 0.0 else 1
                if flag == 3:
                    break
            root = math.sqrt(gram) if gram > 0.0 else 1.0
            if soft:
                missed = abs(max(out[0], 0.0) - result[2]) / root if turn > 1 else math.inf
                soft_root(base, gram if gram > 1e-15 * across else 0.0, out, powers, result)
                multiplier = result[0]
            else:
                missed = abs(min(-out[0], gamma[0] * gram)) / root
                multiplier = max(base, 0.0) / gram if gram > 0.0 else 0.0
            size, far = math.sqrt(size), math.sqrt(far) + out[powers + 9] / root
            near, close = 2e-14 * size + 4e-16 * far, 1e-12 * size + 1e-14 * far
            residual = max(math.sqrt(drift), missed)
            bend = 0.0
            for k in range(n):
                de[k] = V[k, 0] + multiplier * V[k, 1]
                bend += w[k] * de[k] * de[k]
            late = turn >= PATIENCE
            done = turn > 1 and (
                residual <= near
                or (residual >= 0.5 * before and residual <= close)
                or (missed <= (8.0 if late else 1.0) * close and math.sqrt(bend) <= (30.0 if late else 1.0) * near)
            )
            if done or not bent:
                if not done:
                    gamma[0] = multiplier
                    for k in range(n):
                        e[k] += de[k]
                        z[k] = zt[k] - w[k] * e[k] if w[k] > 0.0 else z[k]
                if norm and not pinned and z[0] < 0.0:
                    pinned, before, turn = True, math.inf, 0
                    w[0], z[0], e[0] = 0.0, 0.0, 0.0
                    continue
                flag = 0
                break
            penalty = max(penalty, 1.1 * multiplier)
            work = 0.0
            if nr > 0:
                work = -out[value + 1]
                for k in range(nr):
                    work -= z[r0 + k] * (s[k] - s_old[k])
            old = _level(n, top, soft, out, value, powers, e, w, penalty, work)
            slack = 1e-13 * (bend + abs(old)) + 1e-15 * penalty * root * far
            for k in range(n):
                e_old[k] = e[k]
            length = 1.0
            for _ in range(CUTS):
                for k in range(n):
                    e[k] = e_old[k] + length * de[k]
                    if w[k] > 0.0:
                        z[k] = zt[k] - w[k] * e[k]
                for k in range(nr):
                    s[k] = s_old[k] + e[r0 + k]
                law(z, s, gamma, c, 0, out)
                work = 0.0
                if nr > 0:
                    work = -out[value + 1]
                    for k in range(nr):
                        z[r0 + k] = out[forces + k]
                        work -= z[r0 + k] * (s[k] - s_old[k])
                if math.isfinite(out[0]):
                    now = _level(n, top, soft, out, value, powers, e, w, penalty, work)
                    if now <= old - 1e-4 * length * bend + slack:
                        break
                length *= 0.5
            gamma[0] += length * (multiplier - gamma[0])
            before = residual
        status[point] = flag
        if flag != 0:
            continue
        push = gamma[0] * out[1] + out[ip]
        if pinned and push * weight_q <= zt[0]:
            # q < 0 was rounding: with a smooth tip (slope zero at q = 0) the minimiser is a small q > 0, not an apex
            w[0] = weight_q
            bend = 1.0 + weight_q * out[il]
            z[0] = (zt[0] - weight_q * push) / bend
            e[0] = (zt[0] - z[0]) / weight_q
            pinned, gram = False, 0.0
            for k in range(n):
                V[k, 0], V[k, 1] = 0.0, out[1 + k]
                for l in range(n):
                    M[k, l] = out[il + n * k + l] * w[l]
                M[k, k] += 1.0
            _eliminate(M, n, V, 2)
            for k in range(n):
                gram += out[1 + k] * w[k] * V[k, 1]
        inverse = 0.0
        if gamma[0] > 0.0:
            inverse = 1.0 / (gram + result[1]) if soft else 1.0 / gram
        for k in range(n):
            answer[k], answer[n + k] = e[k], z[k]
            for l in range(n):
                answer[2 * n + n * k + l] = V[k, 1] * inverse * V[l, 1]
        if bent:
            for k in range(n):
                for l in range(n):
                    M[k, l] = out[il + n * k + l] * w[l]
                    V[k, l] = out[il + n * k + l]
                M[k, k] += 1.0
            _eliminate(M, n, V, n)
            for k in range(n):
                for l in range(n):
                    answer[2 * n + n * k + l] += V[k, l]
        if pinned:
            answer[0], answer[n] = zt[0] / weight_q, 0.0
            for l in range(n):
                answer[2 * n + l] = answer[2 * n + n * l] = 0.0
            answer[2 * n] = 1.0 / weight_q
