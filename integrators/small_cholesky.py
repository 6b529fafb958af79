"""Cholesky factorisation of small symmetric matrices, compiled: no allocation, no library call, no view of an array in a loop."""

from __future__ import annotations

import math

from ..cache import njit
from .key import files_hash

__all__ = ["FAST", "factor", "substitute"]

_FOLDER = files_hash("small_cholesky.py")
# sums may be ordered anew, so that they fill vector registers; what is not a number stays so
FAST = {"reassoc", "contract"}


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def factor(matrix):
    """A = LLᵀ from the lower triangle, in place, with the inverses of the diagonal of L on the diagonal.

    A pivot lost to rounding is replaced by a large one, so that its unknown stays as it is.
    """
    n = matrix.shape[0]
    for j in range(n):
        original = matrix[j, j]
        value = original
        for k in range(j):
            value -= matrix[j, k] * matrix[j, k]
        if not value > 1e-15 * original:
            value = 1e15 * max(original, 1e-300)
        inverse = 1.0 / math.sqrt(value)
        matrix[j, j] = inverse
        for i in range(j + 1, n):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value * inverse


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def substitute(matrix, right):
    """Solve with the factor, in place."""
    n = matrix.shape[0]
    for i in range(n):
        value = right[i]
        for k in range(i):
            value -= matrix[i, k] * right[k]
        right[i] = value * matrix[i, i]
    for i in range(n - 1, -1, -1):
        value = right[i] * matrix[i, i]
        right[i] = value
        for k in range(i):
            right[k] -= matrix[i, k] * value
