r"""The problem in the scaling that every solver works in: 3 × 3 blocks, unit normal mobility, data of order one.

Per contact a = W_NN^(−1/2) and c = max|a q|:  r = c a x,  u = (c/a) y,  so that y = W̄ x + q̄ with W̄_NN = 1 and max|q̄| = 1 whatever the
units and the mass ratio; K is unchanged, a contact being scaled as a whole.

A contact without friction (μ = 0) has r_T = 0. It is written as a contact with μ = 1 whose tangential rows are replaced by y_T = x_T:
their only solution is x_T = 0, so that no solver needs a second kind of contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...cache import njit
from .problem import OneStepProblem

__all__ = ["Blocks", "scaled_blocks"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Blocks:
    """W̄ as block rows (`pointer`, `column`, `value` (k, 3, 3)), q̄ (n, 3), μ (n,); `place` is the diagonal block of each row."""

    pointer: Ints
    column: Ints
    value: Array
    place: Ints
    q: Array
    mu: Array
    scale: Array  # (n,) c a: r = scale x
    mobility: Array  # (n,) 1/a²: W_NN of the problem given
    smooth: NDArray[np.bool_]  # (n,) without friction in the problem given

    def reactions(self, x: Array) -> Array:
        """r (3n,) of the scaled x (n, 3); no tangential part where there is no friction."""
        r = self.scale[:, None] * x
        r[self.smooth, 1:] = 0.0
        return r.ravel()

    def unknowns(self, r: Array) -> Array:
        """x (n, 3) of the reactions r (3n,)."""
        return r.reshape(-1, 3) / self.scale[:, None]


def scaled_blocks(problem: OneStepProblem) -> Blocks:
    """Scale and block a problem that has at least one contact."""
    n = problem.contact_count
    full = _with_diagonal(problem.delassus, n)
    pointer, column, value = full.indptr, full.indices, full.data
    place = _diagonal_blocks(pointer, column)
    diagonal = value[place]
    normal = diagonal[:, 0, 0].copy()
    # a contact without normal mobility is scaled by what mobility it has, one without any like the mean of the others
    idle = normal <= 1e-14 * normal.max(initial=0.0)
    if idle.any():
        normal[idle] = np.maximum(diagonal[idle, 1, 1], diagonal[idle, 2, 2])
        idle = normal <= 0.0
        normal[idle] = normal[~idle].mean() if not idle.all() else 1.0
    a = 1.0 / np.sqrt(normal)
    q = problem.q.reshape(-1, 3) * a[:, None]
    c = float(np.max(np.abs(q))) or 1.0
    mu = problem.mu.copy()
    smooth = mu == 0.0
    mu[smooth] = 1.0
    q = q / c
    q[smooth, 1:] = 0.0
    scaled = value.copy()
    _scale_blocks(pointer, column, scaled, a, smooth)
    return Blocks(pointer, column, scaled, place, q, mu, c * a, normal, smooth)


def _with_diagonal(matrix: sp.csr_matrix, n: int) -> sp.bsr_matrix:
    """Block rows, sorted, the diagonal blocks among them."""
    pattern = sp.bsr_matrix((np.full((n, 3, 3), 1e-300), np.arange(n), np.arange(n + 1)), shape=matrix.shape)
    full = sp.bsr_matrix(matrix, blocksize=(3, 3)) + pattern
    full.sort_indices()
    return full


@njit
def _diagonal_blocks(pointer: Ints, column: Ints) -> Ints:
    place = np.full(len(pointer) - 1, -1, dtype=np.int32)
    for i in range(len(pointer) - 1):
        for k in range(pointer[i], pointer[i + 1]):
            if column[k] == i:
                place[i] = k
    return place


@njit
def _scale_blocks(pointer: Ints, column: Ints, value: Array, a: Array, smooth: NDArray[np.bool_]) -> None:
    for i in range(len(pointer) - 1):
        for k in range(pointer[i], pointer[i + 1]):
            j = column[k]
            for s in range(3):
                for t in range(3):
                    if (s > 0 and smooth[i]) or (t > 0 and smooth[j]):
                        value[k, s, t] = 1.0 if i == j and s == t else 0.0
                    else:
                        value[k, s, t] *= a[i] * a[j]
