"""max(a, b), with derivatives by selection; sympy's Max, Min and Abs are rewritten to it at declaration."""

from __future__ import annotations

from typing import Any

from sympy import Abs, Expr, Function, Max, Min, S
from sympy.core.function import ArgumentIndexError

from ..scalars import ScalarVariable
from .atom import Atom
from .positive_part import PositivePart, Step

__all__ = ["Maximum", "MaximumAtom", "rewrite_maximum"]


class Maximum(Function):
    """max(a, b); where a = b the second argument is the one that counts."""

    nargs = 2
    is_real = True

    @classmethod
    def eval(cls, a: Any, b: Any) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        if a == b:
            return a
        if b == 0:
            return PositivePart(a)
        if a == 0:
            return PositivePart(b)
        difference = a - b
        if difference.is_nonnegative:
            return a
        return b if difference.is_nonpositive else None

    def _eval_is_nonnegative(self) -> bool | None:
        a, b = self.args
        return True if a.is_nonnegative or b.is_nonnegative or a == -b else None

    def fdiff(self, argindex: int = 1) -> Expr:
        a, b = self.args
        chosen = Step(a - b)
        if argindex == 1:
            return chosen
        if argindex == 2:
            return 1 - chosen
        raise ArgumentIndexError(self, argindex)

    def _sympystr(self, printer: Any) -> str:
        a, b = self.args
        return f"Abs({printer._print(a)})" if a == -b else f"Max({printer._print(a)}, {printer._print(b)})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        a, b = (printer._print(x) for x in self.args)
        body = rf"\left|{a}\right|" if self.args[0] == -self.args[1] else rf"\max\left({a}, {b}\right)"
        return body if exp is None else rf"{body}^{{{exp}}}"


class MaximumAtom(Atom):
    """Convex, non-decreasing in both arguments, of degree 1."""

    word = "Max"
    node = Maximum
    smoothness = "continuous"

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        return (1, 1)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        a, b = node.args
        if 1 in signs or a == -b:
            return 1
        return -1 if signs == (-1, -1) else 0

    def degree(self, node: Any) -> Expr:
        return S.One

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        return np.maximum(*arguments)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        return cvxpy.maximum(*arguments)

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]] | None:
        """Of |x| as a function of x; max(a, b) has two arguments."""
        return (S.Zero, (dual - 1, -dual - 1)) if node.args[0] == -node.args[1] else None

    def examples(self) -> tuple[Any, ...]:
        x, y = ScalarVariable("x"), ScalarVariable("y")
        return Maximum(x, y), Maximum(x, -x)


def rewrite_maximum(expression: Expr) -> Expr:
    """The expression with Max(a, b, …), Min(a, b, …) and Abs(x) written through `Maximum`."""
    if not expression.has(Max, Min, Abs):
        return expression
    found: Any = expression.replace(lambda e: isinstance(e, Max), lambda e: _nested(e.args))
    found = found.replace(lambda e: isinstance(e, Min), lambda e: -_nested([-a for a in e.args]))
    return found.replace(lambda e: isinstance(e, Abs), lambda e: Maximum(e.args[0], -e.args[0]))


def _nested(arguments: Any) -> Any:
    found, *rest = sorted(arguments, key=lambda a: a.sort_key())
    for other in rest:
        found = Maximum(found, other)
    return found
