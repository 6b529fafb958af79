"""S:T of tensors and u·v of vectors, bilinear; S:S is a convex quadratic form."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Integer, S

from ...errors import DeclarationError
from ..operator import Operator
from ..ranked import Ranked
from ..tensor import PositiveTensor, TensorSymbol, dev, identity
from ..vector import VectorSymbol
from .atom import Atom, Invariant
from .linear import adjoint, as_pair, compose, linear_part
from .positive_square import PositiveSquareLeaf

__all__ = ["Inner", "InnerLeaf", "inner"]


class InnerLeaf(Invariant):
    """S:T or u·v."""

    __slots__ = ()
    word = "inner"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        left, right = (rf"\left({printer._print(a)}\right)" for a in self.args)
        body = rf"{left}\!:\!{right}" if self.args[0].rank == 2 else rf"{left}\cdot{right}"  # type: ignore[attr-defined]
        return body if exp is None else rf"\left({body}\right)^{{{exp}}}"


class Inner(Atom):
    """Of degree 2; convex if both arguments are the same; the conjugate of ½ S:S is itself."""

    word = "inner"
    node = InnerLeaf

    def curvature(self, node: Any, require: Any) -> str:
        return "convex" if node.args[0] == node.args[1] else "unknown"

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1 if node.args[0] == node.args[1] else 0

    def degree(self, node: Any) -> Expr:
        return Integer(2)

    def gradient(self, node: Any, variable: Any) -> Any:
        first, second = node.args
        if first.rank != variable.rank:
            return variable.linear(())
        return adjoint(linear_part(first, variable), second) + adjoint(linear_part(second, variable), first)

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        first, second = node.args
        one = compose(as_pair(linear_part(first, x)), as_pair(linear_part(second, y)))
        two = compose(as_pair(linear_part(second, x)), as_pair(linear_part(first, y)))
        return Operator(weight * (one[0] + two[0]), weight * (one[1] + two[1]))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        return (arguments[0] * arguments[1]).sum(axis=-1)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        left, right = arguments
        if node.args[0] == node.args[1]:
            return cvxpy.sum_squares(left)
        if getattr(left, "is_constant", lambda: True)() or getattr(right, "is_constant", lambda: True)():
            return cvxpy.sum(cvxpy.multiply(left, right))
        raise DeclarationError(f"{node} has no conic form: it is neither a square nor linear")

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]] | None:
        return (inner(dual, dual) / 4, ()) if node.args[0] == node.args[1] else None

    def examples(self) -> tuple[Any, ...]:
        x, y, v = TensorSymbol("X"), TensorSymbol("Y"), VectorSymbol("v")
        return inner(x, x), inner(dev(x), y - identity), inner(v, v)


def _ranked(value: object) -> Ranked:
    if not isinstance(value, Ranked):
        raise DeclarationError("rank mismatch: inner takes two tensors or two vectors, not a scalar")
    return value


def inner(left: Ranked, right: Ranked) -> Expr:
    """Scalar product S:T = tr(ST) of tensors, u·v of vectors."""
    a, b = _ranked(left), _ranked(right)
    if a.rank != b.rank:
        raise DeclarationError(f"rank mismatch: inner of a {a.kind} and a {b.kind}; both must be of one rank")
    if not a.terms() or not b.terms():
        return S.Zero
    if not (a.has(PositiveTensor) or b.has(PositiveTensor)):
        ordered = sorted((a, b), key=lambda t: t.sort_key())
        return InnerLeaf(*ordered)
    if len(a.terms()) == 1 and len(b.terms()) == 1:
        ((x, c),), ((y, d),) = a.terms().items(), b.terms().items()
        if x == y and isinstance(x, PositiveTensor):
            return c * d * PositiveSquareLeaf(x.args[0])
    for x, y in ((a, b), (b, a)):
        if isinstance(x, PositiveTensor) and x.args[0] == y:
            return PositiveSquareLeaf(y)
    raise DeclarationError(
        f"inner({a}, {b}) is not available: the positive part pairs with itself, inner(pos(e), pos(e)), or with its own argument"
    )
