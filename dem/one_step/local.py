r"""One contact with the others held, solved exactly: r ∈ K, u = B r + q, û ⟂ r, for a 3 × 3 block B (normal first).

Open: q_N ≥ 0 gives r = 0. Stick: r = −B⁻¹ q inside the cone. Slip: u_N = 0 and u_T = −λ r_T with λ ≥ 0; eliminating the normal,

    r_N = −(q_N + B_NT r_T)/B_NN ,   (S + λ I) r_T = b ,   S = B_TT − B_TN B_NT/B_NN ,   b = −q_T + B_TN q_N/B_NN ,

one scalar λ with ‖r_T‖ = μ r_N, found by Newton's method inside a bracket: the left side minus the right is positive at λ = 0 (else the
contact sticks) and negative for large λ (r_T → 0, r_N → −q_N/B_NN > 0). B need be neither symmetric nor regular.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...cache import njit

__all__ = ["solve_contact"]

Array = NDArray[np.float64]


@njit
def solve_contact(B: Array, q0: float, q1: float, q2: float, mu: float, r: Array) -> None:
    """Write the solution into `r` (3,)."""
    if q0 >= 0.0 or B[0, 0] <= 0.0:
        r[0] = r[1] = r[2] = 0.0
        return
    inv = 1.0 / B[0, 0]
    s11 = B[1, 1] - B[1, 0] * B[0, 1] * inv
    s12 = B[1, 2] - B[1, 0] * B[0, 2] * inv
    s21 = B[2, 1] - B[2, 0] * B[0, 1] * inv
    s22 = B[2, 2] - B[2, 0] * B[0, 2] * inv
    b1 = -q1 + B[1, 0] * q0 * inv
    b2 = -q2 + B[2, 0] * q0 * inv
    size = abs(s11) + abs(s22) + abs(s12) + abs(s21)
    low = 1e-14 * size if size > 0.0 else 1e-300
    high = -1.0
    shift = low
    for turn in range(80):
        d11 = s11 + shift
        d22 = s22 + shift
        det = d11 * d22 - s12 * s21
        if det == 0.0:
            det = 1e-300
        t1 = (d22 * b1 - s12 * b2) / det
        t2 = (d11 * b2 - s21 * b1) / det
        normal = -(q0 + B[0, 1] * t1 + B[0, 2] * t2) * inv
        length = np.sqrt(t1 * t1 + t2 * t2)
        excess = length - mu * normal
        if turn == 0 and excess <= 0.0:  # stick
            r[0], r[1], r[2] = normal, t1, t2
            return
        if abs(excess) <= 1e-15 * (length + mu * abs(normal)):
            break
        if excess > 0.0:
            low = shift
        else:
            high = shift
        if high > 0.0 and high - low <= 1e-16 * high:
            break
        # derivative along λ: r_T' = −(S + λ)⁻¹ r_T
        v1 = -(d22 * t1 - s12 * t2) / det
        v2 = -(d11 * t2 - s21 * t1) / det
        slope = (t1 * v1 + t2 * v2) / length + mu * (B[0, 1] * v1 + B[0, 2] * v2) * inv if length > 0.0 else 0.0
        # Newton on 1/‖r_T‖-like growth: the step is taken in λ directly and kept only inside the bracket
        trial = shift - excess / slope if slope < 0.0 else -1.0
        if trial <= low or (high > 0.0 and trial >= high):
            trial = 0.5 * (low + high) if high > 0.0 else max(4.0 * shift, size)
        shift = trial
    normal = max(normal, 0.0)
    bound = mu * normal
    if length > 0.0:
        t1 *= bound / length
        t2 *= bound / length
    r[0], r[1], r[2] = normal, t1, t2
