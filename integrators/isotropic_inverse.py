"""The isotropic map ε ↦ α ε + β (tr ε) I + m_t ⟨tr ε + t₀⟩ I + m ⟨ε + e₀ I⟩, inverted at one tensor r with given principal values.

ε is coaxial with r, and tr ε solves one scalar equation,

    Σ_i h(r_i − β T − m_t ⟨T + t₀⟩) = T,    h(y) = y/α where y/α ≤ −e₀, (y − m e₀)/(α + m) elsewhere,

whose residual is concave and decreasing in T (α > 0, α + 3β > 0): Newton's method takes one turn per piece of it at most. The derivative
of the inverse is isotropic up to the axis whose sign stands alone,

    c 𝕀 + w n⊗n + w_i d_i⊗d_i + w_j d_j⊗d_j − (β/D) v⊗v,    v = c I + w n,

n the dyad of that axis, d the unit dyads of the two pairs of axes that it belongs to, w_i, w_j by divided differences.
"""

from __future__ import annotations

from ..cache import njit
from .key import kernels_hash

__all__ = ["compliance_row", "local_inverse", "principal_solution"]

_FOLDER = kernels_hash()


@njit(folder=_FOLDER)
def principal_solution(r0, r1, r2, low, high, beta, shift, e0, mt, t0, k0, k1, k2, open_):
    """Scalar equation in principal values, `low` = 1/α, `high` = 1/(α + m), `shift` = m e₀, begun with a guess of which ε_i + e₀ (k) and
    whether tr ε + t₀ (`open_`) are positive: returns the mean part P, tr ε, these signs, β with the trace term, and D = 1 + β Σ 1/α_i."""
    P, T, b, D = 0.0, 0.0, beta, 1.0
    for _ in range(12):
        b, base = (beta + mt, mt * t0) if open_ else (beta, 0.0)
        w0, w1, w2 = high if k0 else low, high if k1 else low, high if k2 else low
        x0 = r0 - base - (shift if k0 else 0.0)
        x1 = r1 - base - (shift if k1 else 0.0)
        x2 = r2 - base - (shift if k2 else 0.0)
        D = max(1.0 + b * (w0 + w1 + w2), 1e-14)
        T = (w0 * x0 + w1 * x1 + w2 * x2) / D
        P = b * T + base
        n0, n1, n2 = (r0 - P) * low + e0 > 0.0, (r1 - P) * low + e0 > 0.0, (r2 - P) * low + e0 > 0.0
        next_ = T + t0 > 0.0
        if n0 == k0 and n1 == k1 and n2 == k2 and next_ == open_:
            break
        k0, k1, k2, open_ = n0, n1, n2, next_
    return P, T, k0, k1, k2, open_, b, D


@njit(folder=_FOLDER)
def local_inverse(r, low, high, alpha, m, e0, P, k0, k1, k2):
    """The inverse of the map at its solution: ε = c (r − p I) + d n⊗n, and its derivative c 𝕀 + w n⊗n + w₁ d₁⊗d₁ + w₂ d₂⊗d₂ beside
    the spherical part; n the axis whose sign stands alone, first of the places (l, i, j). Returns l, i, j, c, p, d, w, w₁, w₂."""
    count = int(k0) + int(k1) + int(k2)
    if count == 0:
        return 0, 1, 2, low, P, 0.0, 0.0, 0.0, 0.0
    shift = m * e0
    if count == 3:
        return 0, 1, 2, high, P + shift, 0.0, 0.0, 0.0, 0.0
    if count == 1:
        l = 0 if k0 else 1 if k1 else 2
        c, p, w = low, P, high - low
        lone = (r[l] - P - shift) * high
    else:
        l = 2 if not k2 else 1 if not k1 else 0
        c, p, w = high, P + shift, low - high
        lone = (r[l] - P) * low
    i, j = (l + 1) % 3, (l + 2) % 3
    ei, ej = c * (r[i] - p), c * (r[j] - p)
    # of a pair of axes the stiffness is α + m θ, θ = (e_l + e₀)/(e_l − e_i), or its complement where the positive one is i
    gi, gj = lone - ei, lone - ej
    if count == 1:
        wi, wj = gi / (alpha * gi + m * (lone + e0)), gj / (alpha * gj + m * (lone + e0))
    else:
        wi, wj = gi / (alpha * gi - m * (ei + e0)), gj / (alpha * gj - m * (ej + e0))
    return l, i, j, c, p, lone - c * (r[l] - p), w, wi - c, wj - c


@njit(folder=_FOLDER)
def compliance_row(c, w, wi, wj, z_vv, z_vp, z_pp, dyads, t):
    """c 𝕀 + w n⊗n + w_i d_i⊗d_i + w_j d_j⊗d_j − (v, p) Z (v, p)ᵀ into a row of 36; `dyads` holds n⊗n, d_i, d_j, v, p."""
    for k in range(6):
        n_k, i_k, j_k = w * dyads[0, k], wi * dyads[1, k], wj * dyads[2, k]
        v_k, p_k = z_vv * dyads[3, k] + z_vp * dyads[4, k], z_vp * dyads[3, k] + z_pp * dyads[4, k]
        for r in range(6):
            t[6 * k + r] = (n_k * dyads[0, r] + i_k * dyads[1, r] + j_k * dyads[2, r]) - (
                v_k * dyads[3, r] + p_k * dyads[4, r]
            )
        t[7 * k] += c
