"""Polynomials in a few scalars whose second derivative is a sum of squares: a convex program with an exact answer.

f is convex if yᵀ ∇²f(x) y = m(x, y)ᵀ G m(x, y) with G positive semidefinite, m the monomials yᵢ xᵅ (Helton and Nie 2010). A
semidefinite program finds G in floating point; it is rounded to rationals, moved back on the linear equations exactly, and shown to be
positive semidefinite by exact elimination (Peyrl and Parrilo 2008). Only that last step counts as proof.
"""

from __future__ import annotations

from itertools import combinations_with_replacement, product
from typing import TYPE_CHECKING, Any

from sympy import Dummy, Poly, PolynomialError, Rational

from ..atoms.atom import Invariant
from ..atoms.trace import TraceLeaf
from ..scalars import ScalarVariable

if TYPE_CHECKING:
    from .convexity import Proof, Prover

__all__ = ["convex_by_squares"]

LARGEST = 40
"""Monomials in m beyond which no program is set up."""


def convex_by_squares(prover: Prover, expression: Any, goal: int) -> Proof | None:
    """Proof that goal·expression is convex, if it is a polynomial with rational coefficients in scalars and traces."""
    from .convexity import Proof

    leaves = {n for n in expression.atoms(Invariant) if not prover.constant(n)}
    if any(not isinstance(n, TraceLeaf) for n in leaves):
        return None
    scalars = {v for v in prover.variables if isinstance(v, ScalarVariable) and expression.has(v)}
    generators = [*sorted(leaves, key=str), *sorted(scalars, key=str)]
    if not 2 <= len(generators) <= 4:
        return None
    x = [Dummy(f"x{k}", real=True) for k in range(len(generators))]
    try:
        body = Poly(goal * expression.xreplace(dict(zip(generators, x, strict=True))), *x)
    except PolynomialError:
        return None
    if not all(c.is_Rational for c in body.coeffs()) or body.total_degree() % 2 or body.total_degree() > 8:
        return None
    size = _gram_size(body)
    if size is None or not _is_sum_of_squares(body, x):
        return None
    word = "convex" if goal > 0 else "concave"
    return Proof(
        steps=(
            f"{expression} is {word}: its second derivative is a sum of squares, by a semidefinite program of order {size} "
            "whose answer was made rational and verified exactly",
        )
    )


def _gram_size(body: Poly) -> int | None:
    size = len(_basis(body))
    return size if 0 < size <= LARGEST else None


def _basis(body: Poly) -> list[tuple[int, tuple[int, ...]]]:
    """(i, α) of the monomials yᵢ xᵅ: exponents within half of what the second derivative reaches in every variable."""
    n = len(body.gens)
    half = body.total_degree() // 2 - 1
    found = []
    for i in range(n):
        own = body.diff(body.gens[i]).diff(body.gens[i])
        if own.is_zero:
            continue
        top = [own.degree(g) // 2 for g in body.gens]
        for total in range(half + 1):
            for choice in combinations_with_replacement(range(n), total):
                alpha = tuple(choice.count(k) for k in range(n))
                if all(a <= t for a, t in zip(alpha, top, strict=True)):
                    found.append((i, alpha))
    return found


def _is_sum_of_squares(body: Poly, x: list[Any]) -> bool:
    basis = _basis(body)
    n, size = len(x), len(basis)
    wanted: dict[tuple[tuple[int, ...], tuple[int, ...]], Rational] = {}
    for i, j in product(range(n), repeat=2):
        pair = tuple(int(k == i) + int(k == j) for k in range(n))
        for alpha, c in body.diff(x[i]).diff(x[j]).terms():
            if c != 0:
                wanted[(pair, alpha)] = wanted.get((pair, alpha), Rational(0)) + c
    places: dict[tuple[tuple[int, ...], tuple[int, ...]], list[tuple[int, int]]] = {}
    for a, b in product(range(size), repeat=2):
        (i, p), (j, q) = basis[a], basis[b]
        pair = tuple(int(k == i) + int(k == j) for k in range(n))
        places.setdefault((pair, tuple(s + t for s, t in zip(p, q, strict=True))), []).append((a, b))
    if not set(wanted) <= set(places):
        return False
    gram = _program(size, places, wanted)
    if gram is None:
        return False
    # rational, and exactly on the equations: every group of entries is shifted by its mean error
    exact = [[Rational(round(float(v) * 2**24), 2**24) for v in row] for row in gram]
    for a, b in product(range(size), repeat=2):
        exact[a][b] = exact[b][a] = (exact[a][b] + exact[b][a]) / 2
    for key, entries in places.items():
        error = wanted.get(key, Rational(0)) - sum((exact[a][b] for a, b in entries), Rational(0))
        for a, b in entries:
            exact[a][b] += error / len(entries)
    return _positive_semidefinite(exact)


def _program(size: int, places: Any, wanted: Any) -> Any:
    """Gram matrix whose smallest eigenvalue is as large as possible; None if the program fails."""
    import cvxpy
    import numpy as np

    gram, least = cvxpy.Variable((size, size), symmetric=True), cvxpy.Variable()
    constraints = [gram - least * np.eye(size) >> 0, least <= 1.0]
    for key, entries in places.items():
        constraints.append(sum(gram[a, b] for a, b in entries) == float(wanted.get(key, 0)))
    problem = cvxpy.Problem(cvxpy.Maximize(least), constraints)
    try:
        reached: Any = problem.solve(solver=cvxpy.CLARABEL)
    except cvxpy.SolverError:
        return None
    return gram.value if gram.value is not None and reached > -1e-6 else None


def _positive_semidefinite(rows: list[list[Rational]]) -> bool:
    """Exact elimination: every pivot positive, or zero with a zero row."""
    a = [list(row) for row in rows]
    for k in range(len(a)):
        pivot = a[k][k]
        if pivot < 0 or (pivot == 0 and any(a[k][j] != 0 for j in range(k + 1, len(a)))):
            return False
        if pivot == 0:
            continue
        for i in range(k + 1, len(a)):
            ratio = a[i][k] / pivot
            if ratio != 0:
                for j in range(k, len(a)):
                    a[i][j] -= ratio * a[k][j]
    return True
