"""The closed step with unilateral energies of the strain, inverted: the strain that carries a given stress.

With the slip s (dev flow s B, B = B_n + g dev ε) and γ given, ∇W_n(ε) = σ is an isotropic monotone equation

    α ε + β (tr ε) I + m_t ⟨tr ε + t₀⟩ I + m ⟨ε + e₀ I⟩ = r,    α = s_0 − g² s,  β = s_1 + g² s/3,  r = r_n + s g B_n + γ g_T I,

so ε is coaxial with r: one eigenproblem, and one scalar equation for tr ε that is concave, decreasing and piecewise linear, which Newton's
method solves after at most one turn per piece. Elastic states have s = γ = 0; at the apex s = 1/w_q and γ is linear in tr ε, so both end
here. On the cone (s, γ) are found by Newton's method on

    h γ = f(ε),    s ‖B‖ = a γ,

with the derivatives of ε by perturbation, from the start that is exact where the map is linear. If that does not end, the whole point is
left to `inverse_step`. The compliance is the inverse of a diagonal matrix in the frame of r plus four dyads.

Signature, plan and coefficients are those of `kernels.closed_text`; the first array holds stresses, strain and compliance come out. At most
one trace term and one spectral term, both with a > 0.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numba import types

from ..cache import content_hash, load_text, njit
from .inverse_step import advance, begin, inverted
from .isotropic_inverse import compliance_row, local_inverse, principal_solution
from .kernel_types import LAW, METHOD, PLACES, ROW, STEP, TABLE, compiled
from .key import kernels_hash
from .spectral import eigen

__all__ = ["inverse_points", "inverse_unilateral"]

_FOLDER = kernels_hash()
_ROOT = 1.4142135623730951
_HALF = 0.7071067811865476
_FLAT = 1e-13
TURNS = 25

_SIGNATURE = types.void(
    STEP, METHOD, LAW, LAW, TABLE, TABLE, TABLE, TABLE, TABLE, types.int64, ROW, PLACES, TABLE, PLACES
)
_TEXT = '''"""Written by fenchel.integrators.inverse_unilateral; do not edit."""

from fenchel.cache import njit
from fenchel.integrators.inverse_unilateral import inverse_points
from fenchel.integrators.kernel_types import STEP_SIGNATURE
from fenchel.integrators.kernels import step_kernel

FORWARD = step_kernel("closed", 6, {plan})
POINTS = inverse_points()


@njit(cache=False, signature_or_function=STEP_SIGNATURE, nogil=True)  # two calls: pointers cannot be kept on disk
def step(method, law, rest, sig, old, new, strain, compliance, want, dissipation, status, coefficients, plan):
    """The strain that carries a stress, at every point."""
    POINTS(FORWARD, method, law, rest, sig, old, new, strain, compliance, want, dissipation, status, coefficients, plan)
'''


def inverse_points() -> Any:
    """The compiled inverse; its first argument is the step forward, for the points that are left to `inverse_step`."""
    return compiled(_points, _SIGNATURE)


@functools.cache
def inverse_unilateral(plan: tuple[int, ...]) -> Any:
    """The compiled step of a plan."""
    text = _TEXT.format(plan=plan)
    return load_text("kernels", f"fenchel_inverse_step_{content_hash(text, kernels_hash())}", lambda: text).step


@njit(folder=_FOLDER)
def _newton(forward, method, law, rest, given, before, after, out, t, want, loss, row, plan, work):
    """One point by `inverse_step`: returns its status."""
    stiff = abs(row[0, 7]) + 3.0 * abs(row[0, 8])
    rows, tangent, room, control = work[0].reshape(6, 6), work[1:2], work[2], work[3]
    code = np.zeros(1, dtype=np.int64)
    begin(rows, control)
    flag = -1
    while flag < 0:
        forward(method, law, rest, rows[1:2], before, after, rows[2:3], tangent, 1, loss, code, row, plan)
        flag = advance(given, rows, tangent[0], code[0], stiff, room, control)
    if flag == 0:
        # once more at the best point, for its state and tangent
        forward(method, law, rest, rows[1:2], before, after, rows[2:3], tangent, 1, loss, code, row, plan)
    for k in range(6):
        out[k] = rows[1, k]
    if want:
        inverted(tangent[0], stiff, rows, t)
    return flag


def _points(
    forward, method, law, rest, sig, old, new, strain_out, compliance, want, dissipation, status, coefficients, plan
):
    tensors, scalars = plan[0], plan[1]
    step = 1 if coefficients.shape[0] > 1 else 0
    last = compliance.shape[0] - 1
    third = 1.0 / 3.0
    first = 10 + 6 * tensors
    strain = first + 2 * scalars
    frame, full = np.zeros(12), np.zeros(6)
    loss, work = np.zeros(1), np.zeros((4, 36))
    dyads = np.zeros((5, 6))
    for point in range(sig.shape[0]):
        c_ = coefficients[step * point]
        a, w_q, w_m, g_q, g_t, s_0, s_1 = c_[0], c_[1], c_[2], c_[3], c_[4], c_[7], c_[8]
        h = a * a * w_q + w_m
        mt, t0, me, e0 = 0.0, 0.0, 0.0, 0.0
        # other energies than one of each kind with a > 0 go to `inverse_step`
        plain = c_[strain] <= 1.0 and c_[strain + 1] <= 1.0
        o = strain + 2
        if c_[strain] > 0.0:
            plain = plain and c_[o + 1] > 0.0
            mt, t0 = 2.0 * c_[o] * c_[o + 1] * c_[o + 1], c_[o + 2] / c_[o + 1]
            o += 3
        if c_[strain + 1] > 0.0:
            plain = plain and c_[o + 1] > 0.0
            me, e0 = 2.0 * c_[o] * c_[o + 1] * c_[o + 1], c_[o + 2] / c_[o + 1]
        given, x, y = sig[point], old[point], new[point]
        r0, r1, r2 = given[0] - c_[9], given[1] - c_[9], given[2] - c_[9]
        r3, r4, r5 = given[3], given[4], given[5]
        h0, h1, h2, h3, h4, h5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        f_0 = c_[5]
        for k in range(tensors):
            p, o = plan[3 + k], 10 + 6 * k
            if p < 0:
                break  # never: tells the compiler that places are not negative
            x0, x1, x2, x3, x4, x5 = x[p], x[p + 1], x[p + 2], x[p + 3], x[p + 4], x[p + 5]
            trace = x0 + x1 + x2
            w = c_[o]
            h0, h1, h2, h3, h4, h5 = h0 + w * x0, h1 + w * x1, h2 + w * x2, h3 + w * x3, h4 + w * x4, h5 + w * x5
            w = c_[o + 4]
            r0, r1, r2, r3, r4, r5 = r0 - w * x0, r1 - w * x1, r2 - w * x2, r3 - w * x3, r4 - w * x4, r5 - w * x5
            f_0 += c_[o + 1] * trace
            w = c_[o + 5] * trace
            r0, r1, r2 = r0 - w, r1 - w, r2 - w
        for j in range(scalars):
            f_0 += c_[first + 2 * j] * x[plan[3 + tensors + j]]
        mean = (h0 + h1 + h2) * third
        h0, h1, h2 = h0 - mean, h1 - mean, h2 - mean
        still = h0 == 0.0 and h1 == 0.0 and h2 == 0.0 and h3 == 0.0 and h4 == 0.0 and h5 == 0.0
        size = abs(r0) + abs(r1) + abs(r2) + abs(r3) + abs(r4) + abs(r5)
        # stages: 0 elastic, 1 cone, 2 apex; `tried` the apex already
        stage, tried, done, turn = 0, False, False, 0
        slip, gamma, d_slip, d_gamma = 0.0, 0.0, 0.0, 0.0
        fresh, frozen = True, False
        k0, k1, k2, open_ = False, False, False, False
        n_01, n_02, n_12, v0, v1, v2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        flag = 0
        c, w, wi, wj, beta, D, g_b, g_i, g_ii, q = 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0
        nb, ib, jb = 0.0, 0.0, 0.0
        l, i, j = 0, 1, 2
        e_0, e_1, e_2, e_3, e_4, e_5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        b0, b1, b2, b3, b4, b5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        z0, z1, z2, z3, z4, z5, ball = r0, r1, r2, r3, r4, r5, 0.0
        while plain and turn < TURNS:
            turn += 1
            alpha, beta = s_0, s_1
            ball = 0.0
            if stage == 1:
                drop = g_q * g_q * slip
                alpha, beta, ball = s_0 - drop, s_1 + drop * third, g_t * gamma
            elif stage == 2:
                slip = 1.0 / w_q
                drop = g_q * g_q * slip
                alpha, beta = s_0 - drop, s_1 + drop * third - g_t * g_t / w_m
                ball = g_t * f_0 / w_m
            alpha = max(alpha, _FLAT * s_0)
            t = g_q * slip
            if frozen:
                # r in the frame of the elastic state: its diagonal, and what is beside it to the first order
                n0, n1, n2 = frame[3], frame[6], frame[9]
                u0 = h0 * n0 + _HALF * (h5 * n1 + h4 * n2)
                u1 = h1 * n1 + _HALF * (h5 * n0 + h3 * n2)
                u2 = h2 * n2 + _HALF * (h4 * n0 + h3 * n1)
                n_00 = u0 * n0 + u1 * n1 + u2 * n2
                n_02 = t * (u0 * frame[5] + u1 * frame[8] + u2 * frame[11])
                n0, n1, n2 = frame[4], frame[7], frame[10]
                n_01 = t * (u0 * n0 + u1 * n1 + u2 * n2)
                u0 = h0 * n0 + _HALF * (h5 * n1 + h4 * n2)
                u1 = h1 * n1 + _HALF * (h5 * n0 + h3 * n2)
                u2 = h2 * n2 + _HALF * (h4 * n0 + h3 * n1)
                n_11 = u0 * n0 + u1 * n1 + u2 * n2
                n_12 = t * (u0 * frame[5] + u1 * frame[8] + u2 * frame[11])
                v0, v1, v2 = v0 + t * n_00, v1 + t * n_11, v2 - t * (n_00 + n_11)
                z0, z1, z2, z3, z4, z5 = r0 + t * h0, r1 + t * h1, r2 + t * h2, r3 + t * h3, r4 + t * h4, r5 + t * h5
            elif fresh or not still:
                z0, z1, z2, z3, z4, z5 = r0 + t * h0, r1 + t * h1, r2 + t * h2, r3 + t * h3, r4 + t * h4, r5 + t * h5
                full[0], full[1], full[2], full[3], full[4], full[5] = z0, z1, z2, z3, z4, z5
                eigen(full, frame)
                fresh = False
                v0, v1, v2 = frame[0], frame[1], frame[2]
            frame[0], frame[1], frame[2] = v0 + ball, v1 + ball, v2 + ball
            low, high = 1.0 / alpha, 1.0 / (alpha + me)
            if stage == 0:
                open_ = v0 + v1 + v2 > 0.0
                P = beta * (v0 + v1 + v2) / (alpha + 3.0 * beta)
                k0, k1, k2 = v0 > P, v1 > P, v2 > P
            P, T, k0, k1, k2, open_, beta, D = principal_solution(
                frame[0], frame[1], frame[2], low, high, beta, me * e0, e0, mt, t0, k0, k1, k2, open_
            )
            l, i, j, c, p, d, w, wi, wj = local_inverse(frame, low, high, alpha, me, e0, P, k0, k1, k2)
            n0, n1, n2 = frame[3 + l], frame[6 + l], frame[9 + l]
            sphere, lone = p, d
            p -= ball
            e_0, e_1, e_2 = c * (z0 - p) + d * n0 * n0, c * (z1 - p) + d * n1 * n1, c * (z2 - p) + d * n2 * n2
            d *= _ROOT
            e_3, e_4, e_5 = c * z3 + d * n1 * n2, c * z4 + d * n0 * n2, c * z5 + d * n0 * n1
            if me > 30.0 * s_0 and w != 0.0 and not frozen:
                # c r would cancel against d n⊗n: from the principal values, e_j I + (e_l − e_j) n_l⊗n_l + (e_i − e_j) n_i⊗n_i
                d = c * (frame[j] - sphere)
                x0, x1, x2 = frame[3 + i], frame[6 + i], frame[9 + i]
                s, u = c * (frame[l] - sphere) + lone - d, c * (frame[i] - sphere) - d
                e_0, e_1, e_2 = (
                    d + s * n0 * n0 + u * x0 * x0,
                    d + s * n1 * n1 + u * x1 * x1,
                    d + s * n2 * n2 + u * x2 * x2,
                )
                s, u = _ROOT * s, _ROOT * u
                e_3, e_4, e_5 = s * n1 * n2 + u * x1 * x2, s * n0 * n2 + u * x0 * x2, s * n0 * n1 + u * x0 * x1
            if frozen and (wi != 0.0 or wj != 0.0):
                # off-diagonal parts with the stiffness of their pair of axes
                s, u = 2.0 * wi, 2.0 * wj
                s *= n_01 if l + i == 1 else n_02 if l + i == 2 else n_12
                u *= n_01 if l + j == 1 else n_02 if l + j == 2 else n_12
                x0, x1, x2 = (
                    s * frame[3 + i] + u * frame[3 + j],
                    s * frame[6 + i] + u * frame[6 + j],
                    s * frame[9 + i] + u * frame[9 + j],
                )
                e_0, e_1, e_2 = e_0 + n0 * x0, e_1 + n1 * x1, e_2 + n2 * x2
                e_3, e_4, e_5 = (
                    e_3 + _HALF * (n1 * x2 + n2 * x1),
                    e_4 + _HALF * (n0 * x2 + n2 * x0),
                    e_5 + _HALF * (n0 * x1 + n1 * x0),
                )
            T = e_0 + e_1 + e_2
            mean = g_q * T * third
            b0, b1, b2 = h0 + (g_q * e_0 - mean), h1 + (g_q * e_1 - mean), h2 + (g_q * e_2 - mean)
            b3, b4, b5 = h3 + g_q * e_3, h4 + g_q * e_4, h5 + g_q * e_5
            q = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3 + b4 * b4 + b5 * b5)
            bulk = f_0 + g_t * T
            f = bulk + a * q
            if stage == 0 and f <= 0.0:
                done = True
                break
            if stage == 2:
                gamma = bulk / w_m
                if gamma > 0.0 and q <= gamma * a * w_q:
                    done = True
                    break
                # not at the apex: back to the cone
                stage, tried, slip = 1, True, 0.9 / w_q
                gamma = slip * q / a
                fresh = True
                continue
            # B n and its components; products of A⁻¹ with B and I
            t3, t4, t5 = _HALF * b3, _HALF * b4, _HALF * b5
            u0, u1, u2 = b0 * n0 + t5 * n1 + t4 * n2, t5 * n0 + b1 * n1 + t3 * n2, t4 * n0 + t3 * n1 + b2 * n2
            nb = n0 * u0 + n1 * u1 + n2 * u2
            ib = _ROOT * (frame[3 + i] * u0 + frame[6 + i] * u1 + frame[9 + i] * u2)
            jb = _ROOT * (frame[3 + j] * u0 + frame[6 + j] * u1 + frame[9 + j] * u2)
            g_i = w * nb / D
            g_b = c * q * q + w * nb * nb + wi * ib * ib + wj * jb * jb - beta * w * nb * g_i
            g_ii = (3.0 * c + w) / D
            inverse = 1.0 / q if q > 0.0 else 0.0
            q_s, q_g = g_q * g_q * g_b * inverse, g_q * g_t * g_i * inverse
            if stage == 0:
                soft = h - (a * a * q_s * inverse + 2.0 * a * q_g + g_t * g_t * g_ii)
                stage = 1
                if not (soft > 1e-12 * h and q > 0.0):
                    break
                gamma = f / soft
                far = q + gamma * (a * q_s * inverse + q_g)
                slip = a * gamma / far
                if not (slip * w_q < 1.0 and far > 0.0):
                    if w_m > 0.0 and w_q > 0.0:
                        stage, fresh = 2, True
                        continue
                    break
                # worth its while where the energy of the strain is strong enough to turn the axes
                frozen = not still and me > 0.05 * s_0
                continue
            off, apart = h * gamma - f, slip * q - a * gamma
            m_11, m_12 = -g_t * g_q * g_i - a * q_s, h - g_t * g_t * g_ii - a * q_g
            m_21, m_22 = q + slip * q_s, slip * q_g - a
            det = m_11 * m_22 - m_12 * m_21
            d_slip, d_gamma = -(off * m_22 - apart * m_12) / det, -(apart * m_11 - off * m_21) / det
            noise = 4e-16 * (abs(f_0) + abs(g_t * T) + a * q)
            near = 2e-7 * h * gamma + noise
            if not frozen and h * abs(d_gamma) <= near and h * q * abs(d_slip) <= a * near:
                # what is left is added by its first order, if it meets no kink on its way, or is rounding
                far = (abs(g_q * d_slip) * q + 2.0 * abs(g_t * d_gamma)) * low
                gap = min(abs(T + t0), abs(c * (frame[l] - sphere) + lone + e0))
                gap = min(gap, abs(c * (frame[i] - sphere) + e0), abs(c * (frame[j] - sphere) + e0))
                if far <= 1e-6 * gap or (h * abs(d_gamma) <= noise and h * q * abs(d_slip) <= a * noise):
                    done = True
                    break
            frozen = False
            gamma += d_gamma
            slip += d_slip
            if w_q > 0.0 and slip * w_q >= 1.0:
                if tried or w_m <= 0.0:
                    slip = (1.0 - 1e-9) / w_q
                else:
                    stage, fresh = 2, True
            elif not (slip > 0.0 and gamma > 0.0):
                break
        out = strain_out[point]
        if not done:
            row = coefficients[step * point : step * point + 1]
            before, after = old[point : point + 1], new[point : point + 1]
            status[point] = _newton(
                forward,
                method,
                law,
                rest,
                given,
                before,
                after,
                out,
                compliance[min(point, last)],
                want,
                loss,
                row,
                plan,
                work,
            )
            dissipation[point] = loss[0]
            continue
        n0, n1, n2 = frame[3 + l], frame[6 + l], frame[9 + l]
        # A⁻¹ B, and v with A⁻¹ I = v/D
        v0, v1, v2 = c + w * n0 * n0, c + w * n1 * n1, c + w * n2 * n2
        v3, v4, v5 = w * _ROOT * n1 * n2, w * _ROOT * n0 * n2, w * _ROOT * n0 * n1
        x0, x1, x2 = frame[3 + i], frame[6 + i], frame[9 + i]
        y0, y1, y2 = frame[3 + j], frame[6 + j], frame[9 + j]
        i0, i1, i2 = _ROOT * n0 * x0, _ROOT * n1 * x1, _ROOT * n2 * x2
        i3, i4, i5 = n1 * x2 + n2 * x1, n0 * x2 + n2 * x0, n0 * x1 + n1 * x0
        j0, j1, j2 = _ROOT * n0 * y0, _ROOT * n1 * y1, _ROOT * n2 * y2
        j3, j4, j5 = n1 * y2 + n2 * y1, n0 * y2 + n2 * y0, n0 * y1 + n1 * y0
        p0, p1, p2, p3, p4, p5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if stage == 1:
            s, t = wi * ib, wj * jb
            p0, p1, p2 = c * b0 + s * i0 + t * j0, c * b1 + s * i1 + t * j1, c * b2 + s * i2 + t * j2
            p3, p4, p5 = c * b3 + s * i3 + t * j3, c * b4 + s * i4 + t * j4, c * b5 + s * i5 + t * j5
            # w (n:B) n − β (v:B)/D v with v = c I + w n
            s = w * nb
            p0, p1, p2 = (
                p0 + s * n0 * n0 - beta * g_i * v0,
                p1 + s * n1 * n1 - beta * g_i * v1,
                p2 + s * n2 * n2 - beta * g_i * v2,
            )
            s *= _ROOT
            p3, p4, p5 = (
                p3 + s * n1 * n2 - beta * g_i * v3,
                p4 + s * n0 * n2 - beta * g_i * v4,
                p5 + s * n0 * n1 - beta * g_i * v5,
            )
            s, t = g_q * d_slip, g_t * d_gamma / D
            e_0, e_1, e_2 = e_0 + (s * p0 + t * v0), e_1 + (s * p1 + t * v1), e_2 + (s * p2 + t * v2)
            e_3, e_4, e_5 = e_3 + (s * p3 + t * v3), e_4 + (s * p4 + t * v4), e_5 + (s * p5 + t * v5)
            T = e_0 + e_1 + e_2
            mean = g_q * T * third
            b0, b1, b2 = h0 + (g_q * e_0 - mean), h1 + (g_q * e_1 - mean), h2 + (g_q * e_2 - mean)
            b3, b4, b5 = h3 + g_q * e_3, h4 + g_q * e_4, h5 + g_q * e_5
            q = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3 + b4 * b4 + b5 * b5)
            gamma = (f_0 + g_t * T + a * q) / h
            slip = gamma * a / q
        for k in range(tensors):
            p, o = plan[3 + k], 10 + 6 * k
            if p < 0:
                break
            s, flow = c_[o + 2] * slip, c_[o + 3] * gamma
            y[p], y[p + 1], y[p + 2] = x[p] + (s * b0 + flow), x[p + 1] + (s * b1 + flow), x[p + 2] + (s * b2 + flow)
            y[p + 3], y[p + 4], y[p + 5] = x[p + 3] + s * b3, x[p + 4] + s * b4, x[p + 5] + s * b5
        for k in range(scalars):
            p = plan[3 + tensors + k]
            y[p] = x[p] + c_[first + 2 * k + 1] * gamma
        out[0], out[1], out[2], out[3], out[4], out[5] = e_0, e_1, e_2, e_3, e_4, e_5
        dissipation[point] = gamma * c_[6]
        total = abs(e_0) + abs(e_1) + abs(e_2) + abs(e_3) + abs(e_4) + abs(e_5)
        if not total < math.inf:
            flag = 2
        elif total * s_0 > 1e12 * size:
            flag = 3
        status[point] = flag
        if not want:
            continue
        # A⁻¹ − (v, p) Z (v, p)ᵀ
        z_vv, z_vp, z_pp = beta / D, 0.0, 0.0
        if stage == 1:
            inverse = 1.0 / q
            k_bb, k_bi, k_ii = (
                g_q * g_q * (slip - a * a / h) * inverse * inverse,
                -g_q * g_t * a / h * inverse,
                -g_t * g_t / h,
            )
            g_11, g_12 = 1.0 + g_b * k_bb + g_i * k_bi, g_b * k_bi + g_i * k_ii
            g_21, g_22 = g_i * k_bb + g_ii * k_bi, 1.0 + g_i * k_bi + g_ii * k_ii
            det = 1.0 / (g_11 * g_22 - g_12 * g_21)
            z_pp = (k_bb * g_22 - k_bi * g_21) * det
            z_vp = (k_bi * g_11 - k_bb * g_12) * det / D
            z_vv += (k_ii * g_11 - k_bi * g_12) * det / (D * D)
        t = compliance[min(point, last)]
        dyads[0, 0], dyads[0, 1], dyads[0, 2] = n0 * n0, n1 * n1, n2 * n2
        dyads[0, 3], dyads[0, 4], dyads[0, 5] = _ROOT * n1 * n2, _ROOT * n0 * n2, _ROOT * n0 * n1
        dyads[1, 0], dyads[1, 1], dyads[1, 2], dyads[1, 3], dyads[1, 4], dyads[1, 5] = i0, i1, i2, i3, i4, i5
        dyads[2, 0], dyads[2, 1], dyads[2, 2], dyads[2, 3], dyads[2, 4], dyads[2, 5] = j0, j1, j2, j3, j4, j5
        dyads[3, 0], dyads[3, 1], dyads[3, 2], dyads[3, 3], dyads[3, 4], dyads[3, 5] = v0, v1, v2, v3, v4, v5
        dyads[4, 0], dyads[4, 1], dyads[4, 2], dyads[4, 3], dyads[4, 4], dyads[4, 5] = p0, p1, p2, p3, p4, p5
        compliance_row(c, w, wi, wj, z_vv, z_vp, z_pp, dyads, t)
