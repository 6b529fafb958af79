"""Small functions of one point that the emitted steps call."""

from __future__ import annotations

import math

from ...cache import njit
from ..key import kernels_hash

__all__ = ["ROOT", "THIRD", "descending", "norm_of", "size_of", "theta"]

_FOLDER = kernels_hash()
ROOT = 1.4142135623730951
THIRD = 1.0 / 3.0


@njit(folder=_FOLDER, inline="never")
def norm_of(a, size):
    """Euclidean norm of the first `size` entries, scaled so that squares stay in the range of the exponent."""
    largest = 0.0
    for i in range(size):
        part = abs(a[i])
        if not part <= largest:
            largest = part
    if largest == 0.0 or not largest < math.inf:
        return largest
    total = 0.0
    for i in range(size):
        part = a[i] / largest
        total += part * part
    return largest * math.sqrt(total)


@njit(folder=_FOLDER)
def descending(axes):
    """Order eigenvalues `axes[0:3]` from the largest down, with their vectors (columns of `axes[3:12]`)."""
    for turn in range(3):
        i = 1 if turn == 1 else 0
        j = i + 1
        if axes[i] < axes[j]:
            axes[i], axes[j] = axes[j], axes[i]
            for r in range(3):
                o = 3 + 3 * r
                axes[o + i], axes[o + j] = axes[o + j], axes[o + i]


@njit(folder=_FOLDER)
def size_of(axes):
    """Sum of the moduli of the eigenvalues."""
    return abs(axes[0]) + abs(axes[1]) + abs(axes[2])


@njit(folder=_FOLDER)
def theta(a, b, left, right, p_aa, p_bb, p_ab, size, most):
    """(e_a − e_b)/(a − b); its limit ½(P_aa + P_bb) − P_ab where the values coincide.

    A projection turns no further than its trial: what rounding over a small gap makes beyond 0 … `most` is cut off.
    """
    gap = a - b
    if abs(gap) > 1e-9 * size:
        found = (left - right) / gap
        return min(max(found, 0.0), most) if most < math.inf else found
    return 0.5 * (p_aa + p_bb) - p_ab
