"""Proximal steps of scalar convex functions: powers, exponentials, entropies and logarithms, compiled.

For a term g(s) of the objective with s = h − Gy, the augmented Lagrangian at v = λ + τ(Gy − h) asks for the s with

    g′(s) + τ s + v = 0,   then   λ⁺ = −g′(s),   dλ⁺/dv = g″/(g″ + τ),

which is what the projection is for a cone. Every equation is solved in the logarithm of its steep part, where it is convex and increasing,
by Newton's method from the right side: a handful of steps for exponents from 1 to 1000.

    POWER_TERM        C |s|ᵐ, m > 1          EXPONENTIAL_TERM   C exp(s/k)
    ENTROPY_TERM      C (r ln(r/k) − r), r = −s ≥ 0           LOGARITHM_TERM     −C ln s
"""

from __future__ import annotations

import math

from ..cache import njit
from .key import files_hash

__all__ = [
    "ENTROPY_TERM",
    "EXPONENTIAL_TERM",
    "LOGARITHM_TERM",
    "POWER_TERM",
    "proximal_step",
    "scaled_term",
]

POWER_TERM, EXPONENTIAL_TERM, ENTROPY_TERM, LOGARITHM_TERM = range(7, 11)

_FOLDER = files_hash("scalar_terms.py")


@njit(folder=_FOLDER)
def scaled_term(kind, c, k, size):
    """(C, k) of the function g(size · s)/size²."""
    if kind == POWER_TERM:
        return c * size ** (k - 2.0), k
    if kind == EXPONENTIAL_TERM:
        return c / (size * size), k / size
    if kind == ENTROPY_TERM:
        return c / size, k / size
    return c / (size * size), k


@njit(folder=_FOLDER)
def _exponential_root(kappa, right):
    """L with e^L + κ L = right, κ > 0."""
    x = right / kappa
    if right > 0.0:
        # the root of e^x alone lies left of the root for right < 1; one step of Newton leads across
        guess = math.log(right)
        if guess < 0.0:
            guess *= right / (right + kappa)
        x = min(x, guess)
    for _ in range(100):
        e = math.exp(min(x, 700.0))
        step = (e + kappa * x - right) / (e + kappa)
        x -= step
        if abs(step) <= 1e-16 * max(1.0, abs(x)):
            break
    return x


@njit(folder=_FOLDER)
def proximal_step(kind, c, k, v, tau):
    """(λ⁺, dλ⁺/dv, g(s)) of one term at v."""
    if kind == POWER_TERM:
        slope = c * k
        size = abs(v)
        if size == 0.0:
            return 0.0, (1.0 if k < 2.0 else (slope / (slope + tau) if k == 2.0 else 0.0)), 0.0
        goal, one, two = math.log(size), math.log(slope), math.log(tau)
        x = min((goal - one) / (k - 1.0), goal - two)
        for _ in range(60):
            a, b = one + (k - 1.0) * x, two + x
            top = max(a, b)
            ea, eb = math.exp(a - top), math.exp(b - top)
            total = ea + eb
            step = (top + math.log(total) - goal) * total / ((k - 1.0) * ea + eb)
            x -= step
            if abs(step) <= 1e-16 * max(1.0, abs(x)):
                break
        w = math.exp(one + (k - 1.0) * x)
        s = math.exp(x)
        bend = (k - 1.0) * w
        return (w if v > 0.0 else -w), bend / (bend + tau * s), w * s / k
    if kind == EXPONENTIAL_TERM:
        x = _exponential_root(tau * k, tau * k * math.log(c / k) - v)
        w = math.exp(x)
        return -w, w / (w + tau * k), w * k
    if kind == ENTROPY_TERM:
        x = _exponential_root(c / tau, (v + c * math.log(k)) / tau)
        r = math.exp(x)
        w = c * (x - math.log(k))
        return w, c / (c + tau * r), r * (w - c)
    root = math.sqrt(v * v + 4.0 * tau * c)
    s = 2.0 * c / (v + root) if v > 0.0 else (root - v) / (2.0 * tau)
    return c / s, c / (c + tau * s * s), -c * math.log(s)
