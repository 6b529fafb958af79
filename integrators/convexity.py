"""Convexity of the quadratic part of ψ for given parameter values: no modulus, and no combination of moduli, may be negative."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["worst_direction"]

ROUNDING = 1e-10


def worst_direction(matrix: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]] | None:
    """Most negative curvature of a symmetric matrix and its direction, relative to the diagonal; None if it is semidefinite.

    Rows are scaled to a unit diagonal first, so that a small modulus beside a large one is seen. Exactly singular matrices, as of
    an energy of ε − ε^p, pass.
    """
    diagonal = np.diag(matrix).copy()
    for i, value in enumerate(diagonal):
        if value < 0.0 or (value == 0.0 and np.any(matrix[i] != 0.0)):
            return float(min(value, 0.0)), np.eye(len(diagonal))[i]
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 1.0)
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale[None, :])
    if values.size == 0 or values[0] >= -ROUNDING:
        return None
    return float(values[0]), vectors[:, 0]
