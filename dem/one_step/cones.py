r"""Nesterov–Todd scaling of the folded problem, contact by contact.

Folded unknowns x ← (μ r_N, r_T)/c, y ← c (u_N/μ + ‖u_T‖, u_T) turn both Coulomb cones into the Lorentz cone L = {x₀ ≥ ‖x_T‖}, and the
problem into L ∋ x ⟂ y ∈ L, y = W̄x + q̄ + ‖y_T‖ e₀; c = 1, or √μ for very large μ, whose normal rows would vanish. P is the symmetric matrix
with P x = P⁻¹ y = λ (Nesterov and Todd 1997). With E = e₀ tᵀ, t = ∂‖y_T‖/∂y_T, a Newton step on "residual G, complementarity λ∘λ → v" is

    [W̄ + (I − E) P²] dx = (I − E) P c + G ,   c = λ⁻¹∘v ,   dy = P c − P² dx :

a block-diagonal, non-symmetric term on W̄ is all that the cones and de Saxcé's term add.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...cache import njit
from .blocks import Blocks

__all__ = ["Folded", "follow", "jordan", "longest_step", "right_side", "scale_cones", "to_local", "unfold"]

Array = NDArray[np.float64]


class Folded:
    """Work arrays of the scaling: P, P², (I − E)P² (n, 3, 3), λ (n, 3), t (n, 2), smoothed ‖y_T‖ (n,)."""

    def __init__(self, blocks: Blocks) -> None:
        n = len(blocks.mu)
        row = np.repeat(np.arange(n), np.diff(blocks.pointer))
        fold = _folds(blocks.mu)
        self.value = blocks.value * fold[row][:, :, None] * fold[blocks.column][:, None, :]
        self.q = blocks.q * fold
        self.root, self.square, self.block = (np.empty((n, 3, 3)) for _ in range(3))
        self.middle = np.empty((n, 3))
        self.slope = np.empty((n, 2))
        self.slip = np.empty(n)


def unfold(x: Array, mu: Array) -> Array:
    """r (n, 3) of the folded x."""
    return x * _folds(mu)


def _folds(mu: Array) -> Array:
    c = np.where(mu > 10.0, np.sqrt(mu), 1.0)
    return np.column_stack([c / mu, c, c])


@njit
def scale_cones(
    x: Array, y: Array, width: float, root: Array, square: Array, block: Array, middle: Array, slope: Array, slip: Array
) -> bool:
    """Fill the scaling at x, y inside the cones; False if one of them is not. ‖y_T‖ is smoothed to √(‖y_T‖² + width²)."""
    w = np.empty(3)
    for i in range(x.shape[0]):
        xt = np.sqrt(x[i, 1] ** 2 + x[i, 2] ** 2)
        yt = np.sqrt(y[i, 1] ** 2 + y[i, 2] ** 2)
        if not (x[i, 0] > xt and y[i, 0] > yt):
            return False
        dx = np.sqrt((x[i, 0] - xt) * (x[i, 0] + xt))
        dy = np.sqrt((y[i, 0] - yt) * (y[i, 0] + yt))
        inner = x[i, 0] * y[i, 0] + x[i, 1] * y[i, 1] + x[i, 2] * y[i, 2]
        half = 0.5 / np.sqrt(0.5 * (1.0 + inner / (dx * dy)))
        w[0] = half * (y[i, 0] / dy + x[i, 0] / dx)
        w[1] = half * (y[i, 1] / dy - x[i, 1] / dx)
        w[2] = half * (y[i, 2] / dy - x[i, 2] / dx)
        eta = np.sqrt(dy / dx)
        root[i, 0, 0] = eta * w[0]
        for a in range(1, 3):
            root[i, 0, a] = root[i, a, 0] = eta * w[a]
            for b in range(1, 3):
                root[i, a, b] = eta * ((1.0 if a == b else 0.0) + w[a] * w[b] / (1.0 + w[0]))
        for a in range(3):
            for b in range(3):
                square[i, a, b] = 2.0 * eta * eta * w[a] * w[b]
            square[i, a, a] += -eta * eta if a == 0 else eta * eta
            middle[i, a] = root[i, a, 0] * x[i, 0] + root[i, a, 1] * x[i, 1] + root[i, a, 2] * x[i, 2]
        slip[i] = np.sqrt(yt * yt + width * width)
        t1, t2 = (y[i, 1] / slip[i], y[i, 2] / slip[i]) if slip[i] > 0.0 else (0.0, 0.0)
        slope[i, 0], slope[i, 1] = t1, t2
        for b in range(3):
            block[i, 0, b] = square[i, 0, b] - t1 * square[i, 1, b] - t2 * square[i, 2, b]
            block[i, 1, b], block[i, 2, b] = square[i, 1, b], square[i, 2, b]
    return True


@njit
def right_side(middle: Array, root: Array, slope: Array, v: Array, g: Array, c: Array, b: Array) -> None:
    """c = λ⁻¹∘v and b = (I − E) P c + G."""
    for i in range(middle.shape[0]):
        l0, l1, l2 = middle[i, 0], middle[i, 1], middle[i, 2]
        lt = np.sqrt(l1 * l1 + l2 * l2)
        c0 = (l0 * v[i, 0] - l1 * v[i, 1] - l2 * v[i, 2]) / ((l0 - lt) * (l0 + lt))
        c1, c2 = (v[i, 1] - l1 * c0) / l0, (v[i, 2] - l2 * c0) / l0
        c[i, 0], c[i, 1], c[i, 2] = c0, c1, c2
        p0 = root[i, 0, 0] * c0 + root[i, 0, 1] * c1 + root[i, 0, 2] * c2
        p1 = root[i, 1, 0] * c0 + root[i, 1, 1] * c1 + root[i, 1, 2] * c2
        p2 = root[i, 2, 0] * c0 + root[i, 2, 1] * c1 + root[i, 2, 2] * c2
        b[i, 0] = p0 - slope[i, 0] * p1 - slope[i, 1] * p2 + g[i, 0]
        b[i, 1], b[i, 2] = p1 + g[i, 1], p2 + g[i, 2]


@njit
def follow(root: Array, square: Array, c: Array, dx: Array, dy: Array) -> None:
    """dy = P c − P² dx."""
    for i in range(dx.shape[0]):
        for a in range(3):
            dy[i, a] = 0.0
            for b in range(3):
                dy[i, a] += root[i, a, b] * c[i, b] - square[i, a, b] * dx[i, b]


@njit
def to_local(root: Array, dx: Array, dy: Array, a: Array, b: Array) -> tuple[float, float]:
    """a = P dx, b = P⁻¹ dy; returns the sum of their squares and the largest norm of one contact."""
    total = 0.0
    worst = 0.0
    for i in range(dx.shape[0]):
        det = root[i, 0, 0] ** 2 - root[i, 0, 1] ** 2 - root[i, 0, 2] ** 2
        for k in range(3):
            a[i, k] = root[i, k, 0] * dx[i, 0] + root[i, k, 1] * dx[i, 1] + root[i, k, 2] * dx[i, 2]
        # P⁻¹ = J P J/det with J = diag(1, −1, −1)
        b[i, 0] = (root[i, 0, 0] * dy[i, 0] - root[i, 0, 1] * dy[i, 1] - root[i, 0, 2] * dy[i, 2]) / det
        b[i, 1] = (-root[i, 1, 0] * dy[i, 0] + root[i, 1, 1] * dy[i, 1] + root[i, 1, 2] * dy[i, 2]) / det
        b[i, 2] = (-root[i, 2, 0] * dy[i, 0] + root[i, 2, 1] * dy[i, 1] + root[i, 2, 2] * dy[i, 2]) / det
        na = a[i, 0] ** 2 + a[i, 1] ** 2 + a[i, 2] ** 2
        nb = b[i, 0] ** 2 + b[i, 1] ** 2 + b[i, 2] ** 2
        total += na + nb
        worst = max(worst, na, nb)
    return total, np.sqrt(worst)


@njit
def jordan(a: Array, b: Array, out: Array) -> None:
    """out = a∘b = (a·b, a₀ b_T + b₀ a_T)."""
    for i in range(a.shape[0]):
        out[i, 0] = a[i, 0] * b[i, 0] + a[i, 1] * b[i, 1] + a[i, 2] * b[i, 2]
        out[i, 1] = a[i, 0] * b[i, 1] + b[i, 0] * a[i, 1]
        out[i, 2] = a[i, 0] * b[i, 2] + b[i, 0] * a[i, 2]


@njit
def longest_step(x: Array, dx: Array) -> float:
    """The largest s with x + s dx in the cones (at most 1e30)."""
    best = 1e30
    for i in range(x.shape[0]):
        a = dx[i, 0] ** 2 - dx[i, 1] ** 2 - dx[i, 2] ** 2
        b = x[i, 0] * dx[i, 0] - x[i, 1] * dx[i, 1] - x[i, 2] * dx[i, 2]
        xt = np.sqrt(x[i, 1] ** 2 + x[i, 2] ** 2)
        c = (x[i, 0] - xt) * (x[i, 0] + xt)
        reach = b * b - a * c
        if a < 0.0:
            root = np.sqrt(max(reach, 0.0))
            best = min(best, c / (root - b) if b <= 0.0 else -(b + root) / a)
        elif reach > 0.0 and b < 0.0:
            best = min(best, c / (np.sqrt(reach) - b))
        if dx[i, 0] < 0.0:
            best = min(best, -x[i, 0] / dx[i, 0])
    return best
