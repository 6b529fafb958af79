r"""Strain of a set of bodies: Bagi's average over Delaunay cells, and the affine field that fits best.

Bagi: on the Delaunay cells of the centres (reference configuration) the displacement is linear, and the average of its gradient is
Ḡ = Σ V_L G_L / Σ V_L = (1/V) ∮ u ⊗ n dA: it depends on the hull alone. Best fit: Ḡ = (Σ u' ⊗ x')(Σ x' ⊗ x')⁻¹, primes for deviations
from the mean; every body has a say. Both are exact on affine fields. Above one per cent increments are summed, on cells made anew.

Cells whose quality (volume over that of the regular cell with the same sum of squared edges) is below a bound are left out: flat ones on
the hull carry no volume and any gradient. Chains of beads make poor cells, so for wires the best fit is the better measure.

Bagi (1996), Mech. Mater. 22, 165–177; Cundall and Strack (1979), Liao et al. (1997), IJSS 34, 4087–4100; overview: Bagi (2006), IJSS 43.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

__all__ = ["accumulated_gradient", "best_fit_gradient", "boundary_gradient", "delaunay_cells", "delaunay_gradient"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def _check(x: Array, least: int) -> None:
    if x.shape[0] < least:
        raise InputError(
            f"strain: {x.shape[0]} bodies; an affine field in {x.shape[1]} dimensions needs {least} or more"
        )


def delaunay_cells(x: Array, *, quality: float = 1e-3) -> Ints:
    """Delaunay cells of centres (n, d) [m] with a quality of at least `quality` [-], positively oriented, shape (k, d + 1)."""
    from scipy.spatial import Delaunay, QhullError

    x = np.asarray(x, dtype=float)
    d = x.shape[1]
    _check(x, d + 1)
    try:
        # away from round-off of large coordinates and small grains
        cells = Delaunay((x - x.mean(axis=0)) / np.ptp(x, axis=0).max()).simplices.astype(np.int64)
    except QhullError:
        raise InputError("strain: the bodies lie in a plane or on a line; take more of them") from None
    edges = x[cells[:, 1:]] - x[cells[:, :1]]
    volume = np.linalg.det(edges) / factorial(d)
    squares = sum(np.sum((x[cells[:, i]] - x[cells[:, j]]) ** 2, axis=1) for i, j in combinations(range(d + 1), 2))
    regular = squares**1.5 / (72.0 * np.sqrt(3.0)) if d == 3 else squares / (4.0 * np.sqrt(3.0))
    cells[volume < 0.0, :2] = cells[volume < 0.0, 1::-1]
    return cells[np.abs(volume) >= quality * regular]


def delaunay_gradient(reference: Array, displacement: Array, *, quality: float = 1e-3) -> tuple[Array, float]:
    """Bagi's displacement gradient Ḡ (d, d) [-] and the volume of its cells [m^d]; arguments (n, d) [m]."""
    x, u = np.asarray(reference, dtype=float), np.asarray(displacement, dtype=float)
    cells = delaunay_cells(x, quality=quality)
    d = x.shape[1]
    dx = x[cells[:, 1:]] - x[cells[:, :1]]
    du = u[cells[:, 1:]] - u[cells[:, :1]]
    volume = np.linalg.det(dx) / factorial(d)
    # rows of dx, du are edges: G = (dx⁻¹ du)ᵀ
    gradient = np.swapaxes(np.linalg.solve(dx, du), 1, 2)
    total = float(volume.sum())
    return np.einsum("k,kij->ij", volume, gradient) / total, total


def boundary_gradient(reference: Array, displacement: Array, *, quality: float = 1e-3) -> tuple[Array, float]:
    """(1/V) ∮ u ⊗ n dA over the hull of the same cells, and V = (1/d) ∮ x·n dA: equal to `delaunay_gradient` by Gauss's theorem."""
    x, u = np.asarray(reference, dtype=float), np.asarray(displacement, dtype=float)
    cells = delaunay_cells(x, quality=quality)
    d = x.shape[1]
    faces = np.concatenate([np.delete(cells, k, axis=1) for k in range(d + 1)])
    opposite = np.concatenate([cells[:, k] for k in range(d + 1)])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = first[count == 1]
    face, inner = faces[outer], opposite[outer]
    a = x[face[:, 0]]
    if d == 3:
        normal = 0.5 * np.cross(x[face[:, 1]] - a, x[face[:, 2]] - a)
    else:
        edge = x[face[:, 1]] - a
        normal = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    normal[np.sum(normal * (x[inner] - a), axis=1) > 0.0] *= -1.0
    # from the middle of the set: less cancellation
    middle = x.mean(axis=0)
    total = float(np.sum((x[face].mean(axis=1) - middle) * normal) / d)
    return np.einsum("ki,kj->ij", u[face].mean(axis=1) - u.mean(axis=0), normal) / total, total


def best_fit_gradient(reference: Array, displacement: Array) -> Array:
    """Gradient (d, d) [-] of the affine field nearest to the displacements in the mean square; arguments (n, d) [m]."""
    x, u = np.asarray(reference, dtype=float), np.asarray(displacement, dtype=float)
    _check(x, x.shape[1] + 1)
    x, u = x - x.mean(axis=0), u - u.mean(axis=0)
    spread = x.T @ x
    if np.linalg.eigvalsh(spread)[0] <= 1e-12 * np.trace(spread):
        raise InputError("strain: the bodies lie in a plane or on a line; take more of them")
    return np.linalg.solve(spread, x.T @ u).T


def accumulated_gradient(
    frames: Iterable[Array], measure: Callable[[Array, Array], Array | tuple[Array, float]] = best_fit_gradient
) -> Array:
    """Sum of the gradients of the increments between successive positions (n, d) [m]: the logarithmic measure as frames get close."""
    total: Array | None = None
    before: Array | None = None
    for x in frames:
        if before is not None:
            found = measure(before, x - before)
            step = found[0] if isinstance(found, tuple) else found
            total = step if total is None else total + step
        before = np.asarray(x, dtype=float)
    if total is None:
        raise InputError("strain: needs two frames or more")
    return total
