"""The step of laws with one surface f = a q + T + R − k, affine in one deviator norm q, traces and scalar forces: closed form, exact apex.

With B = dev Σ a_k A_k at frozen internal variables, q = ‖B‖:

    elastic  f ≤ 0;
    cone     γ = f/h, h = a² w_q + w_m, valid while q ≥ γ a w_q;   dev ΔX_k = a_k γ a B/q;
    apex     γ = (f − a q)/w_m;                                    dev ΔX_k = a_k B/w_q;

and tr ΔX_k = 3 b_k γ, Δs_j = r_j γ in both; the dissipation is k γ. That the apex is right wherever the cone formula leaves q < 0 follows
from convexity. The tangent is c₀ 𝕀 + c₁ I⊗I + c₂ B⊗B + c₃ (B⊗I + I⊗B). Compiled once per machine: a law enters through numbers.

Coefficients: a, w_q, w_m, g_q, g_T, f at zero, k, stiffness pair, stress at zero; per tensor k_B, k_T, a_k, b_k, moduli pair; per scalar
k_s, r_j; then those of `strain_terms`. Plan: tensors, scalars, strain terms (1) or not (0), then the places in the packed state. With -1
the numbers are those of a conjugate, -psi* over stresses, and stress and tangent change sign: they are strain and compliance.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .kernel_types import STEP_SIGNATURE, compiled
from .spectral import norm6
from .strain_terms import WORK

__all__ = ["closed_step"]


def closed_step() -> Any:
    """The compiled step."""
    return compiled(_step, STEP_SIGNATURE)


def _step(method, law, rest, eps, old, new, stress, tangent, want, dissipation, status, coefficients, plan):
    tensors, scalars = plan[0], plan[1]
    terms = plan[2]
    step = 1 if coefficients.shape[0] > 1 else 0
    last = tangent.shape[0] - 1
    work = np.zeros(WORK)
    third = 1.0 / 3.0
    first = 10 + 6 * tensors
    strain = first + 2 * scalars
    for m in range(eps.shape[0]):
        c = coefficients[step * m]
        a, w_q, w_m, g_q, g_t, s_0, s_1 = c[0], c[1], c[2], c[3], c[4], c[7], c[8]
        h = a * a * w_q + w_m
        e, x, y, t = eps[m], old[m], new[m], tangent[min(m, last)]
        e0, e1, e2, e3, e4, e5 = e[0], e[1], e[2], e[3], e[4], e[5]
        trace = e0 + e1 + e2
        f = c[5] + g_t * trace
        sphere = c[9] + s_1 * trace
        b0, b1, b2, b3, b4, b5 = g_q * e0, g_q * e1, g_q * e2, g_q * e3, g_q * e4, g_q * e5
        s0, s1, s2, s3, s4, s5 = s_0 * e0, s_0 * e1, s_0 * e2, s_0 * e3, s_0 * e4, s_0 * e5
        for k in range(tensors):
            p, o = plan[3 + k], 10 + 6 * k
            if p < 0:
                break  # never: tells the compiler that places are not negative
            x0, x1, x2, x3, x4, x5 = x[p], x[p + 1], x[p + 2], x[p + 3], x[p + 4], x[p + 5]
            w = c[o]
            b0, b1, b2, b3, b4, b5 = b0 + w * x0, b1 + w * x1, b2 + w * x2, b3 + w * x3, b4 + w * x4, b5 + w * x5
            w = c[o + 4]
            s0, s1, s2, s3, s4, s5 = s0 + w * x0, s1 + w * x1, s2 + w * x2, s3 + w * x3, s4 + w * x4, s5 + w * x5
            trace = x0 + x1 + x2
            f += c[o + 1] * trace
            sphere += c[o + 5] * trace
        # the deviator is removed numerically from the sum, so that its trace vanishes to rounding
        mean = (b0 + b1 + b2) * third
        b0, b1, b2 = b0 - mean, b1 - mean, b2 - mean
        if terms < 0:
            # driven by the stress the deviator of a nearly spherical one is a direction: its trace vanishes beside itself
            mean = (b0 + b1 + b2) * third
            b0, b1, b2 = b0 - mean, b1 - mean, b2 - mean
        q = b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3 + b4 * b4 + b5 * b5
        if 1e-280 < q < 1e280:
            q = math.sqrt(q)
        else:
            work[0], work[1], work[2], work[3], work[4], work[5] = b0, b1, b2, b3, b4, b5
            q = norm6(work)
        for j in range(scalars):
            f += c[first + 2 * j] * x[plan[3 + tensors + j]]
        f += a * q
        gamma, slip, p_qq, p_qt, p_tt = 0.0, 0.0, 0.0, 0.0, 0.0
        inverse = 1.0 / q if q > 0.0 else 0.0
        flag = 0
        if not f <= 0.0:
            p_tt = 1.0 / h
            gamma = f * p_tt
            if not h > 0.0:
                flag = 3
            if q >= gamma * a * w_q:
                slip = gamma * a * inverse
                p_qt = a * p_tt
                p_qq = a * p_qt
            else:
                slip = 1.0 / w_q
                p_qq, p_tt = slip, 0.0
                if w_m > 0.0:
                    p_tt = 1.0 / w_m
                    gamma = (f - a * q) / w_m
                else:
                    gamma = q / (a * w_q)
        for k in range(tensors):
            p, o = plan[3 + k], 10 + 6 * k
            if p < 0:
                break
            w, flow = c[o + 2] * slip, c[o + 3] * gamma
            y[p], y[p + 1], y[p + 2] = x[p] + (w * b0 + flow), x[p + 1] + (w * b1 + flow), x[p + 2] + (w * b2 + flow)
            y[p + 3], y[p + 4], y[p + 5] = x[p + 3] + w * b3, x[p + 4] + w * b4, x[p + 5] + w * b5
        for j in range(scalars):
            p = plan[3 + tensors + j]
            y[p] = x[p] + c[first + 2 * j + 1] * gamma
        w = g_q * slip
        sphere -= g_t * gamma
        s0, s1, s2 = s0 - w * b0 + sphere, s1 - w * b1 + sphere, s2 - w * b2 + sphere
        s3, s4, s5 = s3 - w * b3, s4 - w * b4, s5 - w * b5
        if terms < 0:
            s0, s1, s2, s3, s4, s5 = -s0, -s1, -s2, -s3, -s4, -s5
        s = stress[m]
        s[0], s[1], s[2], s[3], s[4], s[5] = s0, s1, s2, s3, s4, s5
        dissipation[m] = gamma * c[6]
        if want:
            drop = g_q * w
            c0 = s_0 - drop
            c1 = s_1 + drop * third - g_t * g_t * p_tt
            c2 = (drop - g_q * g_q * p_qq) * inverse * inverse
            c3 = -g_q * g_t * p_qt * inverse
            if terms < 0:
                c0, c1, c2, c3 = -c0, -c1, -c2, -c3
            u0, u1, u2, u3, u4, u5 = c2 * b0 + c3, c2 * b1 + c3, c2 * b2 + c3, c2 * b3, c2 * b4, c2 * b5
            d0, d1, d2, d3, d4, d5 = c3 * b0 + c1, c3 * b1 + c1, c3 * b2 + c1, c3 * b3, c3 * b4, c3 * b5
            t[0], t[1], t[2] = u0 * b0 + d0 + c0, u0 * b1 + d0, u0 * b2 + d0
            t[3], t[4], t[5] = u0 * b3, u0 * b4, u0 * b5
            t[6], t[7], t[8] = u1 * b0 + d1, u1 * b1 + d1 + c0, u1 * b2 + d1
            t[9], t[10], t[11] = u1 * b3, u1 * b4, u1 * b5
            t[12], t[13], t[14] = u2 * b0 + d2, u2 * b1 + d2, u2 * b2 + d2 + c0
            t[15], t[16], t[17] = u2 * b3, u2 * b4, u2 * b5
            t[18], t[19], t[20] = u3 * b0 + d3, u3 * b1 + d3, u3 * b2 + d3
            t[21], t[22], t[23] = u3 * b3 + c0, u3 * b4, u3 * b5
            t[24], t[25], t[26] = u4 * b0 + d4, u4 * b1 + d4, u4 * b2 + d4
            t[27], t[28], t[29] = u4 * b3, u4 * b4 + c0, u4 * b5
            t[30], t[31], t[32] = u5 * b0 + d5, u5 * b1 + d5, u5 * b2 + d5
            t[33], t[34], t[35] = u5 * b3, u5 * b4, u5 * b5 + c0
        if terms > 0:
            rest(e, s, work, c[strain:], want, t)
        if flag == 0 and not math.isfinite(s[0] + s[1] + s[2] + s[3] + s[4] + s[5]):
            flag = 2
        status[m] = flag
