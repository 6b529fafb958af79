"""Canonical data of a convex program that cvxpy declares: sizes, matrices and cones as plain arrays.

    min ½ vᵀPv + qᵀv + constant   subject to   E v = e,   h − G v ∈ K,

K a product of orthants, second-order, 3×3 semidefinite (Mandel components), exponential and power cones. cvxpy only declares and
rewrites here; no solver runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError
from .cone_projection import EXPONENTIAL, EXPONENTIAL_DUAL, ORTHANT, POWER, POWER_DUAL, SECOND_ORDER, SEMIDEFINITE

__all__ = ["CanonicalForm", "Cone", "canonical_form", "dual_cones", "empty_form"]

Array = NDArray[np.float64]

# clarabel's upper triangle by columns (11, 12, 22, 13, 23, 33) → Mandel (11, 22, 33, 23, 13, 12)
_TO_MANDEL = np.array([0, 2, 5, 4, 3, 1])
_DUAL = {
    EXPONENTIAL: EXPONENTIAL_DUAL,
    EXPONENTIAL_DUAL: EXPONENTIAL,
    POWER: POWER_DUAL,
    POWER_DUAL: POWER,
}


@dataclass(frozen=True)
class Cone:
    """One cone: `kind` of `cone_projection` or `scalar_terms`, number of rows, exponent of a power cone, or the numbers of a term."""

    kind: int
    size: int
    alpha: float = 0.0
    beta: float = 0.0


def dual_cones(cones: Sequence[Cone]) -> tuple[Cone, ...]:
    """The duals, in order."""
    return tuple(Cone(_DUAL.get(c.kind, c.kind), c.size, c.alpha) for c in cones)


@dataclass(frozen=True)
class CanonicalForm:
    """Arrays of the program; `first` is the number of leading columns that stand for the declared variables, in the order asked."""

    P: Array
    q: Array
    E: Array
    e: Array
    G: Array
    h: Array
    cones: tuple[Cone, ...]
    first: int
    constant: float = 0.0


def empty_form(size: int) -> CanonicalForm:
    """The zero function of `size` variables."""
    none = np.zeros((0, size))
    return CanonicalForm(np.zeros((size, size)), np.zeros(size), none, np.zeros(0), none, np.zeros(0), (), size)


def canonical_form(objective: Any, constraints: Sequence[Any], variables: Sequence[Any], where: str) -> CanonicalForm:
    """Canonical data of min `objective` under `constraints`; the columns begin with `variables`.

    Raises `DeclarationError`, beginning with `where`, for what is not convex by cvxpy's rules or has a cone outside the list.
    """
    import cvxpy

    problem = cvxpy.Problem(cvxpy.Minimize(objective), list(constraints))
    if not problem.is_dcp():
        raise DeclarationError(f"{where}: its convexity does not follow from the rules of its atoms")
    count = sum(v.size for v in variables)
    if objective.is_constant() and not constraints:
        return empty_form(count)
    data, _, _ = problem.get_problem_data(cvxpy.CLARABEL)
    A, b = data["A"].toarray(), np.asarray(data["b"], dtype=float)
    q = np.asarray(data["c"], dtype=float)
    upper = np.triu(data["P"].toarray()) if data.get("P") is not None else np.zeros((q.size, q.size))
    P = upper + np.triu(upper, 1).T
    place = data["param_prob"].var_id_to_col
    order: list[int] = []
    absent = 0
    for v in variables:
        if v.id in place:
            order += range(place[v.id], place[v.id] + v.size)
        else:
            # a variable that nothing mentions gets a column of zeros
            order += range(q.size + absent, q.size + absent + v.size)
            absent += v.size
    if absent:
        A = np.hstack([A, np.zeros((A.shape[0], absent))])
        q = np.concatenate([q, np.zeros(absent)])
        P = np.pad(P, (0, absent))
    chosen = set(order)
    order += [j for j in range(q.size) if j not in chosen]
    A, q, P = A[:, order], q[order], P[np.ix_(order, order)]
    sizes = data["dims"]
    start = sizes.zero
    E, e = A[:start], b[:start]
    rows: list[NDArray[np.int64]] = []
    cones: list[Cone] = []
    keep = np.arange(start, start + sizes.nonneg)
    # a row without entries is a true statement about numbers, or makes the program infeasible
    keep = keep[np.abs(A[keep]).max(axis=1, initial=0.0) + np.minimum(b[keep], 0.0) != 0.0]
    if keep.size:
        rows.append(keep)
        cones.append(Cone(ORTHANT, keep.size))
    start += sizes.nonneg
    for n in sizes.soc:
        block = np.arange(start, start + n)
        start += n
        if not A[block].any() and b[block][0] >= float(np.linalg.norm(b[block][1:])):
            continue
        live = np.abs(A[block]).max(axis=1) + np.abs(b[block]) > 0.0
        live[0] = True
        rows.append(block[live])
        cones.append(Cone(SECOND_ORDER, int(live.sum())))
    for n in sizes.psd:
        if n != 3:
            raise DeclarationError(f"{where}: a semidefinite matrix of order {n} is not available; tensors are 3x3")
        rows.append(start + _TO_MANDEL)
        cones.append(Cone(SEMIDEFINITE, 6))
        start += 6
    for _ in range(sizes.exp):
        rows.append(np.arange(start, start + 3))
        cones.append(Cone(EXPONENTIAL, 3))
        start += 3
    for alpha in sizes.p3d:
        rows.append(np.arange(start, start + 3))
        cones.append(Cone(POWER, 3, float(alpha)))
        start += 3
    if start != A.shape[0]:
        raise DeclarationError(f"{where}: cvxpy writes it with a cone that is not available here")
    taken = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
    return CanonicalForm(P, q, E, e, A[taken], b[taken], tuple(cones), count)
