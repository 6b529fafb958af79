"""Convexity of powers, of roots of sums of powers (gauges), and of a power over a positive affine function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy import Mul, Pow, S

from ..ranked import Ranked
from ..scalars import ScalarVariable

if TYPE_CHECKING:
    from .convexity import Proof, Prover

__all__ = ["convex_power", "convex_quotient", "degree_of_homogeneity"]


def convex_power(prover: Prover, node: Any, goal: int) -> Proof | None:
    """uⁿ with constant n: convex for n ≥ 1 and u convex, u ≥ 0 (for even n, u affine); for n < 0 and u concave, u > 0; for 0 < n < 1
    if u is a sum of powers of order 1/n; concave for 0 ≤ n ≤ 1 and u concave, u ≥ 0."""
    base, exponent = node.base, node.exp
    if not prover.constant(exponent):
        return _exponential(prover, node, goal)
    if goal < 0:
        return _concave_power(prover, node)
    if exponent.is_number and exponent < 0:
        inside, positive = prover.curved(base, -1), prover.positive(base)
        if inside is None or positive is None:
            return None
        return (inside + positive).step(f"{node} is convex: a negative power of a positive concave function")
    return _large(prover, node) or _gauge(prover, node)


def _large(prover: Prover, node: Any) -> Proof | None:
    base, exponent = node.base, node.exp
    order = prover.data_nonnegative(exponent - 1, "exponent")
    if order is None:
        return None
    if exponent.is_even and prover.affine(base):
        return order.step(f"{node} is convex: an even power of an affine function")
    for s in (1, -1) if exponent.is_even else (1,):
        inside, positive = prover.curved(base, s), prover.nonnegative(s * base)
        if inside is not None and positive is not None:
            word = "non-negative convex" if s > 0 else "non-positive concave"
            return (inside + positive + order).step(
                f"{node} is convex: a power of order at least one of a {word} function"
            )
    if not exponent.is_number and isinstance(base, ScalarVariable) and base.role == "state":
        # a parameter as exponent makes a real power of a state, as of an accumulated strain, which is defined on x >= 0; of a force
        # or a trace, which take either sign, it has to be said by pos(...)
        from .convexity import Proof

        shown = f"{node} is convex on {base} >= 0, where a real power is defined: its order is at least one"
        return (order + Proof(domain=(base,))).step(shown)
    return None


def _concave_power(prover: Prover, node: Any) -> Proof | None:
    base, exponent = node.base, node.exp
    low, high = (prover.data_nonnegative(e, "exponent") for e in (exponent, 1 - exponent))
    if low is None or high is None:
        return None
    inside = prover.curved(base, -1)
    if inside is None:
        return None
    positive = prover.nonnegative(base)
    proof = inside + low + high
    if positive is None:
        if not exponent.is_number:
            return None
        # the power is not defined where the base is negative; where it is not, the set is convex
        from .convexity import Proof

        return (proof + Proof(domain=(base,))).step(f"{node} is concave where it is defined")
    return (proof + positive).step(f"{node} is concave: a power of order between zero and one of a concave function")


def _gauge(prover: Prover, node: Any) -> Proof | None:
    """(Σ g_i)^(1/p), p > 1, with every g_i^(1/p) convex and non-negative: the p-norm of convex non-negative functions."""
    base, exponent = node.base, node.exp
    low, high = (prover.data_nonnegative(e, "exponent") for e in (exponent, 1 - exponent))
    if low is None or high is None:
        return None
    if exponent == S.Half:
        square = prover.square_sum(base)
        if square is not None:
            return (square + low).step(f"{node} is convex: the root of a non-negative quadratic form is a norm")
    proof = low + high
    for term in prover.terms(base):
        part = _root(prover, term, exponent)
        if part is None:
            return None
        proof = proof + part
    return proof.step(f"{node} is convex: a gauge, the root of order {1 / exponent} of a sum of such powers")


def _root(prover: Prover, term: Any, exponent: Any) -> Proof | None:
    """term^exponent convex and non-negative."""
    if prover.constant(term):
        return prover.data_nonnegative(term)
    weight, rest = prover.split(term)
    data = prover.data_nonnegative(weight)
    if data is None:
        return None
    body, power = (rest.base, rest.exp) if isinstance(rest, Pow) else (rest, S.One)
    if isinstance(rest, Pow) and prover.constant(power):
        order = prover.data_nonnegative(power * exponent - 1, "exponent")
        if order is not None:
            if power.is_even and prover.affine(body):
                return data + order
            inside, positive = prover.curved(body, 1), prover.nonnegative(body)
            if inside is not None and positive is not None:
                return data + order + inside + positive
    degree = degree_of_homogeneity(prover, rest)
    if degree is None:
        return None
    order = prover.data_nonnegative(degree * exponent - 1, "exponent")
    inside, positive = prover.curved(rest, 1), prover.nonnegative(rest)
    if order is None or inside is None or positive is None:
        return None
    return data + order + inside + positive


def degree_of_homogeneity(prover: Prover, node: Any) -> Any:
    """Degree p ≥ 1 of homogeneity of a product of atoms in the variables, or None."""
    from ..atoms import ATOMS

    if isinstance(node, ScalarVariable):
        return S.One
    if isinstance(node, Mul):
        parts = [degree_of_homogeneity(prover, a) for a in node.args]
        return None if None in parts else sum(parts)  # type: ignore[arg-type]
    if node.is_Add:
        found = {degree_of_homogeneity(prover, a) for a in prover.terms(node)}
        return found.pop() if len(found) == 1 else None
    if prover.constant(node):
        return S.Zero
    record = ATOMS.get(type(node))
    own = None if record is None else record.degree(node)
    if own is None:
        return None
    if all(isinstance(a, Ranked) for a in node.args):
        homogeneous = all(k.has(*prover.variables) for a in node.args for k in a.terms())
        return own if homogeneous else None
    inside = {degree_of_homogeneity(prover, a) for a in node.args if not (isinstance(node, Pow) and a == node.exp)}
    return own * inside.pop() if len(inside) == 1 and None not in inside else None


def _exponential(prover: Prover, node: Any, goal: int) -> Proof | None:
    """bᵘ with constant b > 0 and u convex, b ≥ 1, or u affine."""
    if goal < 0 or not prover.constant(node.base):
        return None
    positive = prover.positive(node.base)
    if positive is None:
        return None
    if prover.affine(node.exp):
        return positive.step(f"{node} is convex: an exponential of an affine function")
    inside, large = prover.curved(node.exp, 1), prover.data_nonnegative(node.base - 1)
    if inside is None or large is None:
        return None
    return (positive + inside + large).step(f"{node} is convex: an exponential of a convex function")


def convex_quotient(prover: Prover, node: Any) -> Proof | None:
    """uᵃ/yᵇ with a ≥ 1 + b, b > 0, u convex and non-negative (or affine and a even), y concave and positive: a perspective."""
    above = [p for p in node.args if not (isinstance(p, Pow) and p.exp.is_number and p.exp < 0)]
    below = [p for p in node.args if p not in above]
    if len(above) != 1 or len(below) != 1:
        return None
    (top,), (bottom,) = above, below
    u, a = (top.base, top.exp) if isinstance(top, Pow) else (top, S.One)
    y, b = bottom.base, -bottom.exp
    if a == 1:
        degree = degree_of_homogeneity(prover, u)
        a = S.One if degree is None else degree
        root_convex = prover.curved(u, 1) if degree is not None else None
        positive = prover.nonnegative(u)
        first = None if root_convex is None or positive is None else root_convex + positive
    elif a.is_number and a.is_even and prover.affine(u):
        first = prover.curved(u, 1)
    else:
        inside, positive = prover.curved(u, 1), prover.nonnegative(u)
        first = None if inside is None or positive is None else inside + positive
    second, strictly = prover.curved(y, -1), prover.positive(y)
    order = prover.data_nonnegative(a - 1 - b, "exponent") if prover.constant(a) else None
    if first is None or second is None or strictly is None or order is None:
        return None
    return (first + second + strictly + order).step(f"{node} is convex: a power over a positive concave function")
