"""Tensor algebra on numbers at one point: the words in which a law without a generated step is written out.

Tensors are Mandel rows (6,), vectors (3,), scalars floats.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..potentials.spectral import decompose, eigenvalues, from_matrix

__all__ = [
    "Abs",
    "I",
    "Max",
    "dev",
    "eig_max",
    "eig_min",
    "eig_sum",
    "eigen_dyad",
    "inner",
    "norm",
    "pos",
    "spectral",
    "step",
    "tr",
]

Array = NDArray[np.float64]
I = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def tr(tensor: Array) -> float:
    """Trace."""
    return float(tensor[:3].sum())


def dev(tensor: Array) -> Array:
    """Deviator."""
    return tensor - tr(tensor) / 3.0 * I


def inner(left: Array, right: Array) -> float:
    """Scalar product."""
    return float(left @ right)


def norm(quantity: Array) -> float:
    """Frobenius norm of a tensor, length of a vector."""
    return float(np.linalg.norm(quantity))


def spectral(function: Callable[[Any], Any], tensor: Array) -> Array:
    """Σ g(t_i) n_i⊗n_i."""
    values, vectors = decompose(tensor)
    return from_matrix((vectors * np.array([float(function(v)) for v in values])) @ vectors.T)


def eig_sum(function: Callable[[Any], Any], tensor: Array) -> float:
    """Σ g(t_i)."""
    return float(sum(function(v) for v in eigenvalues(tensor)))


def eig_max(tensor: Array) -> float:
    """Largest eigenvalue."""
    return float(eigenvalues(tensor)[2])


def eig_min(tensor: Array) -> float:
    """Smallest eigenvalue."""
    return float(eigenvalues(tensor)[0])


def eigen_dyad(tensor: Array, end: int) -> Array:
    """n⊗n of the largest (1) or smallest (−1) eigenvalue."""
    vectors = decompose(tensor)[1]
    n = vectors[:, 2 if end == 1 else 0]
    return from_matrix(np.outer(n, n))


def pos(value: Any) -> Any:
    """⟨x⟩ of a scalar, spectral positive part of a tensor."""
    return max(value, 0.0) if np.ndim(value) == 0 else spectral(lambda t: max(t, 0.0), value)


def step(value: float) -> float:
    """H(x), zero at zero."""
    return 1.0 if value > 0.0 else 0.0


def Max(left: float, right: float) -> float:
    """The larger one."""
    return max(left, right)


def Abs(value: float) -> float:
    """Absolute value."""
    return abs(value)
