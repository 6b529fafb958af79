r"""Linear systems with the block pattern of W̄: (block rows of any values) d = b, symmetric or not, often nearly singular.

Sparse LU (SuperLU) with a minimum-degree order on the block graph, found once; pivots are taken near the diagonal. Small systems are
solved densely. Each solution is refined once with the residual.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ...cache import njit
from .blocks import Blocks
from .sweeps import product

__all__ = ["BlockSystem"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]

_DENSE = 120  # unknowns up to which a dense factorisation is the faster one


class BlockSystem:
    """Factorises matrices that share the pattern of `blocks`."""

    def __init__(self, blocks: Blocks) -> None:
        n = len(blocks.mu)
        self.size = 3 * n
        self.dense = self.size <= _DENSE
        self._pointer, self._column = blocks.pointer, blocks.column
        if self.dense:
            self._lu = np.empty((self.size, self.size))
            self._pivot = np.empty(self.size, dtype=np.int64)
        else:
            self._set_order(n)

    def _set_order(self, n: int) -> None:
        count = len(self._column)
        graph = sp.csc_matrix((np.ones(count), self._column, self._pointer), shape=(n, n))
        graph = (graph + graph.T + (4.0 * n + 1.0) * sp.identity(n)).tocsc()
        order = np.argsort(splu(graph, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).perm_c)
        self._order = (3 * order[:, None] + np.arange(3)).ravel()
        numbered = np.arange(1, 9 * count + 1, dtype=float).reshape(count, 3, 3)
        whole = sp.csr_matrix(sp.bsr_matrix((numbered, self._column, self._pointer), shape=(3 * n, 3 * n)))
        whole = sp.csc_matrix(whole[self._order][:, self._order])
        whole.sort_indices()
        self._from, self._rows, self._starts = whole.data.astype(np.int64) - 1, whole.indices, whole.indptr

    def factorise(self, value: Array) -> None:
        """Factorise the matrix of the block values (k, 3, 3). Raises `np.linalg.LinAlgError` if it is singular."""
        self._value = value
        if self.dense:
            _spread(self._pointer, self._column, value, self._lu)
            if not _factorise_dense(self._lu, self._pivot):
                raise np.linalg.LinAlgError("singular")
            return
        data = value.ravel()[self._from]
        if not np.all(np.isfinite(data)):
            raise np.linalg.LinAlgError("not finite")
        matrix = sp.csc_matrix((data, self._rows, self._starts), shape=(self.size, self.size))
        try:
            self._factor = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
        except RuntimeError as failure:
            raise np.linalg.LinAlgError("singular") from failure

    def solve(self, b: Array) -> Array:
        """The solution for b (n, 3), refined once."""
        d = self._once(b)
        rest = np.empty_like(b)
        product(self._pointer, self._column, self._value, -b, d, rest)
        d -= self._once(rest)
        return d

    def _once(self, b: Array) -> Array:
        right = b.ravel()
        if self.dense:
            out = right.copy()
            _solve_dense(self._lu, self._pivot, out)
            return out.reshape(b.shape)
        out = np.empty_like(right)
        out[self._order] = self._factor.solve(right[self._order])
        return out.reshape(b.shape)

    def sign(self) -> int:
        """Sign of the determinant of the matrix factorised last."""
        if self.dense:
            swaps = np.count_nonzero(self._pivot != np.arange(self.size))
            negative = np.count_nonzero(np.diag(self._lu) < 0.0)
            return -1 if (swaps + negative) % 2 else 1
        negative = np.count_nonzero(self._factor.U.diagonal() < 0.0)
        turns = _parity(self._factor.perm_r.astype(np.int64)) * _parity(self._factor.perm_c.astype(np.int64))
        return -turns if negative % 2 else turns


@njit
def _spread(pointer: Ints, column: Ints, value: Array, out: Array) -> None:
    out[:] = 0.0
    for i in range(len(pointer) - 1):
        for k in range(pointer[i], pointer[i + 1]):
            j = column[k]
            for s in range(3):
                for t in range(3):
                    out[3 * i + s, 3 * j + t] = value[k, s, t]


@njit
def _factorise_dense(a: Array, pivot: NDArray[np.int64]) -> bool:
    """LU with row exchanges in place. (LAPACK with threads is several times slower at this size.)"""
    n = a.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        pivot[k] = best
        if not abs(a[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            if a[i, k] != 0.0:
                factor = a[i, k] * inverse
                a[i, k] = factor
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
    return True


@njit
def _solve_dense(a: Array, pivot: NDArray[np.int64], b: Array) -> None:
    n = a.shape[0]
    for k in range(n):
        if pivot[k] != k:
            b[k], b[pivot[k]] = b[pivot[k]], b[k]
    for i in range(n):
        for j in range(i):
            b[i] -= a[i, j] * b[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]


@njit
def _parity(order: NDArray[np.int64]) -> int:
    seen = np.zeros(len(order), dtype=np.bool_)
    sign = 1
    for i in range(len(order)):
        j, length = i, 0
        while not seen[j]:
            seen[j] = True
            j = order[j]
            length += 1
        if length > 0 and length % 2 == 0:
            sign = -sign
    return sign
