"""The quadratic part of a function of tensors, vectors and scalars as one form, and when it is semidefinite.

With dev X_k, t_k = tr X_k, scalars s_j and vectors v_m,

    Q = Σ D_kl dev X_k : dev X_l + Σ M_ij z_i z_j + Σ W_mn v_m·v_n,   z = (t_1, …, s_1, …, 1),

so that Q is convex if and only if D, W and the part of M without the constant 1 are positive semidefinite (the deviators fill a space of
dimension five, the vectors one of three), and Q ≥ 0 everywhere, equivalently √Q a norm of affine functions, if and only if all of M is.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

from sympy import Add, Dummy, Expr, Integer, Mul, Poly, Pow, Rational, S, cancel, default_sort_key

from ..atoms.inner import InnerLeaf, inner
from ..atoms.trace import TraceLeaf, tr
from ..scalars import ScalarVariable
from ..tensor import Deviator, IdentityTensor

__all__ = ["Form", "Minor", "degree_of", "quadratic_form", "semidefinite"]

ONE = S.One
Minor = tuple[Expr, tuple[Any, ...]]
"""An expression that has to be non-negative, and the variables whose block it belongs to."""


def degree_of(expression: Any, variables: frozenset[Any]) -> int | None:
    """Degree as a polynomial in traces, scalar products and scalars of the variables; None if it is none."""
    if not expression.has(*variables):
        return 0
    if _hides(expression, variables):
        return degree_of(_opened(expression, variables), variables)
    if isinstance(expression, (ScalarVariable, TraceLeaf)):
        return 1
    if isinstance(expression, InnerLeaf):
        return sum(1 for a in expression.args if a.has(*variables))
    if isinstance(expression, Add):
        parts = [degree_of(a, variables) for a in expression.args]
        return None if None in parts else max(parts)  # type: ignore[type-var]
    if isinstance(expression, Mul):
        parts = [degree_of(a, variables) for a in expression.args]
        return None if None in parts else sum(parts)  # type: ignore[arg-type]
    if isinstance(expression, Pow) and expression.exp.is_Integer and expression.exp.is_positive:
        inside = degree_of(expression.base, variables)
        return None if inside is None else inside * int(expression.exp)
    return None


def _hides(leaf: Any, variables: frozenset[Any]) -> bool:
    """True if a coefficient inside the leaf depends on a variable (a thermal strain a (T − T₀) I)."""
    return isinstance(leaf, (TraceLeaf, InnerLeaf)) and any(
        c.has(*variables)
        for a in leaf.args
        for c in a.terms().values()  # type: ignore[attr-defined]
    )


def _opened(expression: Any, variables: frozenset[Any]) -> Any:
    """The expression with such leaves multiplied out."""
    found = {}
    for leaf in expression.atoms(TraceLeaf, InnerLeaf):
        if not _hides(leaf, variables):
            continue
        parts = [a.terms().items() for a in leaf.args]
        if isinstance(leaf, TraceLeaf):
            found[leaf] = sum((c * tr(x) for x, c in parts[0]), S.Zero)
        else:
            found[leaf] = sum((c * d * _product(x, y) for x, c in parts[0] for y, d in parts[1]), S.Zero)
    return expression.xreplace(found) if found else expression


def _product(x: Any, y: Any) -> Expr:
    for one, two in ((x, y), (y, x)):
        if isinstance(one, IdentityTensor):
            return tr(two)
    return inner(x, y)


@dataclass
class Form:
    """Coefficients of Q by pairs of variables, each block symmetric."""

    deviators: dict[tuple[Any, Any], Expr] = field(default_factory=dict)
    plain: dict[tuple[Any, Any], Expr] = field(default_factory=dict)
    vectors: dict[tuple[Any, Any], Expr] = field(default_factory=dict)

    def add(self, block: dict[tuple[Any, Any], Expr], one: Any, two: Any, weight: Expr) -> None:
        """Add weight·one·two, half on each side of the diagonal."""
        for pair in ((one, two), (two, one)):
            block[pair] = block.get(pair, S.Zero) + weight / 2

    def minors(self, homogenised: bool, variables: frozenset[Any]) -> list[Minor] | None:
        """Conditions for convexity, or, `homogenised`, for non-negativity everywhere; None if the form is too large to decide."""
        found: list[Minor] = []
        for block in (self.deviators, self.plain, self.vectors):
            names = sorted({a for pair in block for a in pair}, key=default_sort_key)
            if not homogenised:
                # a constant tensor or the constant 1 makes a linear term, which is convex of either sign
                names = [n for n in names if n.has(*variables)]
            rows = [[cancel(block.get((a, b), S.Zero)) for b in names] for a in names]
            minors = semidefinite(rows, names)
            if minors is None:
                return None
            found += minors
        return found


def quadratic_form(expression: Expr, variables: frozenset[Any]) -> Form:
    """Coefficients of a polynomial of degree at most two."""
    expression = _opened(expression, variables)
    leaves = sorted(
        {n for n in expression.atoms(TraceLeaf, InnerLeaf, ScalarVariable) if n.has(*variables)}, key=default_sort_key
    )
    dummies = [Dummy(f"z{i}", real=True) for i in range(len(leaves))]
    form = Form()
    body: Any = expression.xreplace(dict(zip(leaves, dummies, strict=True)))
    terms = Poly(body, *dummies).terms() if dummies else [((), body)]
    for powers, weight in terms:
        factors = [leaf for leaf, power in zip(leaves, powers, strict=True) for _ in range(power)]
        if len(factors) == 1 and isinstance(factors[0], InnerLeaf):
            _inner(form, factors[0], weight)
            continue
        parts = [_affine(f) for f in factors] + [{ONE: S.One}] * (2 - len(factors))
        for one, a in parts[0].items():
            for two, b in parts[1].items():
                form.add(form.plain, one, two, weight * a * b)
    return form


def _affine(leaf: Any) -> dict[Any, Expr]:
    """Coordinates of a scalar or a trace; a scalar product with a constant counts as one of its own."""
    if not isinstance(leaf, TraceLeaf):
        return {leaf: S.One}
    return {TraceLeaf(atom): c for atom, c in leaf.args[0].terms().items()}  # type: ignore[attr-defined]


def _inner(form: Form, leaf: InnerLeaf, weight: Expr) -> None:
    left, right = (a.terms() for a in leaf.args)  # type: ignore[attr-defined]
    for one, a in left.items():
        for two, b in right.items():
            if leaf.args[0].rank == 1:  # type: ignore[attr-defined]
                form.add(form.vectors, one, two, weight * a * b)
                continue
            x, y = (t.args[0] if isinstance(t, Deviator) else t for t in (one, two))
            if not isinstance(x, IdentityTensor) and not isinstance(y, IdentityTensor):
                form.add(form.deviators, x, y, weight * a * b)
            if not isinstance(one, Deviator) and not isinstance(two, Deviator):
                (p, c), (q, d) = (
                    (ONE, Integer(3)) if isinstance(t, IdentityTensor) else (TraceLeaf(t), ONE) for t in (one, two)
                )
                form.add(form.plain, p, q, weight * a * b * c * d * Rational(1, 3))


def semidefinite(rows: list[list[Expr]], names: list[Any]) -> list[Minor] | None:
    """Conditions, necessary and sufficient, for a symmetric matrix of expressions to be positive semidefinite."""
    found: list[Minor] = []
    left = set(range(len(rows)))
    while left:
        part = _component(rows, min(left), left)
        left -= set(part)
        minors = _block([[rows[i][j] for j in part] for i in part], [names[i] for i in part])
        if minors is None:
            return None
        found += minors
    return found


def _component(rows: list[list[Expr]], start: int, left: set[int]) -> list[int]:
    part, queue = {start}, [start]
    while queue:
        i = queue.pop()
        for j in left - part:
            if rows[i][j] != 0:
                part.add(j)
                queue.append(j)
    return sorted(part)


def _block(rows: list[list[Expr]], names: list[Any]) -> list[Minor] | None:
    n = len(rows)
    if n == 1:
        return [(rows[0][0], tuple(names))] if rows[0][0] != 0 else []
    for i in sorted(range(n), key=lambda k: (sum(1 for e in rows[k] if e != 0), k)):
        # completing the square with this variable is exact where the quotients are finite for all values of the parameters
        if rows[i][i] == 0:
            continue
        quotients = [cancel(rows[i][j] / rows[i][i]) for j in range(n)]
        if all(q.as_numer_denom()[1].is_number for q in quotients):
            others = [j for j in range(n) if j != i]
            rest = [[cancel(rows[j][k] - quotients[j] * rows[i][k]) for k in others] for j in others]
            minors = semidefinite(rest, [names[j] for j in others])
            return None if minors is None else [(rows[i][i], tuple(names)), *minors]
    if n > 5:
        return None
    from sympy import Matrix

    found: list[Minor] = []
    for size in range(1, n + 1):
        for part in combinations(range(n), size):
            minor = cancel(Matrix([[rows[i][j] for j in part] for i in part]).det())
            if minor != 0:
                found.append((minor, tuple(names[i] for i in part)))
    return found
