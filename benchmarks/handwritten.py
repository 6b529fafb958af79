"""Drucker–Prager with combined hardening as an engineer writes it by hand for numba: the measure of what is generated.

One law, one formula: radial return on the cone in closed form, no apex, consistent tangent, 3d, float64. The same law as `sand` of the
library (K = bulk, G = shear modulus, f = ‖dev(A + χ)‖/√2 + t/3 tr(A + χ) + R − C₀, α = ε^p), of which nothing is used.
"""

from __future__ import annotations

import math

import numba
import numpy as np

__all__ = ["drucker_prager_by_hand"]


@numba.njit(error_model="numpy")
def drucker_prager_by_hand(eps, old, new, stress, tangent, dissipation, status, K, G, t, C_0, H_k, H_i):
    """State rows: ε^p (6), α (6), p; tangent rows of 36."""
    h = G + H_k / 2.0 + t * t * (K + H_k / 3.0) + H_i
    trial, s = np.empty(6), np.empty(6)
    for m in range(eps.shape[0]):
        volume = 0.0
        for i in range(3):
            volume += eps[m, i] - old[m, i]
        for i in range(6):
            trial[i] = 2.0 * G * (eps[m, i] - old[m, i])
        for i in range(3):
            trial[i] += (K - 2.0 * G / 3.0) * volume
        mean = 0.0
        for i in range(6):
            s[i] = trial[i] - H_k * old[m, 6 + i]
        for i in range(3):
            mean += s[i] / 3.0
        b = 0.0
        for i in range(3):
            s[i] -= mean
        for i in range(6):
            b += s[i] * s[i]
        b = math.sqrt(b / 2.0)
        f = b + t * mean - H_i * old[m, 12] - C_0
        for i in range(36):
            tangent[m, i] = 0.0
        for i in range(6):
            tangent[m, 7 * i] = 2.0 * G
        for i in range(3):
            for j in range(3):
                tangent[m, 6 * i + j] += K - 2.0 * G / 3.0
        gamma = max(f, 0.0) / h
        for i in range(6):
            n = s[i] / (2.0 * b) if b > 0.0 else 0.0
            if i < 3:
                n += t / 3.0
            new[m, i] = old[m, i] + gamma * n
            new[m, 6 + i] = old[m, 6 + i] + gamma * n
            stress[m, i] = trial[i] - gamma * (G * s[i] / b if b > 0.0 else 0.0)
            if i < 3:
                stress[m, i] -= gamma * K * t
        new[m, 12] = old[m, 12] + gamma
        dissipation[m] = C_0 * gamma
        status[m] = 0
        if gamma > 0.0:
            turn = gamma * 2.0 * G * G / b
            for i in range(6):
                left = G * s[i] / b + (K * t if i < 3 else 0.0)
                for j in range(6):
                    right = G * s[j] / b + (K * t if j < 3 else 0.0)
                    tangent[m, 6 * i + j] -= left * right / h - turn * s[i] * s[j] / (2.0 * b * b)
                tangent[m, 7 * i] -= turn
            for i in range(3):
                for j in range(3):
                    tangent[m, 6 * i + j] += turn / 3.0
