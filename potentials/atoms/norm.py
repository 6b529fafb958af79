"""‖T‖ = √(T:T) of a tensor, ‖v‖ of a vector: the support function of the unit ball."""

from __future__ import annotations

from typing import Any

from sympy import Expr, S, sqrt

from ...errors import DeclarationError
from ..operator import Operator
from ..ranked import Ranked
from ..tensor import PositiveTensor
from ..vector import VectorSymbol
from .atom import Atom, Invariant
from .inner import inner
from .linear import adjoint, as_pair, compose, linear_part

__all__ = ["Norm", "NormLeaf", "norm"]


class NormLeaf(Invariant):
    """‖T‖, Frobenius, or ‖v‖, Euclidean."""

    __slots__ = ()
    is_nonnegative = True
    is_extended_nonnegative = True
    word = "norm"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\left\|{printer._print(self.args[0])}\right\|"
        return body if exp is None else rf"{body}^{{{exp}}}"


class Norm(Atom):
    """Convex, non-negative, of degree 1, with a kink at zero; its conjugate is the indicator of the unit ball."""

    word = "norm"
    node = NormLeaf
    smoothness = "continuous"

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1

    def degree(self, node: Any) -> Expr:
        return S.One

    def gradient(self, node: Any, variable: Any) -> Any:
        if node.args[0].rank != variable.rank:
            return variable.linear(())
        return adjoint(linear_part(node.args[0], variable), node.args[0]) / node

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        first = node.args[0]
        px, py = linear_part(first, x), linear_part(first, y)
        if px == (S.Zero, S.Zero) or py == (S.Zero, S.Zero):
            return Operator()
        pair = compose(as_pair(px), as_pair(py))
        left, right = adjoint(px, first) / node, adjoint(py, first) / node
        return Operator(weight * pair[0] / node, weight * pair[1] / node, ((-weight / node, left, right),))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        return np.sqrt((arguments[0] * arguments[0]).sum(axis=-1))

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        return cvxpy.norm2(arguments[0])

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        return S.Zero, (norm(dual) - 1,)

    def examples(self) -> tuple[Any, ...]:
        return (*super().examples(), NormLeaf(VectorSymbol("v")))


def norm(quantity: Ranked) -> Expr:
    """Frobenius norm ‖T‖ = √(T:T), Euclidean norm of a vector."""
    if not isinstance(quantity, Ranked):
        raise DeclarationError(
            "rank mismatch: norm takes a tensor or a vector, not a scalar; write Abs(x) or sqrt(x**2)"
        )
    if not quantity.terms():
        return S.Zero
    return sqrt(inner(quantity, quantity)) if quantity.has(PositiveTensor) else NormLeaf(quantity)
