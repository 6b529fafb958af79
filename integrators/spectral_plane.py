"""The spectral operators of `spectral` for tensors without the shears 23 and 13 (11, 22, 33, √2·12), and for diagonal ones (11, 22, 33).

Eigenvalues and vectors have the places they have there: values first, then the vectors as columns of a 3×3 matrix.
"""

from __future__ import annotations

import math

from ..cache import njit
from .key import kernels_hash

__all__ = [
    "add_positive_derivative_axes",
    "add_positive_derivative_plane",
    "eigen_axes",
    "eigen_plane",
    "positive_part_axes",
    "positive_part_plane",
]

_FOLDER = kernels_hash()


@njit(folder=_FOLDER)
def eigen_plane(t, out):
    """Eigenvalues in `out[0:3]` (the third is that of the axis 3) and vectors of (11, 22, 33, √2·12)."""
    d = 0.7071067811865476 * t[3]
    half = 0.5 * (t[0] - t[1])
    for i in range(12):
        out[i] = 0.0
    out[2], out[11] = t[2], 1.0
    # Jacobi's rotation: exact for a diagonal tensor, and no cancellation in the angle
    ratio = half / d if d != 0.0 else math.inf
    far = not abs(ratio) < 1e150
    tangent = 0.5 / ratio if far else (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
    cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    out[0], out[1] = t[0] + tangent * d, t[1] - tangent * d
    out[3], out[4] = cosine, -sine
    out[6], out[7] = sine, cosine


@njit(folder=_FOLDER)
def eigen_axes(t, out):
    """Eigenvalues and vectors of the diagonal tensor (11, 22, 33)."""
    for i in range(12):
        out[i] = 0.0
    out[0], out[1], out[2] = t[0], t[1], t[2]
    out[3] = out[7] = out[11] = 1.0


@njit(folder=_FOLDER)
def positive_part_plane(t, eigen_, out):
    """Positive part of (11, 22, 33, √2·12) into `out`, decomposition into `eigen_`; returns Σ ⟨t_i⟩²."""
    eigen_plane(t, eigen_)
    for i in range(4):
        out[i] = 0.0
    total = 0.0
    if eigen_[0] >= 0.0 and eigen_[1] >= 0.0:
        out[0], out[1], out[3] = t[0], t[1], t[3]
        total = t[0] * t[0] + t[1] * t[1] + t[3] * t[3]
    else:
        for k in range(2):
            value = eigen_[k]
            if value > 0.0:
                x, y = eigen_[3 + k], eigen_[6 + k]
                out[0] += value * x * x
                out[1] += value * y * y
                out[3] += 1.4142135623730951 * value * x * y
                total += value * value
    out[2] = max(t[2], 0.0)
    return total + out[2] * out[2]


@njit(folder=_FOLDER)
def add_positive_derivative_plane(weight, eigen_, tangent):
    """Add weight · D[·]^≥ to `tangent`, a row of 16; the derivative is H(e_i) where values coincide."""
    one = 1.0 if eigen_[0] > 0.0 else 0.0
    two = 1.0 if eigen_[1] > 0.0 else 0.0
    if eigen_[2] > 0.0:
        tangent[10] += weight
    if one == two:
        if one > 0.0:
            tangent[0] += weight
            tangent[5] += weight
            tangent[15] += weight
        return
    k = 0 if one > two else 1
    mixed = eigen_[k] / (eigen_[k] - eigen_[1 - k])
    x, y = eigen_[3 + k], eigen_[6 + k]
    d0, d1, d3 = x * x, y * y, 1.4142135623730951 * x * y
    m0, m3 = 1.4142135623730951 * x * y, y * y - x * x
    tangent[0] += weight * (d0 * d0 + mixed * m0 * m0)
    tangent[5] += weight * (d1 * d1 + mixed * m0 * m0)
    tangent[15] += weight * (d3 * d3 + mixed * m3 * m3)
    cross, left, right = weight * (d0 * d1 - mixed * m0 * m0), weight * d0 * d3, weight * d1 * d3
    left += weight * mixed * m0 * m3
    right -= weight * mixed * m0 * m3
    tangent[1] += cross
    tangent[4] += cross
    tangent[3] += left
    tangent[12] += left
    tangent[7] += right
    tangent[13] += right


@njit(folder=_FOLDER)
def positive_part_axes(t, eigen_, out):
    """Positive part of the diagonal tensor (11, 22, 33)."""
    eigen_axes(t, eigen_)
    total = 0.0
    for i in range(3):
        out[i] = max(t[i], 0.0)
        total += out[i] * out[i]
    return total


@njit(folder=_FOLDER)
def add_positive_derivative_axes(weight, eigen_, tangent):
    """Add weight · D[·]^≥ to `tangent`, a row of 9."""
    for i in range(3):
        if eigen_[i] > 0.0:
            tangent[4 * i] += weight
