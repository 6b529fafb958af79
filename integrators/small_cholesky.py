"""Factorisation of small symmetric positive definite matrices, compiled: row sweeps without allocation and without library calls."""

from __future__ import annotations

from ..cache import njit
from .key import files_hash

__all__ = ["FAST", "factor", "substitute"]

_FOLDER = files_hash("small_cholesky.py")
# sums may be ordered anew, so that they fill vector registers; what is not a number stays so
FAST = {"reassoc", "contract"}


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def factor(matrix, diagonal):
    """A = UᵀDU from the upper triangle, in place: rows of DU right of the diagonal, 1/D on it; `diagonal` (n,) is room.

    A pivot lost to rounding is replaced by a large one, so that its unknown stays as it is.
    """
    n = matrix.shape[0]
    for k in range(n):
        diagonal[k] = matrix[k, k]
    for k in range(n):
        row = matrix[k]
        value = row[k]
        if not value > 1e-15 * diagonal[k]:
            value = 1e15 * max(diagonal[k], 1e-300)
        inverse = 1.0 / value
        row[k] = inverse
        for i in range(k + 1, n):
            multiple = row[i] * inverse
            if multiple != 0.0:
                below = matrix[i]
                for j in range(i, n):
                    below[j] -= multiple * row[j]


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def substitute(matrix, right):
    """Solve with the factor, in place."""
    n = matrix.shape[0]
    for k in range(n):
        row = matrix[k]
        value = right[k] * row[k]
        right[k] = value
        for j in range(k + 1, n):
            right[j] -= value * row[j]
    for k in range(n - 1, -1, -1):
        row = matrix[k]
        value = 0.0
        for j in range(k + 1, n):
            value += row[j] * right[j]
        right[k] -= value * row[k]
