"""Strain components that follow from a stress that is zero: plane stress, uniaxial stress.

    find e:  σ_r(ε_g, e) = 0,   the gradient of the convex e ↦ W(ε_g, e),

by damped semismooth Newton at all points at once, from e = 0: the step is taken where it halves the residual, or where the slope of W
along it has fallen below 0.8 of its first value; else the step is bisected by the sign of the slope. The tangent is condensed,
C_gg − C_gr C_rr⁻¹ C_rg.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import Status

__all__ = ["Evaluation", "condensed", "relax"]

Array = NDArray[np.float64]
TOLERANCE = 1e-12
TURNS, TRIALS = 60, 30


@dataclass
class Evaluation:
    """Stress (n, m), tangent (n, m, m), status (n,) at strains, and `rest`, further arrays with the point index first."""

    stress: Array
    tangent: Array
    status: NDArray[np.int64]
    rest: tuple[Array, ...] = ()

    def put(self, rows: Any, other: Evaluation) -> None:
        """Take over rows of another evaluation."""
        for mine, theirs in zip(self._arrays(), other._arrays(), strict=True):
            mine[rows] = theirs

    def _arrays(self) -> tuple[Any, ...]:
        return (self.stress, self.tangent, self.status, *self.rest)


def relax(
    evaluate: Callable[[Array, NDArray[np.int64]], Evaluation],
    eps: Array,
    relaxed: tuple[int, ...],
    *,
    rounding: float = np.finfo(float).eps,
) -> tuple[Array, Evaluation]:
    """(strains, evaluation there) with zero stress in the components `relaxed`; `evaluate(strains, points)` at some of the points.

    The status of a point that does not converge is ITERATION_LIMIT; a failure of the step itself is kept.
    """
    eps = eps.copy()
    place = list(relaxed)
    everything = np.arange(len(eps))
    given = np.abs(eps).max(axis=1, initial=0.0)
    found = evaluate(eps, everything)
    stiff = np.abs(np.einsum("nii->ni", found.tangent)).max(axis=1, initial=0.0)
    todo = everything
    for _ in range(TURNS):
        residual = found.stress[todo][:, place]
        size = np.abs(residual).max(axis=1, initial=0.0)
        level = np.abs(found.stress[todo]).max(axis=1, initial=0.0)
        # rounding of stiffness times the given strain bounds what can be reached; a strain that runs away excuses no residual
        floor = 20.0 * rounding * stiff[todo] * given[todo]
        keep = (size > np.maximum(max(TOLERANCE, 4.0 * rounding) * level, floor)) & (found.status[todo] == 0)
        todo, residual, size = todo[keep], residual[keep], size[keep]
        if todo.size == 0:
            return eps, found
        stiff[todo] = np.maximum(stiff[todo], np.abs(np.einsum("nii->ni", found.tangent[todo])).max(axis=1))
        change = -_solved(_block(found.tangent[todo], place, place), residual, 1e-13 * stiff[todo])
        # a strain that runs away leaves the range of numbers; the step then says so by its status
        with np.errstate(over="ignore", invalid="ignore"):
            _search(evaluate, eps, found, todo, place, change, residual, size)
    found.status[todo[found.status[todo] == 0]] = int(Status.ITERATION_LIMIT)
    return eps, found


def _search(evaluate, eps, found, todo, place, change, residual, size) -> None:  # type: ignore[no-untyped-def]
    """One damped step at the points `todo`; `eps` and `found` are moved."""
    first = (residual * change).sum(axis=1)
    start = eps[np.ix_(todo, place)]
    factor, low, up = np.ones(todo.size), np.zeros(todo.size), np.full(todo.size, np.inf)
    left = np.arange(todo.size)
    for turn in range(TRIALS):
        points = todo[left]
        eps[np.ix_(points, place)] = start[left] + factor[left, None] * change[left]
        new = evaluate(eps[points], points)
        now = new.stress[:, place]
        along = (now * change[left]).sum(axis=1)
        good = new.status == 0
        taken = good & (
            (np.abs(now).max(axis=1, initial=0.0) < 0.5 * size[left])
            | (np.abs(along) <= 0.8 * np.abs(first[left]))
            | ((along < 0.0) & np.isinf(up[left]))
        )
        if turn == TRIALS - 1:
            taken[:] = True
        found.put(points[taken], _rows(new, taken))
        forward = good & (along < 0.0)
        low[left] = np.where(~taken & forward, factor[left], low[left])
        up[left] = np.where(~taken & ~forward, factor[left], up[left])
        left = left[~taken]
        if left.size == 0:
            return
        factor[left] = 0.5 * (low[left] + np.where(np.isinf(up[left]), 2.0 * factor[left], up[left]))


def _rows(found: Evaluation, mask: NDArray[np.bool_]) -> Evaluation:
    return Evaluation(found.stress[mask], found.tangent[mask], found.status[mask], tuple(a[mask] for a in found.rest))


def _block(matrices: Array, rows: list[int], columns: list[int]) -> Array:
    return matrices[:, rows][:, :, columns]


def _solved(matrices: Array, right: Array, floor: Array) -> Array:
    """M⁻¹ r of symmetric semidefinite M (n, k, k), eigenvalues below `floor` raised to it."""
    values, vectors = np.linalg.eigh(matrices)
    values = np.maximum(values, np.maximum(floor, 1e-300)[:, None])
    return np.einsum("nij,nj->ni", vectors, np.einsum("nij,ni->nj", vectors, right) / values)


def condensed(tangent: Array, given: tuple[int, ...], relaxed: tuple[int, ...]) -> Array:
    """C_gg − C_gr C_rr⁺ C_rg, (n, g, g); where C_rr is singular so is C_gr, and the pseudo-inverse is right."""
    g, r = list(given), list(relaxed)
    values, vectors = np.linalg.eigh(_block(tangent, r, r))
    size = np.abs(np.einsum("nii->ni", tangent)).max(axis=1, initial=0.0)[:, None]
    inverse = np.where(values > 1e-13 * size, 1.0 / np.where(values > 1e-13 * size, values, 1.0), 0.0)
    mixed = np.einsum("nij,njk->nik", _block(tangent, g, r), vectors)
    return _block(tangent, g, g) - np.einsum("nik,nk,njk->nij", mixed, inverse, mixed)
